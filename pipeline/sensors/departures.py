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

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.inversion.influence import adjoint

DELAY, GAIN, DAMPING = 0, 1, 2
PROBE_DELAY, PROBE_GAIN, PROBE_DAMPING = 1e-3, 1e-3, 1e-6  # s, 1, s-1: steps of the finite differences

Model = Callable[[float, float, float], Floats]
"""The difference that (delay, gain, change of gamma1 - gamma2) make of the first trace, other parameters held."""


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


def probes(model: Model, count: int) -> Floats:
    """Columns by delay, gain and (count 3) damping difference, (count, n)."""
    plain = model(0.0, 0.0, 0.0)
    moved = (model(PROBE_DELAY, 0.0, 0.0), model(0.0, PROBE_GAIN, 0.0))
    columns = [(moved[0] - plain) / PROBE_DELAY, (moved[1] - plain) / PROBE_GAIN]
    if count > DAMPING:
        columns.append((model(0.0, 0.0, PROBE_DAMPING) - plain) / PROBE_DAMPING)
    return np.stack(columns)


def fit_departures(
    residual: Floats,
    tangents: Floats,
    columns: Floats,
    wanted: list[int],
    noise: tuple[float, float],
    linear: tuple[complex, float, float],
    spread: Callable[[Floats], Floats] = np.asarray,
) -> Departures:
    """Fit some of the columns to the residual, the identity's own parameters free beside them.

    Parameters
    ----------
    residual : (n,) array
        Of the identity, rad, NaN = missing.
    tangents : (p, n) array
        Of the identity's parameters, n2 first.
    columns : (k, n) array
        From `probes`.
    wanted : list of int
        Which of them.
    noise : (2,) tuple
        White noise of the difference's readings and of the first trace on its grid, rad.
    linear : tuple
        Eigenvalue of the free swing, step of the first pendulum's grid, and 1 - (n2/n1)^2, by which noise of the first
        trace reaches the difference.
    spread : callable
        Takes a row at the residual's places to the first pendulum's grid.
    """
    size = len(wanted)
    # in place, for of a day at 25 Hz each row has 17 MB
    scaled = np.concatenate([columns[wanted], tangents])
    used = np.isfinite(residual) & np.isfinite(scaled).all(axis=0)
    scaled[:, ~used] = 0.0
    scale = np.sqrt([row @ row for row in scaled])
    scaled /= scale[:, None]
    inverse = np.linalg.inv(scaled @ scaled.T + 1e-14 * np.eye(len(scaled)))
    found = (inverse @ (scaled @ np.where(used, residual, 0.0)) / scale)[:size]
    rows = inverse[:size] / scale[:size, None] @ scaled  # what each reading does to each of the wanted
    covariance = noise[0] ** 2 * rows @ rows.T
    eigenvalue, step, apart = linear
    spread_rows = [spread(row) for row in rows]
    through = np.empty((size, spread_rows[0].size))
    turn, still = complex(np.exp(eigenvalue * step)), np.zeros(through.shape[1])
    for row, out in zip(spread_rows, through, strict=True):
        adjoint(row, still, turn, eigenvalue.imag, step, out)
    through *= step * apart * eigenvalue.imag**2
    covariance += noise[1] ** 2 * through @ through.T
    # without the columns n2 takes up what they would have explained
    alone = np.linalg.inv(scaled[size:] @ scaled[size:].T + 1e-14 * np.eye(len(tangents)))
    taken = (alone @ scaled[size:] @ scaled[:size].T)[0] * scale[:size] / scale[size]
    return Departures(
        value=found,
        sigma=np.sqrt(np.diag(covariance)),
        by_unit=taken,
        covariance=covariance,
        significance=float(found @ np.linalg.solve(covariance, found)),
        explained=float(found @ np.linalg.solve(rows @ rows.T, found)) / noise[0] ** 2,
    )
