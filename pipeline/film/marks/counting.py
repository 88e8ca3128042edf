"""Numbers of the marks: which events are marks, and how many marks lie between them.

The cheapest path through all events, each a mark of some number or none (Viterbi). A step's cost: marks missed, events
passed over, speed unlike that of the step before, and pendulums that did not swing as many marks' time meanwhile. These
are a second clock: their phase advances alike to 1e-3 from mark to mark, whatever the paper does.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events, Gaps, Stand
from pipeline.film.marks.search import commonest
from pipeline.film.parts import Floats, Tracks
from synth.kernels.compiled import kernel, making_kernel

SLACK = 0.24  # of the speed over the whole film: drift, wow and short changes together
EVEN = 0.12  # of the speed, that shows how steadily the paper runs
TAIL = 40.0  # of a change of speed, chi square beyond which its cost grows as a logarithm: paper slips
SKIP = 8  # events that may be passed over in a row
MISSED, PASSED = 2.5, 14.0  # costs of a mark missed, of an event that is none
PHASE_MOST = 40.0  # cost of a swing that does not fit at all
UNSEEN = 0.25  # of a step's rows, on which no trace is followed
LONG, UNFOLLOWED = 10, 5.0  # marks of a step where traces are lost; most that its speed, which nothing shows, may cost
WANDER = 0.006  # rad per root of a mark: what swell does to a pendulum's phase
CHANGE, MOST_CHANGE = (0.002, 0.015), (0.006, 0.04)  # of the relative speed from mark to mark, and over any time
CAUTION = 1.5  # times what the film shows of both
FLOOR = 0.06  # px, of an event's row: what a course that is a little wrong does to single gaps
AROUND = 30  # marks on either side that make the mean speed
LEAST_MARKS = 6
ALIKE = float(np.exp(0.08))  # ratio of the commonest distances of marks
ALONE = 4  # marks missing on either side of one that nothing vouches for
WORST = 30.0  # mean cost of a step from which nothing was understood
Whole = NDArray[np.int64]
HALF = 0.75  # swings on either side in which the phase is fitted
LEAST_SWING = 4.0  # px, of its amplitude
FARTHEST, CARRIED = 1.2, 0.3  # windows' halves over which a phase is carried; rad, 1 sigma, of one half
RANGE, STEP = (0.85, 1.15), 0.005  # speeds for which the fit is prepared
CENTRED = 1e-3  # rad2, least variance of a phase that was carried
NEAR = 8  # marks on either side over which a phase is averaged
NEAR_MARK, NEXT = 0.13, 0.06  # of the spacing, by which marks may lie off it over the film, and locally
BY_LIGHT, STAND_MOST = 0.35, 60.0  # 1 sigma of the logarithm of a stand's length; cost of a phase that does not fit it
LEAST, MOST, MORE = 4.0, 1.6, 16  # rows of a stand; times its length by light, and marks, that are tried
NO_STAND = 16.0  # cost of a bar that is none: a mark across the film, dirt
BESIDE, FEWEST, LONGER = 16, 6, 64  # marks beside a stand that show the phase; that show how the ship shakes it


class Swings(NamedTuple):
    """Phases of the traces' swings at events, rad; NaN where unknown."""

    phase: Floats  # (traces, events)
    extra: Floats  # (traces, events), variance of each beside that of `sigma`
    advance: Floats  # (traces,), from mark to mark, -pi to pi
    sigma: Floats  # (traces,), 1 sigma of a phase
    lost: Floats  # (events,), rows before each event on which no trace is followed

    @property
    def centred(self) -> Floats:
        """Phases that were not carried there; NaN for others."""
        return np.where(self.extra < CENTRED, self.phase, np.nan)


def swings_at(tracks: Tracks, events: Events, places: Floats, spacing: float) -> Swings:
    """Swings at events, which lie on each trace at `places` (traces, events); `spacing` is that of marks."""
    from scipy.ndimage import median_filter

    rows = events.row
    apart, stretch = np.diff(rows), np.ones(rows.size)  # rows per second over the film's mean, by the neighbours
    good = np.abs(apart - spacing) < NEAR_MARK * spacing
    if good.sum() >= 3:
        calm = median_filter(apart[good], 5, mode="nearest")
        stretch = np.asarray(np.interp(rows, 0.5 * (rows[1:] + rows[:-1])[good], calm) / spacing)
    lost = np.concatenate([[0], np.cumsum(~np.isfinite(tracks.course).any(axis=0))])
    before = lost[np.clip(np.round(rows), 0, lost.size - 1).astype(np.int64)].astype(np.float64)
    phase, extra = _phases(tracks, places, stretch)
    advance, sigma = np.full((2, len(places)), np.nan)
    next_one = np.abs(apart / (spacing * stretch[1:]) - 1.0) < NEXT
    for trace, each in enumerate(np.where(extra < CENTRED, phase, np.nan)):
        step = np.diff(each)[next_one]
        step = step[np.isfinite(step)]
        if step.size >= 8:
            centre = np.angle(np.exp(1j * step).sum())
            for _ in range(5):
                centre += np.median(wrapped(step - centre))
            spread = 1.4826 * float(np.median(np.abs(wrapped(step - centre))))
            advance[trace], sigma[trace] = centre, max(spread, 0.01)
    extra += (2.0 * np.pi / tracks.rows_per_swing * events.row_sigma) ** 2
    return Swings(phase, extra, advance, sigma, before)


def wrapped(angle: Floats) -> Floats:
    """Angles between -pi and pi, rad."""
    return np.asarray(np.angle(np.exp(1j * angle)))


def _phases(tracks: Tracks, rows: Floats, stretch: Floats) -> tuple[Floats, Floats]:
    """Phase of every trace's swing at rows of that trace, rad, and its variance from being carried there, (traces, n).

    Near lost rows it is carried on from the nearest whole piece, NaN too far; `stretch` (n,): speed over the mean.
    """
    from scipy.ndimage import distance_transform_edt, maximum_filter1d

    half = max(round(HALF * tracks.rows_per_swing), 3)
    x = np.arange(-half, half + 1.0)
    speed = np.round(np.clip(stretch, *RANGE) / STEP).astype(np.int64)
    out, extra = np.full((2, *rows.shape), np.nan)
    for trace, course in enumerate(tracks.course):
        broken = maximum_filter1d(~np.isfinite(course), 2 * half + 1)
        broken[:half] = broken[-half:] = True
        if broken.all():
            continue
        whole: Any = distance_transform_edt(broken, return_distances=False, return_indices=True)
        middle = np.nan_to_num(rows[trace], nan=-1e9) - 0.5
        near = whole[0][np.clip(np.round(middle), 0, course.size - 1).astype(np.int64)]
        carried = middle - near
        inside = np.abs(carried) <= FARTHEST * half
        for which in np.unique(speed[inside]):
            turn = 2.0 * np.pi / (tracks.rows_per_swing * which * STEP)
            terms = np.stack([np.cos(turn * x), np.sin(turn * x), *[(x / half) ** k for k in range(4)]])
            taps = np.linalg.pinv(terms.T)
            at = np.flatnonzero(inside & (speed == which))
            cos, sin = taps[:2] @ course[near[at][:, None] + np.arange(-half, half + 1)].T
            phase = np.arctan2(-sin, cos) + turn * carried[at]
            out[trace, at] = np.where(np.hypot(cos, sin) > LEAST_SWING, phase, np.nan)
        extra[trace, inside] = (CARRIED * np.maximum(np.abs(carried[inside]) - 1.0, 0.0) / half) ** 2
    return out, extra


def jumps(count: "Count", swings: Swings) -> Floats:
    """Jump of the pendulums' phase at each mark, the smallest of all traces, rad; 0 where it is not known."""
    index, out = count.index, np.full((len(swings.phase), count.index.size), np.inf)
    for trace, (phase, advance) in enumerate(zip(swings.centred[:, count.event], swings.advance, strict=True)):
        known = np.flatnonzero(np.isfinite(phase) & np.isfinite(advance))
        if known.size >= 2 * NEAR:
            turned = np.exp(1j * (phase[known] - advance * index[known]))
            sums = np.convolve(turned, np.ones(NEAR), "valid")  # of NEAR marks, by their first
            out[trace, known[NEAR : known.size - NEAR + 1]] = np.abs(np.angle(sums[NEAR:] * np.conj(sums[:-NEAR])))
    least = out.min(axis=0)
    return np.where(np.isfinite(least), least, 0.0)


class Steps(NamedTuple):
    """Steps that could be meant, by their later event, and how far the paper's speed may change."""

    begin: Whole  # event
    end: Whole  # event
    marks: Whole
    most: Floats  # cost of the speed's change before and after it
    cost: Floats  # of each by itself: marks missed, events passed over, and swings that do not fit
    row: Floats  # of the events
    sigma: Floats
    spacing: float  # rows between marks
    change: float  # 1 sigma of the relative speed's change per mark's interval
    most_change: float  # its limit over long times


@dataclass(frozen=True)
class Count:
    """Marks among the events."""

    event: Whole  # (marks,)
    index: Whole  # (marks,), their numbers from 0 on
    lead: Floats  # (marks - 1,), of the count to the next mark before any other, as a difference of chi squares

    def part(self, first: int, stop: int) -> "Count":
        """Some of the marks."""
        return Count(self.event[first:stop], self.index[first:stop], self.lead[first : stop - 1])


def usual_spacing(gaps: Gaps, traces: int) -> float:
    """Rows between marks: the commonest distance of gaps on the trace with most; `RefusedError`: too few."""
    rows = gaps.row[gaps.trace == np.argmax(np.bincount(gaps.trace, minlength=traces))]
    apart = np.diff(rows)
    if np.count_nonzero(apart > 1e-6) < LEAST_MARKS:
        raise RefusedError(
            f"film: {rows.size} gaps found in the traces, too few for a time axis; "
            "check that the film bears time marks, or state the gap and the rows per second"
        )
    return float(np.exp(np.median(np.log(commonest(apart[apart > 1e-6], ALIKE)))))


def unsteadiness(rows: Floats, spacing: float) -> tuple[float, float]:
    """How much the relative speed changes from mark to mark, and over any time, 1 sigma, as a film shows."""
    speed = np.diff(rows) / spacing
    speed = speed[np.abs(speed - 1.0) < EVEN]
    if speed.size < 4 * LEAST_MARKS:
        return CHANGE[1], MOST_CHANGE[1]
    half = min(AROUND, (speed.size - 1) // 2)
    mean = np.convolve(speed, np.full(2 * half + 1, 1.0 / (2 * half + 1)), "valid")
    near = CAUTION * 1.4826 * float(np.median(np.abs(np.diff(speed))))
    far = CAUTION * float(np.sqrt(np.mean((speed[half : half + mean.size] - mean) ** 2)))
    return float(np.clip(near, *CHANGE)), float(np.clip(far, *MOST_CHANGE))


def counted(rows: Floats, sigma: Floats, swings: Swings, spacing: float, breaks: Floats) -> Count:
    """The cheapest count of all, of events on `rows`, px, in order, one mark over each break; `RefusedError`: none."""
    steps = list_steps(rows, sigma, spacing, swings, breaks)
    forward, backward, before = count_marks(steps, np.searchsorted(steps.end, np.arange(rows.size + 1)))
    whole = forward + backward
    if not np.isfinite(whole.min(initial=np.inf)):
        raise RefusedError(
            f"film: no even row of time marks runs from one end to the other (about {spacing:.1f} rows apart); "
            "cut the film where it was stopped and read the parts one by one"
        )
    # the last step of the cheapest path, then back
    remaining = rows.size - 1 - steps.end
    finished = np.where(remaining < SKIP, forward + PASSED * remaining, np.inf)
    best, reverse = float(finished.min()), [int(np.argmin(finished))]
    while before[reverse[-1]] >= 0:
        reverse.append(int(before[reverse[-1]]))
    path = np.array(reverse[::-1])
    if best > WORST * path.size:
        raise RefusedError(
            f"film: the gaps in the traces do not come evenly (about {spacing:.1f} rows apart); "
            "check the interval of the marks, or that this is a pendulum film"
        )
    event = np.concatenate([steps.begin[path[:1]], steps.end[path]])
    index = np.concatenate([[0], np.cumsum(steps.marks[path])])
    # cost of the best other count between the same two events, beyond the best of all
    _, between = np.unique(steps.begin * rows.size + steps.end, return_inverse=True)
    other = np.full(between.max() + 1, np.inf)
    np.minimum.at(other, between, np.where(np.isin(np.arange(whole.size), path), np.inf, whole))
    lead = other[between[path]] - best
    # any false gap would do as well as a mark that stands alone where many are missing
    step = np.diff(index)
    kept = np.flatnonzero(~np.concatenate([[False], np.minimum(step[1:], step[:-1]) >= ALONE, [False]]))
    return Count(event[kept], index[kept], np.array([lead[a:b].min() for a, b in itertools.pairwise(kept)]))


def list_steps(row: Floats, sigma: Floats, spacing: float, swings: Swings, breaks: Floats) -> Steps:
    """All steps that could be meant; one over a break counts one mark, at any speed and phase."""
    end = np.repeat(np.arange(row.size), SKIP)
    begin = end - np.tile(np.arange(SKIP, 0, -1), row.size)
    begin, end = begin[begin >= 0], end[begin >= 0]
    length = (row[end] - row[begin]) / spacing
    low = np.maximum(np.ceil(length / (1.0 + SLACK)), 1.0).astype(np.int64)
    high = np.floor(length / (1.0 - SLACK)).astype(np.int64)
    broken = np.searchsorted(breaks, row[end]) > np.searchsorted(breaks, row[begin])
    low, number = np.where(broken, 1, low), np.where(broken, 1, np.maximum(high - low + 1, 0))
    pair = np.repeat(np.arange(begin.size), number)
    marks = low[pair] + np.arange(pair.size) - (np.cumsum(number) - number)[pair]
    lost = swings.lost[end] - swings.lost[begin] > UNSEEN * (row[end] - row[begin])
    most = np.where(broken[pair], 0.0, np.where((marks >= LONG) & lost[pair], UNFOLLOWED, np.inf))
    begin, end = begin[pair], end[pair]
    cost = MISSED * np.where(marks < 6, marks - 1.0, 5.0 + 0.1 * (marks - 6.0)) + PASSED * (end - begin - 1.0)
    for phase, extra, advance, each in zip(*swings[:4], strict=True):
        away = wrapped(phase[end] - phase[begin] - advance * marks)
        variance = 2.0 * each**2 + WANDER**2 * marks + extra[begin] + extra[end]
        cost += np.where(np.isfinite(away) & (most > 0.0), np.minimum(away**2 / variance, PHASE_MOST), 0.0)
    return Steps(begin, end, marks, most, cost, row, np.hypot(sigma, FLOOR), spacing, *unsteadiness(row, spacing))


@making_kernel
def count_marks(steps: Steps, first_of: Whole) -> tuple[Floats, Floats, Whole]:
    """Least cost of all paths up to each step, and after it; the step before it; event k's begin at `first_of[k]`."""
    events, total, cost = steps.row.size, steps.cost.size, steps.cost
    forward, backward, before = np.empty(total), np.empty(total), np.empty(total, dtype=np.int64)
    for k in range(total):
        a = steps.begin[k]
        best, which = PASSED * a if a < SKIP else math.inf, -1
        for j in range(first_of[a], first_of[a + 1]):
            after = forward[j] + turn_cost(steps, j, k)
            if after < best:
                best, which = after, j
        forward[k], before[k] = best + cost[k], which
        remaining = events - 1 - steps.end[k]
        backward[k] = PASSED * remaining if remaining < SKIP else math.inf
    for k in range(total - 1, -1, -1):
        for j in range(first_of[steps.begin[k]], first_of[steps.begin[k] + 1]):
            backward[j] = min(backward[j], backward[k] + cost[k] + turn_cost(steps, j, k))
    return forward, backward, before


@kernel
def turn_cost(steps: Steps, j: int, k: int) -> float:
    """Cost of the speed's change from step j to the next, k."""
    a, b, c = steps.begin[j], steps.end[j], steps.end[k]
    before, after, row, sigma = steps.marks[j], steps.marks[k], steps.row, steps.sigma
    away = ((row[c] - row[b]) / after - (row[b] - row[a]) / before) / steps.spacing
    change = min(steps.change * 0.5 * (before + after), steps.most_change) ** 2
    noise = (sigma[a] ** 2 + sigma[b] ** 2) / before**2 + (sigma[b] ** 2 + sigma[c] ** 2) / after**2
    cost = TAIL * math.log1p(away * away / (change + noise / steps.spacing**2) / TAIL)
    return float(min(cost, steps.most[j], steps.most[k]))


def lengths(
    before: Count, after: Count, rows: Floats, swings: Swings, stand: Stand, pace: float
) -> tuple[NDArray[np.int64], Floats]:
    """Numbers of marks over a stand, best first, and costs: by the phases but for whole swings, by its light those."""
    moved = (rows[after.event[0]] - rows[before.event[-1]]) / pace
    length = max(stand.length, LEAST) / pace
    number = np.arange(max(round(moved), 1), int(moved + MOST * length) + MORE)
    stood = (number - moved) / length
    away = np.log(np.maximum(stood, 1e-3)) / BY_LIGHT
    cost = np.where((stood > 1.0) & stand.saturated, 0.0, away**2)
    cost[(number - moved) * pace < LEAST] = NO_STAND
    for phase, advance, sigma in zip(swings.phase, swings.advance, swings.sigma, strict=True):
        one, few, shaken = _extrapolated(before.index - before.index[-1], phase[before.event], advance)
        other, many, shakes = _extrapolated(after.index - after.index[0], phase[after.event], advance)
        if min(few, many) < FEWEST or not np.isfinite(advance):
            continue
        jump = wrapped(other - one - advance * number)
        variance = sigma**2 * (4.0 / few + 4.0 / many) + WANDER**2 * (number + BESIDE) + shaken + shakes
        cost = cost + np.minimum(jump**2 / variance, STAND_MOST)
    order = np.argsort(cost, kind="stable")
    return number[order], cost[order]


def _extrapolated(away: NDArray[np.int64], phase: Floats, advance: float) -> tuple[float, int, float]:
    """Phase at a mark by those nearest to it, their number, and its variance over a longer time, rad2."""
    known = np.isfinite(phase) & (np.abs(away) < LONGER)
    turned = np.exp(1j * (phase[known] - advance * away[known]))
    near = turned[np.abs(away[known]) < BESIDE]
    middle = float(np.angle(near.sum()))
    return middle, near.size, float(np.mean(np.angle(turned * np.exp(-1j * middle)) ** 2)) if near.size else 0.0
