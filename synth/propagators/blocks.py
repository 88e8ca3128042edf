"""Moments as whole numbers of an exact step, blocks of them, and sums of functions of time at all of them.

A sum over functions f of Re(weight(t_b) f(tau)) splits into a part even in tau and a part odd in tau. Each is
a product (blocks x functions) times (functions x reaches) over the positive half alone; one added to the other is the
first half of the block, backwards, and one taken from the other is the second half. For f = exp(i w tau) the even part
is a cosine and the odd part a sine, so that a harmonic costs one multiplication a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.phase import Floats, Integers, Phasors, Turns, turns

PORTION = 512
"""Functions of one product: keeps the tables of a long recorded motion small."""

ONE_THREAD = 1 << 18
"""Multiplications up to which OpenBLAS keeps to one thread."""
FEWEST_ROWS = 8


@dataclass(frozen=True)
class Ticks:
    """Moments t = index * step."""

    index: Integers
    """(moments,) evenly spaced or not."""

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
    """

    centres: Ticks | EvenTicks
    """t_b"""
    reaches: Ticks | EvenTicks
    """tau, positive and increasing."""
    centre_step: Fraction
    reach_step: Fraction
    """Their steps, s; exact."""

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

    @property
    def last(self) -> float:
        """Largest time before or after t = 0, s."""
        centres, reaches = self.seconds
        return float(np.abs(centres).max(initial=0.0) + reaches[-1])


def product(
    even: Sequence[tuple[Floats, Floats]], odd: Sequence[tuple[Floats, Floats]], result: Floats, *, begun: bool
) -> None:
    """Evaluate some functions and put their sum into a result, or add it to one that is begun.

    Rows are taken in strips small enough for the BLAS to keep to one thread: a product of a tenth of a millisecond
    gains little from a second thread, and waits for milliseconds if that thread's core is busy. Products too large
    for strips may have all threads.

    Parameters
    ----------
    even, odd
        Weights (rows, blocks) and tables (rows, reaches) of some functions, at least of one; odd is before minus after.
    result : (blocks, moments) float64
    """
    evens, odds = ([np.concatenate(column) for column in zip(*each, strict=True)] for each in (even, odd))
    rows = ONE_THREAD // max(evens[1].size, 1)
    rows = len(result) if rows < FEWEST_ROWS else min(rows, len(result))
    space = np.empty((2, max(rows, 1), evens[1].shape[1]))
    halves((evens[0].T, evens[1]), (odds[0].T, odds[1]), result, space, begun=begun)


def halves(
    even: tuple[Floats, Floats], odd: tuple[Floats, Floats], result: Floats, space: Floats, *, begun: bool = False
) -> None:
    """Both halves of a product, in strips of rows.

    Parameters
    ----------
    even, odd : pairs of float64
        Weights (blocks, functions), and table (functions, reaches).
    result : (blocks, 2 * reaches)
        As of `product`.
    space : (2, rows, reaches)
        Working space for so many rows at a time.
    """
    reaches = space.shape[2]
    before, after = result[:, reaches - 1 :: -1], result[:, reaches:]
    for begin in range(0, len(result), space.shape[1]):
        strip = slice(begin, begin + space.shape[1])
        some = after[strip]
        evens = np.matmul(even[0][strip], even[1], out=space[0, : len(some)])
        odds = np.matmul(odd[0][strip], odd[1], out=space[1, : len(some)])
        if begun:
            before[strip] += evens + odds
            some += evens - odds
        else:
            np.add(evens, odds, out=before[strip])
            np.subtract(evens, odds, out=some)
