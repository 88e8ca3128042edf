"""Readings of a record laid on a lattice of even steps, each with its own offset: any times, any traces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.arrays import Floats

MOST_ANGLE = 1.27  # of the swing a step, rad; readings lie within half of it
FINE_ANGLE, FAST_ANGLE = 0.8, 0.3  # of readings that share a node: where they are fine, where the ship vibrates
FINE = 1e-4  # noise of readings over the arc, below which a step's polynomial of what the sine leaves errs as much


@dataclass(frozen=True)
class Lattice:
    """Steps and readings."""

    start: float
    step: float  # Time of the first node by the record's clock, and spacing, s
    nodes: int
    node: np.ndarray
    trace: np.ndarray  # (r,)
    offset: Floats
    value: Floats  # (r,) s after the node; rad, or acceleration over reference gravity
    combination: Floats  # (t, p)

    @cached_property
    def time(self) -> Floats:
        """Of each reading since the first node, s."""
        return np.asarray(self.node * self.step + self.offset)

    @cached_property
    def of_trace(self) -> list[np.ndarray]:
        """Readings of each trace, in order, then those of the accelerations."""
        return [np.flatnonzero(self.trace == j) for j in range(self.combination.shape[0] + 2)]

    @cached_property
    def spacing(self) -> list[float]:
        """s between such readings, as a rule; at least a millisecond."""
        return [float(max(np.median(np.diff(self.time[own])), 1e-3)) if own.size > 1 else 1.0 for own in self.of_trace]

    @cached_property
    def interval(self) -> float:
        """s between readings of any trace, as a rule."""
        return float(np.median(np.diff(np.unique(self.time))))

    @cached_property
    def longest_gap(self) -> float:
        """s between readings of any trace, at the most."""
        return float(np.diff(self.time).max(initial=0.0))

    @property
    def dense(self) -> bool:
        """Whether no readings of different times share a node, as a rule."""
        return self.step < 1.5 * self.interval

    @property
    def duration(self) -> float:
        """From the first node to the last, s."""
        return self.step * (self.nodes - 1)

    def until(self, nodes: int) -> Lattice:
        """Its first nodes alone."""
        some = slice(0, int(np.searchsorted(self.node, nodes)))
        own = {name: getattr(self, name)[some] for name in ("node", "trace", "offset", "value")}
        return replace(self, nodes=nodes, **own)


def lay(time: Floats, series: Floats, combination: Floats, frequency: float, *, angle: float = MOST_ANGLE) -> Lattice:
    """Lay series on a lattice.

    Parameters
    ----------
    time : (n,) array, s
    series : (t or t + 2, n) array
        Traces, then horizontal and vertical acceleration over reference gravity; NaN = missing.
    combination : (t, p) array
    frequency : float
        Of the swing, rad s-1.
    angle : float
        Of the swing, rad, in which readings share a node.
    """
    spacing = np.diff(time)
    even = float(time[-1] - time[0]) / max(time.size - 1, 1)
    least = float(spacing.min(initial=np.inf))
    regular = bool(np.all(np.abs(spacing - np.rint(spacing / least) * least) < 1e-6 * least))
    if regular and spacing.size:
        even = float(time[-1] - time[0]) / np.rint((time[-1] - time[0]) / least)
    between = even * frequency
    together = max(1.0, float(np.floor(angle / between)))  # readings about each node
    step = even * together / np.ceil(between / MOST_ANGLE)
    start = float(time[0]) + 0.5 * (together - 1.0) * even
    node = np.rint((time - start) / step).astype(np.int64)
    offset = time - start - node * step
    if regular:  # equal offsets are equal to the last digit
        offset = 0.5 * even * np.rint(2.0 * offset / even)
    trace, at = np.nonzero(np.isfinite(series))
    order = np.lexsort((trace, at))
    trace, at = trace[order], at[order]
    return Lattice(
        start=start,
        step=step,
        nodes=int(node[-1]) + 1,
        node=node[at],
        trace=trace.astype(np.int8),
        offset=offset[at],
        value=series[trace, at],
        combination=np.ascontiguousarray(combination, dtype=np.float64),
    )


def folded(frequency: float, step: float) -> float:
    """Where readings at that step show a frequency, rad s-1."""
    turns = frequency * step / (2.0 * np.pi)
    return float(abs(turns - np.rint(turns)) * 2.0 * np.pi / step)


WINDOW = 25.0  # s
FAST, FAST_PEAK, FAST_LINE = 1.8, 6.0, 0.3  # of the swing; deviations of a mean power; of the third harmonic
LEAST_GAP = 0.2  # s: shorter ones are interpolated without harm
QUIETEST = 1e-6  # rad: motion below it is none
BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)  # Harris (1978), Proc. IEEE 66, 51, table 1


def blackman_harris(count: int) -> Floats:
    """The taper of four cosines, (count,); scipy's own, whose module takes half a second to import.

    Examples
    --------
    >>> blackman_harris(5).round(4).tolist()
    [0.0001, 0.2175, 1.0, 0.2175, 0.0001]
    """
    return np.asarray(BLACKMAN_HARRIS @ np.cos(np.outer(np.arange(4), np.linspace(0.0, 2.0 * np.pi, count))))


def shared_angle(time: Floats, series: Floats, swing: float, arc: float, *, sine: bool) -> float:
    """Angle of the swing, rad, in which readings, (n,), NaN where missing, may share a node.

    Less where they show motion much faster than a swing of that arc, rad; and where they are so fine that what a step's
    polynomial leaves of the sine would show.
    """
    from scipy.interpolate import CubicSpline

    there = np.isfinite(series)
    if there.sum() < 64:
        return MOST_ANGLE
    at, value = time[there], series[there]
    step = max(float(np.median(np.diff(at))), 1e-3)
    rows = int(WINDOW / step)
    turns = 2.0 * np.pi * np.fft.rfftfreq(rows, step) / swing
    fast = turns > FAST
    if not fast.any():
        return MOST_ANGLE
    filled, taper, found = CubicSpline(at, value), blackman_harris(rows), []
    own = np.arange(rows) * step
    design, inverse = _of_the_swing(own, swing, taper)
    for begin in np.arange(at[0], at[-1] - WINDOW, WINDOW):
        low, high = np.searchsorted(at, (begin, begin + WINDOW))
        if high - low > 2 and np.diff(at[low:high]).max() < LEAST_GAP:
            series = filled(begin + own)
            found.append(np.abs(np.fft.rfft(taper * (series - design @ (inverse @ series)))[fast]) ** 2)
    if not found:
        return FAST_ANGLE
    power = np.mean(found, axis=0) / float(taper @ taper)
    allowed = (1.0 + FAST_PEAK / np.sqrt(len(found))) * max(float(np.median(power)), QUIETEST**2)
    # the swing's own third harmonic, whose amplitude the ship changes
    third = float(taper.sum()) ** 2 / float(taper @ taper) * (arc**3 / 192.0) ** 2
    if np.any(power >= allowed + third * (np.abs(turns[fast] - 3.0) < FAST_LINE)):
        return FAST_ANGLE
    return FINE_ANGLE if sine and float(np.median(power)) < (FINE * arc) ** 2 else MOST_ANGLE


def _of_the_swing(own: Floats, swing: float, taper: Floats) -> tuple[Floats, Floats]:
    """A line, the swing with an amplitude that changes evenly, its third harmonic; and what fits them under a taper."""
    since = own - own.mean()
    once, thrice = np.exp(1j * swing * since), np.exp(3j * swing * since)
    parts = (once.real, once.imag, since * once.real, since * once.imag, thrice.real, thrice.imag)
    design = np.stack([np.ones(own.size), since, *parts], axis=1)
    left = taper[:, None] * design
    return design, np.linalg.pinv(design.T @ left, hermitian=True) @ left.T
