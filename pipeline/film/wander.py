"""Paper that moves sideways under the light: what is common to all traces, and in a difference cannot be the ship's.

A ship's motion moves the pendulums alike, and their difference hardly at all. Paper moves every line on it by the same
distance. Steps are the same in all traces and sharper than any swing; creases are the same in all traces and gone
after some millimetres; what is slow in the difference's trace is wander. Steps and wander are taken off, samples on a
crease are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats

SWINGS = 3.0  # of a window in which the slow part is told from the swing
REACH = 2.5  # swings on either side of an event
LEAST = 24  # samples of a window
SHOWS = 2.0  # px, 1 sigma of a wander that is taken off
CREASES = (0.25, 0.5)  # swings in which a crease fades on either side
HIDES = 3.0  # such lengths, in which it is left out
LEAST_EVENT, STANDS_OUT, SHOWN = 0.4, 12.0, 5.0  # px; of its sigma, at its time and beside it
ALIKE = 8.0  # sigma between the traces of one event
MOST_EVENTS = 30


class Paper(NamedTuple):
    """How paper moved."""

    shift: Floats
    """(samples,) px."""
    creased: NDArray[np.bool_]
    """(samples,) Samples on a crease."""
    steps: int
    creases: int


class Event(NamedTuple):
    """A step or a crease."""

    time: float
    length: float
    """s in which a crease fades; 0 of a step."""
    size: float
    """px."""
    excess: float
    """Size over its sigma."""


def paper_motion(time: Floats, column: Floats, sums: Floats, period: float) -> Paper | None:
    """How paper moved at each sample; None where no difference shows that it did.

    Parameters
    ----------
    time : (samples,) array
        s.
    column : (traces, samples) array
        Of the traces, px; NaN where nothing was read.
    sums : (traces,) array
        Of the pendulums' weights in each trace: 0 of a difference.
    period : float
        Of the swing, s.
    """
    differences = np.abs(sums) < 1e-9
    if not differences.any():
        return None
    shift, creased, rest, count = np.zeros(time.size), np.zeros(time.size, dtype=bool), column.copy(), [0, 0]
    for event in events(time, rest, int(np.argmax(differences)), period):
        if event.length:
            here = np.abs(time - event.time) < HIDES * event.length
            creased |= here
        else:
            # what lies on the step is read on both of its sides
            creased |= np.abs(time - event.time) < 1.5 * np.median(np.diff(time))
            shift += np.where(time >= event.time, event.size, 0.0)
        count[event.length > 0.0] += 1
    rest = np.where(creased, np.nan, column - shift)
    slow = [slow_part(time, each, period) for each in rest[differences]]
    known = [each for each in slow if each is not None]
    common = np.mean(known, axis=0) if known else np.zeros(time.size)
    if float(np.std(common)) > SHOWS:
        shift = shift + common
    if not shift.any() and not creased.any():
        return None
    return Paper(shift - shift.mean(), creased, *count)


def events(time: Floats, column: Floats, difference: int, period: float) -> list[Event]:
    """Steps and creases of all traces at once, in order of how far they stand out."""
    found: list[Event] = []
    column = column.copy()
    grid = np.arange(time[0] + period, time[-1] - period, 0.25 * period)
    best = [_event(time, column[difference : difference + 1], at, period) for at in grid]
    while len(found) < MOST_EVENTS:
        near = max(range(grid.size), key=lambda k: best[k].excess, default=-1)
        if near < 0 or best[near].excess < SHOWN:
            break
        close = time[np.abs(time - grid[near]) < 0.8 * period]
        event = max(
            (_event(time, column, each, period) for each in close - 0.5 * np.median(np.diff(time))),
            key=lambda each: each.excess,
        )
        over = np.abs(grid - grid[near]) < (REACH + 0.5) * period
        if event.excess < STANDS_OUT or abs(event.size) < LEAST_EVENT:
            best[near] = NONE
            continue
        found.append(event)
        if event.length:
            column[:, np.abs(time - event.time) < HIDES * event.length] = np.nan
        else:
            column -= np.where(time >= event.time, event.size, 0.0)
            column[:, np.abs(time - event.time) < 1.5 * np.median(np.diff(time))] = np.nan
        again = [_event(time, column[difference : difference + 1], at, period) for at in grid[over]]
        for k, each in zip(np.flatnonzero(over), again, strict=True):
            best[k] = each
    return found


NONE = Event(0.0, 0.0, 0.0, 0.0)


def _event(time: Floats, column: Floats, at: float, period: float) -> Event:
    """The likeliest event at a time, by least squares of each trace beside its swing; one not alike in all is none."""
    first, last = np.searchsorted(time, [at - REACH * period, at + REACH * period])
    t = time[first:last] - at
    shapes = [np.where(t >= 0.0, 1.0, 0.0), *(np.exp(-np.abs(t) / (length * period)) for length in CREASES)]
    best = NONE
    base = _terms(t / period)
    for length, shape in zip((0.0, *CREASES), shapes, strict=True):
        sizes, weights = [], []
        for each in column[:, first:last]:
            known = np.isfinite(each)
            if np.count_nonzero(known) < LEAST:
                return NONE
            terms = base[known]
            q, _ = np.linalg.qr(terms)
            left, own = (y - q @ (q.T @ y) for y in (each[known], shape[known]))
            power = float(own @ own)
            if power < 0.5:
                return NONE
            size = float(own @ left) / power
            variance = float(np.sum((left - size * own) ** 2)) / max(left.size - terms.shape[1] - 1, 1) / power
            sizes.append(size)
            weights.append(1.0 / max(variance, 1e-12))
        size = float(np.average(sizes, weights=weights))
        excess = abs(size) * float(np.sqrt(np.sum(weights)))
        apart = float(np.max(np.abs(np.array(sizes) - size) * np.sqrt(weights)))
        if excess > best.excess and apart < ALIKE + 0.2 * excess:
            best = Event(at, length * period, size, excess)
    return best


def _terms(turns: Floats) -> Floats:
    """What a trace does beside events, (n, k): a swing that changes, on a slow course."""
    t, angle = turns / REACH, 2.0 * np.pi * turns
    slow = [np.ones_like(t), t, t**2, t**3]
    return np.stack([*slow, *(t**k * wave for wave in (np.cos(angle), np.sin(angle)) for k in range(3))], axis=1)


def slow_part(time: Floats, column: Floats, period: float) -> Floats | None:
    """The trace without its swing, (samples,) px, by least squares in windows of some swings; None with too few."""
    from scipy.interpolate import CubicSpline

    middles, values = [], []
    for middle in np.arange(time[0] + 0.5 * SWINGS * period, time[-1], period):
        inside = (np.abs(time - middle) < 0.5 * SWINGS * period) & np.isfinite(column)
        if np.count_nonzero(inside) < LEAST or np.ptp(time[inside]) < 0.7 * SWINGS * period:
            continue
        t = (time[inside] - middle) / (SWINGS * period)
        cosine, sine = np.cos(2.0 * np.pi * SWINGS * t), np.sin(2.0 * np.pi * SWINGS * t)
        terms = np.stack([np.ones_like(t), t, t**2, t**3, cosine, sine, t * cosine, t * sine], axis=1)
        values.append(float(np.linalg.lstsq(terms, column[inside], rcond=None)[0][0]))
        middles.append(middle)
    if len(middles) < 4:
        return None
    return np.asarray(CubicSpline(middles, values)(np.clip(time, middles[0], middles[-1])))
