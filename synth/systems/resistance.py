"""What resists or drives the swing of one pendulum: angular acceleration, rad/s^2, by angle and rate.

Terms hold arrays of one value a pendulum; a kernel adds its share to the acceleration so far. A new law is a field of
the schema, declared a resistance, and its class and kernel here.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene_fields import Section
from data_schemas.scene_pendulum import RESISTANCES, ImpulseEscapement, Pendulum
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered
from synth.systems.terms import together


def terms_of(pendulums: Sequence[Pendulum]) -> Any:
    """What resists or drives any pendulum, zero for the others; `SceneError`: a declared resistance has no law."""
    terms = []
    for field, name in (RESISTANCES | {"escapement": "a van der Pol escapement"}).items():
        values = [getattr(each, field) for each in pendulums]
        values = [None if isinstance(each, ImpulseEscapement) else each for each in values]  # kicks, no force
        if not any(values):
            continue
        if field not in LAWS:
            raise SceneError(f"pendulums.{field}: no propagator knows {name}")
        count = len(LAWS[field].__annotations__)
        rows = [
            list(each.model_dump(exclude={"kind"}).values()) if isinstance(each, Section) else [each or 0.0]
            for each in values
        ]
        columns = np.array([[*row, *[1.0] * (count - len(row))] for row in rows]).T
        terms.append(LAWS[field](*map(np.ascontiguousarray, columns)))
    return together(*terms)


class Viscous(NamedTuple):
    """Damping `-2 gamma theta'`."""

    damping_rate: Floats  # (pendulums,) gamma, 1/s


@registered("driven", Viscous)
@kernel
def _viscous(acceleration: float, index: int, angle: float, rate: float, term: Viscous) -> float:
    return acceleration - 2.0 * term.damping_rate[index] * rate


class Quadratic(NamedTuple):
    """Turbulent air: `-c |theta'| theta'`."""

    coefficient: Floats  # (pendulums,) c, 1/rad


@registered("driven", Quadratic)
@kernel
def _quadratic(acceleration: float, index: int, angle: float, rate: float, term: Quadratic) -> float:
    return acceleration - term.coefficient[index] * abs(rate) * rate


class KnifeEdge(NamedTuple):
    """Dry friction of a knife edge, smoothed: `-f tanh(theta' / scale)`."""

    friction: Floats  # (pendulums,) f, rad/s^2
    scale: Floats  # (pendulums,) rate at which friction reaches 76 %, rad/s


@registered("driven", KnifeEdge)
@kernel
def _knife_edge(acceleration: float, index: int, angle: float, rate: float, term: KnifeEdge) -> float:
    return acceleration - term.friction[index] * math.tanh(rate / term.scale[index])


class VanDerPolDrive(NamedTuple):
    """Escapement of Kanunnikov and Lamper, `Q_i/(m l_i) = eps (1 - S_i^2/S0^2) S_i'`, S_i = l_i phi_i."""

    rate: Floats  # (pendulums,) eps, 1/s
    angle: Floats  # (pendulums,) S0/l_i, rad: below it the escapement drives, above it resists


@registered("driven", VanDerPolDrive)
@kernel
def _van_der_pol(acceleration: float, index: int, angle: float, rate: float, term: VanDerPolDrive) -> float:
    share = angle / term.angle[index]
    return acceleration + term.rate[index] * (1.0 - share * share) * rate


LAWS: dict[str, type] = {
    "damping_rate": Viscous, "quadratic_damping": Quadratic, "knife_edge": KnifeEdge, "escapement": VanDerPolDrive,
}  # fmt: skip
"""Terms by the field of a scene's pendulum whose number, or numbers in order, are theirs, one array each."""


class VanDerPol(NamedTuple):
    """The oscillator `y'' = mu (1 - y^2) y' - y`, the field's stiff reference problem; state (y, y')."""

    stiffness: float  # mu


@registered("derivative", VanDerPol)
@kernel
def _derivative(time: float, state: Floats, system: VanDerPol, out: Floats) -> None:
    out[0] = state[1]
    out[1] = system.stiffness * (1.0 - state[0] * state[0]) * state[1] - state[0]
