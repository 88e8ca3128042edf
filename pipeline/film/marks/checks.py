"""Tests of a count of marks against minute codes and pendulums, and what is to be distrusted of a time axis."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import Count
from pipeline.film.marks.minutes import Minutes
from pipeline.film.marks.swings import Swings, jumps
from pipeline.film.parts import Floats, Strobe, TimeAxis

LEAST_LEAD = 12.0  # of the best count before any other
JUMP = 1.0  # rad: a third of what one mark too many makes
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one
MANY, LONG = 0.1, 5.0  # share of marks missing; s


def certain_part(count: Count, codes: Floats) -> Count:
    """The longest part of a count within which each number is certain, or confirmed by `codes` on both sides.

    Codes are given by the numbers of their minutes' marks.
    """
    confirmed = (codes.min(initial=np.inf) <= count.index[:-1]) & (codes.max(initial=-np.inf) >= count.index[1:])
    edges = [0, *(1 + np.flatnonzero((count.lead < LEAST_LEAD) & ~confirmed)), count.index.size]
    begin, end = max(itertools.pairwise(edges), key=lambda part: count.index[part[1] - 1] - count.index[part[0]])
    return Count(count.event[begin:end], count.index[begin:end] - count.index[begin], count.lead[begin : end - 1])


def check(minutes: Minutes, events: Events, count: Count, swings: Swings) -> None:
    """Refuse a count that codes or pendulums contradict.

    Raises
    ------
    RefusedError
        More codes are out of step than chance puts there, or all pendulums would have lost or gained part of a swing
        at once.
    """
    if minutes.residue is not None and minutes.against > max(1.0, DISAGREE * minutes.seen):
        raise RefusedError(
            f"film: {minutes.against} of {minutes.seen + minutes.against} minute codes are out of step with the count "
            "of marks; cut the film where marks are missing and read the parts one by one"
        )
    jump = np.nan_to_num(jumps(count.index.astype(np.float64), swings.at(count.event)))
    worst = int(np.argmax(jump))
    if jump[worst] > JUMP:
        raise RefusedError(
            f"film: near row {events.row[count.event[worst]]:.0f} all pendulums jump by {jump[worst]:.1f} rad against "
            "the count of marks; cut the film there and read the parts one by one"
        )


def marks_seen(axis: TimeAxis, strobe: Strobe) -> NDArray[np.int64]:
    """Numbers of the marks that a trace shows, (marks,).

    A mark in the turning points of all traces may be too faint to be searched for, and yet be read where it is due.
    """
    return np.union1d(axis.index, strobe.index[np.isfinite(strobe.position).any(axis=0)])


def marks_flags(axis: TimeAxis, strobe: Strobe) -> tuple[str, ...]:
    """What to distrust of the marks: the axis's flags, and marks that no trace shows."""
    seen = marks_seen(axis, strobe)
    missing = {
        "marks-many-missing": seen.size < (1.0 - MANY) * (axis.index[-1] - axis.index[0] + 1),
        "marks-long-gap": bool((np.diff(seen) * axis.interval > LONG).any()),
    }
    return (*axis.flags, *(name for name, holds in missing.items() if holds))
