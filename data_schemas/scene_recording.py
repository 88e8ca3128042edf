"""How a scene is recorded: traces, sample times, reading noise, every defect of a real film or logger; and its film.

A film comes to be in two steps: it is exposed (camera, clock, drive and lamp); then development, dirt and scanner.
"""

from fractions import Fraction
from typing import Literal, Self

from pydantic import model_validator

from data_schemas.scene_fields import (
    Count,
    Number,
    Rational,
    Section,
    Seed,
    Switch,
    TraceName,
    check_distinct,
    quantity,
    refuse,
)

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
        refuse(self.stop <= self.start, "stop must be after start")
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
        refuse(self.mark_gap >= self.gap_interval, "mark_gap must be shorter than gap_interval")
        refuse(self.outliers and not self.outlier_amplitude, "outliers need an outlier_amplitude above 0")
        refuse(self.outlier_amplitude and not self.outliers, "outlier_amplitude needs a number of outliers")
        least = float(self.step) + min((each.size for each in self.clock_steps), default=0.0)
        refuse(not least > 0, "clock_steps back by more than a sampling step make time run backwards")
        both = self.marks and self.sampling_rate != _DEFAULT_RATE
        refuse(both, "give either sampling_rate or marks = true; marks are mark_interval apart")
        refuse(not self.marks and self.mark_interval != _DEFAULT_MARKS, "mark_interval needs marks = true")
        check_distinct((trace.name for trace in self.traces or ()), "traces must have different names")
        refuse(self.traces == (), "traces must name at least one trace, or be left out")
        return self

    @property
    def step(self) -> Fraction:
        """Time between readings, s, by the chronometer."""
        return self.mark_interval if self.marks else 1 / self.sampling_rate


class FilmTrace(Section):
    """Where one trace of the record lies on the film; what is left out is that of the film."""

    name: TraceName = quantity(..., "", "name of the trace, as in the record")
    position: Number | None = quantity(None, "mm", "place across the paper; left out: spread evenly", ge=0, le=2000)
    offset: Number = quantity(0.0, "mm", "how much later along the film this trace is written", ge=-100, le=100)
    lever: Number | None = quantity(None, "mm rad-1", "deflection per elongation; left out: the film's", gt=0, le=1e6)


class Dimming(Stretch):
    """A stretch of time in which the lamp is weak; `[10, 20, 0.15]` says the same as the three keys."""

    factor: Number = quantity(..., "1", "light that is left of the lamp's", ge=0, le=10)


class Film(Section):
    """A film and its scan. Every defect is absent unless it is named.

    Characteristic curve: density = fog + (density_max - fog) / (1 + (half_exposure / exposure)^gamma).

    Examples
    --------
    >>> Film(speed=1.5, grain=0.05).gap
    0.03
    """

    # optics and layout; dimensions of historic cameras were found in no source: these are assumed
    speed: Number = quantity(5.0, "mm s-1", "nominal speed of the film", gt=0, le=200)
    paper_width: Number = quantity(127.0, "mm", "width of the paper", ge=5, le=2000)
    margin: Number = quantity(10.0, "mm", "blank film before the start and after the end", ge=0, le=10_000)
    spot: Number = quantity(0.10, "mm", "1 sigma of the spot of light, a Gaussian", ge=0.005, le=5)
    lever: Number = quantity(2000.0, "mm rad-1", "optical lever: deflection on the film per elongation", gt=0, le=1e6)
    traces: tuple[FilmTrace, ...] = quantity((), "", "place, offset and lever of single traces, by name")
    lamp: Number = quantity(1.0, "1", "exposure on the axis of a line at rest at nominal speed", gt=0, le=1e3)
    blackouts: tuple[Stretch, ...] = quantity((), "", "stretches with the lamp off, as [start, stop] in s")
    dimmings: tuple[Dimming, ...] = quantity((), "", "stretches with the lamp weak, as [start, stop, factor]")
    # the chronometer's shutter: closed for a moment, centred on every mark
    mark_interval: Number = quantity(0.5, "s", "time between the chronometer's marks", ge=0.01, le=3600)
    gap: Number = quantity(0.03, "s", "how long the shutter is closed, centred on the mark; 0: no marks", ge=0, le=10)
    minute_code: Number = quantity(0.125, "s", "second closing after each full minute; 0: never", ge=0, le=60)
    missing_marks: Number = quantity(0.0, "1", "part of the marks at which the shutter stays open", ge=0, le=1)
    spurious_marks: Count = quantity(0, "1", "number of gaps at random that are no marks", ge=0, le=1_000_000)
    # how the paper runs, and what becomes of it when it dries
    drift: Number = quantity(0.0, "1", "part by which the speed changes from start to end", ge=-0.5, le=0.5)
    wow: Number = quantity(0.0, "1", "amplitude of a periodic error of the speed, as part of it", ge=0, le=0.5)
    wow_period: Number = quantity(7.0, "s", "period of that error", ge=0.1, le=1e5)
    walk: Number = quantity(0.0, "1", "rms of a random error of the speed, as part of it", ge=0, le=0.1)
    walk_time: Number = quantity(5.0, "s", "time over which the random error is correlated", ge=0.5, le=1e5)
    stretch_along: Number = quantity(0.0, "1", "part by which the paper is longer than when exposed", ge=-0.1, le=0.1)
    stretch_across: Number = quantity(0.0, "1", "part by which it is wider", ge=-0.1, le=0.1)
    skew: Number = quantity(0.0, "degrees", "shear: column c falls tan(skew) * c rows further along", ge=-20, le=20)
    # what development shows of the light
    fog: Number = quantity(0.1, "1", "density of what was not exposed", ge=0, le=3)
    density_max: Number = quantity(1.5, "1", "density of what was exposed without end", gt=0, le=6)
    half_exposure: Number = quantity(0.2, "1", "exposure that gives half of the range", gt=0, le=1e3)
    gamma: Number = quantity(1.5, "1", "steepness of the curve", ge=0.2, le=10)
    grain: Number = quantity(0.0, "1", "1 sigma of a pixel at 300 dpi where density is 1; as its root", ge=0, le=1)
    fog_gradient: Number = quantity(0.0, "1", "fog of the right edge less that of the left", ge=-2, le=2)
    # what chance and people leave on a film
    dust: Number = quantity(0.0, "dm-2", "specks and pinholes on each square decimetre", ge=0, le=1e4)
    scratches: Number = quantity(0.0, "m-1", "scratches along each metre of film", ge=0, le=1e3)
    handwriting: Count = quantity(0, "1", "notes written on the film", ge=0, le=1000)
    torn_end: Number = quantity(0.0, "mm", "length of film that is torn off at its end", ge=0, le=1e6)
    # the image that is made of the film
    dpi: Number = quantity(300.0, "inch-1", "pixels to the inch", ge=50, le=4800)
    bits: Literal[8, 16] = quantity(8, "1", "bits of a pixel")
    polarity: Literal["negative", "positive"] = quantity("negative", "", "'negative': dark lines on light paper")
    upside_down: Switch = quantity(False, "", "whether the film lay in the scanner turned by half a turn")
    rotation: Number = quantity(0.0, "degrees", "turn in the scanner; positive: its end is further right", ge=-5, le=5)
    vignette: Number = quantity(0.0, "1", "part of the light lost at the image's left and right edge", ge=0, lt=1)
    blur: Number = quantity(0.0, "1", "1 sigma of the scanner's blur, px", ge=0, le=10)
    seed: Seed | None = quantity(None, "1", "all chance of the film comes from this number; left out: the scene's")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_distinct((trace.name for trace in self.traces), "traces must have different names")
        refuse(self.gap > 0.5 * self.mark_interval, "gap must be at most half of mark_interval")
        wrong = self.minute_code and not self.gap < self.minute_code < self.mark_interval - self.gap
        refuse(wrong, "minute_code must be longer than the gap and shorter than mark_interval less the gap, or 0")
        slowest = 1.0 - max(-self.drift, 0.0) - self.wow - 4.0 * self.walk
        refuse(slowest < 0.1, "drift, wow and walk together would stop the film; make them smaller")
        darkest = self.fog + abs(self.fog_gradient)
        refuse(self.density_max <= darkest, "density_max must be above the fog, its gradient included")
        return self
