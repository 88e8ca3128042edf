"""Phases of harmonics at exact times, free of drift: 64-bit fixed-point turns, which wrap as angles do.

    turns per step = (F + remainder) / 2^64,   F integer,  0 <= remainder < 1

Plain double phases lose 1e-12 rad in an hour, which is 100 times what the simulator may err by.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Phasors = NDArray[np.complex128]

_WORD = 1 << 64
_GUARD = 128  # bits behind the point in square roots
_INVERSE_TURN = int(  # 1/(2 pi), 103 digits
    "1591549430918953357688837633725143620344596457404564487476673440588967976342265350901138027662530859560"
)
_INVERSE_TURN_SCALE = 10**103
_REST = 60  # bits of a remainder
_REST_MASK = (1 << _REST) - 1
_UNIT = 2.0 * math.pi / _WORD  # rad


@dataclass(frozen=True)
class Turns:
    """How far each of several harmonics turns in one step."""

    units: NDArray[np.uint64]  # (harmonics,) whole units of 2^-64 turn a step, modulo one turn
    remainder: Floats  # (harmonics,) what is left, in units

    def angles(self, index: Integers) -> Floats:
        """Angles after `index` steps of either sign, (harmonics, times) rad within half a turn of zero, to 4e-16."""
        wrapped = self.units[:, None] * index.view(np.uint64)  # modulo 2^64, as it should
        angles: Floats = wrapped.view(np.int64).astype(np.float64)
        angles += self.remainder[:, None] * index
        angles *= _UNIT
        return angles

    def wrapped(self, index: Integers) -> NDArray[np.uint64]:
        """Where in its turn each harmonic is after `index` steps, in 2^-64 turn, (harmonics, times)."""
        rest = np.rint(self.remainder[:, None] * index).astype(np.int64)
        return self.units[:, None] * index.view(np.uint64) + rest.view(np.uint64)

    def phasors(self, index: Integers) -> Phasors:
        """Return exp(i angle) after `index` steps, (harmonics, times)."""
        return phasors(self.angles(index))


def phasors(angles: Floats) -> Phasors:
    """Return exp(i angle); two real functions are faster than the complex exponential."""
    result = np.empty(angles.shape, dtype=np.complex128)
    np.cos(angles, out=result.real)
    np.sin(angles, out=result.imag)
    return result


def turns(angular_frequencies: Sequence[float | Fraction], step: Fraction) -> Turns:
    """Fixed-point turns of harmonics, rad/s, for a step of time, s; both are exact, a double is the number it is."""
    top, bottom = step.numerator * _INVERSE_TURN << 64 + _REST, step.denominator * _INVERSE_TURN_SCALE
    ratios = (each.as_integer_ratio() for each in angular_frequencies)
    return _turns([above * top // (below * bottom) for above, below in ratios])


def rational_turns(turn: Fraction) -> Turns:
    """Turns of one harmonic that turns by a rational part of a turn in a step."""
    return _turns([(turn.numerator << 64 + _REST) // turn.denominator])


def _turns(fixed: Sequence[int]) -> Turns:
    units = np.array([each >> _REST & _WORD - 1 for each in fixed], dtype=np.uint64)
    return Turns(units, np.array([each & _REST_MASK for each in fixed], dtype=np.float64) / (1 << _REST))


def full_turn(period: Fraction) -> Fraction:
    """Return 2 pi/period, right to 100 digits."""
    return Fraction(_INVERSE_TURN_SCALE, _INVERSE_TURN) / period


def damped_frequency(frequency: float, damping_rate: float) -> Fraction:
    """Square root of n^2 - gamma^2, right to 2^-128; as a double it would cost 2e-12 rad in an hour."""
    (top, bottom), (loss, below) = frequency.as_integer_ratio(), damping_rate.as_integer_ratio()
    square = (top * below) ** 2 - (loss * bottom) ** 2
    return Fraction(math.isqrt(square << 2 * _GUARD), bottom * below << _GUARD)
