"""What a person corrects of the reading of a film: NAME.edits.toml beside the scan NAME.film.tif.

Rows and columns are pixels of the scan turned clockwise by `orientation` degrees, so that rows run with time; pixel i
reaches from i to i + 1. Traces count from 1, from the left at rest. Edits apply to the reading of the untouched film.
"""

import os
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from data_schemas.errors import FileError, RecordError
from data_schemas.film_description import film_stem
from data_schemas.scene_fields import Count, Number, Section, Text, load_section, quantity, refuse
from data_schemas.text_files import toml_text
from data_schemas.writing import write_text

KIND = "film-edits"
Place = tuple[Number, Number]  # row and column, px
Trace = Annotated[Count, Field(ge=1, le=100)]


class _Edit(Section):
    by: Text = quantity("", "", "who made the edit", max_length=100)
    at: Text = quantity("", "", "when, date and time", max_length=40)
    note: Text = quantity("", "", "why", max_length=1000)


class Mask(_Edit):
    """Nothing is read in a region."""

    kind: Literal["mask"] = "mask"
    points: tuple[Place, ...] = quantity(..., "px", "corners [row, column]; two are a rectangle's", min_length=2)


class Follow(_Edit):
    """A trace runs along a line: it is looked for there, and read where the film shows it."""

    kind: Literal["follow"] = "follow"
    trace: Trace = quantity(..., "1", "number of the trace, from the left at rest")
    points: tuple[Place, ...] = quantity(..., "px", "points [row, column] of the line, rows increasing", min_length=2)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        rows = [row for row, _ in self.points]
        refuse(sorted(set(rows)) != rows, "rows of the line must increase from point to point")
        return self


class _At(_Edit):
    row: Number = quantity(..., "px", "where, on that trace")
    trace: Trace = quantity(1, "1", "number of the trace, from the left at rest")


class Mark(_At):
    """A mark of the chronometer lies here; its clock time, where it is given, tells the times of all the others."""

    kind: Literal["mark"] = "mark"
    time: Text | None = quantity(None, "", "'HH:MM:SS' on the start's day, or with a date", max_length=40)

    @model_validator(mode="after")
    def _readable(self) -> Self:
        self.seconds("2000-01-01T00:00:00Z")
        return self

    def seconds(self, start: str) -> float | None:
        """Its time, s since `start`, or None; a time without a date is that within half a day of the start."""
        if self.time is None:
            return None
        begin = datetime.fromisoformat(start).replace(tzinfo=None)
        dated = any(mark in self.time[1:] for mark in "T ")
        try:
            if dated:
                return (datetime.fromisoformat(self.time).replace(tzinfo=None) - begin).total_seconds()
            clock = time.fromisoformat(self.time).replace(tzinfo=None)
        except ValueError:
            raise ValueError(f"the time {self.time!r} is no time; write it as '12:03:00'") from None
        away = (datetime.combine(begin.date(), clock) - begin) / timedelta(seconds=1)
        return away - 86400.0 * round(away / 86400.0)


class NoMark(_At):
    """What was taken for a mark here is none."""

    kind: Literal["no-mark"] = "no-mark"


class Break(_Edit):
    """How many marks passed here is not known: marks are counted on both sides, joined only if clock times tell."""

    kind: Literal["break"] = "break"
    row: Number = quantity(..., "px", "where")


class Ignore(_Edit):
    """A trace is not read, on some rows or on the whole film."""

    kind: Literal["ignore"] = "ignore"
    trace: Trace = quantity(..., "1", "number of the trace, from the left at rest")
    first_row: Number | None = quantity(None, "px", "from here; left out: from the begin of the film")
    last_row: Number | None = quantity(None, "px", "to here; left out: to the end of the film")


Edit = Annotated[Mask | Follow | Mark | NoMark | Break | Ignore, Field(discriminator="kind")]


class FilmEdits(Section):
    """Edits of one film, in the order in which they were made."""

    kind: Literal["film-edits"] = quantity(KIND, "", "says what this file is")
    sha256: tuple[Annotated[str, Field(strict=True, pattern="^[0-9a-f]{64}$")], ...] = quantity(
        ..., "", "of the image, or of its strips in order", min_length=1
    )
    orientation: Literal[0, 90, 180, 270] = quantity(0, "degree", "clockwise turn after which rows run with time")
    edits: tuple[Edit, ...] = quantity((), "", "the edits", max_length=10_000)

    def text(self) -> str:
        """As TOML, the same for the same edits."""
        content = self.model_dump()
        content["edits"] = [{key: value for key, value in each.items() if value != ""} for each in content["edits"]]
        return toml_text(content)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write them, whole or not at all."""
        write_text(self.text(), path, overwrite=True)


def edits_path(film: str | os.PathLike[str]) -> Path:
    """Where the edits of a film are kept: a/ship.edits.toml beside a/ship.film.tif."""
    return Path(film).with_name(film_stem(film) + ".edits.toml")


def load_edits(path: str | os.PathLike[str]) -> FilmEdits:
    """Read edits; raises as `load_description`."""
    return load_section(path, FilmEdits, "edits of a film", RecordError, FileError)
