"""How far the first trace departs from what the difference says of it: delay, gain, and what looks like a delay.

If the trace reads `(1 + gain) theta1(t - delay)`, the difference is `L trace(t + delay)/(1 + gain)`: two more columns
in the least squares of the identity. A delay turns the phase of `i (n1-n2) Z1` by n delay, a gain changes its size. So
does an error of gamma1 - gamma2 or of n1 - n2: the first is a third column where the record states no damping, the
second is corrected alike, whichever of the two it is.

What can be told follows from the Fisher matrix: of a swing's response that grows over the record only what is bent,
a share (n1-n2) T/20 or so, cannot be taken for a change of n2 and of the start. So 1 sigma of the gain, and of n times
the delay, is about `20 sqrt(2/N) sigma/(Theta1 ((n1-n2) T)^2)`, sigma the reading noise: 0.2 % and 0.3 ms in half an
hour at 25 Hz, 1e-4 rad, Theta1 = 10 mrad and (n1-n2)/n2 = 1e-4; a hundred times as much at 1e-5, where neither matters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from data_schemas.scratch import release
from pipeline.arrays import Floats
from pipeline.inversion.influence import adjoint

DELAY, GAIN, DAMPING = 0, 1, 2


@dataclass(frozen=True)
class Departures:
    """Least squares for what is wrong with the first trace.

    Attributes
    ----------
    value, sigma : (k,) arrays
        Delay (s), gain (1) and, where it was asked for, the change of gamma1 - gamma2 (s-1), with 1 sigma.
    by_unit : (k,) array
        What leaving each of them out does to n2, rad s-1 for one unit of it.
    covariance : (k, k) array
    significance : float
        Chi square of all of them together, of k degrees of freedom.
    explained : float
        By how much they lower the sum of squares, in squares of the difference's noise.
    """

    value: Floats
    sigma: Floats
    by_unit: Floats
    covariance: Floats
    significance: float
    explained: float

    @property
    def effect(self) -> Floats:
        """What leaving each of them out, at its value, does to n2, rad s-1."""
        return self.by_unit * self.value

    @property
    def effect_sigma(self) -> float:
        """1 sigma of n2 from their uncertainty, once they are corrected, rad s-1."""
        return float(np.sqrt(np.abs(self.by_unit @ self.covariance @ self.by_unit)))

    def less_certain(self, sigma: Floats) -> Departures:
        """The same with a further independent 1 sigma, (k,)."""
        covariance = self.covariance + np.diag(sigma**2)
        significance = float(self.value @ np.linalg.solve(covariance, self.value))
        return replace(self, sigma=np.sqrt(np.diag(covariance)), covariance=covariance, significance=significance)


class Rows(Protocol):
    """The rows of the least squares, made portion by portion."""

    @property
    def parts(self) -> Sequence[slice]:
        """The places of each portion."""

    def tangents(self, number: int) -> Floats:
        """Of the identity's parameters in one portion, n2 first, (p, m); portions are first asked for in order."""

    def columns(self, number: int, count: int) -> Floats:
        """By delay, gain and (count 3) damping difference in one portion, (count, m)."""


def fit_departures(
    residual: Floats,
    made: Rows,
    wanted: list[int],
    noise: tuple[float, float],
    linear: tuple[complex, float, float],
    spread: Callable[[Floats, int], Floats] = lambda row, _: row,
) -> Departures:
    """Fit some of the columns to the residual, the identity's own parameters free beside them.

    The rows are made twice, portion by portion: forwards for their products, backwards for the adjoint of the response.

    Parameters
    ----------
    residual : (n,) array
        Of the identity, rad, NaN = missing.
    made : Rows
        Columns and tangents.
    wanted : list of int
        Which of the columns.
    noise : (2,) tuple
        White noise of the difference's readings and of the first trace on its grid, rad.
    linear : tuple
        Eigenvalue of the free swing, step of the first pendulum's grid, and 1 - (n2/n1)^2, by which noise of the first
        trace reaches the difference.
    spread : callable
        Takes a portion of a row at the residual's places, and its number, to the first pendulum's grid.
    """

    def rows_of(number: int) -> tuple[Floats, Floats]:
        left = residual[made.parts[number]]
        rows = np.concatenate([made.columns(number, max(wanted) + 1)[wanted], made.tangents(number)])
        used = np.isfinite(left) & np.isfinite(rows).all(axis=0)
        rows[:, ~used] = 0.0
        return rows, np.where(used, left, 0.0)

    size = len(wanted)
    products, right = np.zeros(()), np.zeros(())
    for number in range(len(made.parts)):
        rows, left = rows_of(number)
        products, right = products + rows @ rows.T, right + rows @ left
        release(residual)
    scale = np.sqrt(np.diag(products))
    scaled = products / np.outer(scale, scale)
    inverse = np.linalg.inv(scaled + 1e-14 * np.eye(len(scale)))
    found = (inverse @ (right / scale) / scale)[:size]
    by_row = inverse[:size] / scale[:size, None] / scale
    turn, backwards = complex(np.exp(linear[0] * linear[1])), [0.0j] * size
    covariance, through = np.zeros((2, size, size))
    for number in reversed(range(len(made.parts))):
        if number + 1 < len(made.parts):
            rows, _ = rows_of(number)  # those of the last portion are there
        influence = by_row @ rows  # what each reading does to each of the wanted
        covariance += influence @ influence.T
        noisy = np.stack([spread(row, number) for row in influence])
        still, out = np.zeros(noisy.shape[1]), np.empty_like(noisy)
        for which, row in enumerate(noisy):
            backwards[which] = adjoint(row, still, turn, linear[0].imag, linear[1], backwards[which], out[which])
        through += out @ out.T
        release(residual)
    told = float(found @ np.linalg.solve(covariance, found)) / noise[0] ** 2
    covariance *= noise[0] ** 2
    covariance += (noise[1] * linear[1] * linear[2] * linear[0].imag ** 2) ** 2 * through
    # without the columns n2 takes up what they would have explained
    alone = np.linalg.inv(scaled[size:, size:] + 1e-14 * np.eye(len(scale) - size))
    taken = (alone @ scaled[size:, :size])[0] * scale[:size] / scale[size]
    return Departures(
        value=found,
        sigma=np.sqrt(np.diag(covariance)),
        by_unit=taken,
        covariance=covariance,
        significance=float(found @ np.linalg.solve(covariance, found)),
        explained=told,
    )
