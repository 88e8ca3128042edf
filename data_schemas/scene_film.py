"""The section `film` of a scene: a photographic film exposed to the traces, with every defect a film may have.

First how it is exposed: camera, clock, drive and lamp; then what becomes of it: development, dirt, scanner.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from data_schemas.scene_fields import Count, Number, Section, Seed, Switch, TraceName, check_distinct, quantity
from data_schemas.scene_recording import Stretch


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
        if self.gap > 0.5 * self.mark_interval:
            raise ValueError("gap must be at most half of mark_interval")
        if self.minute_code and not self.gap < self.minute_code < self.mark_interval - self.gap:
            raise ValueError(
                "minute_code must be longer than the gap and shorter than mark_interval less the gap, or 0"
            )
        if 1.0 - max(-self.drift, 0.0) - self.wow - 4.0 * self.walk < 0.1:
            raise ValueError("drift, wow and walk together would stop the film; make them smaller")
        if self.density_max <= self.fog + abs(self.fog_gradient):
            raise ValueError("density_max must be above the fog, its gradient included")
        return self
