"""Any moments: the closed form at Chebyshev nodes of short blocks, interpolated inside each.

Over a block of half-length r every harmonic with w r <= 4 is a polynomial of degree 27 to 1e-19
(its Chebyshev coefficients are Bessel functions J_k(w r)), so the interpolation is exact to rounding,
and the cost does not grow with the product of moments and harmonics as sines would.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats, Integers, Phasors, rational_turns
from synth.propagators import closed_form
from synth.propagators.periodic import Places
from synth.propagators.ticks import Blocks, Ticks
from synth.propagators.times import Times

_NODES = 28
_REACH = 4.0  # largest angle of any harmonic within half a block, rad
_CLOSE = 26  # binary orders of what is split off a period
_FINE = 1 << 40  # nodes and starts are multiples of 2^-40 of a block's half-length: exact integers


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

    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics, (sums, moments); see `closed_form.series`."""
        layout = _Layout(self, float(np.max(angular_frequency, initial=1.0)))
        return layout.interpolate(closed_form.series(angular_frequency, coefficients, layout.blocks))

    def _elongation(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        layout = self._layout(responses, angular_frequency)
        return layout.interpolate(closed_form.elongation(responses, angular_frequency, layout.blocks))

    def _free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        layout = self._layout([response], angular_frequency)
        free = closed_form.free_harmonic(response, angular_frequency, layout.blocks)
        real, imaginary = layout.interpolate(np.array([free.real, free.imag]))
        result: Phasors = real + 1j * imaginary
        return result

    def _layout(self, responses: Sequence[Response], angular_frequency: Floats) -> _Layout:
        fastest = max(response.frequency for response in responses)
        return _Layout(self, float(np.max(angular_frequency[: responses[0].alone], initial=fastest)))


@dataclass(frozen=True)
class _Layout:
    """Blocks that hold the moments, and where in its block each moment lies."""

    times: UnevenTimes
    fastest: float

    @cached_property
    def _half_length(self) -> float:
        """A power of two, so that blocks start at exact times of the chronometer."""
        reach = _REACH / (self.fastest * float(self.times.scale))
        return math.ldexp(1.0, math.frexp(reach)[1] - 1)

    @cached_property
    def _number(self) -> Integers:
        """Number of the block that each moment lies in."""
        return np.floor(self.times.seconds / (2 * self._half_length)).astype(np.int64)

    @cached_property
    def _used(self) -> tuple[Integers, Integers]:
        numbers, row = np.unique(self._number, return_inverse=True)
        return numbers, row.astype(np.int64)

    @cached_property
    def blocks(self) -> Blocks:
        unit = Fraction(self._half_length) * self.times.scale
        nodes = _nodes()
        return Blocks(Ticks(2 * self._used[0] + 1), Ticks(nodes[_NODES // 2 :]), unit, unit / _FINE)

    def interpolate(self, values: Floats) -> Floats:
        """Chebyshev interpolation, (sums, starts, offsets) to (sums, moments)."""
        polynomials = np.polynomial.chebyshev.chebvander(_nodes() / _FINE, _NODES - 1)
        coefficients = values @ np.linalg.inv(polynomials).T
        centre = (2 * self._number + 1) * self._half_length
        place = (self.times.seconds - centre) / self._half_length
        basis = np.polynomial.chebyshev.chebvander(place, _NODES - 1)
        return np.array([np.einsum("ij,ij->i", basis, each[self._used[1]]) for each in coefficients])


def _nodes() -> Integers:
    """Chebyshev nodes, increasing and even about zero, in units of 2^-40."""
    angles = (2 * np.arange(_NODES // 2) + 1) * math.pi / (2 * _NODES)
    after = np.rint(np.cos(angles[::-1]) * _FINE).astype(np.int64)
    return np.concatenate([-after[::-1], after])
