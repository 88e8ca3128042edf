"""Numbers of the marks: which events are marks, and how many marks lie between them.

The cheapest way through all events, each a mark of some number or none (Viterbi). A step goes from one event to a later
one and counts d marks. Its price: marks missed, events passed over, speed unlike that of the step before, and pendulums
that did not swing d marks' time meanwhile.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.parts import Floats
from synth.kernels.compiled import kernel

SLACK = 0.18  # of the speed over the whole film: drift, wow and walk together
SKIP = 8  # events that may be passed over in a row
MISSED, PASSED = 2.5, 14.0  # prices of a mark missed, of an event that is none
PHASE_MOST = 40.0  # price of a swing that does not fit at all
WANDER = 0.006  # rad per root of a mark: what swell does to a pendulum's phase
CHANGE, MOST_CHANGE = (0.002, 0.015), (0.006, 0.04)  # of the relative speed from mark to mark, and over any time
CAUTION = 1.5  # times what the film shows of both
FLOOR = 0.06  # px, of an event's row: what a course that is a little wrong does to single gaps
AROUND = 30  # marks on either side that make the mean speed
LEAST_LEAD = 12.0  # of the best count before any other
LEAST_MARKS = 6
ALONE = 4  # marks missing on either side of one that nothing vouches for
WORST = 30.0  # mean price of a step from which nothing was understood
Whole = NDArray[np.int64]


class Steps(NamedTuple):
    """Steps that could be meant, by their later event: from which event to which, and how many marks on."""

    begin: Whole
    end: Whole
    marks: Whole


class Pace(NamedTuple):
    """Rows of the events and 1 sigma, rows between marks, and how far the paper's speed may change.

    `change` is 1 sigma of the relative speed's change per mark's interval, `most_change` its limit over long times.
    """

    row: Floats
    sigma: Floats
    spacing: float
    change: float
    most_change: float


@dataclass(frozen=True)
class Count:
    """Marks among the events.

    Attributes
    ----------
    event : (marks,) array of int64
        Which events are marks.
    index : (marks,) array of int64
        Their numbers, from 0 on.
    lead : (marks - 1,) array
        By how much the count from each mark to the next is better than any other, as a difference of chi squares.
    """

    event: NDArray[np.int64]
    index: NDArray[np.int64]
    lead: Floats


def spacing_of(rows: Floats) -> float:
    """Rows between marks: the commonest distance of successive events.

    Raises
    ------
    RefusedError
        Too few events.
    """
    apart = np.diff(rows)
    apart = apart[apart > 1e-6]
    if apart.size < LEAST_MARKS:
        raise RefusedError(
            f"film: {rows.size} gaps found in the traces, too few for a time axis; "
            "check that the film bears time marks, or state the gap and the rows per second"
        )
    logs = np.sort(np.log(apart))
    within = np.searchsorted(logs, logs + 0.08) - np.arange(logs.size)
    start = int(np.argmax(within))
    near = logs[start : start + within[start]]
    return float(np.exp(np.median(near)))


def unsteadiness(rows: Floats, spacing: float) -> tuple[float, float]:
    """How much the relative speed changes from mark to mark, and from any time to any other, 1 sigma, as a film shows.

    Parameters
    ----------
    rows : (events,) array
    spacing : float
        Rows between marks.
    """
    speed = np.diff(rows) / spacing
    speed = speed[np.abs(speed - 1.0) < SLACK]
    if speed.size < 4 * LEAST_MARKS:
        return CHANGE[1], MOST_CHANGE[1]
    near = CAUTION * 1.4826 * float(np.median(np.abs(np.diff(speed))))
    half = min(AROUND, (speed.size - 1) // 2)
    total = np.concatenate([[0.0], np.cumsum(speed)])
    mean = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    far = CAUTION * float(np.sqrt(np.mean((speed[half : half + mean.size] - mean) ** 2)))
    return float(np.clip(near, *CHANGE)), float(np.clip(far, *MOST_CHANGE))


def counted(
    rows: Floats, sigma: Floats, phase: Floats, doubt: Floats, advance: Floats, spread: Floats, spacing: float
) -> Count:
    """The cheapest count of all.

    Parameters
    ----------
    rows, sigma : (events,) arrays
        In order, px.
    phase, doubt : (traces, events) arrays
        Of the swings, rad, NaN = unknown; variance that each has beside `spread`.
    advance, spread : (traces,) arrays
        By which the phases advance from mark to mark, and 1 sigma of a phase, rad.
    spacing : float
        Rows between marks.

    Raises
    ------
    RefusedError
        No way leads from the film's start to its end.
    """
    steps = list_steps(rows, spacing)
    price = prices(steps, phase, doubt, advance, spread)
    first_of = np.searchsorted(steps.end, np.arange(rows.size + 1))
    pace = Pace(rows, np.hypot(sigma, FLOOR), spacing, *unsteadiness(rows, spacing))
    forward, backward, before = count_marks(pace, steps, price, first_of)
    whole = forward + backward
    if not np.isfinite(whole.min(initial=np.inf)):
        raise RefusedError(
            f"film: no even row of time marks runs from one end to the other (about {spacing:.1f} rows apart); "
            "cut the film where it was stopped and read the parts one by one"
        )
    # the last step of the cheapest way, then back
    left = rows.size - 1 - steps.end
    finished = np.where(left < SKIP, forward + PASSED * left, np.inf)
    at, path = int(np.argmin(finished)), []
    while at >= 0:
        path.append(at)
        at = int(before[at])
    way = np.array(path[::-1])
    event = np.concatenate([steps.begin[way[:1]], steps.end[way]])
    index = np.concatenate([[0], np.cumsum(steps.marks[way])])
    best = float(finished.min())
    if best > WORST * way.size:
        raise RefusedError(
            f"film: the gaps in the traces do not come evenly (about {spacing:.1f} rows apart); "
            "check the interval of the marks, or that this is a pendulum film"
        )
    return _accompanied(Count(event, index, _leads(way, steps, whole, best)))


def _accompanied(count: Count) -> Count:
    """Without marks that stand alone in a hole: any false gap would do as well there."""
    step = np.diff(count.index)
    alone = np.concatenate([[False], np.minimum(step[1:], step[:-1]) >= ALONE, [False]])
    lead, kept = count.lead.copy(), np.flatnonzero(~alone)
    joined = [float(lead[a:b].min()) for a, b in itertools.pairwise(kept)]
    return Count(count.event[kept], count.index[kept], np.array(joined))


def _leads(way: Whole, steps: Steps, whole: Floats, best: float) -> Floats:
    """Price of the best other count between the same two events, beyond the best of all."""
    names = steps.begin * (steps.end.max() + 1) + steps.end
    order = np.argsort(names, kind="stable")
    low, high = (np.searchsorted(names[order], names[way], side=side) for side in ("left", "right"))
    lead = np.full(way.size, np.inf)
    for k, step in enumerate(way):
        others = order[low[k] : high[k]]
        others = others[steps.marks[others] != steps.marks[step]]
        if others.size:
            lead[k] = float(whole[others].min()) - best
    return lead


def shifted(count: Count, at: int, by: int) -> Count:
    """The same with so many marks more between mark `at` and the next."""
    index = count.index.copy()
    index[at + 1 :] += by
    return Count(count.event, index, count.lead)


def list_steps(row: Floats, spacing: float) -> Steps:
    """All steps that could be meant."""
    end = np.repeat(np.arange(row.size), SKIP)
    begin = end - np.tile(np.arange(SKIP, 0, -1), row.size)
    begin, end = begin[begin >= 0], end[begin >= 0]
    length = (row[end] - row[begin]) / spacing
    low = np.maximum(np.ceil(length / (1.0 + SLACK)), 1.0).astype(np.int64)
    number = np.maximum(np.floor(length / (1.0 - SLACK)).astype(np.int64) - low + 1, 0)
    pair = np.repeat(np.arange(begin.size), number)
    return Steps(begin[pair], end[pair], low[pair] + np.arange(pair.size) - (np.cumsum(number) - number)[pair])


def prices(steps: Steps, phase: Floats, doubt: Floats, advance: Floats, spread: Floats) -> Floats:
    """Price of every step by itself: marks missed, events passed over, and swings that do not fit."""
    begin, end, count = steps
    price = MISSED * np.where(count < 6, count - 1.0, 5.0 + 0.1 * (count - 6.0)) + PASSED * (end - begin - 1.0)
    for each, variance, pace, sigma in zip(phase, doubt, advance, spread, strict=True):
        away = each[end] - each[begin] - pace * count
        away -= 2.0 * np.pi * np.floor(away / (2.0 * np.pi) + 0.5)
        room = 2.0 * sigma**2 + WANDER**2 * count + variance[begin] + variance[end]
        price += np.where(np.isfinite(away), np.minimum(away**2 / room, PHASE_MOST), 0.0)
    return np.asarray(price)


@kernel
def count_marks(pace: Pace, steps: Steps, price: Floats, first_of: Whole) -> tuple[Floats, Floats, Whole]:
    """Least price of all ways up to and including each step, and of all ways after it; the step before it.

    `first_of` (events + 1,) tells where the steps that end at each event begin. Ways begin and end within the first and
    last `SKIP` events.
    """
    events, total = pace.row.size, price.size
    forward, backward, before = np.empty(total), np.empty(total), np.empty(total, dtype=np.int64)
    for k in range(total):
        a = steps.begin[k]
        best, which = math.inf, -1
        if a < SKIP:
            best = PASSED * a
        for j in range(first_of[a], first_of[a + 1]):
            after = forward[j] + turn_price(pace, steps, j, k)
            if after < best:
                best, which = after, j
        forward[k], before[k] = best + price[k], which
    for k in range(total):
        left = events - 1 - steps.end[k]
        backward[k] = PASSED * left if left < SKIP else math.inf
    for k in range(total - 1, -1, -1):
        for j in range(first_of[steps.begin[k]], first_of[steps.begin[k] + 1]):
            backward[j] = min(backward[j], backward[k] + price[k] + turn_price(pace, steps, j, k))
    return forward, backward, before


@kernel
def turn_price(pace: Pace, steps: Steps, j: int, k: int) -> float:
    """Price of the speed's change from step j to the next, k."""
    a, b, c = steps.begin[j], steps.end[j], steps.end[k]
    before, after = steps.marks[j], steps.marks[k]
    away = ((pace.row[c] - pace.row[b]) / after - (pace.row[b] - pace.row[a]) / before) / pace.spacing
    room = min(pace.change * 0.5 * (before + after), pace.most_change) ** 2
    noise = (pace.sigma[a] ** 2 + pace.sigma[b] ** 2) / before**2
    noise += (pace.sigma[b] ** 2 + pace.sigma[c] ** 2) / after**2
    return float(away * away / (room + noise / pace.spacing**2))
