"""What a real apparatus adds: a case that tilts, errors of traces, of the clock and of accelerometers, handling."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from data_schemas.scene_fields import Label, Number, Section, Switch, TraceName, quantity
from data_schemas.scene_motion import Harmonics, Numbers, Table


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

    pitch: Tilt | None = quantity(
        None,
        "",
        "tilt within the plane of swing: kind = 'harmonics', 'tabulated' or 'gimbal'",
    )
    roll: Tilt | None = quantity(None, "", "tilt of the plane of swing across it, of the same kinds")
    reference: Literal["vertical", "case"] = quantity(
        "case", "", "what the record's elongations are measured from: 'vertical' or 'case'"
    )
    write_tilt: Switch = quantity(False, "", "whether the record carries the tilt within the plane of swing")
    tilt_noise: Number = quantity(0.0, "rad", "1 sigma of white noise of that tilt", ge=0, le=1)


class Step(Section):
    """A value that changes at once."""

    time: Number = quantity(..., "s", "when, by the chronometer", ge=0)
    size: Number = quantity(..., "", "by how much", ge=-1e3, le=1e3)


class TraceErrors(Section):
    """What is wrong with the reading of one trace, or of all.

    An angle x becomes `(1 + scale) (tan(lever x)/lever + cubic x^3) + zero + drift (t - half the record) + steps`,
    clipped; read at the time less `delay`.
    """

    trace: TraceName | None = quantity(None, "", "name of the trace; left out: all traces")
    zero: Number = quantity(0.0, "rad", "what stands for an angle of zero", ge=-1, le=1)
    drift: Number = quantity(0.0, "rad", "change of the zero over the record; none in its middle", ge=-1, le=1)
    steps: tuple[Step, ...] = quantity((), "", "steps of the zero, as {time, size} in s and rad")
    scale: Number = quantity(0.0, "1", "relative error of the scale", gt=-1, le=10)
    cubic: Number = quantity(0.0, "rad-2", "factor of the cube of the angle", ge=-1e3, le=1e3)
    lever: Number = quantity(
        0.0,
        "1",
        "turns of the light to one of the pendulum, on a flat film: 2 with a mirror; 0: no tangent",
        ge=0,
        le=4,
    )
    clip: Number | None = quantity(None, "rad", "largest elongation that is read; left out: any", gt=0, le=10)
    delay: Number = quantity(0.0, "s", "time by which the trace comes late", ge=-1, le=1)


class Wow(Section):
    """Times that are off periodically, as those of a film drive."""

    amplitude: Number = quantity(..., "s", "largest error of the record's time", ge=0, le=1)
    period: Number = quantity(..., "s", "period of the error", ge=0.1, le=1e6)
    phase: Number = quantity(0.0, "rad", "phase of its sine at t = 0", ge=-100, le=100)


class Accelerometer(Section):
    """A recorded acceleration of the support, with its errors: (1 + scale) a(t - delay) + bias + noise."""

    bias: Number = quantity(0.0, "m s-2", "what it reads at rest; 9.81 where gravity is in it", ge=-100, le=100)
    scale: Number = quantity(0.0, "1", "relative error of the scale; -2 for a wrong sign", ge=-100, le=100)
    delay: Number = quantity(0.0, "s", "time by which it comes late", ge=-10, le=10)
    noise: Number = quantity(0.0, "m s-2", "1 sigma of its white noise", ge=0, le=100)
    missing: tuple[tuple[Number, Number], ...] = quantity((), "", "stretches without values, as [start, stop] in s")
    frame: Literal["earth", "case"] = quantity(
        "earth", "", "of the horizontal one: 'case' adds gravity times the tilt within the plane of swing"
    )


class Event(Section):
    """Something done to one pendulum, at the nearest of even instants, 16 or more a period; the truth says when."""

    pendulum: Label = quantity(..., "", "label of the pendulum")
    time: Number = quantity(..., "s", "true time", gt=0, le=1e8)


class Knock(Event):
    """A sudden change of the angular velocity."""

    kind: Literal["knock"] = quantity("knock", "", "the angular velocity changes at once")
    change: Number = quantity(..., "rad", "change of theta'/n", ge=-10, le=10)


class Restart(Event):
    """The pendulum is started anew by hand."""

    kind: Literal["restart"] = quantity("restart", "", "the pendulum is started anew")
    angle: Number = quantity(..., "rad", "angle from which it goes on", ge=-10, le=10)
    angular_velocity: Number = quantity(0.0, "rad s-1", "with this angular velocity", ge=-100, le=100)


class Release(Event):
    """The pendulum is held until then, and released."""

    kind: Literal["release"] = quantity("release", "", "the pendulum is held at an angle until it is released")
    angle: Number = quantity(..., "rad", "angle at which it is held", ge=-10, le=10)


class Clamp(Event):
    """The pendulum stands still from then on."""

    kind: Literal["clamp"] = quantity("clamp", "", "the pendulum is clamped and stands still from then on")
    angle: Number = quantity(0.0, "rad", "angle at which it stands", ge=-10, le=10)


Handling = Annotated[Knock | Restart | Release | Clamp, Field(discriminator="kind")]
