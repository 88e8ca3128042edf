"""What the user says about the columns of a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from data_schemas.errors import UsageError


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
        "rad", "deg" or "mm" (on the film).
    lever : float, optional
        Optical lever, mm rad-1, positive; needed with and only with "mm".
    periods : mapping of str to float
        Full period at infinitesimal arc of each pendulum, s; the key "" means the only pendulum.
    gravity : float, optional
        Gravity at which the periods hold, m s-2.
    combinations : mapping of str to str
        Pendulums of a trace, such as {"upper": "1-2"}; a trace not named here is read from its own label.
    """

    time: str = ""
    columns: Sequence[str] = ()
    unit: str = "rad"
    lever: float | None = None
    periods: Mapping[str, float] = field(default_factory=dict)
    gravity: float | None = None
    combinations: Mapping[str, str] = field(default_factory=dict)

    def radians_per_unit(self) -> float:
        """Factor from the table's unit to radians.

        Raises
        ------
        UsageError
            Millimetres without a lever, or a lever without millimetres.
        """
        if self.unit == "mm":
            if self.lever is None:
                raise UsageError("--unit mm needs --lever, the optical lever in mm per rad")
            return 1.0 / self.lever
        if self.lever is not None:
            raise UsageError(f"--lever is for elongations in mm; add --unit mm, or drop it with {self.unit}")
        return math.radians(1.0) if self.unit == "deg" else 1.0
