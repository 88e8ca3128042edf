"""Which traces swing on a piece of film: hypotheses sorted, doubles of one trace put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.seeds import propose
from pipeline.film.tracking.turning_points import turning_points

MOST_PROPOSALS = 4000
CERTAIN = 6  # power of the share against the length of the way: two traces taken for one swing are a long way
NOISE = 3.5  # sigma of the smoothed paper from which on it counts as darker than its sides
MOST_KEPT = 24
SAME = 2.5  # spots of distance across the line under which two swings are one


@dataclass(frozen=True)
class Swing:
    """A trace as first seen.

    Attributes
    ----------
    row : float
        Where the state holds, px from the edge of the film.
    state : (6,) array
        See `motion`.
    share : float
        Part of the way that lies on dark paper.
    """

    row: float
    state: Floats
    share: float

    @property
    def amplitude(self) -> float:
        """Half the width of the swing, px."""
        return float(np.hypot(self.state[3], self.state[4]))

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(2.0 * np.pi / self.state[5])

    def column(self, row: Floats) -> Floats:
        """Place at some rows, px."""
        return _columns(self.row, self.state, row)[0]

    def at(self, row: float) -> Floats:
        """State at another row."""
        along, (m, m1, m2, p, q, w) = row - self.row, self.state
        c, s = np.cos(w * along), np.sin(w * along)
        return np.array([m + along * (m1 + 0.5 * along * m2), m1 + m2 * along, m2, p * c - q * s, p * s + q * c, w])


def find_swings(
    darkness: NDArray[np.float32],
    first: int,
    spot: float,
    sigma: float,
    period: float | None = None,
) -> list[Swing]:
    """Swinging traces on a piece of film that starts at row `first`, the surest first.

    Parameters
    ----------
    darkness : (rows, columns) array
        Above blank film.
    spot, sigma : float
        Of the spot (px) and of one pixel of blank film.
    period : float, optional
        Rows in a full swing, if known.
    """
    smooth, points = turning_points(darkness, spot)
    if points.shape[0] < 3:
        return []
    least = NOISE * sigma / (2.0 * np.sqrt(np.pi) * 0.8 * spot) * 1.3
    shortest, longest = (0.85 * period, 1.18 * period) if period else (5.0 * spot, 0.8 * darkness.shape[0])
    out = np.empty((MOST_PROPOSALS, 8))
    count = propose(smooth, points, spot, least, shortest, longest, out)
    found = [Swing(first + each[0], each[1:7].copy(), float(each[7])) for each in out[:count]]
    found.sort(key=lambda swing: -(swing.share**CERTAIN) * swing.amplitude * swing.state[5])
    return _apart(found, spot)


def _apart(swings: list[Swing], spot: float) -> list[Swing]:
    """One swing of each trace: the surest."""
    if not swings:
        return []
    rows, states = np.array([swing.row for swing in swings]), np.array([swing.state for swing in swings])
    free = np.ones(len(swings), dtype=bool)
    kept: list[Swing] = []
    while free.any() and len(kept) < MOST_KEPT:
        best = int(np.argmax(free))
        free[best] = False
        kept.append(swings[best])
        rest = np.flatnonzero(free)
        free[rest] = ~_same_trace(swings[best], rows[rest], states[rest], spot)
    return kept


def _same_trace(one: Swing, rows: Floats, states: Floats, spot: float) -> NDArray[np.bool_]:
    """Which of other swings follow one line with `one` for a period about the middle between them."""
    middle = 0.5 * (one.row + rows)
    period = np.minimum(one.period, 2.0 * np.pi / states[:, 5])
    at = middle[:, None] + np.linspace(-0.5, 0.5, 25) * period[:, None]
    own, slope = _columns(one.row, one.state[:, None, None], at)
    other, _ = _columns(rows[:, None], states.T[:, :, None], at)
    return np.asarray(np.median(np.abs(own - other) / np.sqrt(1.0 + slope**2), axis=1) < SAME * spot)


def _columns(row: float | Floats, state: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Place and slope of swings at some rows."""
    along = at - row
    m, m1, m2, p, q, w = state
    c, s = np.cos(w * along), np.sin(w * along)
    place = m + along * (m1 + 0.5 * along * m2) + p * c - q * s
    return place, m1 + along * m2 - w * (p * s + q * c)
