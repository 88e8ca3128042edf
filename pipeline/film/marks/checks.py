"""Tests of a count of marks against minute codes and pendulums, and what is to be distrusted of a time axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import Count
from pipeline.film.marks.minutes import Minutes, code_marks
from pipeline.film.marks.swings import Swings, jumps
from pipeline.film.parts import Strobe, TimeAxis

LEAST_LEAD = 12.0  # of the best count before any other
JUMP = 1.0  # rad: a third of what one mark too many makes
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one
MANY, LONG = 0.1, 5.0  # share of marks missing; s


def check(minutes: Minutes, events: Events, count: Count, swings: Swings, interval: float) -> None:
    """Refuse a count that codes or pendulums contradict, or that could as well be another.

    Raises
    ------
    RefusedError
        More codes are out of step than chance puts there; or over some stretch that no codes on both sides confirm the
        number of marks is uncertain; or all pendulums would have lost or gained part of a swing at once.
    """
    if minutes.residue is not None and minutes.against > max(1.0, DISAGREE * minutes.seen):
        raise RefusedError(
            f"film: {minutes.against} of {minutes.seen + minutes.against} minute codes are out of step with the count "
            "of marks; cut the film where marks are missing and read the parts one by one"
        )
    codes = code_marks(minutes, events, count, interval)
    for at in np.flatnonzero(count.lead < LEAST_LEAD):
        before, after = count.index[at], count.index[at + 1]
        if not ((codes <= before).any() and (codes >= after).any()):
            raise RefusedError(
                f"film: {after - before - 1} marks in a row are missing after row {events.row[count.event[at]]:.0f} "
                "and their number is uncertain; cut the film there and read the parts one by one"
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
