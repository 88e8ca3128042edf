"""Which traces swing on a piece of film: hypotheses from turning points, proven by following them.

Two turning points on one side and one on the other between them fix a harmonic on a slow curve. It is judged by how far
the paper is darker than on both sides: nothing but a swinging trace is so along 1.5 periods.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import Floats32, Optics
from pipeline.film.tracking.motion import moved, place_and_rate, solve
from pipeline.film.tracking.pieces import NO_LINES, SHOWN, Filter, Piece, Section, Swing, follow_from, run
from synth.kernels.compiled import kernel, making_kernel

DARKEST_SHARE = 0.35  # of the darkest smoothed pixels, from which a peak may be a turning point
DARK_SHARE, ALIKE = 0.01, 0.7  # pixels left out when the spot is measured; likeness down to which it is followed
MOST_POINTS, MOST_PROPOSALS = 200, 4000
SAMPLES, LEAST_SHARE = 96, 0.5  # places judged on a hypothesis' way, and share of them that must be dark
FIRST_SHARE, LEAST_SHOWN = 0.375, 0.3  # dark of the first quarter, or it is none; of all that must not lie on lines
STRIDE = 37  # has no divisor in common with SAMPLES: a few of them are spread over the whole way
BEYOND = 0.3  # periods judged before the first and after the last turning point
CERTAIN = 6  # power of the share against the length of the way: two traces taken for one swing are a long way
NOISE = 3.5  # sigma of the smoothed paper from which on it counts as darker than its sides
MOST_KEPT = 24
LEAST_USED = 0.45  # share of rows read by which a seed proves true
LEAST_SWINGS, LEAST_AMPLITUDE = 1.6, 3.0  # followed; spots
PERIOD_SLACK = 0.12
SURE_SHARE = 0.8
SAME = 2.5  # spots of distance across the line under which two swings are one


def read_section(
    darkness: Floats32, first: int, optics: Optics, period: float | None, count: int | None,
    seeds: list[Swing] | None = None, least: float = LEAST_USED,
) -> Section | None:  # fmt: skip
    """Find the traces of a section and follow them, None if there are none that are read on a `least` share of rows."""
    if seeds is None:
        seeds = find_swings(darkness, first, optics.spot, float(np.sqrt(optics.grain[0])), period)
    proven: list[Piece] = []
    swing_rows: float | None = None
    # a trace that others cross all the time may only be followed once they are known: those that failed try again
    for seed in [*seeds, *[seed for seed in seeds if seed.share > SURE_SHARE]]:
        if count is not None and len(proven) == count:
            break
        if swing_rows is not None and abs(seed.period / swing_rows - 1.0) > PERIOD_SLACK:
            continue
        if any(_on(seed, piece, first, optics.spot) for piece in proven):
            continue
        proof = _prove(seed, proven, darkness, first, optics)
        if proof is not None and not any(_coincide(proof[1], piece, optics.spot) for piece in proven):
            swing_rows = swing_rows or proof[0]
            proven.append(proof[1])
    return _follow_together(darkness, first, proven, optics, least)


def _follow_together(
    darkness: Floats32, first: int, pieces: list[Piece], optics: Optics, least: float
) -> Section | None:
    """Follow traces jointly that were each proven; the worst is left out until all are read for most of their way."""
    while pieces:
        together = np.all([piece.followed[0] > 0 for piece in pieces], axis=0)
        if not together.any():
            pieces = pieces[:-1]
            continue
        begin = int(np.flatnonzero(together)[np.count_nonzero(together) // 2])
        pieces = sorted(pieces, key=lambda piece: float(piece.states[begin, 0, 0]))
        swings = [Swing(first + begin + 0.5, piece.states[begin, 0].copy()) for piece in pieces]
        section = follow_from(swings, darkness, first, optics, 0.5 * together.sum())
        if section.share.min() >= least:
            return section
        del pieces[int(np.argmin(section.share))]
    return None


def _prove(
    seed: Swing, others: list[Piece], darkness: Floats32, first: int, optics: Optics
) -> tuple[float, Piece] | None:
    """Follow a seed beside the known traces: rows in a swing, and a piece with it first; None if it is none."""
    begin = int(np.clip(round(seed.row - 0.5) - first, 0, darkness.shape[0] - 1))
    beside = [Swing(first + begin + 0.5, piece.states[begin, 0]) for piece in others if piece.followed[0, begin]]
    begun = Filter.of([seed, *beside], first + begin - 0.5)
    run(begun, darkness[begin:], first + begin, 1, optics.lens, NO_LINES)
    if begun.alive[0]:
        begun.turned()
    else:  # lost on the way, or the trace ends: back from where the seed was, to a row
        begun = Filter.of([seed, *beside], first + begin - 0.5)
        begun.alive[:], begun.begins[:] = 0, begin
    piece = run(begun, darkness, first, -1, optics.lens, NO_LINES)
    followed = piece.followed[0] > 0
    used = np.isfinite(piece.variance[0]) & followed
    shown = piece.followed[0] == SHOWN
    if followed.sum() < LEAST_SWINGS * seed.period or used.sum() < LEAST_USED * shown.sum():
        return None
    at = int(np.flatnonzero(followed)[followed.sum() // 2])
    swing = Swing(first + at + 0.5, piece.states[at, 0])
    if swing.amplitude < LEAST_AMPLITUDE * optics.spot or abs(swing.period / seed.period - 1.0) > 2.0 * PERIOD_SLACK:
        return None
    return swing.period, piece


def _apart(piece: Piece, rows: NDArray[np.int64], column: Floats) -> float:
    """How far columns lie from the course of a piece on some rows, across the line, px."""
    course, slope = place_and_rate(piece.states[rows, 0])
    return float(np.median(np.abs(course - column) / np.hypot(1.0, slope)))


def _on(seed: Swing, piece: Piece, first: int, spot: float) -> bool:
    """Whether a seed lies on a trace that was followed."""
    middle, half = round(seed.row - first - 0.5), int(0.5 * seed.period)
    rows = np.flatnonzero(piece.followed[0])
    rows = rows[np.abs(rows - middle) <= half]
    return rows.size >= 0.5 * half and _apart(piece, rows, place_and_rate(seed.at(first + rows + 0.5))[0]) < SAME * spot


def _coincide(one: Piece, other: Piece, spot: float) -> bool:
    """Whether two pieces follow one trace for a good part of their way."""
    rows = np.flatnonzero((one.followed[0] > 0) & (other.followed[0] > 0))
    return rows.size > 0 and _apart(one, rows, place_and_rate(other.states[rows, 0])[0]) < spot


def find_swings(darkness: Floats32, first: int, spot: float, sigma: float, period: float | None = None) -> list[Swing]:
    """Swinging traces from row `first` on, surest first; `sigma` of a blank pixel, `period` in rows, if known."""
    smooth, points = turning_points(across_hidden(darkness), spot)
    if points.shape[0] < 3:
        return []
    smooth[np.isnan(darkness)] = np.nan
    least = NOISE * sigma / (2.0 * np.sqrt(np.pi) * 0.8 * spot) * 1.3
    shortest, longest = (0.85 * period, 1.18 * period) if period else (5.0 * spot, 0.8 * darkness.shape[0])
    out = np.empty((MOST_PROPOSALS, 8))
    free = out[: propose(smooth, points, spot, least, shortest, longest, out)]
    merit = free[:, 7] ** CERTAIN * np.hypot(free[:, 4], free[:, 5]) * free[:, 6]
    free = free[np.argsort(-merit, kind="stable")]
    kept: list[Swing] = []
    while len(free) and len(kept) < MOST_KEPT:
        best, free = free[0], free[1:]
        kept.append(Swing(first + best[0], best[1:7].copy(), float(best[7])))
        # others that follow one line with it for a period about the middle between them are the same trace
        shorter = 2.0 * np.pi / np.maximum(best[6], free[:, 6:7])
        at = 0.5 * (best[0] + free[:, :1]) + np.linspace(-0.5, 0.5, 25) * shorter
        own, slope = place_and_rate(moved(best[1:7], at - best[0]))
        other, _ = place_and_rate(moved(free[:, None, 1:7], at - free[:, :1]))
        free = free[np.median(np.abs(own - other) / np.sqrt(1.0 + slope**2), axis=1) >= SAME * spot]
    return kept


def across_hidden(darkness: Floats32) -> Floats32:
    """What is hidden, even from row to row: a trace that turns under a line shows on both its sides."""
    seen = darkness.copy()
    rows = np.arange(len(darkness))
    for column in np.flatnonzero(np.isnan(darkness).any(axis=0)):
        known = np.isfinite(darkness[:, column])
        seen[:, column] = np.interp(rows, rows[known], darkness[known, column]) if known.any() else 0.0
    return seen


def spot_size(darkness: Floats32) -> float:
    """1 sigma of the spot, px: at a distance d rows are alike by exp(-d^2/4 spot^2); darkest pixels left out."""
    clipped = np.clip(darkness, 0.0, np.quantile(darkness, 1.0 - DARK_SHARE)).astype(np.float64)
    clipped -= clipped.mean()
    top = max(3, min(100, darkness.shape[0] // 4))
    nearest = float(np.mean(clipped[1:] * clipped[:-1]))
    for distance in range(2, top):
        ratio = float(np.mean(clipped[distance:] * clipped[:-distance])) / max(nearest, 1e-12)
        if ratio < ALIKE:
            return float(np.clip(np.sqrt((distance**2 - 1.0) / (-4.0 * np.log(max(ratio, 0.02)))), 0.6, 40.0))
    return 1.2


def turning_points(darkness: Floats32, spot: float) -> tuple[Floats32, Floats]:
    """Smoothed darkness, and points (n, 3): row, column, px, +1 where a trace turns at its greatest, else -1."""
    from scipy import ndimage

    smooth: Floats32 = ndimage.gaussian_filter(darkness, 0.8 * spot, mode="nearest")
    reach = 2 * max(1, round(1.5 * spot)) + 1
    peaks: NDArray[np.bool_] = ndimage.maximum_filter(smooth, size=reach, mode="nearest") == smooth
    top = float(np.quantile(smooth[peaks], 0.995)) if peaks.any() else 0.0
    row, column = np.nonzero(peaks & (smooth > DARKEST_SHARE * top))
    strongest = np.argsort(smooth[row, column])[::-1][:MOST_POINTS]
    row, column = row[strongest], column[strongest]
    away = max(2, round(3.0 * spot))
    wide = ndimage.uniform_filter1d(smooth, 2 * max(1, round(1.5 * spot)) + 1, axis=0, mode="nearest")
    right = wide[row, np.minimum(column + away, darkness.shape[1] - 1)]
    left = wide[row, np.maximum(column - away, 0)]
    near = np.pad(smooth, 1, mode="edge").astype(np.float64)
    peak = near[row + 1, column + 1]
    finer_row = row + 0.5 + _vertex(near[row, column + 1], peak, near[row + 2, column + 1])
    finer_column = column + 0.5 + _vertex(near[row + 1, column], peak, near[row + 1, column + 2])
    points = np.stack([finer_row, finer_column, np.where(left > right, 1.0, -1.0)], axis=1)
    return smooth, points[np.argsort(points[:, 0], kind="stable")]


def _vertex(before: Floats, peak: Floats, after: Floats) -> Floats:
    """By how much a parabola through a peak and its two neighbours culminates beside it, px."""
    bend = np.minimum(before + after - 2.0 * peak, -1e-9)
    return np.asarray(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))


@making_kernel
def swing_through(points: Floats, a: int, b: int, c: int) -> Floats:
    """Harmonic on a parabola that turns at three points, at the row of the middle one: m, m1, m2, p, q, w; or NaN."""
    frequency = 2.0 * math.pi / (points[c, 0] - points[a, 0])
    swing = 0.5 * abs(points[b, 1] - 0.5 * (points[a, 1] + points[c, 1]))
    matrix, right, row, out = np.zeros((5, 5)), np.zeros(5), np.empty(5), np.full(6, math.nan)
    slack = 0.05 * swing * frequency  # of the slope at a turning point: its row is known to a good part of a row
    for slope in (False, True):
        for at in (a, b, c):
            place = points[at, 0] - points[b, 0]
            value = 0.0 if slope else points[at, 1]
            co, si = math.cos(frequency * place), math.sin(frequency * place)
            if slope:
                row[0], row[1], row[2] = 0.0, 1.0 / slack, place / slack
                row[3], row[4] = -frequency * si / slack, -frequency * co / slack
            else:
                row[0], row[1], row[2], row[3], row[4] = 1.0, place, 0.5 * place * place, co, -si
            for i in range(5):
                right[i] += row[i] * value
                for j in range(5):
                    matrix[i, j] += row[i] * row[j]
    stiff = 1.0 / (0.05 * swing * frequency * frequency)
    matrix[2, 2] += stiff * stiff
    if solve(matrix, right, 5):
        out[:5], out[5] = right, frequency
    return out


@kernel
def share_on_line(smooth: Floats32, middle: float, state: Floats, spot: float, least: float) -> float:
    """Share of a hypothesis' way, 1.5 periods and a bit, if shown, where the paper is darker than on both sides."""
    rows, columns = smooth.shape
    period = 2.0 * math.pi / state[5]
    length = (0.5 + BEYOND) * period
    hits, inside, hidden = 0, 0, 0
    for n in range(SAMPLES):
        i = n * STRIDE % SAMPLES
        if n == SAMPLES // 4 and hits < FIRST_SHARE * inside:
            return 0.0
        along = -length + 2.0 * length * (i + 0.5) / SAMPLES
        co, si = math.cos(state[5] * along), math.sin(state[5] * along)
        column = state[0] + along * (state[1] + 0.5 * along * state[2]) + state[3] * co - state[4] * si
        slope = state[1] + along * state[2] - state[5] * (state[3] * si + state[4] * co)
        size = math.sqrt(1.0 + slope * slope)
        row = middle + along
        if not (0.0 <= row < rows and 0.0 <= column < columns):
            continue
        here = smooth[int(row), int(column)]
        if math.isnan(here):
            hidden += 1
            continue
        inside += 1
        sides, lowest = 0.0, 0
        for sign in (-1.0, 1.0):
            r = int(row + sign * 4.0 * spot * slope / size)
            c = int(column - sign * 4.0 * spot / size)
            if 0 <= r < rows and 0 <= c < columns and not math.isnan(smooth[r, c]):
                sides += smooth[r, c]
                lowest += 1
        if lowest > 0 and here - sides / lowest > least:
            hits += 1
    if inside + hidden < 0.7 * SAMPLES or inside < LEAST_SHOWN * SAMPLES:
        return 0.0
    return hits / inside


@making_kernel
def propose(
    smooth: Floats32, points: Floats, spot: float, least: float, shortest: float, longest: float, out: Floats
) -> int:
    """Swings through all triples of turning points that are good enough: (n, 8) of row, state, share; their number."""
    n, count = points.shape[0], 0
    for a in range(n):
        for b in range(a + 1, n):
            first = points[b, 0] - points[a, 0]
            if first > 0.7 * longest:
                break
            width = (points[b, 1] - points[a, 1]) * points[b, 2]
            if points[a, 2] == points[b, 2] or first < 0.3 * shortest or width < 8.0 * spot:
                continue
            for c in range(b + 1, n):
                second = points[c, 0] - points[b, 0]
                if second > 2.0 * first or first + second > longest:
                    break
                if points[c, 2] != points[a, 2] or second < 0.5 * first or first + second < shortest:
                    continue
                if abs(points[c, 1] - points[a, 1]) > 1.2 * width:
                    continue
                state = swing_through(points, a, b, c)
                share = share_on_line(smooth, points[b, 0], state, spot, least)
                if share >= LEAST_SHARE and count < out.shape[0]:
                    out[count, 0], out[count, 1:7], out[count, 7] = points[b, 0], state, share
                    count += 1
    return count
