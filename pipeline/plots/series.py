"""Ways to draw a time series so that it stays readable: the envelope of many swings, and units that suit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

_BINS = 700  # about one a pixel column


def angle_scale(largest: float) -> tuple[float, str]:
    """Factor from radians and the unit's name that suit angles up to the largest.

    >>> angle_scale(0.02), angle_scale(1.6), angle_scale(2e-5)
    ((1000.0, 'mrad'), (1.0, 'rad'), (1000000.0, 'µrad'))
    """
    if largest >= 0.3:
        return 1.0, "rad"
    return (1e3, "mrad") if largest >= 2e-4 else (1e6, "µrad")


def time_scale(longest: float) -> tuple[float, str]:
    """Factor from seconds and the unit's name that suit a record of that length.

    >>> time_scale(136.0), time_scale(1800.0)
    ((1.0, 's'), (0.016666666666666666, 'min'))
    """
    if longest <= 300.0:
        return 1.0, "s"
    return (1.0 / 60.0, "min") if longest <= 4 * 3600.0 else (1.0 / 3600.0, "h")


def over_time(axes: Axes, time: Floats, up: str) -> Floats:
    """Label both axes of a panel over the time from the start, s; return that time in the unit that suits."""
    factor, unit = time_scale(float(time[-1]))
    axes.set_xlim(0.0, time[-1] * factor)
    axes.set_xlabel(f"time from the start, {unit}")
    axes.set_ylabel(up)
    return np.asarray(time * factor)


def draw_band(axes: Axes, time: Floats, values: Floats, *, color: str, label: str) -> None:
    """Fill between the least and the greatest value of each pixel column; a gap in the record stays open.

    A line through thousands of swings would be one solid block with accidental edges.
    """
    if time.size <= 2 * _BINS:
        axes.plot(time, values, color=color, label=label, linewidth=0.8)
        return
    edges = np.linspace(time[0], time[-1], _BINS + 1)
    bins = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, _BINS - 1)
    low, high = np.full(_BINS, np.inf), np.full(_BINS, -np.inf)
    good = np.isfinite(values)
    np.minimum.at(low, bins[good], values[good])
    np.maximum.at(high, bins[good], values[good])
    middle = 0.5 * (edges[:-1] + edges[1:])
    axes.fill_between(middle, low, high, where=low <= high, color=color, alpha=0.85, linewidth=0.3, label=label)


def thin(time: Floats, values: Floats, most: int = 4000) -> tuple[Floats, Floats]:
    """Every k-th point of a smooth series, so that a figure of it is drawn in no time."""
    step = max(1, time.size // most)
    return time[::step], values[::step]


def running_mean(time: Floats, values: Floats, width: float) -> Floats:
    """Mean over `width` seconds about each instant; NaN where the series has no value.

    Reading noise makes the phase speed of single seconds far wilder than any correction.
    """
    good = np.isfinite(values)
    sums = np.concatenate([[0.0], np.cumsum(np.where(good, values, 0.0))])
    counts = np.concatenate([[0], np.cumsum(good)])
    first = np.searchsorted(time, time - 0.5 * width, side="left")
    last = np.searchsorted(time, time + 0.5 * width, side="right")
    with np.errstate(invalid="ignore"):
        return np.where(good, (sums[last] - sums[first]) / (counts[last] - counts[first]), np.nan)


def robust_limits(values: Floats, *, hidden: float = 0.5, margin: float = 0.15) -> tuple[float, float]:
    """Limits that show all but the wildest values (`hidden` per cent at each end), which would hide the rest."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return -1.0, 1.0
    low, high = np.percentile(finite, [hidden, 100.0 - hidden])
    spread = max(high - low, 1e-9 * max(abs(low), abs(high), 1e-300))
    return float(low - margin * spread), float(high + margin * spread)
