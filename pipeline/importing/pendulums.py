"""Traces as combinations of pendulums, and the period of each pendulum."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import shown
from data_schemas.errors import UsageError

_LABEL = re.compile(r"[^\s=:-]{1,64}")


def combine(traces: Sequence[str], given: Mapping[str, str]) -> tuple[list[str], NDArray[np.float64]]:
    """Labels of the pendulums, and each trace as their combination (trace, pendulum).

    A trace is read from `given`, else from its own label: "1" is a pendulum, "1-2" a difference.

    `UsageError`: a combination that names no pendulums, or traces that repeat each other.

    Examples
    --------
    >>> combine(["1", "1-2"], {})
    (['1', '2'], array([[ 1.,  0.],
           [ 1., -1.]]))
    """
    for trace in given:
        if trace not in traces:
            raise UsageError(f"--combination {trace}=...: there is no trace '{trace}'; traces: {', '.join(traces)}")
    parts = {}
    for trace in traces:
        labels = given.get(trace, trace).split("-")
        if not all(_LABEL.fullmatch(label) for label in labels) or len(set(labels)) < len(labels):
            raise UsageError(
                f"trace '{trace}': '{given.get(trace, trace)}' is no combination of different pendulums; "
                f"write --combination {trace}=1 or {trace}=1-2"
            )
        parts[trace] = labels
    pendulums = sorted({label for labels in parts.values() for label in labels}, key=_natural)
    matrix = np.zeros((len(traces), len(pendulums)))
    for row, labels in enumerate(parts.values()):
        for order, label in enumerate(labels):
            matrix[row, pendulums.index(label)] = 1.0 if order == 0 else -1.0
    if len(traces) > 1 and np.linalg.matrix_rank(matrix) < len(traces):
        raise UsageError(
            f"traces {', '.join(traces)} repeat each other as combinations of pendulums; "
            "leave one out with --column, or correct --combination"
        )
    return pendulums, matrix


def periods(pendulums: Sequence[str], options: ImportOptions, *, needed: bool) -> NDArray[np.float64] | None:
    """Period of each pendulum in s; None if none was given nor is needed (a single trace does without).

    `UsageError`: a period of an unknown pendulum, or several traces without periods or without their gravity.
    """
    given = {label: constant("period", value) for label, value in options.periods.items()}
    known = ", ".join(pendulums)
    if "" in given:
        if len(pendulums) > 1:
            raise UsageError(f"--period {given['']:g}: there are pendulums {known}; write LABEL=SECONDS for each")
        given[pendulums[0]] = given.pop("")
    for label in given:
        if label not in pendulums:
            raise UsageError(f"--period {label}=...: there is no pendulum '{label}'; pendulums: {known}")
    if not given and not needed:
        return None
    for label in pendulums:
        if label not in given:
            raise UsageError(f"pendulum {label} has no period, which gravity needs; add --period {label}=SECONDS")
    if needed and options.gravity is None:
        raise UsageError("the gravity at which the periods hold is missing; add --gravity, in m/s2")
    return np.array([given[label] for label in pendulums])


def constant(name: str, value: Any) -> float:
    """A constant of the instrument, as a file or a program states it; `UsageError` if it is no number."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"instrument: {name} = {shown(repr(value))} is not a number; correct it") from None


def _natural(label: str) -> tuple[bool, int, str]:
    """Order labels as numbers where they are numbers: 2 before 10."""
    is_number = label.isascii() and label.isdigit()
    return not is_number, int(label) if is_number else 0, label


@dataclass(frozen=True)
class ImportOptions:
    """What the columns of the table mean; every default is the plainest reading.

    Attributes
    ----------
    time : str
        Name of the time column, or its number from 1; "" takes the first.
    columns : sequence of str
        Columns to import as NAME or NAME:TRACE; empty takes all but the time.
    unit : str
        "rad", "mrad", "deg" or "mm" (on the film); "" takes what a column's header says, else rad.
    lever : float, optional
        Optical lever, mm rad-1, positive; needed with and only with "mm".
    periods : mapping of str to float
        Full period at infinitesimal arc of each pendulum, s; the key "" means the only pendulum.
    gravity : float, optional
        Gravity at which the periods hold, m s-2.
    combinations : mapping of str to str
        Pendulums of a trace, such as {"upper": "1-2"}; a trace not named here is read from its own label.
    accelerations : mapping of str to str
        Column of "vertical_acceleration" or "horizontal_acceleration" of the support, m s-2.
    position : str
        "X,Y": columns of a bob's position, from which its angle is made about the circle through all of them.
    noise : float, optional
        1 sigma of the readings, in the table's unit.
    instrument : mapping
        Further variables of /instrument: a number, or one for each pendulum by its label; and `restoring`.
    """

    time: str = ""
    columns: Sequence[str] = ()
    unit: str = ""
    lever: float | None = None
    periods: Mapping[str, float] = field(default_factory=dict)
    gravity: float | None = None
    combinations: Mapping[str, str] = field(default_factory=dict)
    accelerations: Mapping[str, str] = field(default_factory=dict)
    position: str = ""
    noise: float | None = None
    instrument: Mapping[str, Any] = field(default_factory=dict)

    def radians_per_unit(self, header: str = "") -> float:
        """Factor to radians from the table's unit, which a column's header may say.

        `UsageError`: millimetres without a lever, a lever without millimetres, or a header that says another unit than
        asked for.
        """
        if self.unit and header and self.unit != header:
            raise UsageError(f"--unit {self.unit}: the header says {header}; drop --unit, or correct the header")
        unit = self.unit or header or "rad"
        if unit == "mm":
            if self.lever is None:
                raise UsageError("--unit mm needs --lever, the optical lever in mm per rad")
            return 1.0 / self.lever
        if self.lever is not None:
            raise UsageError(f"--lever is for elongations in mm; add --unit mm, or drop it with {unit}")
        return {"deg": math.radians(1.0), "mrad": 1e-3}.get(unit, 1.0)
