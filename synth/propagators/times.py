"""What is asked of moments, even or uneven: all sums over harmonics, with those of long tables by Fourier transform."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import Response
from synth.phase import Floats, Phasors
from synth.propagators.periodic import PeriodicSums, Places


class Times(ABC):
    """Moments at which sums are evaluated."""

    @abstractmethod
    def series(self, angular_frequency: Floats, coefficients: Phasors) -> Floats:
        """Real parts of sums of harmonics, (sums, count), one by one; see `closed_form.series`."""

    @abstractmethod
    def places(self, period: Fraction) -> Places:
        """Where in a period the moments lie, (count,), in 2^-64 of it."""

    @abstractmethod
    def _elongation(self, responses: Sequence[Response], angular_frequency: Floats) -> Floats:
        """Angles of the pendulums but for the combs of the motion."""

    @abstractmethod
    def _free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        """Free harmonic but for the combs of the motion."""

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
        result = self._elongation(responses, angular_frequency)
        return self._with(result, [each.transforms for each in responses])

    def free_harmonic(self, response: Response, angular_frequency: Floats) -> Phasors:
        """Complex free harmonic of one pendulum, (count,), rad."""
        result = self._free_harmonic(response, angular_frequency)
        for sums in response.beat_transforms:
            real, imaginary = sums.at(self.places(sums.period))
            result += real + 1j * imaginary
        return result

    def _with(self, rows: Floats, transforms: Sequence[Sequence[PeriodicSums]]) -> Floats:
        for row, each in zip(rows, transforms, strict=True):
            for sums in each:
                row += sums.at(self.places(sums.period))[0]
        return rows
