"""Conditions of a scene that change the pendulums' periods, and what the record states of them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from data_schemas.scene_fields import Number, Section, Switch, quantity
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


class BaseStation(Section):
    """An occupation of a base station, before or after."""

    label: Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_. +-]{1,40}$")] = quantity(..., "", "its name")
    time: Number = quantity(..., "s", "when, from the record's start; negative before it", ge=-1e9, le=1e9)
    gravity: Number = quantity(..., "m s-2", "gravity of the station", ge=0.1, le=100)


def _error(unit: str, of: str) -> Number:
    number: Number = quantity(
        0.0, unit, f"1 sigma by which the record's {of} is off; the record states it", ge=0, le=1e4
    )
    return number


class Conditions(Section):
    """Heat, air, tilt, turn and way of the ship; what is left out does not act and is not in the record.

    The periods of the pendulums hold at temperature_reference in vacuum. A stated uncertainty makes the record's value
    wrong by a draw of that size from the scene's seed.
    """

    temperature: Number | None = quantity(None, "K", "mean temperature of the pendulums", ge=100, le=500)
    temperature_reference: Number = quantity(288.15, "K", "temperature at which the periods hold", ge=100, le=500)
    temperature_amplitude: Number = quantity(
        0.0, "K", "half the range of a sinusoidal course within the record", ge=0, le=100
    )
    temperature_period: Number = quantity(86400.0, "s", "period of that course", ge=60, le=1e8)
    temperature_phase: Number = quantity(0.0, "rad", "phase of its sine at t = 0", ge=-100, le=100)
    temperature_uncertainty: Number = _error("K", "temperature")
    air_density: Number | None = quantity(None, "kg m-3", "density of the air in the case", ge=0, le=100)
    air_density_reference: Number = quantity(
        1.2, "kg m-3", "density of the air that lengthens the periods by density_coefficient", gt=0, le=100
    )
    air_density_uncertainty: Number = _error("kg m-3", "air density")
    tilt: Number | None = quantity(None, "rad", "angle of the plane of swing out of the vertical", ge=-0.5, le=0.5)
    tilt_uncertainty: Number = _error("rad", "tilt")
    yaw_rate: Number | None = quantity(None, "rad s-1", "rate of turn of the plane of swing", ge=-1, le=1)
    yaw_rate_uncertainty: Number = _error("rad s-1", "rate of turn")
    latitude: Number | None = quantity(None, "degrees", "latitude, north positive", ge=-90, le=90)
    longitude: Number | None = quantity(None, "degrees", "longitude, east positive", ge=-360, le=360)
    height: Number | None = quantity(None, "m", "height above the sea's surface", ge=-1.2e4, le=1e4)
    tide: Switch = quantity(False, "", "whether the tide of a yielding Earth acts; it needs latitude and longitude")
    speed: Number | None = quantity(None, "m s-1", "speed of the ship over ground", ge=0, le=100)
    course: Number | None = quantity(None, "degrees", "course over ground, from north by east", ge=-360, le=360)
    speed_uncertainty: Number = _error("m s-1", "speed")
    course_uncertainty: Number = _error("degrees", "course")
    chronometer_rate_uncertainty: Number = _error("s day-1", "chronometer rate")
    bases: tuple[BaseStation, ...] = quantity((), "", "occupations of base stations, in order of time")
    base_period_uncertainty: Number = quantity(
        0.0, "s", "1 sigma of a period that was measured at a base; the record states it", ge=0, le=1
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.speed is None) != (self.course is None) or (self.speed is not None and self.latitude is None):
            raise ValueError("the ship's way needs latitude, speed and course together")
        if self.tide and (self.latitude is None or self.longitude is None):
            raise ValueError("tide needs latitude and longitude")
        if self.temperature_amplitude and self.temperature is None:
            raise ValueError("temperature_amplitude needs the mean temperature")
        for name in ("temperature", "air_density", "tilt", "yaw_rate", "speed", "course"):
            if getattr(self, f"{name}_uncertainty") and getattr(self, name) is None:
                raise ValueError(f"{name}_uncertainty needs {name}")
        if self.base_period_uncertainty and not self.bases:
            raise ValueError("base_period_uncertainty needs bases")
        times = [base.time for base in self.bases]
        if sorted(set(times)) != times:
            raise ValueError("bases must be in order of time")
        return self
