"""Motion of the support, terms that add along each axis, and tilt of the case."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import Field, ValidationInfo, field_validator, model_validator

from data_schemas.scene_fields import Count, Label, Name, Number, Section, Seed, Switch, quantity

Numbers = tuple[Number, ...]
Axis = Literal["horizontal", "transverse", "vertical"]


_AXIS: Any = quantity("horizontal", "", "'horizontal' in the swing plane, 'transverse' to it, or 'vertical', up")
Column = Annotated[Count, Field(ge=1)] | Name


class Still(Section):
    """The support is at rest."""

    kind: Literal["still"] = quantity("still", "", "the support is at rest")

    @property
    def axis(self) -> Axis:
        """Nothing moves; counts as horizontal."""
        return "horizontal"


class Harmonics(Section):
    """Lists of harmonics, amplitude * cos(angular_frequency * t + phase) each."""

    amplitude: Numbers
    angular_frequency: Numbers | None = quantity(None, "rad s-1", "angular frequencies, 0 to 1e5; these or period")
    period: Numbers | None = quantity(None, "s", "period of each harmonic, above 1e-4; this or angular_frequency")
    phase: Numbers | None = quantity(None, "rad", "phase of each harmonic at t = 0; left out: all zero")

    @model_validator(mode="after")
    def _lists_agree(self) -> Self:
        given = [name for name in ("angular_frequency", "period") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("give either angular_frequency or period, not both")
        rates = getattr(self, given[0])
        if len(rates) != len(self.amplitude):
            raise ValueError(f"{given[0]} must have one number for each of the {len(self.amplitude)} amplitudes")
        if self.phase is not None and len(self.phase) != len(self.amplitude):
            raise ValueError(f"phase must have one number for each of the {len(self.amplitude)} amplitudes")
        if given[0] == "period" and min(rates) < 1e-4:
            raise ValueError("period must be at least 1e-4 s")
        if given[0] == "angular_frequency" and not (min(rates) >= 0 and max(rates) <= 1e5):
            raise ValueError("angular_frequency must be between 0 and 1e5 rad/s")
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

    @model_validator(mode="after")
    def _one_detuning(self) -> Self:
        if (self.detuning is None) == (self.beat_period is None):
            raise ValueError("give either detuning or beat_period")
        return self

    @property
    def axis(self) -> Axis:
        """A vertical motion near n does not resonate."""
        return "horizontal"

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
