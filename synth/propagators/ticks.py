"""Moments as whole numbers of an exact step, and blocks of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.phase import Floats, Integers, Phasors, Turns, turns


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
        """Return exp(i w t), (harmonics, moments), exact to rounding."""
        return rate.phasors(self.index)


@dataclass(frozen=True)
class EvenTicks:
    """Moments t = (first + stride * k) * step, k = 0, 1 ... count - 1."""

    first: int
    stride: int
    count: int

    @property
    def index(self) -> Integers:
        """All of them, (moments,) int64."""
        return np.arange(self.count, dtype=np.int64) * self.stride + self.first

    def phasors(self, rate: Turns) -> Phasors:
        """Return exp(i w t), (harmonics, moments), exact to rounding: products of three short rows, to spare sines."""
        side = round(self.count ** (1 / 3)) or 1
        outer = -(-self.count // side**2)
        steps = [np.arange(side), np.arange(side) * side, np.arange(outer) * side**2]
        index = np.concatenate(steps) * self.stride
        index[:side] += self.first
        short = rate.phasors(index)
        rows = len(short)
        pairs = (short[:, side : 2 * side, None] * short[:, None, :side]).reshape(rows, side**2)
        table = short[:, 2 * side :, None] * pairs[:, None, :]
        return table.reshape(rows, outer * side**2)[:, : self.count]


@dataclass(frozen=True)
class Blocks:
    """Moments t_b + tau and t_b - tau: every block lies evenly about its centre.

    The moments of a block run from the farthest before the centre to the farthest after it.

    Attributes
    ----------
    centres : Ticks or EvenTicks
        t_b
    reaches : Ticks or EvenTicks
        tau, positive and increasing.
    centre_step, reach_step : Fraction
        Their steps, s; exact.
    """

    centres: Ticks | EvenTicks
    reaches: Ticks | EvenTicks
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
        centres, reaches = (each.index.astype(np.float64) for each in (self.centres, self.reaches))
        return centres * float(self.centre_step), reaches * float(self.reach_step)
