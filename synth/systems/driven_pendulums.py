"""Any number of pendulums on a support that moves as prescribed (section 1 of the formula sheet).

    theta_i'' = -n_i^2 [(1 + zeta) sin theta_i + u cos theta_i] + terms,      u = x''/g, zeta = z''/g
    theta_i'' = -n_i^2 [(1 + zeta) theta_i + u] + terms                       linear

Horizontal and vertical motion, the law and every resistance are terms; what is `None` is not compiled.
"""

import math
from typing import Any, NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import by_type, or_none, registered
from synth.systems.terms import driven, motion, weight


class Sine(NamedTuple):
    """The pendulum itself."""

    power: float = 1.0  # unused: a tuple without fields does not compile


class Linear(NamedTuple):
    """Its limit of small angles."""

    power: float = 1.0  # unused, as above


@by_type("restoring")
def slant(angle: float, restoring: Any) -> Any:
    """Sine and cosine of an angle, or what they are where the law is linear."""


@registered("slant", Sine)
def _slant(angle: float, restoring: Sine) -> tuple[float, float]:
    return math.sin(angle), math.cos(angle)


@registered("slant", Linear)
def _slant_linear(angle: float, restoring: Linear) -> tuple[float, float]:
    return angle, 1.0


class DrivenPendulums(NamedTuple):
    """State (theta_1, theta_1', theta_2, ...); mirror: theta -> -theta with the horizontal motion reversed."""

    natural_frequency: Floats  # (pendulums,) n_i at infinitesimal arc, rad/s
    gravity: float = 9.80665  # m/s^2; only the ratio of the support's acceleration to it matters
    restoring: Any = Sine()  # `Sine()` or `Linear()`
    horizontal: Any = None  # x'': `Harmonics` or None
    vertical: Any = None  # z'', up positive: `Harmonics` or None
    terms: Any = None  # Resistances and drives, `terms.together(...)`, or None
    kicks: Any = None  # `terms.Impulses`, which the explicit integrator alone knows, or None
    first_angle: int = 0  # Place of the first pendulum's angle in the state


@or_none
def relative(acceleration: Any, gravity: float) -> Any:
    """Acceleration over gravity; None stays None."""
    return acceleration / gravity


@registered("derivative", DrivenPendulums)
@kernel
def _derivative(time: float, state: Floats, system: DrivenPendulums, out: Floats) -> None:
    horizontal = relative(motion(time, system.horizontal), system.gravity)
    vertical = relative(motion(time, system.vertical), system.gravity)
    frequencies, restoring, terms = system.natural_frequency, system.restoring, system.terms
    for i in range(frequencies.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        sine, cosine = slant(angle, restoring)
        square = frequencies[i] * frequencies[i]
        out[2 * i] = rate
        out[2 * i + 1] = driven(-square * weight(sine, cosine, 1.0, horizontal, vertical), i, angle, rate, terms)


@registered("response", DrivenPendulums)
@kernel
def _response(state: Floats, index: int, system: DrivenPendulums, out: Floats) -> None:
    """Unit impulse on one pendulum, per m l^2: its rate alone changes."""
    out[:] = 0.0
    out[2 * index + 1] = 1.0
