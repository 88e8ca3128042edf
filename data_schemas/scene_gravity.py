"""Gravity that changes over the record, as on a ship that crosses an anomaly; the change is added to `gravity`."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from data_schemas.scene_fields import Number, Section, quantity
from data_schemas.scene_motion import Table

LARGEST_CHANGE = 1e-2
"""Of gravity: 10 Gal, far more than a ship meets."""


class LinearCourse(Section):
    """gravity + rate * t."""

    kind: Literal["linear"] = quantity("linear", "", "gravity changes evenly")
    rate: Number = quantity(..., "m s-3", "change of gravity in a second; 1 mGal an hour is 2.8e-9", ge=-1, le=1)


class SineCourse(Section):
    """gravity + amplitude * sin(2 pi t/period + phase)."""

    kind: Literal["sine"] = quantity("sine", "", "gravity swings about its mean")
    amplitude: Number = quantity(..., "m s-2", "largest change of gravity", ge=-1, le=1)
    period: Number = quantity(..., "s", "time of a full cycle", ge=10, le=1e9)
    phase: Number = quantity(0.0, "rad", "phase of the sine at t = 0", ge=-100, le=100)


class TableCourse(Table):
    """Gravity + a column of a CSV or netCDF file, given as a tabulated motion is."""

    section: ClassVar[str] = "gravity_course"
    kind: Literal["table"] = quantity("table", "", "gravity changes as a table says")


GravityCourse = Annotated[LinearCourse | SineCourse | TableCourse, Field(discriminator="kind")]
