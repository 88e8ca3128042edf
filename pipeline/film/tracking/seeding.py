"""Which traces swing on a piece of film: hypotheses sorted, doubles of one trace put together.

Two turning points on one side and one on the other between them fix a harmonic on a slow curve. The hypothesis is
judged by the share of its way on which the paper is darker than on both sides: nothing but a swinging trace is dark
along 1.5 periods of such a curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.motion import moved, place_and_rate, solve
from synth.kernels.compiled import kernel

DARKEST_SHARE = 0.35  # of the darkest smoothed pixels, from which a peak may be a turning point
DARK_SHARE, ALIKE = 0.01, 0.7  # pixels left out when the spot is measured; likeness down to which it is followed
MOST_POINTS, MOST_PROPOSALS = 200, 4000
SAMPLES, LEAST_SHARE = 96, 0.5  # places judged on a hypothesis' way, and share of them that must be dark
STRIDE = 37  # has no divisor in common with SAMPLES: a few of them are spread over the whole way
BEYOND = 0.3  # periods judged before the first and after the last turning point
CERTAIN = 6  # power of the share against the length of the way: two traces taken for one swing are a long way
NOISE = 3.5  # sigma of the smoothed paper from which on it counts as darker than its sides
MOST_KEPT = 24
SAME = 2.5  # spots of distance across the line under which two swings are one
Floats32 = NDArray[np.float32]


@dataclass(frozen=True)
class Swing:
    """A trace as first estimated."""

    row: float  # where the state holds, px from the edge of the film
    state: Floats  # (6,), see `motion`
    share: float = 1.0  # part of the way that lies on dark paper

    @property
    def amplitude(self) -> float:
        """Half the width of the swing, px."""
        return float(np.hypot(self.state[3], self.state[4]))

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(2.0 * np.pi / self.state[5])

    def at(self, row: float | Floats) -> Floats:
        """State at another row, or at several, (..., 6)."""
        return moved(self.state, row - self.row)


def find_swings(darkness: Floats32, first: int, spot: float, sigma: float, period: float | None = None) -> list[Swing]:
    """Swinging traces on a piece of film that starts at row `first`, the surest first.

    `sigma` is that of one pixel of blank film, `period` the rows in a full swing, if known.
    """
    smooth, points = turning_points(darkness, spot)
    if points.shape[0] < 3:
        return []
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


def spot_size(darkness: Floats32) -> float:
    """1 sigma of the spot, px, from how alike rows are that lie close together.

    Most of a trace runs steeply across the rows, and its cut along the film is the spot's own profile. The likeness at
    a distance d falls as exp(-d^2/4 spot^2); the distance 0 holds the grain and is left out, and so are the darkest
    pixels: dirt and turning points, wider than a line.
    """
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
    """Smoothed darkness, and the points (n, 3): row, column, +1 where the trace turns at its greatest column, else -1.

    Points count px from the piece's edges.
    """
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


@kernel
def swing_through(points: Floats, a: int, b: int, c: int, out: Floats, matrix: Floats, right: Floats) -> bool:
    """Harmonic on a parabola that turns at three points, at the row of the middle one: m, m1, m2, p, q, w."""
    frequency = 2.0 * math.pi / (points[c, 0] - points[a, 0])
    swing = 0.5 * abs(points[b, 1] - 0.5 * (points[a, 1] + points[c, 1]))
    matrix[:], right[:5] = 0.0, 0.0
    row = right[5:10]
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
    if not solve(matrix, right, 5):
        return False
    out[:5], out[5] = right[:5], frequency
    return True


@kernel
def share_on_line(smooth: Floats32, middle: float, state: Floats, spot: float, least: float) -> float:
    """Share of a hypothesis' way, 1.5 periods and a bit, on which the paper is darker than both its sides."""
    rows, columns = smooth.shape
    period = 2.0 * math.pi / state[5]
    length = (0.5 + BEYOND) * period
    hits, inside = 0, 0
    for n in range(SAMPLES):
        i = n * STRIDE % SAMPLES
        if n == SAMPLES // 4 and hits < SAMPLES // 10:
            return 0.0
        along = -length + 2.0 * length * (i + 0.5) / SAMPLES
        co, si = math.cos(state[5] * along), math.sin(state[5] * along)
        column = state[0] + along * (state[1] + 0.5 * along * state[2]) + state[3] * co - state[4] * si
        slope = state[1] + along * state[2] - state[5] * (state[3] * si + state[4] * co)
        size = math.sqrt(1.0 + slope * slope)
        row = middle + along
        if row < 0.0 or row >= rows or column < 0.0 or column >= columns:
            continue
        inside += 1
        sides, lowest = 0.0, 0
        for sign in (-1.0, 1.0):
            r = int(row + sign * 4.0 * spot * slope / size)
            c = int(column - sign * 4.0 * spot / size)
            if 0 <= r < rows and 0 <= c < columns:
                sides += smooth[r, c]
                lowest += 1
        here = smooth[int(row), int(column)]
        if lowest > 0 and here - sides / lowest > least:
            hits += 1
    if inside < 0.7 * SAMPLES:
        return 0.0
    return hits / inside


@kernel
def propose(
    smooth: Floats32, points: Floats, spot: float, least: float, shortest: float, longest: float, out: Floats
) -> int:
    """Swings through all triples of turning points that are good enough: (n, 8) of row, state, share; their number."""
    n, count = points.shape[0], 0
    state, matrix, right = np.empty(6), np.empty((5, 5)), np.empty(10)
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
                if not swing_through(points, a, b, c, state, matrix, right):
                    continue
                share = share_on_line(smooth, points[b, 0], state, spot, least)
                if share >= LEAST_SHARE and count < out.shape[0]:
                    out[count, 0], out[count, 1:7], out[count, 7] = points[b, 0], state, share
                    count += 1
    return count
