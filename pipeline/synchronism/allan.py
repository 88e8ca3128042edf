"""Allan deviation of each clock's rate against the record's time, by allantools (overlapping estimate)."""

from __future__ import annotations

import importlib.util

import numpy as np

from data_schemas.errors import UsageError
from pipeline.arrays import Floats
from pipeline.gravity import DAY

_LEAST = 8
REMEDY = "install allantools, as with pip install 'isochrony[clocks]'"
_BLOCKS = 16
_TURN = 2.0 * np.pi


def available() -> bool:
    """Whether allantools is installed."""
    return importlib.util.find_spec("allantools") is not None


def allan_deviation(time: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """Overlapping Allan deviation of clocks.

    Parameters
    ----------
    time : (k,) array
        Evenly spaced, s.
    phase : (clocks, k) array
        Unwrapped, rad; NaN = missing. The longest stretch without a gap in any clock is used.

    Returns
    -------
    averaging_time : (m,) s, one octave apart
    deviation : (clocks, m), relative rate

    Raises
    ------
    UsageError
        If allantools is not installed.
    """
    if not available():
        raise UsageError(f"the Allan deviation needs allantools; {REMEDY}")
    import allantools

    part = _longest(np.asarray(np.isfinite(phase).all(axis=0)))
    stretch, spacing = phase[:, part], float(time[1] - time[0])
    if stretch.shape[1] < _LEAST:
        return np.empty(0), np.empty((len(phase), 0))
    rows = []
    for row in stretch:
        speed = (row[-1] - row[0]) / (spacing * (row.size - 1))  # a clock's own mean rate is no instability
        ahead = row / speed  # s: the time this clock shows
        found = allantools.oadev(ahead, rate=1.0 / spacing, data_type="phase", taus="octave")
        rows.append((found[0], found[1]))
    shared = min(len(taus) for taus, _ in rows)
    return np.asarray(rows[0][0][:shared]), np.stack([deviation[:shared] for _, deviation in rows])


def _longest(known: np.ndarray) -> slice:
    """The longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    starts, ends = edges[::2], edges[1::2]
    if starts.size == 0:
        return slice(0, 0)
    best = int(np.argmax(ends - starts))
    return slice(int(starts[best]), int(ends[best]))


def instantaneous(time: Floats, psi: Floats) -> Floats:
    """Rate difference at each instant, swings a day; NaN beside what is missing.

    Examples
    --------
    >>> t = np.arange(5.0)
    >>> instantaneous(t, 2.0 * np.pi * t / 86400.0).round(9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0]
    """
    return np.asarray(np.gradient(psi, time) * (DAY / _TURN))


def mean(time: Floats, psi: Floats) -> tuple[float, float]:
    """Mean rate difference over the record and one sigma, swings a day.

    It holds for the steps of slips too.
    """
    slope, sigma = block_slope(time, psi, _BLOCKS)
    return slope * DAY / _TURN, sigma * DAY / _TURN


def block_slope(time: Floats, values: Floats, blocks: int) -> tuple[float, float]:
    """Slope and one sigma of it: least squares through means of blocks, whose scatter gives the sigma.

    So it holds for noise of any colour shorter than a block.
    """
    parts = np.array_split(np.flatnonzero(np.isfinite(values)), blocks)
    x, means = (np.array([series[each].mean() for each in parts]) for series in (time, values))
    x -= x.mean()
    slope = float(x @ means / (x @ x))
    rest = means - means.mean() - slope * x
    return slope, float(np.sqrt(rest @ rest / (blocks - 2) / (x @ x)))
