"""Moments, even or uneven, and what is asked of them: sums over harmonics, those of long tables by Fourier transform.

Uneven moments: the closed form at Chebyshev nodes of short blocks, interpolated inside each. Over a block of length 2 r
every harmonic with w r <= 4 is a polynomial of degree 27 to 1e-19 (its Chebyshev coefficients are Bessel functions of
w r), so the interpolation is exact to rounding, and the cost does not grow with the product of moments and harmonics as
sines would.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import Response
from synth.phase import Floats, Integers, Phasors, rational_turns
from synth.propagators import closed_form
from synth.propagators.blocks import Blocks, EvenTicks, Ticks
from synth.propagators.periodic import PeriodicSums, Places

_NODES = 28
_REACH = 4.0  # largest angle of any harmonic within half a block, rad
_CLOSE = 26  # binary orders of what is split off a period
_FINE = 1 << 40  # nodes and starts are multiples of 2^-40 of a block's half-length: exact integers


Interpolate = Callable[[Any], Any]


class Times(ABC):
    """Moments at which sums are evaluated."""

    @abstractmethod
    def places(self, period: Fraction) -> Places:
        """Where in a period the moments lie, (count,), in 2^-64 of it."""

    @abstractmethod
    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Blocks for frequencies up to the fastest, rad/s, and what gives (sums, count) at these moments from values
        (sums, blocks, moments) there, real or complex."""

    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics, (sums, count), one by one; see `closed_form.series`."""
        blocks, at = self._layout(float(np.max(angular_frequency, initial=1.0)))
        result: Floats = at(closed_form.series(angular_frequency, coefficients, blocks))
        return result

    def acceleration(self, motion: HarmonicSum) -> Floats:
        """Acceleration of the support, (count,), m/s^2."""
        alone = motion.alone
        result = self.series(motion.angular_frequency[:alone], motion.acceleration[None, :alone])
        moved: Floats = self._with(result, [motion.transforms])[0]
        return moved

    def slow(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        """Steady answers to the harmonics away from n, (pendulums, count), rad."""
        alone = responses[0].alone
        result = self.series(angular_frequency[:alone], np.array([each.forced[:alone] for each in responses]))
        return self._with(result, [each.slow_transforms for each in responses])

    def elongation(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        """Angles of the pendulums, (pendulums, count), rad."""
        blocks, at = self._layout(_fastest(responses, angular_frequency))
        result = at(closed_form.elongation(responses, angular_frequency, blocks))
        return self._with(result, [each.transforms for each in responses])

    def free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        """Complex free harmonic of one pendulum, (count,), rad."""
        blocks, at = self._layout(_fastest([response], angular_frequency))
        result: Phasors = at(closed_form.free_harmonic(response, angular_frequency, blocks)[None])[0]
        for sums in response.beat_transforms:
            real, imaginary = sums.at(self.places(sums.period))
            result += real + 1j * imaginary
        return result

    def _with(self, rows: Floats, transforms: Sequence[Sequence[PeriodicSums]]) -> Floats:
        for row, each in zip(rows, transforms, strict=True):
            for sums in each:
                row += sums.at(self.places(sums.period))[0]
        return rows


def _fastest(responses: Sequence[Response], angular_frequency: Floats) -> float:
    own = max(response.frequency for response in responses)
    return float(np.max(angular_frequency[: responses[0].alone], initial=own))


@dataclass(frozen=True)
class EvenTimes(Times):
    """Even moments, as a propagator wants them.

    Attributes
    ----------
    step : Fraction
        s, of true time
    count : int
    first : int
        Steps before the first of these moments.
    """

    step: Fraction
    count: int
    first: int = 0

    def stretch(self, begin: int, end: int) -> EvenTimes:
        """The moments from number `begin` up to `end`, counted among these."""
        return EvenTimes(self.step, end - begin, self.first + begin)

    def places(self, period: Fraction) -> Places:
        """See `Times.places`."""
        index = np.arange(self.first, self.first + self.count, dtype=np.int64)
        places: Places = rational_turns(self.step / period).wrapped(index)[0]
        return places

    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Fewer moments a block than blocks: few sines, and shapes that suit the matrix product.

        Centres lie half-way between two moments, so all counting is in half steps.
        """
        half = max(1, math.isqrt(self.count // 6))
        centres = EvenTicks(2 * (half + self.first) - 1, 4 * half, -(-self.count // (2 * half)))
        blocks = Blocks(centres, EvenTicks(1, 2, half), self.step / 2, self.step / 2)
        return blocks, lambda values: values.reshape(len(values), -1)[:, : self.count]


@dataclass(frozen=True)
class UnevenTimes(Times):
    """Moments in any order.

    Attributes
    ----------
    seconds : (moments,) float64
        Time of the chronometer, taken as exact.
    scale : Fraction
        True time over the chronometer's.
    """

    seconds: Floats
    scale: Fraction

    @property
    def count(self) -> int:
        """Number of moments."""
        return self.seconds.size

    def stretch(self, begin: int, end: int) -> UnevenTimes:
        """The moments from number `begin` up to `end`."""
        return UnevenTimes(self.seconds[begin:end], self.scale)

    def places(self, period: Fraction) -> Places:
        """See `Times.places`; split at exact times so close together that what is left needs no care."""
        length = math.ldexp(1.0, math.frexp(float(period))[1] - _CLOSE)
        number = np.floor(self.seconds / length)
        left = (self.seconds - number * length) * float(self.scale / period * 2**64)
        whole = rational_turns(Fraction(length) * self.scale / period).wrapped(number.astype(np.int64))[0]
        places: Places = whole + np.rint(left).astype(np.uint64)
        return places

    def _layout(self, fastest: float) -> tuple[Blocks, Interpolate]:
        """Blocks that hold the moments; half their length is a power of two, so that they start at exact times."""
        half = math.ldexp(1.0, math.frexp(_REACH / (fastest * float(self.scale)))[1] - 1)
        number = np.floor(self.seconds / (2 * half)).astype(np.int64)  # of the block that each moment lies in
        used, row = np.unique(number, return_inverse=True)
        unit, nodes = Fraction(half) * self.scale, _nodes()
        blocks = Blocks(Ticks(2 * used + 1), Ticks(nodes[_NODES // 2 :]), unit, unit / _FINE)
        place = (self.seconds - (2 * number + 1) * half) / half

        def interpolate(values: Any) -> Any:
            if np.iscomplexobj(values):
                return interpolate(values.real) + 1j * interpolate(values.imag)
            polynomials = np.polynomial.chebyshev.chebvander(nodes / _FINE, _NODES - 1)
            coefficients = values @ np.linalg.inv(polynomials).T
            basis = np.polynomial.chebyshev.chebvander(place, _NODES - 1)
            return np.array([np.einsum("ij,ij->i", basis, each[row]) for each in coefficients])

        return blocks, interpolate


def _nodes() -> Integers:
    """Chebyshev nodes, increasing and even about zero, in units of 2^-40."""
    angles = (2 * np.arange(_NODES // 2) + 1) * math.pi / (2 * _NODES)
    after = np.rint(np.cos(angles[::-1]) * _FINE).astype(np.int64)
    return np.concatenate([-after[::-1], after])
