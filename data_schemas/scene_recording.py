"""How a scene is recorded: traces, sample times, reading noise and every defect of a real film or logger."""

from __future__ import annotations

from fractions import Fraction
from typing import Literal, Self

from pydantic import model_validator

from data_schemas.scene_fields import Count, Number, Rational, Section, Switch, TraceName, check_distinct, quantity

_DEFAULT_RATE = Fraction(25)  # Hz
_DEFAULT_MARKS = Fraction(1, 2)  # s


class Trace(Section):
    """One line of the record: a combination of the pendulums' angles."""

    name: TraceName = quantity(..., "", "name of the trace; no two alike")
    combination: dict[str, Number] = quantity(..., "1", "factors by pendulum, such as {1 = 1, 2 = -1}", min_length=1)


class Stretch(Section):
    """A stretch of time; the list `[10, 20]` says the same as `{start = 10, stop = 20}`."""

    start: Number = quantity(..., "s", "first moment", ge=0)
    stop: Number = quantity(..., "s", "end; the reading at this moment stands", gt=0)

    @model_validator(mode="before")
    @classmethod
    def _from_list(cls, value: object) -> object:
        if isinstance(value, list | tuple) and 2 <= len(value) <= len(cls.model_fields):
            return dict(zip(cls.model_fields, value, strict=False))
        return value

    @model_validator(mode="after")
    def _forwards(self) -> Self:
        if self.stop <= self.start:
            raise ValueError("stop must be after start")
        return self


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
    lever: Number = quantity(0.0, "1", "turn of light over pendulum: 2 by a mirror; 0: no tangent", ge=0, le=4)
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
    frame: Literal["earth", "case"] = quantity("earth", "", "'case' adds gravity times the tilt to a horizontal one")


class Recording(Section):
    """What is written down of the motion."""

    traces: tuple[Trace, ...] | None = quantity(None, "", "left out: the first pendulum and successive differences")
    sampling_rate: Rational = quantity(_DEFAULT_RATE, "Hz", "samples a second of the chronometer, or a ratio as '25/3'")
    marks: Switch = quantity(False, "", "readings at the time marks only, one every mark_interval")
    mark_interval: Rational = quantity(_DEFAULT_MARKS, "s", "time between marks, if marks = true")
    jitter: Number = quantity(0.0, "s", "1 sigma of the sampling instants, which the record states", ge=0, le=10)
    drop_fraction: Number = quantity(0.0, "1", "part of the readings that are absent, time and all", ge=0, le=0.95)
    noise: Number = quantity(0.0, "rad", "1 sigma of white noise, independent in each trace", ge=0, le=1)
    quantisation: Number = quantity(0.0, "rad", "step to which samples are rounded; 0: not rounded", ge=0, le=1)
    gap_interval: Number = quantity(60.0, "s", "time between the marks that blot out the trace", gt=0, le=1e6)
    mark_gap: Number = quantity(0.0, "s", "time lost at every such mark, from the mark on", ge=0, le=1e5)
    missing: tuple[Stretch, ...] = quantity((), "", "stretches without readings, as {start, stop}")
    missing_samples: Count = quantity(0, "1", "samples missing at random, in each trace", ge=0, le=100_000_000)
    outliers: Count = quantity(0, "1", "number of outliers at random, in each trace", ge=0, le=100_000_000)
    outlier_amplitude: Number = quantity(0.0, "rad", "size of the error of an outlier; its sign is random", ge=0, le=10)
    chronometer_rate: Number = quantity(0.0, "s day-1", "r: true time = its time * (1 + r/86400)", ge=-1000, le=1000)
    errors: tuple[TraceErrors, ...] = quantity((), "", "errors of single traces, or of all; they follow each other")
    clock_steps: tuple[Step, ...] = quantity((), "", "steps of the record's time, as {time, size} in s")
    wow: Wow | None = quantity(None, "", "a periodic error of the record's time")
    record_uncertainty: Switch | None = quantity(None, "", "whether its noise is stated; left out: if there is any")
    horizontal_acceleration: Switch | Accelerometer = quantity(False, "", "whether it is recorded; or its errors")
    vertical_acceleration: Switch | Accelerometer = quantity(False, "", "whether it is recorded; or its errors")
    write_damping: Switch = quantity(True, "", "whether the record states the damping rates")
    write_restoring: Switch = quantity(True, "", "whether the record states the restoring law")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.mark_gap >= self.gap_interval:
            raise ValueError("mark_gap must be shorter than gap_interval")
        if self.outliers and not self.outlier_amplitude:
            raise ValueError("outliers need an outlier_amplitude above 0")
        if self.outlier_amplitude and not self.outliers:
            raise ValueError("outlier_amplitude needs a number of outliers")
        if self.clock_steps and not float(self.step) + min(0.0, *(each.size for each in self.clock_steps)) > 0:
            raise ValueError("clock_steps back by more than a sampling step make time run backwards")
        if self.marks and self.sampling_rate != _DEFAULT_RATE:
            raise ValueError("give either sampling_rate or marks = true; marks are mark_interval apart")
        if not self.marks and self.mark_interval != _DEFAULT_MARKS:
            raise ValueError("mark_interval needs marks = true")
        check_distinct((trace.name for trace in self.traces or ()), "traces must have different names")
        if self.traces is not None and not self.traces:
            raise ValueError("traces must name at least one trace, or be left out")
        return self

    @property
    def step(self) -> Fraction:
        """Time between readings, s, by the chronometer."""
        return self.mark_interval if self.marks else 1 / self.sampling_rate
