"""Sums of functions of time at all moments of all blocks, as matrix products over half of each block.

A sum over functions f of Re(weight(t_b) f(tau)) splits into a part even in tau and a part odd in tau. Each is
a product (blocks x functions) times (functions x reaches) over the positive half alone; their sum is the
second half of the block and their difference the first half, backwards. For f = exp(i w tau) the even part is
a cosine and the odd part a sine, so that a harmonic costs one multiplication a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from synth.phase import Floats, Phasors

PORTION = 512
"""Functions of one product: keeps the tables of a long recorded motion small."""

_ONE_THREAD = 1 << 18  # multiplications up to which OpenBLAS keeps to one thread
_FEWEST_ROWS = 8


@dataclass(frozen=True)
class Halves:
    """Weights and tables of some functions: (rows, blocks) and (rows, reaches), even and odd."""

    even_weights: Floats
    even_table: Floats
    odd_weights: Floats
    odd_table: Floats


def harmonic_halves(weights: Phasors, table: Phasors) -> Halves:
    """Harmonics: Re(W exp(i w tau)) = Re W cos(w tau) - Im W sin(w tau).

    Parameters
    ----------
    weights : (harmonics, blocks)
        W
    table : (harmonics, reaches)
        exp(i w tau)
    """
    return Halves(weights.real, table.real, -weights.imag, table.imag)


def general_halves(weights: Phasors, after: Phasors, before: Phasors) -> Halves:
    """Any functions, given on both sides of the centre.

    Parameters
    ----------
    weights : (functions, blocks)
        W
    after, before : (functions, reaches)
        f(tau) and f(-tau)
    """
    rows = np.concatenate([weights.real, -weights.imag])
    even, odd = (after + before) / 2, (after - before) / 2
    return Halves(rows, np.concatenate([even.real, even.imag]), rows, np.concatenate([odd.real, odd.imag]))


@dataclass
class RunningSum:
    """Adds up products over one array of moments, several small ones at a time.

    Attributes
    ----------
    result : (blocks, moments) float64
        Its content does not matter before the first product.
    """

    result: Floats
    _pending: list[Halves] = field(default_factory=list)
    _begun: bool = False

    def add(self, halves: Halves) -> None:
        """Add functions; they may wait for others."""
        self._pending.append(halves)
        if sum(len(each.even_weights) for each in self._pending) >= PORTION:
            self.finish()

    def finish(self) -> None:
        """Evaluate what waits.

        Rows are taken in strips small enough for the BLAS to keep to one thread: a product of a tenth of
        a millisecond gains little from a second thread, and waits for milliseconds if that thread's core is
        busy. Products too large for strips may have all threads.
        """
        even_weights, even_table, odd_weights, odd_table = (
            np.concatenate([getattr(each, name) for each in self._pending]) for name in _PARTS
        )
        reaches = even_table.shape[1]
        rows = _ONE_THREAD // max(even_table.size, odd_table.size, 1)
        if rows < _FEWEST_ROWS:
            rows = len(self.result)
        for begin in range(0, len(self.result), rows):
            strip = slice(begin, begin + rows)
            even = even_weights[:, strip].T @ even_table
            odd = odd_weights[:, strip].T @ odd_table
            before, after = self.result[strip, reaches - 1 :: -1], self.result[strip, reaches:]
            if self._begun:
                before += even - odd
                after += even + odd
            else:
                np.subtract(even, odd, out=before)
                np.add(even, odd, out=after)
        self._pending.clear()
        self._begun = True


_PARTS = ("even_weights", "even_table", "odd_weights", "odd_table")
