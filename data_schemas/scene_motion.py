"""What acts on the apparatus: motion of the support, tilt of the case, the course of gravity, heat, air and way."""

import math
import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import Field, ValidationInfo, field_validator, model_validator

from data_schemas.scene_fields import Count, Label, Name, Number, Section, Seed, Switch, quantity, refuse

Numbers = tuple[Number, ...]
Axis = Literal["horizontal", "transverse", "vertical"]


_AXIS: Any = quantity("horizontal", "", "'horizontal' in the swing plane, 'transverse' to it, or 'vertical', up")
Column = Annotated[Count, Field(ge=1)] | Name


class Still(Section):
    """The support is at rest."""

    kind: Literal["still"] = quantity("still", "", "the support is at rest")
    axis: ClassVar[Axis] = "horizontal"


class Harmonics(Section):
    """Lists of harmonics, amplitude * cos(angular_frequency * t + phase) each."""

    amplitude: Numbers
    angular_frequency: Numbers | None = quantity(None, "rad s-1", "angular frequencies, 0 to 1e5; these or period")
    period: Numbers | None = quantity(None, "s", "period of each harmonic, above 1e-4; this or angular_frequency")
    phase: Numbers | None = quantity(None, "rad", "phase of each harmonic at t = 0; left out: all zero")

    @model_validator(mode="after")
    def _lists_agree(self) -> Self:
        given = [name for name in ("angular_frequency", "period") if getattr(self, name) is not None]
        refuse(len(given) != 1, "give either angular_frequency or period, not both")
        rates, count = getattr(self, given[0]), len(self.amplitude)
        for name, values in ((given[0], rates), ("phase", self.phase)):
            wrong = values is not None and len(values) != count
            refuse(wrong, f"{name} must have one number for each of the {count} amplitudes")
        if given[0] == "period":
            refuse(min(rates) < 1e-4, "period must be at least 1e-4 s")
        else:
            within = min(rates) >= 0 and max(rates) <= 1e5
            refuse(not within, "angular_frequency must be between 0 and 1e5 rad/s")
        return self


class HarmonicMotion(Harmonics):
    """Acceleration x'' = sum of amplitude * cos(angular_frequency * t + phase)."""

    kind: Literal["harmonics"] = quantity("harmonics", "", "a sum of harmonics of the acceleration")
    amplitude: Numbers = quantity(..., "m s-2", "amplitude of each harmonic of x''", min_length=1)
    axis: Axis = _AXIS


class NearResonantMotion(Section):
    """One harmonic of circular frequency m close to a pendulum's n, with n - m = 2 nu (P 29)."""

    kind: Literal["near-resonant"] = quantity("near-resonant", "", "one harmonic close to a pendulum's frequency")
    amplitude: Number = quantity(..., "m s-2", "amplitude of the acceleration", ge=0, le=100)
    detuning: Number | None = quantity(None, "rad s-1", "nu, half of n less the motion's frequency", ge=-10, le=10)
    beat_period: Number | None = quantity(None, "s", "time between zeros of the beat, pi/nu; instead of detuning", gt=0)
    phase: Number = quantity(0.0, "rad", "phase of the acceleration at t = 0", ge=-100, le=100)
    pendulum: Label | None = quantity(None, "", "label of the pendulum it is close to; left out: the first")
    axis: ClassVar[Axis] = "horizontal"  # a vertical motion near n does not resonate

    @model_validator(mode="after")
    def _one_detuning(self) -> Self:
        refuse((self.detuning is None) == (self.beat_period is None), "give either detuning or beat_period")
        return self

    @property
    def nu(self) -> float:
        """Half the difference of the circular frequencies, rad/s."""
        return self.detuning if self.detuning is not None else math.pi / cast(float, self.beat_period)


class SeaMotion(Section):
    """Acceleration of a vessel carried by the orbital motion of a wind sea in deep water.

    Two terms with one seed, one for each axis, make the orbits: the vertical motion leads by a quarter.
    """

    kind: Literal["sea"] = quantity("sea", "", "a sea state")
    spectrum: Literal["jonswap", "pierson-moskowitz"] = quantity("jonswap", "", "peak factor 3.3 or 1")
    significant_height: Number = quantity(..., "m", "four times the rms elevation of the sea", ge=0, le=30)
    peak_period: Number = quantity(..., "s", "period at the peak of the spectrum", ge=1, le=60)
    depth: Number = quantity(0.0, "m", "immersion d of the vessel; every wave is reduced by exp(-k d)", ge=0, le=1000)
    direction: Number = quantity(0.0, "degrees", "direction from the swing plane; 90: across", ge=-360, le=360)
    cutoff: Number = quantity(3.0, "1", "highest frequency over the peak's; sets the rms acceleration", gt=0.6, le=40)
    components: Count = quantity(64, "1", "number of harmonics that make up the sea", ge=1, le=100_000)
    seed: Seed | None = quantity(None, "1", "left out: derived from the scene's")
    axis: Axis = _AXIS


class Table(Section):
    """A series over time: a column of a CSV or netCDF file."""

    section: ClassVar[str] = "motion"  # Where in a scene it stands, for messages
    file: Name = quantity(..., "", "CSV or netCDF, from the scene's folder")
    time: Column = quantity(1, "", "column of the times in s: a name, or a number counted from 1")
    value: Column = quantity(2, "", "column of the values: a name, or a number counted from 1")
    factor: Number = quantity(1.0, "1", "what turns the column into m s-2", ge=-1e6, le=1e6)
    begin: Number | None = quantity(None, "s", "the table's time at which the record begins; left out: its first")
    interpolation: Literal["band-limited", "spline"] = quantity("band-limited", "", "'spline' for uneven steps")

    @field_validator("file")
    @classmethod
    def _beside_the_scene(cls, value: str, info: ValidationInfo) -> str:
        """Make the path stand on its own, so that a loaded scene does not depend on the current folder.

        A scene of anybody's making reads no file of whoever simulates it.
        """
        context = info.context or {}
        folder = context.get("folder")
        if folder is None:
            return value
        path = folder / value
        within = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
        if not within and not context.get("anywhere"):
            raise ValueError("a table lies beside its scene or below; put it there, or give --allow-paths")
        return str(path)


class TabulatedMotion(Table):
    """An acceleration that was recorded: a column of a CSV or netCDF file."""

    kind: Literal["tabulated"] = quantity("tabulated", "", "a recorded series of accelerations")
    axis: Axis = _AXIS


Motion = Annotated[
    Still | HarmonicMotion | NearResonantMotion | SeaMotion | TabulatedMotion, Field(discriminator="kind")
]


class HarmonicTilt(Harmonics):
    """tilt = sum of amplitude * cos(angular_frequency * t + phase)."""

    kind: Literal["harmonics"] = quantity("harmonics", "", "a sum of harmonics of the angle")
    amplitude: Numbers = quantity(..., "rad", "amplitude of each harmonic of the angle", min_length=1)


class TabulatedTilt(Table):
    """An angle that was recorded: a column of a CSV or netCDF file, times its factor in rad."""

    kind: Literal["tabulated"] = quantity("tabulated", "", "a recorded series of angles")


class GimbalTilt(Section):
    """The case follows the apparent vertical as a damped pendulum does.

    b'' + 2 damping w b' + w^2 b = w^2 a/g, with w = 2 pi/period and a the acceleration of the support along the axis.
    """

    kind: Literal["gimbal"] = quantity("gimbal", "", "the case follows the apparent vertical")
    period: Number = quantity(..., "s", "own period of the gimbal; one shorter than the sea's follows", gt=0, le=1e4)
    damping: Number = quantity(0.5, "1", "part of critical damping", gt=0, le=100)


Tilt = Annotated[HarmonicTilt | TabulatedTilt | GimbalTilt, Field(discriminator="kind")]


class Case(Section):
    """The case of the apparatus, which tilts.

    A pitch, within the plane of swing, leaves the pendulums alone, but elongations that are measured from the case lack
    it; a roll turns the plane of swing itself out of the vertical. Both are positive as elongations are.
    """

    pitch: Tilt | None = quantity(None, "", "tilt in the plane of swing: kind = 'harmonics', 'tabulated' or 'gimbal'")
    roll: Tilt | None = quantity(None, "", "tilt of the plane of swing across it, of the same kinds")
    reference: Literal["vertical", "case"] = quantity("case", "", "what the elongations are measured from")
    write_tilt: Switch = quantity(False, "", "whether the record carries the tilt within the plane of swing")
    tilt_noise: Number = quantity(0.0, "rad", "1 sigma of white noise of that tilt", ge=0, le=1)


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


def _error(unit: str, of: str) -> Any:
    return quantity(0.0, unit, f"1 sigma of the error of the record's {of}, which states it", ge=0, le=1e4)


class Conditions(Section):
    """Heat, air, tilt, turn and way of the ship; what is left out does not act and is not in the record.

    The periods of the pendulums hold at temperature_reference in vacuum. A stated uncertainty makes the record's value
    wrong by a draw of that size from the scene's seed.
    """

    temperature: Number | None = quantity(None, "K", "mean temperature of the pendulums", ge=100, le=500)
    temperature_reference: Number = quantity(288.15, "K", "temperature at which the periods hold", ge=100, le=500)
    temperature_amplitude: Number = quantity(0.0, "K", "amplitude of a sine within the record", ge=0, le=100)
    temperature_period: Number = quantity(86400.0, "s", "period of that sine", ge=60, le=1e8)
    temperature_phase: Number = quantity(0.0, "rad", "phase of its sine at t = 0", ge=-100, le=100)
    temperature_uncertainty: Number = _error("K", "temperature")
    air_density: Number | None = quantity(None, "kg m-3", "density of the air in the case", ge=0, le=100)
    air_density_reference: Number = quantity(1.2, "kg m-3", "density at which density_coefficient holds", gt=0, le=100)
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
    base_period_uncertainty: Number = quantity(0.0, "s", "1 sigma of the periods at bases, stated", ge=0, le=1)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        half = (self.speed is None) != (self.course is None) or (self.speed is not None and self.latitude is None)
        refuse(half, "the ship's way needs latitude, speed and course together")
        refuse(self.tide and None in (self.latitude, self.longitude), "tide needs latitude and longitude")
        lacking = self.temperature_amplitude and self.temperature is None
        refuse(lacking, "temperature_amplitude needs the mean temperature")
        for name in ("temperature", "air_density", "tilt", "yaw_rate", "speed", "course"):
            lacking = getattr(self, f"{name}_uncertainty") and getattr(self, name) is None
            refuse(lacking, f"{name}_uncertainty needs {name}")
        refuse(self.base_period_uncertainty and not self.bases, "base_period_uncertainty needs bases")
        times = [base.time for base in self.bases]
        refuse(sorted(set(times)) != times, "bases must be in order of time")
        return self
