"""Projection from uneven sample times: the response, known on a uniform grid, goes to the samples.

It goes there by the eight functions of the quadrature; the difference itself is never interpolated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from data_schemas.scratch import portions, release, room
from pipeline.arrays import Floats
from pipeline.projection.kernels import COLUMNS
from pipeline.projection.taps import CENTRE, NODES, fitted_basis
from pipeline.projection.uniform import UniformProblem, oscillation
from synth.kernels.compiled import summing_kernel


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
        # its own difference is not asked for
        self._uniform = UniformProblem(whole, whole, step, fitted_at, ratio, damping_difference)
        self.half = 0.5 * float(time[-1])
        self._time, self._difference = time, difference
        self._where, self._weights = from_grid(time, step, whole.size, fitted_at)
        self._starts = np.minimum(np.arange(self._uniform.slopes.shape[0]) * self._uniform.block, whole.size - 1) * step
        edges = np.searchsorted(time, [-np.inf, *(edge for span in cut for edge in span), np.inf])
        self.pieces = [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]
        self.residual: Floats = room(time.size)
        self._response: Floats = room(time.size)
        self._slopes = room(time.size), room(time.size)

    def _portions(self) -> Iterator[slice]:
        return portions(self._time.size, self._time, self._difference, self.residual, self._response, *self._slopes)

    def respond(self, frequency: float, gamma: float) -> None:
        """See `Problem`."""
        self._uniform.respond(frequency, gamma)
        series = self._uniform.response
        eigenvalue = complex(-gamma, oscillation(frequency, gamma))
        still = self._uniform.slopes * np.exp(-eigenvalue * self._starts)[:, None]
        for part in self._portions():
            time = self._time[part]
            interpolate(series, self._where[part], self._weights[part], self._response[part])
            carrier = np.exp(eigenvalue * time)
            for column, slope in enumerate(self._slopes):
                slope[part] = (carrier * np.interp(time, self._starts, still[:, column])).imag
            release(series, self._where, self._weights)

    def nudge(self, frequency_change: float, damping_change: float) -> None:
        """See `Problem`."""
        for part in self._portions():
            by_frequency, by_damping = (slope[part] for slope in self._slopes)
            self._response[part] += frequency_change * by_frequency + damping_change * by_damping

    def moments(self, frequency: float, gamma: float, coefficient: Floats, limit: float) -> tuple[Floats, int]:
        """See `Problem`."""
        gram, beyond = np.zeros((len(self.pieces), COLUMNS, COLUMNS)), 0
        for part in self._portions():
            columns = self._columns(part, frequency, gamma)
            self.residual[part] = np.nan
            for which, piece in enumerate(self.pieces):
                here = slice(max(piece.start, part.start), min(piece.stop, part.stop))
                if here.start >= here.stop:
                    continue
                own = columns[here.start - part.start : here.stop - part.start]
                residual = own[:, 7]
                residual -= own[:, :3] @ coefficient[which]
                within = np.abs(residual) <= limit
                beyond += int((np.abs(residual) > limit).sum())
                self.residual[here] = np.where(within, residual, np.nan)
                chosen = own if within.all() else own[within]
                gram[which] += chosen.T @ chosen
        return gram, beyond

    def _columns(self, part: slice, frequency: float, gamma: float) -> Floats:
        """Those of `kernels.moments` at some readings, the last less the response alone."""
        time = self._time[part]
        columns = np.empty((time.size, COLUMNS))
        carrier = np.exp((-gamma + 1j * oscillation(frequency, gamma)) * time)
        scaled = time / self.half - 1.0
        columns[:, 0], columns[:, 1], columns[:, 2] = carrier.real, carrier.imag, 1.0
        columns[:, 3], columns[:, 4] = scaled * carrier.real, scaled * carrier.imag
        columns[:, 5], columns[:, 6] = (slope[part] for slope in self._slopes)
        columns[:, 7] = self._difference[part] - self._response[part]
        return columns


def from_grid(time: Floats, step: float, count: int, frequency: float) -> tuple[NDArray[np.int64], Floats]:
    """First node and eight weights that interpolate a uniform series at each time."""
    matrix = fitted_basis(np.arange(NODES) - CENTRE, frequency * step)
    where, weights = room(time.size, np.int64), room((time.size, NODES))
    for part in portions(time.size, time, where, weights):
        place = time[part] / step
        where[part] = np.clip(np.floor(place).astype(np.int64) - 3, 0, count - NODES)
        position = place - where[part] - CENTRE
        weights[part] = np.linalg.solve(matrix, fitted_basis(position, frequency * step)).T
    return where, weights


@summing_kernel
def interpolate(series: Floats, where: NDArray[np.int64], weights: Floats, out: Floats) -> None:
    """`out[k] = sum_j weights[k, j] series[where[k] + j]`."""
    for k in range(out.size):
        at, total = where[k], 0.0
        for j in range(NODES):
            total += weights[k, j] * series[at + j]
        out[k] = total


def taken(series: Floats, where: NDArray[np.int64], weights: Floats) -> Floats:
    """A uniform series at some times, by what `from_grid` says of them."""
    out = np.empty(where.size)
    interpolate(series, where, weights, out)
    return out
