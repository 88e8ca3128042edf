r"""Moments as whole numbers of an exact step, blocks of them, and sums of functions of time at all of them.

A sum of Re(weight(t_b) f(tau)) splits into parts even and odd in tau, each a product (blocks x functions) times
(functions x reaches) over the positive half alone; for f = exp(i w tau) a harmonic costs one multiplication a sample.

Many multiples k = 0, 1 ... K - 1 of one frequency (a long recorded motion), at any moments: an inverse Fourier
transform on a grid of M >= 4 K points a period, between which a kernel phi of 16 points interpolates; what it does to
a harmonic is divided out beforehand,

    sum_j phi(u - j) exp(i theta j) = Phi(theta) exp(i theta u) + aliases,    |theta| = 2 pi k/M <= pi/2

For phi the Kaiser-Bessel window I0(beta sqrt(1 - (u/8)^2)), with Phi = 16 sinh(q)/q, q^2 = beta^2 - (8 theta)^2, the
aliases are 1e-15 (Fourmont, J. Fourier Anal. Appl. 9, 431, 2003). Within a step of the grid the 16 values of phi are
polynomials of the place. The place itself is a whole number of 2^-64 period: exact however late.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synth.phase import Floats, Integers, Phasors, Turns, turns

_ONE_THREAD = 1 << 18  # multiplications up to which OpenBLAS keeps to one thread
_FEWEST_ROWS = 8
_POINTS = 16  # of the grid under the kernel
_HALF = _POINTS // 2
_SHAPE = 1.5 * math.pi * _HALF  # beta: the kernel's transform ends where the aliases of K = M/4 begin
_TERMS = 16  # of the polynomials: 1e-16 of the largest
Places = NDArray[np.uint64]  # Where in the period, in 2^-64 of it


@dataclass(frozen=True)
class Ticks:
    """Moments t = index * step."""

    index: Integers  # (moments,)
    stride: int | None = None  # from one to the next, where it is the same for all

    @classmethod
    def even(cls, first: int, stride: int, count: int) -> "Ticks":
        """Evenly spaced ones."""
        return cls(np.arange(count, dtype=np.int64) * stride + first, stride)

    def phasors(self, rate: Turns) -> Phasors:
        """Return exp(i w t), (harmonics, moments), exact to rounding; of even ones as products of three short rows."""
        if self.stride is None or not self.index.size:
            return rate.phasors(self.index)
        count = self.index.size
        side = round(count ** (1 / 3)) or 1
        outer = -(-count // side**2)
        steps = [np.arange(side), np.arange(side) * side, np.arange(outer) * side**2]
        index = np.concatenate(steps) * self.stride
        index[:side] += self.index[0]
        short = rate.phasors(index)
        rows = len(short)
        pairs = (short[:, side : 2 * side, None] * short[:, None, :side]).reshape(rows, side**2)
        table = short[:, 2 * side :, None] * pairs[:, None, :]
        return table.reshape(rows, outer * side**2)[:, :count]


@dataclass(frozen=True)
class Blocks:
    """Moments t_b + tau and t_b - tau, from the farthest before a block's centre to the farthest after it."""

    centres: Ticks  # t_b
    reaches: Ticks  # tau, positive and increasing
    centre_step: Fraction
    reach_step: Fraction  # Their steps, s; exact

    @property
    def shape(self) -> tuple[int, int]:
        """Number of blocks, and of moments in each."""
        return self.centres.index.size, 2 * self.reaches.index.size

    def phasors(self, frequencies: Sequence[float | Fraction]) -> tuple[Phasors, Phasors]:
        """Return exp(i w t_b), (harmonics, blocks), and exp(i w tau), (harmonics, reaches)."""
        rate = turns(frequencies, self.centre_step)
        inner = rate if self.reach_step == self.centre_step else turns(frequencies, self.reach_step)
        return self.centres.phasors(rate), self.reaches.phasors(inner)

    @cached_property
    def seconds(self) -> tuple[Floats, Floats]:
        """Return t_b and tau in s, each rounded once."""
        centres, reaches = (each.index.astype(np.float64) for each in (self.centres, self.reaches))
        return centres * float(self.centre_step), reaches * float(self.reach_step)

    @property
    def last(self) -> float:
        """Largest time before or after t = 0, s."""
        centres, reaches = self.seconds
        return float(np.abs(centres).max(initial=0.0) + reaches[-1])


def product(even: Sequence[tuple[Floats, Floats]], odd: Sequence[tuple[Floats, Floats]], result: Floats) -> None:
    """Evaluate some functions and put their sum into a result, (blocks, moments).

    Even and odd parts of each are weights (rows, blocks) and tables (rows, reaches); odd is before minus after.
    Strips of rows are small enough for the BLAS to keep to one thread: a product of a tenth of a millisecond gains
    little from a second, and waits for milliseconds if that thread's core is busy.
    """
    evens, odds = ([np.concatenate(column) for column in zip(*each, strict=True)] for each in (even, odd))
    reaches = evens[1].shape[1]
    rows = _ONE_THREAD // max(evens[1].size, 1)
    rows = max(1, len(result) if rows < _FEWEST_ROWS else min(rows, len(result)))
    space = np.empty((2, rows, reaches))  # once: fresh memory costs as much as the sums
    before, after = result[:, reaches - 1 :: -1], result[:, reaches:]
    for begin in range(0, len(result), rows):
        strip = slice(begin, begin + rows)
        some = after[strip]
        one = np.matmul(evens[0].T[strip], evens[1], out=space[0, : len(some)])
        other = np.matmul(odds[0].T[strip], odds[1], out=space[1, : len(some)])
        np.add(one, other, out=before[strip])
        np.subtract(one, other, out=some)


@dataclass(frozen=True)
class PeriodicSums:
    """Real parts of several sums of coefficient * exp(2 pi i k t/period)."""

    period: Fraction  # s
    coefficients: Phasors  # (sums, K)

    @cached_property
    def _digits(self) -> int:
        """M is two to this power."""
        return max(4 * int(self.coefficients.shape[1]), 2 * _POINTS).bit_length()

    @cached_property
    def _windows(self) -> list[Floats]:
        """Of each sum, the 16 points of the grid about every step, (M, 16)."""
        size = 1 << self._digits
        angle = np.arange(self.coefficients.shape[1], dtype=np.float64) * (2 * math.pi / size)
        root = np.sqrt(_SHAPE**2 - (_HALF * angle) ** 2)
        growth = np.exp((_HALF * angle) ** 2 / (_SHAPE + root))
        inverse = root * growth / (_HALF * -np.expm1(-2 * root)) * _scaled_bessel(np.array(_SHAPE))  # 1/Phi
        factor = inverse * (size / 2)
        factor[0] *= 2
        grids = (np.fft.irfft(each * factor, size) for each in self.coefficients)  # one at a time: they may be large
        around = [np.concatenate([grid[1 - _HALF :], grid, grid[:_HALF]]) for grid in grids]
        return [np.lib.stride_tricks.sliding_window_view(each, _POINTS) for each in around]

    def at(self, places: Places) -> Floats:
        """Values, (sums, moments)."""
        result = np.empty((len(self.coefficients), places.size))
        cell = (places >> np.uint64(64 - self._digits)).astype(np.intp)
        inside = (places << np.uint64(self._digits)).astype(np.float64) * 2.0**-64
        kernel = np.polynomial.chebyshev.chebvander(2 * inside - 1, _TERMS - 1) @ _polynomials()
        for each, windows in zip(result, self._windows, strict=True):
            np.einsum("ij,ij->i", windows[cell], kernel, out=each)
        return result


@functools.cache
def _polynomials() -> Floats:
    """Chebyshev coefficients of the values of phi in a step, (terms, 16)."""
    nodes = np.cos((2 * np.arange(_TERMS) + 1) * (math.pi / (2 * _TERMS)))
    away = ((nodes[:, None] + 1) / 2 + (_HALF - 1) - np.arange(_POINTS)) / _HALF
    root = np.sqrt(1 - away**2)
    # I0(z) is exp(z) times a slow function: the difference of the exponents is formed without their rounding
    values = np.exp(-_SHAPE * away**2 / (1 + root)) * _scaled_bessel(_SHAPE * root) / _scaled_bessel(np.array(_SHAPE))
    return np.linalg.solve(np.polynomial.chebyshev.chebvander(nodes, _TERMS - 1), values)


def _scaled_bessel(argument: Floats) -> Floats:
    return np.i0(argument) * np.exp(-argument)
