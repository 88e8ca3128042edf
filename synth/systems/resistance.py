"""What resists or drives the swing of one pendulum: angular acceleration as a function of angle and rate.

Each term holds one value a pendulum; `torque per m l^2` is what the kernels return, in rad/s^2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.terms import term


class Viscous(NamedTuple):
    """Damping `-2 gamma theta'`."""

    damping_rate: Floats
    """(pendulums,) gamma, 1/s."""


@term("driven", Viscous)
@kernel
def _viscous(index: int, angle: float, rate: float, term: Viscous) -> float:
    return -2.0 * term.damping_rate[index] * rate


@term("driven_slope", Viscous)
@kernel
def _viscous_slope(index: int, angle: float, rate: float, term: Viscous) -> tuple[float, float]:
    return 0.0, -2.0 * term.damping_rate[index]


class Quadratic(NamedTuple):
    """Turbulent air: `-c |theta'| theta'`."""

    coefficient: Floats
    """(pendulums,) c, 1/rad."""


@term("driven", Quadratic)
@kernel
def _quadratic(index: int, angle: float, rate: float, term: Quadratic) -> float:
    return -term.coefficient[index] * abs(rate) * rate


@term("driven_slope", Quadratic)
@kernel
def _quadratic_slope(index: int, angle: float, rate: float, term: Quadratic) -> tuple[float, float]:
    return 0.0, -2.0 * term.coefficient[index] * abs(rate)


class KnifeEdge(NamedTuple):
    """Dry friction of a knife edge, smoothed: `-f tanh(theta' / scale)`."""

    friction: Floats
    """(pendulums,) f, rad/s^2."""
    scale: Floats
    """(pendulums,) rate at which friction reaches 76 %, rad/s."""


@term("driven", KnifeEdge)
@kernel
def _knife_edge(index: int, angle: float, rate: float, term: KnifeEdge) -> float:
    return -term.friction[index] * math.tanh(rate / term.scale[index])


@term("driven_slope", KnifeEdge)
@kernel
def _knife_edge_slope(index: int, angle: float, rate: float, term: KnifeEdge) -> tuple[float, float]:
    share = math.tanh(rate / term.scale[index])
    return 0.0, -term.friction[index] / term.scale[index] * (1.0 - share * share)


class VanDerPolDrive(NamedTuple):
    """Escapement of Kanunnikov and Lamper, `Q_i/(m l_i) = eps (1 - S_i^2/S0^2) S_i'`, S_i = l_i phi_i."""

    rate: Floats
    """(pendulums,) eps, 1/s."""
    angle: Floats
    """(pendulums,) S0/l_i, rad: below it the escapement drives, above it resists."""


@term("driven", VanDerPolDrive)
@kernel
def _van_der_pol(index: int, angle: float, rate: float, term: VanDerPolDrive) -> float:
    share = angle / term.angle[index]
    return term.rate[index] * (1.0 - share * share) * rate


@term("driven_slope", VanDerPolDrive)
@kernel
def _van_der_pol_slope(index: int, angle: float, rate: float, term: VanDerPolDrive) -> tuple[float, float]:
    share = angle / term.angle[index]
    return -2.0 * term.rate[index] * share / term.angle[index] * rate, term.rate[index] * (1.0 - share * share)
