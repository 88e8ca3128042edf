"""Moments as whole numbers of an exact step, and blocks of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.phase import Floats, Integers, Phasors, Turns, turns

_WORTHWHILE = 16  # moments from which a row of phasors is made as a product


@dataclass(frozen=True)
class Ticks:
    """Moments t = index * step.

    Attributes
    ----------
    index : (moments,) int64
        Evenly spaced or not.
    """

    index: Integers

    @property
    def count(self) -> int:
        """Number of moments."""
        return self.index.size

    def phasors(self, rate: Turns) -> Phasors:
        """Return exp(i w t), (harmonics, moments), exact to rounding.

        An evenly spaced row is the product of two short ones, which spares most sines.
        """
        if self.count < _WORTHWHILE or np.any(np.diff(self.index, 2)):
            return rate.phasors(self.index)
        inner = math.isqrt(self.count - 1) + 1
        first = rate.phasors(self.index[:inner])
        jumps = rate.phasors(self.index[::inner] - self.index[0])
        table = jumps[:, :, None] * first[:, None, :]
        return table.reshape(len(first), jumps.shape[1] * inner)[:, : self.count]


@dataclass(frozen=True)
class Blocks:
    """Moments t_b + tau and t_b - tau: every block lies evenly about its centre.

    The moments of a block run from the farthest before the centre to the farthest after it.

    Attributes
    ----------
    centres : Ticks
        t_b
    reaches : Ticks
        tau, positive and increasing.
    centre_step, reach_step : Fraction
        Their steps, s; exact.
    """

    centres: Ticks
    reaches: Ticks
    centre_step: Fraction
    reach_step: Fraction

    @property
    def shape(self) -> tuple[int, int]:
        """Number of blocks, and of moments in each."""
        return self.centres.count, 2 * self.reaches.count

    def phasors(self, frequencies: Sequence[float | Fraction]) -> tuple[Phasors, Phasors]:
        """Return exp(i w t_b), (harmonics, blocks), and exp(i w tau), (harmonics, reaches)."""
        rate = turns(frequencies, self.centre_step)
        inner = rate if self.reach_step == self.centre_step else turns(frequencies, self.reach_step)
        return self.centres.phasors(rate), self.reaches.phasors(inner)

    @property
    def seconds(self) -> tuple[Floats, Floats]:
        """Return t_b and tau in s, each rounded once."""
        centres = self.centres.index.astype(np.float64) * float(self.centre_step)
        return centres, self.reaches.index.astype(np.float64) * float(self.reach_step)
