"""Phases of harmonics at exact times, free of drift: 64-bit fixed-point turns.

An angle counts modulo one turn only, and unsigned 64-bit integers count modulo 2^64. If one step of time is
F units of 2^-64 turn, k steps are k*F units, and the product may wrap: the phase is exact for every k.

    turns per step = (F + remainder) / 2^64,   F integer,  0 <= remainder < 1

Plain double phases lose 1e-12 rad in an hour, which is 100 times what the simulator may err by.
"""

from __future__ import annotations

import functools
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
_GUARD = 256  # bits behind the point in 1/(2 pi) and in square roots
_INVERSE_TURN = int(  # 1/(2 pi), 103 digits
    "1591549430918953357688837633725143620344596457404564487476673440588967976342265350901138027662530859560"
)
_INVERSE_TURN_SCALE = 10**103
_UNIT = 2.0 * math.pi / _WORD  # rad


@dataclass(frozen=True)
class Turns:
    """How far each of several harmonics turns in one step.

    Attributes
    ----------
    units : (harmonics,) uint64
        Whole units of 2^-64 turn a step, modulo one turn.
    remainder : (harmonics,) float64
        What is left, in units.
    """

    units: NDArray[np.uint64]
    remainder: Floats

    def angles(self, index: Integers) -> Floats:
        """Angles after `index` steps, within half a turn of zero.

        Parameters
        ----------
        index : (times,) int64
            Number of steps, of either sign.

        Returns
        -------
        (harmonics, times) float64
            In rad, right to 4e-16.
        """
        wrapped = self.units[:, None] * index.view(np.uint64)  # modulo 2^64, as it should
        angles: Floats = wrapped.view(np.int64).astype(np.float64)
        angles += self.remainder[:, None] * index
        angles *= _UNIT
        return angles

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
    """Fixed-point turns of harmonics for a step of time.

    Parameters
    ----------
    angular_frequencies
        rad/s, exact: a double is taken as the number it is.
    step
        s, exact.

    Examples
    --------
    An hour of 20 Hz, and a harmonic of 7 rad/s: 25200 rad.

    >>> import math
    >>> angle = turns([7.0], Fraction(1, 20)).angles(np.array([72000]))
    >>> bool(abs(angle[0, 0] - math.remainder(25200, 2 * math.pi)) < 3e-12)  # the right side is the poorer
    True
    """
    pairs = [_turn(frequency, step.numerator, step.denominator) for frequency in angular_frequencies]
    return Turns(np.array([units for units, _ in pairs], dtype=np.uint64), np.array([rest for _, rest in pairs]))


@functools.lru_cache(maxsize=8192)  # one record asks for the same harmonics for its angles, its truth and its motion
def _turn(frequency: float | Fraction, numerator: int, denominator: int) -> tuple[int, float]:
    """Units and remainder of one harmonic for a step of numerator/denominator seconds."""
    top, bottom = frequency.as_integer_ratio()
    above = top * numerator * _INVERSE_TURN << 64
    below = bottom * denominator * _INVERSE_TURN_SCALE
    units, left = divmod(above, below)
    return units % _WORD, (left << 60) // below * 2.0**-60


def damped_frequency(frequency: float, damping_rate: float) -> Fraction:
    """Square root of n^2 - gamma^2, right to 2^-256; as a double it would cost 2e-12 rad in an hour."""
    square = Fraction(frequency) ** 2 - Fraction(damping_rate) ** 2
    scaled = (square.numerator << 2 * _GUARD) // square.denominator
    return Fraction(math.isqrt(scaled), 1 << _GUARD)
