"""How a film is exposed: the camera, its clock, its drive and the lamp. Part of the section `film` of a scene."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from data_schemas.film_fields import Dimming, FilmTrace
from data_schemas.scene_fields import Count, Number, Section, quantity
from data_schemas.scene_recording import Stretch


class FilmCamera(Section):
    """Optics and layout. Dimensions of historic cameras were found in no source: these are assumed."""

    speed: Number = quantity(5.0, "mm s-1", "nominal speed of the film", gt=0, le=200)
    paper_width: Number = quantity(127.0, "mm", "width of the paper", ge=5, le=2000)
    margin: Number = quantity(10.0, "mm", "blank film before the start and after the end", ge=0, le=10_000)
    spot: Number = quantity(0.10, "mm", "1 sigma of the spot of light, a Gaussian", ge=0.005, le=5)
    lever: Number = quantity(2000.0, "mm rad-1", "optical lever: deflection on the film per elongation", gt=0, le=1e6)
    traces: tuple[FilmTrace, ...] = quantity((), "", "place, offset and lever of single traces, by name")
    lamp: Number = quantity(
        1.0, "1", "exposure on the axis of a line at rest at nominal speed, in the unit of half_exposure", gt=0, le=1e3
    )
    blackouts: tuple[Stretch, ...] = quantity((), "", "stretches with the lamp off, as [start, stop] in s")
    dimmings: tuple[Dimming, ...] = quantity((), "", "stretches with the lamp weak, as [start, stop, factor]")

    @model_validator(mode="after")
    def _each_trace_once(self) -> Self:
        names = [trace.name for trace in self.traces]
        if len(set(names)) < len(names):
            raise ValueError("traces must have different names")
        return self


class FilmMarks(Section):
    """The chronometer's shutter: closed for a moment, centred on every mark."""

    mark_interval: Number = quantity(0.5, "s", "time between the chronometer's marks", ge=0.01, le=3600)
    gap: Number = quantity(0.03, "s", "how long the shutter is closed, centred on the mark; 0: no marks", ge=0, le=10)
    minute_code: Number = quantity(
        0.125, "s", "how long after each full minute the shutter closes a second time; 0: never", ge=0, le=60
    )
    missing_marks: Number = quantity(0.0, "1", "part of the marks at which the shutter stays open", ge=0, le=1)
    spurious_marks: Count = quantity(0, "1", "number of gaps at random that are no marks", ge=0, le=1_000_000)

    @model_validator(mode="after")
    def _gaps_apart(self) -> Self:
        if self.gap > 0.5 * self.mark_interval:
            raise ValueError("gap must be at most half of mark_interval")
        if self.minute_code and not self.gap < self.minute_code < self.mark_interval - self.gap:
            raise ValueError(
                "minute_code must be longer than the gap and shorter than mark_interval less the gap, or 0"
            )
        return self


class FilmDrive(Section):
    """How the paper runs, and what becomes of it when it dries."""

    drift: Number = quantity(0.0, "1", "part by which the speed changes from start to end", ge=-0.5, le=0.5)
    wow: Number = quantity(0.0, "1", "amplitude of a periodic error of the speed, as part of it", ge=0, le=0.5)
    wow_period: Number = quantity(7.0, "s", "period of that error", ge=0.1, le=1e5)
    walk: Number = quantity(0.0, "1", "rms of a random error of the speed, as part of it", ge=0, le=0.1)
    walk_time: Number = quantity(5.0, "s", "time over which the random error is correlated", ge=0.5, le=1e5)
    stretch_along: Number = quantity(0.0, "1", "part by which the paper is longer than when exposed", ge=-0.1, le=0.1)
    stretch_across: Number = quantity(0.0, "1", "part by which it is wider", ge=-0.1, le=0.1)
    skew: Number = quantity(
        0.0, "degrees", "shear: light at column c falls tan(skew) * c rows further along", ge=-20, le=20
    )

    @model_validator(mode="after")
    def _forwards(self) -> Self:
        slowest = 1.0 - max(-self.drift, 0.0) - self.wow - 4.0 * self.walk
        if slowest < 0.1:
            raise ValueError("drift, wow and walk together would stop the film; make them smaller")
        return self
