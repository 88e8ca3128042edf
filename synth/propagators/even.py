"""Moments at even steps: t = 0, step, 2 step ..., or a stretch of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats, Phasors, rational_turns
from synth.propagators import closed_form
from synth.propagators.periodic import Places
from synth.propagators.ticks import Blocks, EvenTicks
from synth.propagators.times import Times


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

    def _blocks(self) -> Blocks:
        """Fewer moments a block than blocks: few sines, and shapes that suit the matrix product.

        Centres lie half-way between two moments, so all counting is in half steps.
        """
        half = max(1, math.isqrt(self.count // 6))
        centres = EvenTicks(2 * (half + self.first) - 1, 4 * half, -(-self.count // (2 * half)))
        return Blocks(centres, EvenTicks(1, 2, half), self.step / 2, self.step / 2)

    def places(self, period: Fraction) -> Places:
        """See `Times.places`."""
        index = np.arange(self.first, self.first + self.count, dtype=np.int64)
        places: Places = rational_turns(self.step / period).wrapped(index)[0]
        return places

    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics, (sums, count); see `closed_form.series`."""
        result = closed_form.series(angular_frequency, coefficients, self._blocks())
        return result.reshape(len(coefficients), -1)[:, : self.count]

    def _elongation(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        blocks = self._blocks()
        result = closed_form.elongation(responses, angular_frequency, blocks)
        return result.reshape(len(responses), -1)[:, : self.count]

    def _free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        return closed_form.free_harmonic(response, angular_frequency, self._blocks()).reshape(-1)[: self.count]
