r"""Sums over many multiples of one frequency, at any moments: an inverse Fourier transform and short interpolation.

A long recorded motion is tens of thousands of harmonics k = 0, 1 ... K - 1 of one period, and every moment of every
pendulum is a sum over all of them. The transform gives these sums on a grid of M >= 4 K points a period; between the
points a kernel phi of 16 points interpolates, and what it does to a harmonic is known and divided out beforehand,

    sum_j phi(u - j) exp(i theta j) = Phi(theta) exp(i theta u) + aliases,    |theta| = 2 pi k/M <= pi/2

For phi the Kaiser-Bessel window I0(beta sqrt(1 - (u/8)^2)), with Phi = 16 sinh(q)/q, q^2 = beta^2 - (8 theta)^2, the
aliases are 1e-15 (Fourmont, J. Fourier Anal. Appl. 9, 431, 2003). Within a step of the grid the 16 values of phi are
polynomials of the place. The place itself is a whole number of 2^-64 period: exact however late.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synth.phase import Floats, Phasors

_POINTS = 16  # of the grid under the kernel
_HALF = _POINTS // 2
_SHAPE = 1.5 * math.pi * _HALF  # beta: the kernel's transform ends where the aliases of K = M/4 begin
_TERMS = 16  # of the polynomials: 1e-16 of the largest
_STRIP = 512  # moments of one matrix product, which then keeps to one thread
_STRIPS = 8  # at a time: in the processor's cache

Places = NDArray[np.uint64]
"""Where in the period, in 2^-64 of it."""


@dataclass(frozen=True)
class PeriodicSums:
    """Real parts of several sums of coefficient * exp(2 pi i k t/period)."""

    period: Fraction
    """s"""
    coefficients: Phasors
    """(sums, K)."""

    @cached_property
    def _digits(self) -> int:
        """M is two to this power."""
        return max(4 * int(self.coefficients.shape[1]), 2 * _POINTS).bit_length()

    @cached_property
    def _windows(self) -> list[Floats]:
        """Of each sum, the 16 points of the grid about every step, (M, 16)."""
        size = 1 << self._digits
        angle = np.arange(self.coefficients.shape[1], dtype=np.float64) * (2 * math.pi / size)
        factor = _inverse_transform(angle) * (size / 2)
        factor[0] *= 2
        grids = (np.fft.irfft(each * factor, size) for each in self.coefficients)  # one at a time: they may be large
        around = [np.concatenate([grid[1 - _HALF :], grid, grid[:_HALF]]) for grid in grids]
        return [np.lib.stride_tricks.sliding_window_view(each, _POINTS) for each in around]

    def at(self, places: Places) -> Floats:
        """Values, (sums, moments).

        Parameters
        ----------
        places : (moments,)
        """
        result = np.empty((len(self.coefficients), places.size))
        strips = _STRIP * _STRIPS
        for begin in range(0, places.size, strips):
            some = places[begin : begin + strips]
            cell = (some >> np.uint64(64 - self._digits)).astype(np.intp)
            inside = (some << np.uint64(self._digits)).astype(np.float64) * 2.0**-64
            kernel = _kernel(inside)
            for each, windows in zip(result, self._windows, strict=True):
                np.einsum("ij,ij->i", windows[cell], kernel, out=each[begin : begin + strips])
        return result


def _kernel(inside: Floats) -> Floats:
    """The 16 values of phi at places within a step, 0 to 1, (moments, 16)."""
    rows = -(-inside.size // _STRIP)
    basis = np.ones((_TERMS, rows * _STRIP))
    basis[1, : inside.size] = 2 * inside - 1
    twice = 2 * basis[1]
    for term in range(2, _TERMS):
        np.multiply(twice, basis[term - 1], out=basis[term])
        basis[term] -= basis[term - 2]
    values: Floats = np.matmul(basis.reshape(_TERMS, rows, _STRIP).transpose(1, 2, 0), _polynomials())
    return values.reshape(rows * _STRIP, _POINTS)[: inside.size]


@functools.cache
def _polynomials() -> Floats:
    """Chebyshev coefficients of the values of phi in a step, (terms, 16)."""
    nodes = np.cos((2 * np.arange(_TERMS) + 1) * (math.pi / (2 * _TERMS)))
    away = ((nodes[:, None] + 1) / 2 + (_HALF - 1) - np.arange(_POINTS)) / _HALF
    root = np.sqrt(1 - away**2)
    # I0(z) is exp(z) times a slow function: the difference of the exponents is formed without their rounding
    values = np.exp(-_SHAPE * away**2 / (1 + root)) * _scaled_bessel(_SHAPE * root) / _scaled_bessel(np.array(_SHAPE))
    return np.linalg.solve(np.polynomial.chebyshev.chebvander(nodes, _TERMS - 1), values)


def _inverse_transform(angle: Floats) -> Floats:
    """1/Phi at angles theta."""
    root = np.sqrt(_SHAPE**2 - (_HALF * angle) ** 2)
    growth = np.exp((_HALF * angle) ** 2 / (_SHAPE + root))
    return np.asarray(root * growth / (_HALF * -np.expm1(-2 * root)) * _scaled_bessel(np.array(_SHAPE)))


def _scaled_bessel(argument: Floats) -> Floats:
    return np.i0(argument) * np.exp(-argument)
