"""A uniform grid for a first pendulum that was read at uneven times.

It is an input of the correction, to be integrated; the difference, whose frequency is wanted, stays as it was read.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from data_schemas import scratch
from data_schemas.errors import RefusedError
from data_schemas.scratch import by_portions, portions, release, room
from pipeline.arrays import Floats, readings
from pipeline.outliers import THRESHOLD, local_maxima
from pipeline.projection.taps import NODES, fitted_basis

FIT_SAMPLES = 14  # of the first pendulum around each grid point; more than the eight functions, so that noise averages
MOST_STRETCH = 2.5  # a grid point whose samples span more than this many times the usual is a gap
TOGETHER = 4096  # grid points that are fitted together: each takes its readings many times over
MOST_ANGLE = 0.35  # rad of swing between grid points
FLOOR = 1e-3  # of the largest elongation: below it lies what the fit errs by where readings are few
BESIDE = 10  # readings on each side among which the wild one is looked for
ROUNDS = 20
SAMPLE = 65_536  # readings that tell how far the rest are from the grid
MOST_TOLD = 0.8  # rad of swing between readings, beyond which a local fit errs by more than they
LEFT = 0.78  # of white noise, the share that the grid of the same readings does not follow: .75 to .81 as measured


def grid_step(time: Floats, frequency: float) -> float:
    """Step of the grid, s.

    Raises
    ------
    RefusedError
        Fewer than four samples a swing.
    """
    spacing = float(time[-1]) / (time.size - 1)
    if spacing * frequency > 0.5 * np.pi:
        raise RefusedError("time: uneven samples fewer than four a swing; give at least four samples a swing")
    intervals = int(np.ceil(time[-1] * frequency / min(MOST_ANGLE, 1.25 * spacing * frequency)))
    return float(time[-1]) / intervals


def reject_uneven(time: Floats, series: Floats, step: float, frequency: float) -> tuple[Floats, Floats, int, float]:
    """Replace wild readings by NaN: those that their neighbours' grid does not lead to, the wildest around first.

    Parameters
    ----------
    time, series, step, frequency
        See `to_grid`.

    Returns
    -------
    (n,) array, (m,) array, int, float
        The series (itself when nothing was found), its grid, how many readings were rejected, and the white noise that
        the grid leaves unexplained (1 sigma, rad; NaN where the swing turns too far between readings to tell).
    """
    from pipeline.projection.uneven import from_grid, taken

    given, whole, error = series, to_grid(time, series, step, frequency), room(time.size)
    where, weights = from_grid(time, step, whole.size, frequency)
    largest = float(np.nanmax(np.abs(series)))
    for _ in range(ROUNDS):
        for part in portions(time.size, series, error, where, weights):
            error[part] = np.abs(series[part] - taken(whole, where[part], weights[part]))
        scale = 1.4826 * float(np.nanmedian(error[:: -(-time.size // SAMPLE)]))
        wild = np.flatnonzero(error > max(THRESHOLD * scale, FLOOR * largest))
        if not wild.size:
            break
        series = by_portions(np.copy, series)
        for top in wild[local_maxima(error[wild], wild, FIT_SAMPLES)]:
            series[_to_blame(time, series, int(top), frequency)] = np.nan
        whole = to_grid(time, series, step, frequency)
    close = float(time[-1]) * frequency < MOST_TOLD * (time.size - 1)
    return series, whole, readings(given) - readings(series), scale / LEFT if close else float("nan")


def _to_blame(time: Floats, series: Floats, place: int, frequency: float) -> int:
    """The reading around a place without which the others agree best: a fit may run through a wild one, and miss them.

    Without a reading the sum of squares of a fit falls by `r^2/(1 - h)`, r its departure and h its leverage.
    """
    around = np.arange(max(place - BESIDE, 0), min(place + BESIDE + 1, series.size))
    around = around[np.isfinite(series[around])]
    if around.size <= NODES:
        return place
    tau = time[around] - time[place]
    scale = float(np.abs(tau).max())
    basis, _ = np.linalg.qr(fitted_basis(tau / scale, frequency * scale).T)
    left = series[around] - basis @ (basis.T @ series[around])
    return int(around[np.argmax(left**2 / np.maximum(1.0 - np.sum(basis**2, axis=1), 1e-9))])


def to_grid(time: Floats, series: Floats, step: float, frequency: float) -> Floats:
    """Uniform values by a local fit of the eight functions through the nearest samples; NaN where there are too few.

    Parameters
    ----------
    time, series : (n,) arrays
        s, rad; NaN = missing.
    step, frequency : float
        s, rad s-1.
    """
    count, known = round(time[-1] / step) + 1, readings(series)
    out = room(count)
    if known < FIT_SAMPLES:
        out[:] = np.nan
        return out
    if known < series.size:
        time, series = _present(time, series, known)
    usual = _usual_span(time)
    scale = usual / (FIT_SAMPLES - 1)
    # each function over the largest it comes to, so that the ridge weighs them alike
    size = np.zeros(NODES)
    parts = [slice(begin, min(begin + TOGETHER, count)) for begin in range(0, count, TOGETHER)]

    def made() -> Iterator[tuple[NDArray[np.bool_], NDArray[np.intp], Floats]]:
        for part in parts:
            rows, tau = _around(time, part, step)
            reach = np.abs(tau)
            # out first: a window that spans a gap reaches so far that its powers would drown those of all others
            good = (reach.max(axis=1) <= MOST_STRETCH * usual) & (reach.min(axis=1) <= 0.3 * usual)
            yield good, rows[good], fitted_basis((tau[good] / scale).ravel(), frequency * scale)
            release(time)

    # the functions cost more than all the rest: those of a short record are kept from the first time
    kept = list(made()) if count <= scratch.PORTION else None
    for _, _, basis in kept or made():
        size = np.maximum(size, np.abs(basis).max(axis=1, initial=0.0))
    size[size == 0.0] = 1.0  # there is no good point at all
    origin = fitted_basis(np.zeros(1), frequency * scale)[:, 0] / size
    for part, (good, rows, functions) in zip(parts, kept or made(), strict=True):
        basis = functions.reshape(NODES, *rows.shape)
        basis = np.moveaxis(basis / size[:, None, None], 0, -1)
        # value at the grid point is the constant's coefficient plus that of cos, where cos is kept as such
        normal = np.einsum("gik,gil->gkl", basis, basis) + 1e-13 * np.eye(NODES)
        right = np.einsum("gik,gi->gk", basis, series[rows])
        values = np.full(good.size, np.nan)
        values[good] = np.linalg.solve(normal, right[:, :, None])[:, :, 0] @ origin
        out[part] = values
        release(time, series, out)
    return out


def _around(time: Floats, part: slice, step: float) -> tuple[NDArray[np.intp], Floats]:
    """The readings around some points of the grid, (points, FIT_SAMPLES), and their times from there, s."""
    grid = np.arange(part.start, part.stop) * step
    start = np.clip(np.searchsorted(time, grid) - FIT_SAMPLES // 2, 0, time.size - FIT_SAMPLES)
    rows = start[:, None] + np.arange(FIT_SAMPLES)
    return rows, time[rows] - grid[:, None]


def _present(time: Floats, series: Floats, known: int) -> tuple[Floats, Floats]:
    """The readings that are there, `known` in number, and their times."""
    short, found, begin = room(known), room(known), 0
    for part in portions(series.size, time, series, short, found):
        present = np.isfinite(series[part])
        end = begin + int(np.count_nonzero(present))
        short[begin:end], found[begin:end] = time[part][present], series[part][present]
        begin = end
    return short, found


def _usual_span(time: Floats) -> float:
    """Median of what `FIT_SAMPLES` readings span, s."""
    spans = room(time.size - FIT_SAMPLES + 1)
    for part in portions(spans.size, spans, time):
        spans[part] = time[part.start + FIT_SAMPLES - 1 : part.stop + FIT_SAMPLES - 1] - time[part]
    return float(np.median(spans, overwrite_input=True))
