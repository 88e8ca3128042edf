"""All traces of one section of film, found without help and followed through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.combine import combined
from pipeline.film.tracking.optics import Optics
from pipeline.film.tracking.pieces import Filter, Piece, run, start
from pipeline.film.tracking.seeding import SAME, Swing, find_swings

LEAST_USED = 0.45  # share of rows read by which a seed proves true
LEAST_SWINGS = 1.6
PERIOD_SLACK = 0.12


@dataclass(frozen=True)
class Section:
    """Traces of one section.

    Attributes
    ----------
    first : int
        Its first row.
    darkness : (rows, columns) array
        Above blank film.
    swings : tuple of Swing
        One a trace, from left to right, at one common row.
    states : (rows, traces, 6) array
        The course (see `motion`).
    place, brightness : (traces, rows) arrays
        Readings, NaN where there are none.
    share : (traces,) array
        Rows read of those followed.
    """

    first: int
    darkness: NDArray[np.float32]
    swings: tuple[Swing, ...]
    states: Floats
    place: Floats
    brightness: Floats
    share: Floats

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(np.median([swing.period for swing in self.swings]))


def read_section(
    darkness: NDArray[np.float32],
    first: int,
    optics: Optics,
    period: float | None,
    count: int | None,
    seeds: list[Swing] | None = None,
) -> Section | None:
    """Find the traces of a section and follow them, None if there are none."""
    if seeds is None:
        seeds = find_swings(darkness, first, optics.spot, float(np.sqrt(optics.grain[0])), period)
    alone: list[tuple[Swing, Piece]] = []
    for seed in seeds:
        if alone and abs(seed.period / alone[0][0].period - 1.0) > PERIOD_SLACK:
            continue
        if any(_on(seed, piece, first, optics.spot) for _, piece in alone):
            continue
        proven = _prove(seed, darkness, first, optics)
        if proven is not None and not any(_coincide(proven[1], piece, optics.spot) for _, piece in alone):
            alone.append(proven)
        if count is not None and len(alone) == count:
            break
    if not alone:
        return None
    return follow_together(darkness, first, [piece for _, piece in alone], optics)


def follow_together(
    darkness: NDArray[np.float32], first: int, pieces: list[Piece], optics: Optics
) -> Section | None:
    """Follow traces jointly that were each followed alone."""
    together = np.all([piece.followed[0] > 0 for piece in pieces], axis=0)
    if not together.any():
        return None
    begin = int(np.argmax(together))
    begin += int(np.count_nonzero(together[begin:]) // 2)
    swings = [Swing(first + begin + 0.5, piece.states[begin, 0].copy(), 1.0) for piece in pieces]
    swings.sort(key=lambda swing: float(swing.state[0]))
    forward, backward, _ = both_ways(start(swings, first + begin - 0.5), darkness, first, begin, optics)
    states, _, _, _, known = combined(forward, backward, optics)
    used = np.isfinite(backward.variance) & (known > 0)
    middle = first + begin + 0.5
    swings = [Swing(middle, states[begin, k].copy(), 1.0) for k in range(len(swings))]
    return Section(
        first,
        darkness,
        tuple(swings),
        states,
        np.where(used, backward.place, np.nan),
        np.where(used, backward.brightness, np.nan),
        used.sum(axis=1) / np.maximum((known > 0).sum(axis=1), 1),
    )


def both_ways(
    begun: Filter, darkness: NDArray[np.float32], first: int, begin: int, optics: Optics
) -> tuple[Piece, Piece, Filter]:
    """From row `begin` of a piece to its end, back to its start, and to its end again: forward, backward, at the end."""
    run(begun, darkness[begin:], first + begin, 1, optics)
    for k in np.flatnonzero(begun.alive):
        begun.restart(int(k), begun.states[k], float(begun.lamp[k]))
    backward = run(begun, darkness, first, -1, optics)
    for k in np.flatnonzero(begun.alive):
        begun.restart(int(k), begun.states[k], float(begun.lamp[k]))
    forward = run(begun, darkness, first, 1, optics)
    return forward, backward, begun


def _prove(seed: Swing, darkness: NDArray[np.float32], first: int, optics: Optics) -> tuple[Swing, Piece] | None:
    """Follow a seed alone through the section; None if it leads nowhere."""
    begin = int(np.clip(round(seed.row - 0.5) - first, 0, darkness.shape[0] - 1))
    begun = start([seed], first + begin - 0.5)
    run(begun, darkness[begin:], first + begin, 1, optics)
    if not begun.alive[0]:  # lost on the way, or the trace ends: back from where the seed was
        begun = start([seed], first + begin + 0.5)
        piece = run(begun, darkness[: begin + 1], first, -1, optics)
        rest = darkness.shape[0] - begin - 1
        piece = _padded(piece, rest)
    else:
        begun.restart(0, begun.states[0], float(begun.lamp[0]))
        piece = run(begun, darkness, first, -1, optics)
    followed = piece.followed[0] > 0
    used = np.isfinite(piece.variance[0]) & followed
    if followed.sum() < LEAST_SWINGS * seed.period or used.sum() < LEAST_USED * followed.sum():
        return None
    at = int(np.flatnonzero(followed)[followed.sum() // 2])
    state = piece.states[at, 0]
    swing = Swing(first + at + 0.5, state.copy(), float(used.sum() / followed.sum()))
    if swing.amplitude < 3.0 * optics.spot or abs(swing.period / seed.period - 1.0) > 2.0 * PERIOD_SLACK:
        return None
    return swing, piece


def _padded(piece: Piece, rows: int) -> Piece:
    """A piece with rows added behind that were not followed."""
    more = Piece.empty(1, rows)
    more.variance[:] = np.inf
    by_rows = [np.concatenate([a, b], axis=1) for a, b in (
        (piece.place, more.place), (piece.variance, more.variance), (piece.brightness, more.brightness),
        (piece.followed, more.followed))]
    states = np.concatenate([piece.states, more.states])
    return Piece(*by_rows, states, np.concatenate([piece.covariances, more.covariances]))  # type: ignore[arg-type]


def _on(seed: Swing, piece: Piece, first: int, spot: float) -> bool:
    """Whether a seed lies on a trace that was followed."""
    middle = round(seed.row - first - 0.5)
    half = int(0.5 * seed.period)
    rows = np.arange(max(0, middle - half), min(piece.followed.shape[1], middle + half + 1))
    rows = rows[piece.followed[0, rows] > 0]
    if rows.size < 0.5 * half:
        return False
    course, slope = _course(piece, rows)
    away = np.abs(course - seed.column(first + rows + 0.5)) / np.sqrt(1.0 + slope**2)
    return bool(np.median(away) < SAME * spot)


def _coincide(one: Piece, other: Piece, spot: float) -> bool:
    """Whether two pieces follow one trace for a good part of their way."""
    rows = np.flatnonzero((one.followed[0] > 0) & (other.followed[0] > 0))
    if rows.size == 0:
        return False
    (a, slope), (b, _) = _course(one, rows), _course(other, rows)
    return bool(np.mean(np.abs(a - b) / np.sqrt(1.0 + slope**2) < spot) > 0.5)


def _course(piece: Piece, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
    state = piece.states[rows, 0]
    return state[:, 0] + state[:, 3], state[:, 1] - state[:, 5] * state[:, 4]
