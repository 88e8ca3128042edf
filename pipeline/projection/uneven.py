"""Projection from uneven sample times: the response, known on a uniform grid, goes to the samples.

It goes there by the eight functions of the quadrature; the difference itself is never interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Floats
from pipeline.projection.kernels import COLUMNS
from pipeline.projection.taps import CENTRE, NODES, fitted_basis
from pipeline.projection.uniform import UniformProblem, oscillation


class UnevenProblem:
    """Uneven samples of the difference, NaN = missing; the first pendulum on a uniform grid. See `solve.Problem`."""

    def __init__(
        self,
        time: Floats,
        whole: Floats,
        step: float,
        difference: Floats,
        fitted_at: float,
        ratio: float,
        damping_difference: float,
        cut: Sequence[tuple[float, float]] = (),
    ) -> None:
        self._uniform = UniformProblem(whole, np.full(whole.size, np.nan), step, fitted_at, ratio, damping_difference)
        self.half = 0.5 * float(time[-1])
        self._used = np.isfinite(difference)
        self.residual: Floats = np.full(time.size, np.nan)
        self._time, self._difference = time[self._used], difference[self._used]
        self._where, self._weights = from_grid(self._time, step, whole.size, fitted_at)
        self._starts = np.minimum(np.arange(self._uniform.slopes.shape[0]) * self._uniform.block, whole.size - 1) * step
        self._columns = np.empty((self._time.size, COLUMNS))
        edges = np.searchsorted(self._time, [-np.inf, *(edge for span in cut for edge in span), np.inf])
        self.pieces = [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]

    def respond(self, frequency: float, gamma: float) -> None:
        """See `Problem`."""
        self._uniform.respond(frequency, gamma)
        around = self._uniform.response[self._where[:, None] + np.arange(NODES)]
        self._response = np.einsum("ij,ij->i", around, self._weights)
        eigenvalue = complex(-gamma, oscillation(frequency, gamma))
        still = self._uniform.slopes * np.exp(-eigenvalue * self._starts)[:, None]
        carrier = np.exp(eigenvalue * self._time)
        for column in range(2):
            slope = carrier * np.interp(self._time, self._starts, still[:, column])
            self._columns[:, 5 + column] = slope.imag

    def nudge(self, frequency_change: float, damping_change: float) -> None:
        """See `Problem`."""
        self._response += frequency_change * self._columns[:, 5] + damping_change * self._columns[:, 6]

    def moments(self, frequency: float, gamma: float, coefficient: Floats, limit: float) -> tuple[Floats, int]:
        """See `Problem`."""
        residual = self._fill_columns(frequency, gamma)
        gram, beyond, kept = np.empty((len(self.pieces), COLUMNS, COLUMNS)), 0, np.full(residual.size, np.nan)
        for which, piece in enumerate(self.pieces):
            columns, left = self._columns[piece], residual[piece]
            left -= columns[:, :3] @ coefficient[which]
            within = np.abs(left) <= limit
            kept[piece] = np.where(within, left, np.nan)
            columns[:, 7] = left
            chosen = columns if within.all() else columns[within]
            gram[which] = chosen.T @ chosen
            beyond += int((~within).sum())
        self.residual[self._used] = kept
        return gram, beyond

    def _fill_columns(self, frequency: float, gamma: float) -> Floats:
        carrier = np.exp((-gamma + 1j * oscillation(frequency, gamma)) * self._time)
        scaled = self._time / self.half - 1.0
        self._columns[:, 0], self._columns[:, 1], self._columns[:, 2] = carrier.real, carrier.imag, 1.0
        self._columns[:, 3], self._columns[:, 4] = scaled * carrier.real, scaled * carrier.imag
        return np.asarray(self._difference - self._response)


def from_grid(time: Floats, step: float, count: int, frequency: float) -> tuple[np.ndarray, Floats]:
    """First node and eight weights that interpolate a uniform series at each time."""
    where = np.clip(np.floor(time / step).astype(np.int64) - 3, 0, count - NODES)
    position = time / step - where - CENTRE
    matrix = fitted_basis(np.arange(NODES) - CENTRE, frequency * step)
    return where, np.linalg.solve(matrix, fitted_basis(position, frequency * step)).T.copy()
