"""Tests of a count of marks against what else keeps time on the film: minute codes and pendulums."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.marks.counting import LEAST_LEAD, Count
from pipeline.film.marks.events import Events
from pipeline.film.marks.minutes import Minutes
from pipeline.film.parts import Floats

NEAR = 8  # marks on either side that a pendulum's phase is averaged over
JUMP = 1.0  # rad: a third of what one mark too many makes
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one


def check_minutes(minutes: Minutes) -> None:
    """Refuse a count that the minute codes contradict.

    Raises
    ------
    RefusedError
        More codes are out of step than chance puts there.
    """
    if minutes.residue is not None and minutes.against > max(1.0, DISAGREE * minutes.seen):
        raise RefusedError(
            f"film: {minutes.against} of {minutes.seen + minutes.against} minute codes are out of step with the count "
            "of marks; cut the film where marks are missing and read the parts one by one"
        )


def check_leads(codes: Floats, events: Events, count: Count) -> None:
    """Refuse a count that could as well be another, where no minute codes on both sides confirm it.

    Parameters
    ----------
    codes : array
        Numbers of the minute marks whose codes were seen and agree.

    Raises
    ------
    RefusedError
        Over some stretch the number of marks is uncertain.
    """
    for at in np.flatnonzero(count.lead < LEAST_LEAD):
        before, after = count.index[at], count.index[at + 1]
        if (codes <= before).any() and (codes >= after).any():
            continue
        raise RefusedError(
            f"film: {after - before - 1} marks in a row are missing after row {events.row[count.event[at]]:.0f} and "
            "their number is uncertain; cut the film there and read the parts one by one"
        )


def jumps(index: Floats, phase: Floats, advance: Floats) -> Floats:
    """Jump of the pendulums' phase from before each mark to after it, the smallest of all traces, rad; NaN = unknown.

    Parameters
    ----------
    index : (marks,) array
    phase : (traces, marks) array
    advance : (traces,) array
        Phase from mark to mark, rad.
    """
    out = np.full((len(phase), index.size), np.nan)
    for trace, each in enumerate(phase):
        if not np.isfinite(advance[trace]):
            continue
        known = np.flatnonzero(np.isfinite(each))
        turned = np.exp(1j * (each[known] - advance[trace] * index[known]))
        if known.size < 2 * NEAR:
            continue
        total = np.concatenate([[0.0], np.cumsum(turned)])
        sums = total[NEAR:] - total[:-NEAR]  # of NEAR marks, by their first
        # the slow part of the phase: what two neighbouring stretches of the same length differ by is the pendulum's own
        out[trace, known[NEAR : known.size - NEAR + 1]] = np.abs(np.angle(sums[NEAR:] * np.conj(sums[:-NEAR])))
    known_any = np.isfinite(out).any(axis=0)
    least = np.full(index.size, np.nan)
    least[known_any] = np.nanmin(out[:, known_any], axis=0)
    return least


def check_swings(index: Floats, rows: Floats, phase: Floats, advance: Floats) -> None:
    """Refuse a count by which all pendulums would have lost or gained part of a swing at once.

    Raises
    ------
    RefusedError
        They jump.
    """
    jump = jumps(index, phase, advance)
    if not np.isfinite(jump).any():
        return
    worst = int(np.nanargmax(jump))
    if jump[worst] > JUMP:
        raise RefusedError(
            f"film: near row {rows[worst]:.0f} all pendulums jump by {jump[worst]:.1f} rad against the count of marks; "
            "cut the film there and read the parts one by one"
        )
