"""All traces of one section of film, found without help and followed through it; and which of them is which.

Traces found anew are known by amplitude, resting place and phase. Through a blackout the paper may have run fast or
slow, which shifts the phases of all traces alike, and the ship may have moved the slow part; what the pendulums keep
are their amplitudes and the phase between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import Floats32, Optics
from pipeline.film.tracking.motion import place_and_rate
from pipeline.film.tracking.pieces import Filter, Piece, combined, run, start
from pipeline.film.tracking.seeding import SAME, Swing, find_swings

LEAST_USED = 0.45  # share of rows read by which a seed proves true
LEAST_SWINGS, LEAST_AMPLITUDE = 1.6, 3.0  # followed; spots
PERIOD_SLACK = 0.12
SURE_SHARE = 0.8
AMPLITUDE, PLACE, PHASE, COMMON = 0.06, 0.5, 0.25, 1.5  # 1 sigma: of the amplitude (twice), radians
WORST, AMBIGUOUS = 40.0, 9.0  # chi square a trace at most, and by which the second best must be worse
MOST_TRACES = 6
Last = list[tuple[float, Floats]]  # Row and state at which each trace was read last


@dataclass(frozen=True)
class Section:
    """Traces of one section, from left to right."""

    first: int  # row of the film
    darkness: Floats32  # (rows, columns), above blank film
    swings: tuple[Swing, ...]  # one a trace, all at one row
    states: Floats  # (rows, traces, 6), see `motion`
    place: Floats  # (traces, rows), NaN where there is no reading
    brightness: Floats
    share: Floats  # (traces,), rows read of those followed

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(np.median([swing.period for swing in self.swings]))


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


def follow_from(swings: Sequence[Swing], darkness: Floats32, first: int, optics: Optics, least: float) -> Section:
    """Follow swings given at one row both ways through a section; fewer rows than `least` count as so many."""
    begin = round(swings[0].row - 0.5) - first
    begun = start(swings, first + begin - 0.5)
    run(begun, darkness[begin:], first + begin, 1, optics)
    backward, forward = (run(_turned(begun), darkness, first, order, optics) for order in (-1, 1))
    course = combined(forward, backward, optics.spot, optics.shear)
    states, known = course.states, course.known > 0
    used = np.isfinite(backward.variance) & known
    place, light = np.where(used, backward.place, np.nan), np.where(used, backward.brightness, np.nan)
    share = used.sum(axis=1) / np.maximum(known.sum(axis=1), least)
    there = tuple(Swing(first + begin + 0.5, state.copy()) for state in states[begin])
    return Section(first, darkness, there, states, place, light, share)


def _turned(begun: Filter) -> Filter:
    """The filter at the end of a piece, started again from where the traces are."""
    for k in np.flatnonzero(begun.alive):
        begun.restart(int(k), begun.states[k].copy(), float(begun.lamp[k]))
    return begun


def _prove(
    seed: Swing, others: list[Piece], darkness: Floats32, first: int, optics: Optics
) -> tuple[float, Piece] | None:
    """Follow a seed beside the known traces: rows in a swing, and a piece with it first; None if it is none."""
    begin = int(np.clip(round(seed.row - 0.5) - first, 0, darkness.shape[0] - 1))
    beside = [Swing(first + begin + 0.5, piece.states[begin, 0]) for piece in others if piece.followed[0, begin]]
    begun = start([seed, *beside], first + begin - 0.5)
    run(begun, darkness[begin:], first + begin, 1, optics)
    begins = None
    if begun.alive[0]:
        _turned(begun)
    else:  # lost on the way, or the trace ends: back from where the seed was, to a row
        begun = start([seed, *beside], first + begin - 0.5)
        begins = np.full(begun.alive.size, begin)
        begun.alive[:] = 0
    piece = run(begun, darkness, first, -1, optics, begins)
    followed = piece.followed[0] > 0
    used = np.isfinite(piece.variance[0]) & followed
    if followed.sum() < LEAST_SWINGS * seed.period or used.sum() < LEAST_USED * followed.sum():
        return None
    at = int(np.flatnonzero(followed)[followed.sum() // 2])
    swing = Swing(first + at + 0.5, piece.states[at, 0])
    if swing.amplitude < LEAST_AMPLITUDE * optics.spot or abs(swing.period / seed.period - 1.0) > 2.0 * PERIOD_SLACK:
        return None
    return swing.period, piece


def _apart(piece: Piece, rows: NDArray[np.int64], column: Floats) -> float:
    """How far columns lie from the course of a piece on some rows, across the line, px."""
    course, slope = place_and_rate(piece.states[rows, 0])
    return float(np.median(np.abs(course - column) / np.sqrt(1.0 + slope**2)))


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


def match(section: Section, last: Last) -> list[int]:
    """Trace number of each swing of the section, -1 for a swing that is none of them; none if that is not certain."""
    traces, names = len(section.swings), len(last)
    if max(traces, names) > MOST_TRACES:
        return []
    size = min(traces, names)
    cost = sorted(
        (_cost(section, chosen, named, last), chosen, named)
        for chosen in permutations(range(traces), size)
        for named in combinations(range(names), size)
    )
    if cost[0][0] > WORST * size or (len(cost) > 1 and cost[1][0] - cost[0][0] < AMBIGUOUS):
        return []
    names_of = dict(zip(cost[0][1], cost[0][2], strict=True))
    return [names_of.get(place, -1) for place in range(traces)]


def _cost(section: Section, chosen: tuple[int, ...], names: tuple[int, ...], last: Last) -> float:
    """Chi square of some swings that are taken for some traces."""
    total, phases = 0.0, []
    for place, name in zip(chosen, names, strict=True):
        swing, (row, state) = section.swings[place], last[name]
        amplitude = float(np.hypot(state[3], state[4]))
        total += (np.log(swing.amplitude / amplitude) / AMPLITUDE) ** 2
        total += ((swing.state[0] - state[0]) / (PLACE * amplitude)) ** 2
        then = np.arctan2(state[4], state[3]) + state[5] * (swing.row - row)
        phases.append(np.arctan2(swing.state[4], swing.state[3]) - then)
    turned = np.exp(1j * np.array(phases))
    common = float(np.angle(turned.mean()))
    apart = np.angle(turned * np.exp(-1j * common))
    return float(total + np.sum((apart / PHASE) ** 2) + (common / COMMON) ** 2)
