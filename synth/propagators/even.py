"""Moments at even steps: t = 0, step, 2 step ..."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats, Phasors
from synth.propagators import closed_form
from synth.propagators.ticks import Blocks, Ticks


@dataclass(frozen=True)
class EvenTimes:
    """Even moments, as a propagator wants them.

    Attributes
    ----------
    step : Fraction
        s, of true time
    count : int
    """

    step: Fraction
    count: int

    def _blocks(self) -> Blocks:
        """Fewer moments a block than blocks: few sines, and shapes that suit the matrix product.

        Centres lie half-way between two moments, so all counting is in half steps.
        """
        half = max(1, math.isqrt(self.count // 8))
        centres = np.arange(-(-self.count // (2 * half)), dtype=np.int64) * (4 * half) + (2 * half - 1)
        reaches = 2 * np.arange(half, dtype=np.int64) + 1
        return Blocks(Ticks(centres), Ticks(reaches), self.step / 2, self.step / 2)

    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics, (sums, count); see `closed_form.series`."""
        result = closed_form.series(angular_frequency, coefficients, self._blocks())
        return result.reshape(len(coefficients), -1)[:, : self.count]

    def elongation(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        """Angles of the pendulums, (pendulums, count), rad."""
        blocks = self._blocks()
        result = closed_form.elongation(responses, angular_frequency, blocks)
        return result.reshape(len(responses), -1)[:, : self.count]

    def free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        """Complex free harmonic of one pendulum, (count,), rad."""
        return closed_form.free_harmonic(response, angular_frequency, self._blocks()).reshape(-1)[: self.count]
