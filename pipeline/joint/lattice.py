"""Readings of a record laid on a lattice of even steps, each with its own offset: any times, any traces."""

from dataclasses import dataclass
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
    def first(self) -> np.ndarray:
        """First reading of each node, (k + 1,)."""
        return np.asarray(np.searchsorted(self.node, np.arange(self.nodes + 1)), dtype=np.int64)

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
    def read(self) -> Floats:
        """When any trace was read, s since the first node."""
        return np.unique(self.time[self.trace < self.combination.shape[0]])

    @cached_property
    def longest_gap(self) -> float:
        """s between readings of any trace, at the most."""
        return float(np.diff(self.read).max(initial=0.0))

    @cached_property
    def apart(self) -> Floats:
        """s between the readings of traces about each node, (k,)."""
        after = np.clip(np.searchsorted(self.read, self.step * np.arange(self.nodes)), 1, self.read.size - 1)
        return np.asarray(self.read[after] - self.read[after - 1])

    @property
    def dense(self) -> bool:
        """Whether no readings of different times share a node, as a rule."""
        return self.step < 1.5 * self.interval

    @property
    def duration(self) -> float:
        """From the first node to the last, s."""
        return self.step * (self.nodes - 1)


def lay(time: Floats, series: Floats, combination: Floats, frequency: float, *, angle: float = MOST_ANGLE) -> Lattice:
    """Lay series, (t or t + 2, n), at times, (n,) s, on a lattice: traces, then horizontal and vertical acceleration
    over reference gravity; NaN = missing. `frequency` of the swing, rad s-1; `angle`, rad of it for one node."""
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
        start=start, step=step, nodes=int(node[-1]) + 1, node=node[at].astype(np.int32), trace=trace.astype(np.int8),
        offset=offset[at], value=series[trace, at], combination=np.ascontiguousarray(combination, dtype=np.float64),
    )  # fmt: skip


def folded(frequency: float, step: float) -> float:
    """Where readings at that step show a frequency, rad s-1."""
    turns = frequency * step / (2.0 * np.pi)
    return float(abs(turns - np.rint(turns)) * 2.0 * np.pi / step)


LONG_GAP = 5.0  # s
WINDOW = 25.0  # s
FAST, FAST_PEAK, FAST_LINE = 1.8, 6.0, 0.3  # of the swing; deviations of a mean power; of the third harmonic
EVEN = 1e-6  # of a step
LEAST_GAP = 0.2  # s: shorter ones are interpolated without harm
QUIETEST = 1e-6  # rad: motion below it is none
TAPER = 14.0  # of a Kaiser window, that lets 1e-5 of the swing pass, and 5e-6 four lines off


def shared_angle(time: Floats, series: Floats, swing: float, arc: float, *, sine: bool) -> float:
    """Angle of the swing, rad, in which readings, (n,), NaN where missing, may share a node; less where they move much
    faster than a swing of that arc, rad, or are so fine that what a step's polynomial leaves of the sine would show."""
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
    even = np.ptp(np.diff(at)) < EVEN * step
    filled, taper, found = None if even else CubicSpline(at, value), np.kaiser(rows, TAPER), []
    for begin in np.arange(at[0], at[-1] - WINDOW, WINDOW):
        low, high = np.searchsorted(at, (begin, begin + WINDOW))
        if high - low > 2 and np.diff(at[low:high]).max() < LEAST_GAP:
            part = value[low : low + rows] if filled is None else filled(begin + step * np.arange(rows))
            found.append(np.abs(np.fft.rfft(taper * (part - part.mean()))[fast]) ** 2)
    if not found:
        return FAST_ANGLE
    power = np.mean(found, axis=0) / float(taper @ taper)
    allowed = (1.0 + FAST_PEAK / np.sqrt(len(found))) * max(float(np.median(power)), QUIETEST**2)
    # the swing's own third harmonic, whose amplitude the ship changes
    third = float(taper.sum()) ** 2 / float(taper @ taper) * (arc**3 / 192.0) ** 2
    if np.any(power >= allowed + third * (np.abs(turns[fast] - 3.0) < FAST_LINE)):
        return FAST_ANGLE
    return FINE_ANGLE if sine and float(np.median(power)) < (FINE * arc) ** 2 else MOST_ANGLE
