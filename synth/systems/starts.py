"""What the start of a motion says of all of it: how fast it can change, and whether symmetry holds two clocks together."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from synth.phase import Floats
from synth.systems.dispatch import plain_jacobian
from synth.systems.resistance import VanDerPolDrive
from synth.systems.terms import apart

CAUTION = (
    "the clocks are alike and begin alike: they stay so to the last bit, on a motion that may be unstable; start one "
    "of them a little off, such as 1e-6 of its swing"
)
_OWN = ("mass", "length", "detuning", "natural_frequency")


def symmetric(system: Any, state: ArrayLike) -> bool:
    """Whether two like clocks begin with angles and rates equal but for one sign; they stay so in floating point.

    The system is a `ReducedBeam`, `ElasticBeam`, `FlexibleFrame` or `Metronomes`, its state (n,).
    """
    pairs = np.asarray(state, dtype=np.float64)[system.first_angle :].reshape(-1, 2)
    terms = apart(getattr(system, "terms", None))
    own = [getattr(system, name) for name in _OWN if hasattr(system, name)] + [row for term in terms for row in term]
    if len(pairs) != 2 or any(np.ptp(each) for each in own):
        return False
    return bool(np.array_equal(pairs[0], pairs[1]) or np.array_equal(pairs[0], -pairs[1]))


def fastest_rate(system: Any, start: ArrayLike) -> float:
    """Largest modulus of an eigenvalue of the Jacobian, 1/s (1 over the system's unit of time), at likely states.

    These are rest, the start, ends and middle of the swing, and twice a van der Pol escapement's angle. The equations
    run as plain Python, without the motion of the ship, which makes nothing stiff.
    """
    calm = system._replace(**{name: None for name in ("horizontal", "vertical") if hasattr(system, name)})
    matrices = [plain_jacobian(0.0, state, calm) for state in _likely(calm, np.asarray(start, dtype=np.float64))]
    finite = [matrix for matrix in matrices if np.isfinite(matrix).all()]
    return max((float(np.abs(np.linalg.eigvals(matrix)).max()) for matrix in finite), default=math.nan)


def _likely(system: Any, start: Floats) -> list[Floats]:
    states = [np.zeros_like(start), start]
    first = getattr(system, "first_angle", None)
    if first is None:
        return states
    rest = plain_jacobian(0.0, states[0], system)
    angles, rates = slice(first, None, 2), slice(first + 1, None, 2)
    own = np.sqrt(np.abs(np.diagonal(rest[rates, angles])))  # frequencies, nearly
    reach = np.hypot(start[angles], np.divide(start[rates], own, out=np.zeros_like(own), where=own > 0.0))
    drives = [each for each in apart(getattr(system, "terms", None)) if isinstance(each, VanDerPolDrive)]
    escapements = np.max([2.0 * each.angle for each in drives], axis=0, initial=0.0) * np.ones_like(reach)
    for amplitude in (reach, np.minimum(reach, 0.5 * math.pi), escapements):
        for angle, rate in ((amplitude, 0.0), (0.0, own * amplitude), (0.7 * amplitude, 0.7 * own * amplitude)):
            state = start.copy()
            state[angles], state[rates] = angle, rate
            states.append(state)
    return states
