"""What the observer knows of a film: NAME.film.toml beside NAME.film.tif, made of the table of the instrument."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from data_schemas.errors import FileError, RecordError
from data_schemas.scene_fields import (
    Name,
    Number,
    Section,
    Text,
    check_distinct,
    check_known,
    load_section,
    quantity,
    refuse,
)
from data_schemas.variables import rows_of

KIND = "film-description"
BASE, PENDULUM, TIME = "base", "pendulum", "time"
_LIMITS: dict[str | None, dict[str, float]] = {None: {}, "positive": {"gt": 0}, "not negative": {"ge": 0}}


def _of_instrument(*dims: str, also: tuple[str, ...] | None = None) -> list[str]:
    """Names of the instrument's numbers of some dimensions; with `also`, those that may have other dimensions too."""
    rows = ((name, row) for name, row in rows_of("instrument").items() if row.dims == dims and row.dtype == "f8")
    return [name for name, row in rows if also is None or also in row.also]


def _field(name: str, *, each: bool = False, required: bool = False) -> Any:
    """Field for a variable of the instrument, or for `each` pendulum's by label."""
    row = rows_of("instrument")[name]
    limits = dict[str, Any](_LIMITS[row.limit])
    kind: Any = dict[str, Annotated[float, Field(strict=True, **limits)]] if each else Number
    meaning = f"{row.long_name}, of each pendulum by label" if each else row.long_name
    entry = quantity(... if required else None, row.units, meaning, **({} if each else limits))
    return (kind if required else kind | None), entry


BASES = {name: of_base for name in _of_instrument(BASE) if (of_base := name.removeprefix("base_"))}
"""Variables of the instrument with a value a base, and their keys."""

PERIODS = {name: name.removeprefix("base_") for name in _of_instrument(BASE, PENDULUM)}
"""Those with a value a base and pendulum, and their keys."""

COURSES = _of_instrument(also=(TIME,))  # Those that may be read again and again while the film runs


def _section(name: str, meaning: str, **fields: Any) -> Any:
    return create_model(name, __base__=Section, __doc__=meaning, **fields)


_OF_BASES = {
    key: _field(name, each=name in PERIODS, required=not name.endswith("_uncertainty"))
    for name, key in (BASES | PERIODS).items()
}
DescribedBase: Any = _section(
    "DescribedBase",
    "An occupation of a base station, before or after.",
    label=(Name, quantity(..., "", "name of the station")),
    **_OF_BASES,
)
DescribedReading: Any = _section(
    "DescribedReading",
    "Conditions as they were read at some time; between readings they are taken to change evenly.",
    time=(Number, quantity(..., "s", "when, in the record's seconds")),
    **{name: _field(name) for name in COURSES},
)
DescribedPendulum: Any = _section(
    "DescribedPendulum",
    "A pendulum.",
    label=(Name, quantity(..., "", "label of the pendulum")),
    **{name: _field(name) for name in _of_instrument(PENDULUM)},
)
_CONSTANTS = {name: _field(name) for name in _of_instrument()}
DescribedInstrument: Any = _section("DescribedInstrument", "Conditions of all pendulums.", **_CONSTANTS)


class DescribedTrace(Section):
    """A trace as the observer knows it."""

    name: Name = quantity(..., "", "name of the trace")
    combination: dict[str, Number] = quantity(..., "1", "factor of each pendulum by label", min_length=1)
    lever: Number | None = quantity(None, "mm rad-1", "optical lever: deflection on the film per elongation", gt=0)
    position: Number | None = quantity(None, "mm", "place across the film at rest, from the left edge", ge=0)
    amplitude: Number | None = quantity(None, "mm", "nominal amplitude of the swing on the film", gt=0)


class FilmDescription(Section):
    """What is known of a film without looking at it. What is left out is not known.

    Traces stand as they lie from the left to the right at rest, or with their positions.
    """

    kind: Literal["film-description"] = quantity(KIND, "", "says what this file is")
    record_id: Name = quantity("film", "", "identifier of the record")
    title: Text = quantity("", "", "what the film shows")
    start_time: Name = quantity("2000-01-01T00:00:00Z", "", "date and time of the record's zero; a full minute")
    speed: Number | None = quantity(None, "mm s-1", "nominal speed of the film", gt=0)
    dpi: Number | None = quantity(None, "inch-1", "pixels of the scan to the inch", gt=0)
    mark_interval: Number = quantity(0.5, "s", "time between the chronometer's marks", gt=0)
    gap: Number | None = quantity(None, "s", "how long the shutter is closed at a mark", ge=0)
    minute_code: Number | None = quantity(None, "s", "second closing after each full minute; 0: none", ge=0)
    marks: Literal["double", "long", "omitted", "none"] | None = quantity(
        None, "", "full minutes: two closings, a longer one, none, or as ever"
    )
    mark_kind: Literal["gaps", "dark-lines", "bright-lines", "edge"] | None = quantity(
        None, "", "gaps in traces, lines across, ticks at the edge; left out: sought"
    )
    restoring: Literal["sine", "linear"] = quantity("sine", "", "restoring law of the pendulums")
    traces: tuple[DescribedTrace, ...] = quantity(..., "", "the traces", min_length=1)
    pendulums: tuple[DescribedPendulum, ...] = quantity(..., "", "the pendulums", min_length=1)
    instrument: DescribedInstrument = quantity(DescribedInstrument(), "", "conditions of all pendulums")
    bases: tuple[DescribedBase, ...] = quantity((), "", "occupations of base stations, before and after")
    readings: tuple[DescribedReading, ...] = quantity((), "", "conditions read while the film ran, in order of time")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels, names = [one.label for one in self.pendulums], [one.name for one in self.traces]
        for each in (labels, names):
            check_distinct(each, "traces and pendulums must have different names")
        for trace in self.traces:
            check_known(trace.combination, labels, f"trace {trace.name!r} names the pendulum")
        _check_bases(self.bases, labels)
        _check_readings(self.readings, self.instrument)
        return self


def _check_bases(bases: Sequence[Any], labels: list[str]) -> None:
    """Raise ValueError where bases state different things, or other pendulums than there are."""
    check_distinct((base.label for base in bases), "bases must have different labels; name each occupation for itself")
    for key in (*BASES.values(), *PERIODS.values()):
        given = [getattr(base, key) is not None for base in bases]
        told = f"{key} is stated of {sum(given)} of {len(given)} bases; state it of all or of none"
        refuse(any(given) and not all(given), told)
        for base in bases if key in PERIODS.values() else ():
            stated = getattr(base, key)
            told = f"base {base.label!r} states {key} of {', '.join(stated or ())}; the pendulums are"
            refuse(stated is not None and set(stated) != set(labels), f"{told} {', '.join(labels)}")


def _check_readings(readings: Sequence[Any], instrument: Any) -> None:
    """Raise ValueError where readings are out of order, hold nothing, or repeat what the instrument states."""
    times = [reading.time for reading in readings]
    refuse(sorted(set(times)) != times, "readings must be in order of time")
    for name in COURSES:
        given = [getattr(reading, name) is not None for reading in readings]
        twice = any(given) and getattr(instrument, name) is not None
        refuse(twice, f"{name} is stated in instrument and in readings; leave one of them out")
    empty = any(all(getattr(reading, name) is None for name in COURSES) for reading in readings)
    refuse(empty, f"a reading must hold {' or '.join(COURSES)}")


def description_path(film: str | os.PathLike[str]) -> Path:
    """Where the description of a film is kept: a/ship.film.toml beside a/ship.film.tif."""
    return Path(film).with_name(film_stem(film) + ".film.toml")


def film_stem(film: str | os.PathLike[str]) -> str:
    """Name of a film without folder and endings: ship.v2 of a/ship.v2.film.tif."""
    return Path(film).with_suffix("").name.removesuffix(".film")


def load_description(path: str | os.PathLike[str]) -> FilmDescription:
    """Read a description; `FileError`: it cannot be read, or is not TOML; `RecordError`: faulty keys, in one line."""
    return load_section(path, FilmDescription, "a film's description", RecordError, FileError)
