"""What is to be distrusted of a time axis, by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Strobe, TimeAxis

MANY, LONG = 0.1, 5.0  # share of marks missing; s

MEANINGS = {
    "marks-without-minute-code": "no minute code was found: the count of marks is checked by the pendulums alone",
    "marks-direction-unknown": "the marks do not tell in which direction the film ran",
    "marks-codes-disagree": "a minute code is out of step with the count of marks: the film may have stood still",
    "marks-offset-unsure": "the traces' offset along the film may be wrong by the distance of one mark",
    "marks-many-missing": "more than a tenth of the marks were not found",
    "marks-long-gap": "over more than five seconds no mark was found",
    "marks-false": "gaps were found that are neither marks nor minute codes",
    "marks-one-trace": "only one trace shows the marks",
}


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
