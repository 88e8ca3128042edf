"""Paper that moves sideways under the light: what is common to all traces, and in a difference cannot be the ship's.

A ship's motion moves the pendulums alike, their difference hardly at all; paper moves every line by the same distance.
Steps are sharper than any swing, creases are gone after some millimetres; what is slow in the difference's trace is
wander. Steps and wander are taken off, samples on a crease are left out.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.normal_points import swing_terms

SWINGS = 3.0  # of a window in which the slow part is told from the swing
REACH = 2.5  # swings on either side of an event
LEAST = 24  # samples of a window
SPARSE = 0.6  # of a swing between samples
SHOWS, SWAYS = 0.3, 2.0  # px, 1 sigma of a wander that is taken off; of a sway that tells differences from pendulums
RARE = (0.1, 0.9)  # quantiles of a slow part, beyond which a trace may have strayed
HALF = 0.5  # of either, what every trace has of it at least
CREASES = (0.25, 0.5)  # swings in which a crease fades on either side
HIDES = 3.0  # such lengths, in which it is left out
LEAST_EVENT, STANDS_OUT, SHOWN = 0.4, 12.0, 5.0  # px; of its sigma, at its time and beside it
ALIKE = 8.0  # sigma between the traces of one event
MOST_EVENTS = 30
PLACES = 500  # at a time, which bounds the memory


class Paper(NamedTuple):
    """How paper moved."""

    shift: Floats  # (samples,) px
    creased: NDArray[np.bool_]  # (samples,), on a crease
    steps: tuple[float, ...]  # s, when
    creases: int

    def at(self, instants: Floats, time: Floats) -> "Paper":
        """The same at other instants than those of the samples, `time`, s."""
        near = np.searchsorted(0.5 * (time[1:] + time[:-1]), instants)
        return self._replace(shift=np.interp(instants, time, self.shift), creased=self.creased[near])


class Event(NamedTuple):
    """A step or a crease."""

    time: float
    length: float  # s in which a crease fades; 0 of a step
    size: float  # px
    excess: float  # size over its sigma; 0 where it is none

    def moves(self, time: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """By how much the paper lies aside at some times, px, and which of them tell nothing of the paper."""
        if self.length:
            return np.zeros(time.size), np.abs(time - self.time) < HIDES * self.length
        # what lies on the step is read on both of its sides
        return np.where(time >= self.time, self.size, 0.0), np.abs(time - self.time) < 1.5 * np.median(np.diff(time))


def paper_motion(time: Floats, row: Floats, column: Floats, sums: Floats, period: float) -> Paper | None:
    """How paper moved at each sample, `time` (samples,) s; None where no difference shows that it did.

    `row` (samples,) px, along the film; `column` (traces, samples) px, NaN where nothing was read; `sums` (traces,) of
    the pendulums' weights, 0 of a difference; `period` of the swing, s.
    """
    differences = np.abs(sums) < 1e-9
    if not differences.any():
        return None
    shift, creased = np.zeros(time.size), np.zeros(time.size, dtype=bool)
    found = events(time, column, int(np.argmax(differences)), period)
    for event in found:
        aside, hidden = event.moves(time)
        shift, creased = shift + aside, creased | hidden
    for part in (partial(even_part, row), slow_part):
        slow, all_move = sideways(part, SHOWS, time, np.where(creased, np.nan, column - shift), differences, period)
        if slow is not None and all_move:
            shift = shift + slow
    if not shift.any() and not creased.any():
        return None
    steps = tuple(sorted(event.time for event in found if not event.length))
    return Paper(shift - shift.mean(), creased, steps, len(found) - len(steps))


def exchanged(time: Floats, column: Floats, sums: Floats, period: float) -> bool:
    """Whether differences sway as no paper does, and pendulums do not: exchanged, or upside down; times may be rows."""
    even = [even_part(time, time, own, period) for own in column]  # of a film that lies turned
    upright = np.stack([own - (0.0 if lean is None else lean) for own, lean in zip(column, even, strict=True)])
    aside, all_move = sideways(_usual_part, SWAYS, time, upright, np.abs(sums) < 1e-9, period)
    return aside is not None and not all_move


def _usual_part(time: Floats, column: Floats, period: float) -> Floats | None:
    """The slow part but for what is rare: a trace that strays is no ship."""
    slow = slow_part(time, column, period)
    return slow if slow is None else np.clip(slow, *np.nanquantile(slow, RARE))


def sideways(
    part: Callable[[Floats, Floats, float], Floats | None], least: float, time: Floats, column: Floats,
    differences: NDArray[np.bool_], period: float,
) -> tuple[Floats | None, bool]:  # fmt: skip
    """A part of the differences' motion, (samples,) px, None under `least`, 1 sigma; if all others move as much."""
    known = [each for each in (part(time, own, period) for own in column[differences]) if each is not None]
    aside = np.mean(known, axis=0) if known else np.zeros(1)
    moved = float(np.std(aside))
    if moved <= least:
        return None, True
    others = [part(time, own, period) for own in column[~differences]]
    return aside, all(each is None or float(np.std(each)) >= HALF * moved for each in others)


def events(time: Floats, column: Floats, difference: int, period: float) -> list[Event]:
    """Steps and creases of all traces at once, in order of how far they stand out."""
    found: list[Event] = []
    grid = np.arange(time[0] + period, time[-1] - period, 0.25 * period)
    alone = slice(difference, difference + 1)
    best = _likeliest(time, column[alone], grid, period)
    while len(found) < MOST_EVENTS:
        near = max(range(grid.size), key=lambda k: best[k].excess, default=-1)
        if near < 0 or best[near].excess < SHOWN:
            break
        close = time[np.abs(time - grid[near]) < 0.8 * period] - 0.5 * np.median(np.diff(time))
        event = max(_likeliest(time, column, close, period), key=lambda each: each.excess)
        if event.excess < STANDS_OUT or abs(event.size) < LEAST_EVENT:
            best[near] = best[near]._replace(excess=0.0)
            continue
        found.append(event)
        aside, hidden = event.moves(time)
        column = np.where(hidden, np.nan, column - aside)
        again = np.flatnonzero(np.abs(grid - grid[near]) < (REACH + 0.5) * period)
        for k, each in zip(again, _likeliest(time, column[alone], grid[again], period), strict=True):
            best[k] = each
    return found


def _likeliest(time: Floats, column: Floats, at: Floats, period: float) -> list[Event]:
    """The likeliest event at each of some times, by least squares beside the swings; no excess if not alike in all."""
    if at.size >= 2 * PLACES:
        parts = np.array_split(at, at.size // PLACES)
        return [event for part in parts for event in _likeliest(time, column, part, period)]
    first, last = (np.searchsorted(time, at + reach * period)[:, None] for reach in (-REACH, REACH))
    place = first + np.arange(int(np.max(last - first, initial=1)))
    inside, place = place < last, np.minimum(place, time.size - 1)
    t = time[place] - at[:, None]
    lengths = period * np.array([0.0, *CREASES])
    shapes = np.stack([np.where(t >= 0.0, 1.0, 0.0), *(np.exp(-np.abs(t) / each) for each in lengths[1:])], axis=-1)
    base = swing_terms(t / period / REACH, t / period, 4, 3)
    sizes, weights = np.zeros((2, len(column), at.size, lengths.size))
    told = np.ones(at.size, dtype=bool)
    for trace, each in enumerate(column):
        known = (inside & np.isfinite(each[place]))[..., None]
        count = np.count_nonzero(known, axis=(1, 2))
        q, _ = np.linalg.qr(base * known)
        y = np.concatenate([np.where(known, each[place][..., None], 0.0), shapes * known], axis=-1)
        y -= q @ (q.swapaxes(1, 2) @ y)
        left, own = y[..., :1], y[..., 1:]
        power = np.sum(own**2, axis=1)
        told &= (count >= LEAST) & (power.min(axis=-1) >= 0.5)
        power = np.maximum(power, 0.5)
        sizes[trace] = np.sum(own * left, axis=1) / power
        free = np.maximum(count - base.shape[-1] - 1, 1)[:, None]
        variance = np.sum((left - sizes[trace][:, None] * own) ** 2, axis=1) / free / power
        weights[trace] = 1.0 / np.maximum(variance, 1e-12)
    size = np.average(sizes, axis=0, weights=weights)
    excess = np.abs(size) * np.sqrt(np.sum(weights, axis=0))
    apart = np.max(np.abs(sizes - size) * np.sqrt(weights), axis=0)
    excess = np.where((apart < ALIKE + 0.2 * excess) & told[:, None], excess, 0.0)
    best = np.argmax(excess, axis=-1)
    return [Event(float(at[k]), float(lengths[b]), float(size[k, b]), float(excess[k, b])) for k, b in enumerate(best)]


def even_part(row: Floats, time: Floats, column: Floats, period: float) -> Floats | None:
    """How the trace runs aside evenly by rows, as on a film that lies turned, (samples,) px; None with too few."""
    known = np.isfinite(column)
    if np.count_nonzero(known) < LEAST or np.median(np.diff(time)) > SPARSE * period:
        return None
    along = 2.0 * (row - row[0]) / np.ptp(row) - 1.0
    terms = swing_terms(along[known], (time[known] - time[known].mean()) / period, 2, 4)
    return np.asarray(np.linalg.lstsq(terms, column[known], rcond=None)[0][1] * (along - along.mean()))


def slow_part(time: Floats, column: Floats, period: float) -> Floats | None:
    """The trace without its swing, (samples,) px, by least squares in windows of some swings; None with too few."""
    from scipy.interpolate import CubicSpline

    middles, values = [], []
    for middle in np.arange(time[0] + 0.5 * SWINGS * period, time[-1], period):
        inside = (np.abs(time - middle) < 0.5 * SWINGS * period) & np.isfinite(column)
        if np.count_nonzero(inside) < LEAST or np.ptp(time[inside]) < 0.7 * SWINGS * period:
            continue
        turns = (time[inside] - middle) / period
        terms = swing_terms(turns / SWINGS, turns, 4, 2)
        values.append(float(np.linalg.lstsq(terms, column[inside], rcond=None)[0][0]))
        middles.append(middle)
    if len(middles) < 4:
        return None
    course, inside = CubicSpline(middles, values), np.clip(time, middles[0], middles[-1])
    return np.asarray(course(inside) + (time - inside) * course(inside, 1))
