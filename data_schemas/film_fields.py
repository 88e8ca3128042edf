"""Sections that describe where a trace lies on a film, and when its lamp is weak."""

from __future__ import annotations

from pydantic import model_validator

from data_schemas.scene_fields import Number, Section, TraceName, quantity
from data_schemas.scene_recording import Stretch


class FilmTrace(Section):
    """Where one trace of the record lies on the film; what is left out is that of the film."""

    name: TraceName = quantity(..., "", "name of the trace, as in the record")
    position: Number | None = quantity(
        None, "mm", "place across the paper at rest; left out: the traces spread evenly", ge=0, le=2000
    )
    offset: Number = quantity(0.0, "mm", "how much later along the film this trace is written", ge=-100, le=100)
    lever: Number | None = quantity(
        None, "mm rad-1", "deflection per elongation; left out: the film's lever", gt=0, le=1e6
    )


class Dimming(Stretch):
    """A stretch of time in which the lamp is weak; `[10, 20, 0.15]` says the same as the three keys."""

    factor: Number = quantity(..., "1", "light that is left of the lamp's", ge=0, le=10)

    @model_validator(mode="before")
    @classmethod
    def _from_triple(cls, value: object) -> object:
        if isinstance(value, list | tuple) and len(value) == 3:
            return {"start": value[0], "stop": value[1], "factor": value[2]}
        return value
