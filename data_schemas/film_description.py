"""What the observer knows of a film: written beside the image, read with it. NAME.film.toml beside NAME.film.tif."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, ValidationError, create_model, model_validator

from data_schemas.errors import FileError, RecordError
from data_schemas.film_conditions import (
    PENDULUM,
    DescribedBase,
    DescribedReading,
    Name,
    check_bases,
    check_readings,
    fields,
)
from data_schemas.scene_faults import one_line
from data_schemas.scene_fields import Number, Section, quantity
from data_schemas.toml_file import load_toml

KIND = "film-description"

Text = Annotated[str, Field(strict=True)]
Kind = TypeVar("Kind", bound=Section)


class DescribedTrace(Section):
    """A trace as the observer knows it."""

    name: Name = quantity(..., "", "name of the trace")
    combination: dict[str, Number] = quantity(..., "1", "factor of each pendulum by label", min_length=1)
    lever: Number | None = quantity(None, "mm rad-1", "optical lever: deflection on the film per elongation", gt=0)
    position: Number | None = quantity(None, "mm", "place across the film at rest, from the left edge", ge=0)
    amplitude: Number | None = quantity(None, "mm", "nominal amplitude of the swing on the film", gt=0)


class _LabelledPendulum(Section):
    label: Name = quantity(..., "", "label of the pendulum")


DescribedPendulum: Any = create_model(
    "DescribedPendulum",
    __base__=_LabelledPendulum,
    __doc__="A pendulum.",
    **fields(PENDULUM),
)
DescribedInstrument: Any = create_model(
    "DescribedInstrument",
    __base__=Section,
    __doc__="Conditions of all pendulums.",
    **fields(),
)


class FilmDescription(Section):
    """What is known of a film without looking at it. What is left out is not known.

    Traces stand as they lie from the left to the right at rest, or with their positions.

    Examples
    --------
    >>> trace = {"name": "1", "combination": {"1": 1.0}}
    >>> known = FilmDescription(record_id="a", traces=[trace], pendulums=[{"label": "1", "period": 1.01}])
    >>> FilmDescription.model_validate(known.model_dump()) == known
    True
    """

    kind: Literal["film-description"] = quantity(KIND, "", "says what this file is")
    record_id: Name = quantity("film", "", "identifier of the record")
    title: Text = quantity("", "", "what the film shows")
    start_time: Name = quantity(
        "2000-01-01T00:00:00Z", "", "date and time from which the record counts its seconds; a full minute"
    )
    speed: Number | None = quantity(None, "mm s-1", "nominal speed of the film", gt=0)
    dpi: Number | None = quantity(None, "inch-1", "pixels of the scan to the inch", gt=0)
    mark_interval: Number = quantity(0.5, "s", "time between the chronometer's marks", gt=0)
    gap: Number | None = quantity(None, "s", "how long the shutter is closed at a mark", ge=0)
    minute_code: Number | None = quantity(
        None, "s", "how long after each full minute the shutter closes a second time; 0: never", ge=0
    )
    marks: Literal["double", "long", "omitted", "none"] | None = quantity(
        None, "", "what the shutter does at each full minute: closes twice, for longer, not at all, or as ever"
    )
    mark_kind: Literal["gaps", "dark-lines", "bright-lines", "edge"] | None = quantity(
        None,
        "",
        "what marks the time: gaps in the traces, lines across the film, or ticks at its edge; left out: sought",
    )
    restoring: Literal["sine", "linear"] = quantity("sine", "", "restoring law of the pendulums")
    traces: tuple[DescribedTrace, ...] = quantity(..., "", "the traces", min_length=1)
    pendulums: tuple[DescribedPendulum, ...] = quantity(..., "", "the pendulums", min_length=1)
    instrument: DescribedInstrument = quantity(DescribedInstrument(), "", "conditions of all pendulums")
    bases: tuple[DescribedBase, ...] = quantity((), "", "occupations of base stations, before and after")
    readings: tuple[DescribedReading, ...] = quantity(
        (), "", "conditions as they were read while the film ran, in order of time"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels = [each.label for each in self.pendulums]
        names = [each.name for each in self.traces]
        if len(set(labels)) < len(labels) or len(set(names)) < len(names):
            raise ValueError("traces and pendulums must have different names")
        for trace in self.traces:
            for label in trace.combination:
                if label not in labels:
                    raise ValueError(
                        f"trace {trace.name!r} names the pendulum {label!r}; there are {', '.join(labels)}"
                    )
        check_bases(self.bases, labels)
        check_readings(self.readings, self.instrument)
        return self


def description_path(film: str | os.PathLike[str]) -> Path:
    """Where the description of a film is kept: beside its image.

    Examples
    --------
    >>> description_path("a/ship.film.tif").name, description_path("a/scan.png").name
    ('ship.film.toml', 'scan.film.toml')
    """
    path = Path(film)
    return path.with_name(film_stem(path) + ".film.toml")


def film_stem(film: str | os.PathLike[str]) -> str:
    """Name of a film without folder and endings.

    Examples
    --------
    >>> film_stem("a/ship.v2.film.tif"), film_stem("scan.png")
    ('ship.v2', 'scan')
    """
    return Path(film).with_suffix("").name.removesuffix(".film")


def load_description(path: str | os.PathLike[str]) -> FilmDescription:
    """Read a description.

    Raises
    ------
    FileError
        The file cannot be read, or is not TOML.
    RecordError
        With one line that names the file, every faulty key, its value and what is allowed.
    """
    return load_section(path, FilmDescription, "a film's description")


def load_section(path: str | os.PathLike[str], kind: type[Kind], what: str) -> Kind:
    """Read what stands beside a film; raises as `load_description`."""
    content = load_toml(path, what, FileError)
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        raise RecordError(f"{path}: {one_line(error, kind)}") from None
