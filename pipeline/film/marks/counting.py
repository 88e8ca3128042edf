"""Numbers of the marks: which events are marks, and how many marks lie between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.count_kernels import PASSED, SKIP, SLACK, count_marks, list_steps, price_steps
from pipeline.film.parts import Floats

CHANGE, MOST_CHANGE = (0.002, 0.015), (0.006, 0.04)  # of the relative speed from mark to mark, and over any time
CAUTION = 1.5  # times what the film shows of both
FLOOR = 0.06  # px, of an event's row: what a course that is a little wrong does to single gaps
AROUND = 30  # marks on either side that make the mean speed
LEAST_LEAD = 12.0  # of the best count before any other
LEAST_MARKS = 6
ALONE = 4  # marks missing on either side of one that nothing vouches for
WORST = 30.0  # mean price of a step from which nothing was understood


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
    begin, end, count = (np.empty(0, dtype=np.int64) for _ in range(3))
    total = list_steps(rows, spacing, begin, end, count)
    begin, end, count = (np.empty(total, dtype=np.int64) for _ in range(3))
    list_steps(rows, spacing, begin, end, count)
    price = np.empty(total)
    price_steps(begin, end, count, phase, doubt, advance, spread, price)
    first_of = np.searchsorted(end, np.arange(rows.size + 1))
    forward, backward, before = np.empty(total), np.empty(total), np.empty(total, dtype=np.int64)
    if total:
        count_marks(
            rows, np.hypot(sigma, FLOOR), spacing, begin, end, count, price, first_of,
            min(SKIP, rows.size), *unsteadiness(rows, spacing), forward, backward, before,
        )  # fmt: skip
    whole = forward + backward
    if total == 0 or not np.isfinite(whole.min()):
        raise RefusedError(
            f"film: no even row of time marks runs from one end to the other (about {spacing:.1f} rows apart); "
            "cut the film where it was stopped and read the parts one by one"
        )
    # the last step of the cheapest way, then back
    left = rows.size - 1 - end
    finished = np.where(left < SKIP, forward + PASSED * left, np.inf)
    at, path = int(np.argmin(finished)), []
    while at >= 0:
        path.append(at)
        at = int(before[at])
    steps = np.array(path[::-1])
    event = np.concatenate([begin[steps[:1]], end[steps]])
    index = np.concatenate([[0], np.cumsum(count[steps])])
    best = float(finished.min())
    if best > WORST * steps.size:
        raise RefusedError(
            f"film: the gaps in the traces do not come evenly (about {spacing:.1f} rows apart); "
            "check the interval of the marks, or that this is a pendulum film"
        )
    return _accompanied(Count(event, index, _leads(steps, begin, end, count, whole, best)))


def _accompanied(count: Count) -> Count:
    """Without marks that stand alone in a hole: any false gap would do as well there."""
    step = np.diff(count.index)
    alone = np.concatenate([[False], np.minimum(step[1:], step[:-1]) >= ALONE, [False]])
    lead, kept = count.lead.copy(), np.flatnonzero(~alone)
    joined = [float(lead[a:b].min()) for a, b in itertools.pairwise(kept)]
    return Count(count.event[kept], count.index[kept], np.array(joined))


def _leads(
    steps: NDArray[np.int64],
    begin: NDArray[np.int64],
    end: NDArray[np.int64],
    count: NDArray[np.int64],
    whole: Floats,
    best: float,
) -> Floats:
    """Price of the best other count between the same two events, beyond the best of all."""
    names = begin * (end.max() + 1) + end
    order = np.argsort(names, kind="stable")
    low, high = (np.searchsorted(names[order], names[steps], side=side) for side in ("left", "right"))
    lead = np.full(steps.size, np.inf)
    for k, step in enumerate(steps):
        others = order[low[k] : high[k]]
        others = others[count[others] != count[step]]
        if others.size:
            lead[k] = float(whole[others].min()) - best
    return lead


def shifted(count: Count, at: int, by: int) -> Count:
    """The same with so many marks more between mark `at` and the next."""
    index = count.index.copy()
    index[at + 1 :] += by
    return Count(count.event, index, count.lead)
