"""A film on the table: its edits, what they make of it, and what the page shows.

An edit gives gravity at once, from the last reduction; the whole one follows in a process that the next edit ends.
"""

import getpass
import io
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import ValidationError
from xarray import DataTree

from data_schemas.checksum import numbers_sha256
from data_schemas.errors import IsochronyError, RecordError, RefusedError
from data_schemas.film_description import FilmDescription
from data_schemas.film_edits import FilmEdits, edits_path, load_edits
from data_schemas.scene_fields import one_line
from pipeline.conditions import MGAL
from pipeline.film.digitise import make_record, open_film, summary
from pipeline.film.edits import check_scan
from pipeline.film.following import FilmTraces, Progress, find_time
from pipeline.film.knowledge import FilmOptions, Known
from pipeline.film.reading import Reading, read_traces
from pipeline.film.table.doubtful import doubtful
from pipeline.film.table.refining import Gravity, Refining, going_on

TILE = 512  # px, of a side


@dataclass
class Session:
    """A film, its edits and what they make of it; not for several threads at once, but for `tile` and `overlay`."""

    levels: ClassVar[int] = 6  # sizes in which tiles are there, each half of the one before

    untouched: FilmTraces  # the film without edits
    known: Known
    edits: FilmEdits
    path: Path  # where the edits are kept
    who: str  # kept with every edit
    name: str  # of the film's file
    jobs: int
    reading: Reading | None = None
    refusal: IsochronyError | None = None
    record: DataTree | None = None  # as it is now; None where the film is refused
    saved_at: str | None = None

    def __post_init__(self) -> None:
        made = self.edits.edits
        self._steps = [self.edits.model_copy(update={"edits": made[:k]}) for k in range(len(made) + 1)]
        self._at = len(made)  # the step at which the film is
        self._revision = 0
        self._refining = Refining()
        self._before, self._gravity = Gravity(), Gravity()
        self._read()

    @staticmethod
    def open(
        paths: Sequence[Path], description: FilmDescription | None = None, options: FilmOptions | None = None, *,
        edits: Path | None = None, who: str | None = None, jobs: int = 1, progress: Progress | None = None,
    ) -> "Session":  # fmt: skip
        """Follow a film's traces, take up its edits; raises as `open_film`, `find_time`, `check_scan` of these."""
        path, options = edits_path(paths[0]) if edits is None else edits, options or FilmOptions()
        made = load_edits(path) if path.exists() else None
        if made is not None:
            options = replace(options, orientation=str(made.orientation))
        scan, known = open_film(paths, description, options)
        if made is not None:
            check_scan(made, scan)
        traces, _ = find_time(scan, known, None, jobs, progress)
        if made is None:
            made = FilmEdits.model_validate({"sha256": traces.scan.sha256, "orientation": traces.scan.orientation})
        return Session(traces, known, made, path, who or _user(), paths[0].name, jobs)

    def state(self) -> dict[str, Any]:
        """Film, traces, edits, gravity (`refining`: a better one is under way), doubtful places: plain JSON."""
        self._gravity = self._refining.latest(self._gravity)
        reading, scan, edits = self.reading, self.untouched.scan, self.edits.model_dump(mode="json")
        now, before = self._gravity.value_m_s2, self._before.value_m_s2
        change = None if now is None or before is None else (now - before) / MGAL
        refused = None if self.refusal is None else str(self.refusal)
        shown: dict[str, Any] = {"samples": 0, "accepted_fraction": 0.0, "flags": [], "notes": []}
        if reading is not None and self.record is not None:
            row = summary(self.record, reading)
            shown = {key: row[key] for key in shown}
        count, names = len(self.untouched.tracks.course), [trace.name for trace in self.known.traces]
        names = names if len(names) == count else [str(k + 1) for k in range(count)]
        return {
            "name": self.name,
            "rows": scan.rows,
            "columns": scan.columns,
            "traces": [{"number": k + 1, "name": name} for k, name in enumerate(names)],
            "edits": edits["edits"],
            "can_undo": self._at > 0,
            "can_redo": self._at < len(self._steps) - 1,
            "revision": self._revision,
            "gravity": {**asdict(self._gravity), "change_mgal": change, "refining": self._refining.busy},
            "reading": {**shown, "refused": refused},
            "doubtful": [] if reading is None else doubtful(reading, self._clock),
            "saved": str(self.path),
            "saved_at": self.saved_at,
            "numbers_sha256": None if self.record is None else numbers_sha256(self.record),
        }

    def edit(self, *edits: dict[str, Any]) -> dict[str, Any]:
        """Add an edit, or several as one step; the new state. `RecordError`: it cannot be meant, nothing changes."""
        own = {"by": self.who, "at": datetime.now(UTC).isoformat(timespec="seconds")}
        made = [{key: value for key, value in each.items() if value is not None} | own for each in edits]
        content = self.edits.model_dump(mode="json")
        try:
            all_edits = FilmEdits.model_validate({**content, "edits": [*content["edits"], *made]})
        except ValidationError as error:
            raise RecordError(one_line(error, FilmEdits)) from None
        return self._take([*self._steps[: self._at + 1], all_edits], self._at + 1)

    def undo(self) -> dict[str, Any]:
        """Take back the last step."""
        return self._take(self._steps, self._at - 1, "undo")

    def redo(self) -> dict[str, Any]:
        """Make the step again that was taken back last."""
        return self._take(self._steps, self._at + 1, "redo")

    def close(self) -> None:
        """End what still runs."""
        self._refining.end()

    def csv(self) -> str:
        """Readings: time and angle of every trace with its uncertainty, as text."""
        if self.record is None:
            raise RefusedError(str(self.refusal))
        traces, out = self.record["record"].dataset, io.StringIO()
        names = [str(each) for each in traces["trace"].values]
        head = ["time_s", *(f"{name}_rad" for name in names), *(f"{name}_sigma_rad" for name in names)]
        time, angles = self.record.dataset["time"].values, traces["elongation"].values
        table = np.column_stack([time, *angles, *traces["elongation_uncertainty"].values])
        np.savetxt(out, table, "%.9g", ",", header=",".join(head), comments="")
        return out.getvalue()

    def tile(self, level: int, down: int, across: int) -> bytes:
        """A tile of the film as PNG, at 1/2**level of its size."""
        from PIL import Image

        scan, side = self.untouched.scan, TILE << level
        first, left = down * side, across * side
        pixels = np.asarray(scan.read(first, min(first + side, scan.rows))[:, left : left + side])
        picture = Image.fromarray((pixels >> 8 if scan.full_scale > 255 else pixels).astype(np.uint8))
        width, height = (max(1, -(-each // (1 << level))) for each in picture.size)
        out = io.BytesIO()
        picture.resize((width, height), Image.Resampling.BOX).save(out, "PNG", compress_level=1)
        return out.getvalue()

    def overlay(self, first_row: int, last_row: int, most: int) -> dict[str, Any]:
        """Courses, readings and marks on some rows, at `most` so many of them."""
        reading, tracks = self.reading, self._now.tracks
        first, last = max(0, first_row), min(last_row, self.untouched.scan.rows - 1)
        rows = np.unique(np.linspace(first, last, min(most, max(last - first + 1, 1))).astype(int))
        position = tracks.position if len(rows) > last - first else tracks.position * np.nan
        marks = []
        if reading is not None:
            axis = reading.axis
            inside = np.flatnonzero((axis.row >= first - 50) & (axis.row <= last + 50))
            for at in inside[:: max(-(-inside.size // most), 1)].tolist():
                places = [
                    None if np.isnan(row) else [row, float(np.nan_to_num(course[min(int(row), course.size - 1)]))]
                    for row, course in zip(axis.row_of_trace[:, at].tolist(), tracks.course, strict=True)
                ]
                seconds = float(axis.index[at] * axis.interval)
                label, minute = self._clock(seconds), seconds % 60.0 == 0.0
                marks.append({"row": float(axis.row[at]), "trace_rows": places, "label": label, "minute": minute})
        return {
            "rows": (rows + 0.5).tolist(),
            "courses": [_listed(each[rows]) for each in tracks.course],
            "read": [_listed(each[rows]) for each in position],
            "marks": marks,
        }

    def _take(self, steps: list[FilmEdits], at: int, what: str = "edit") -> dict[str, Any]:
        """Read the film with the edits of a step; where they cannot be meant, all stays as it was."""
        if not 0 <= at < len(steps):
            raise RecordError(f"there is nothing to {what}")
        before, self.edits, known = self.edits, steps[at], self._refining.latest(self._gravity)
        try:
            self._read()
        except RecordError:
            self.edits = before
            raise
        self._before, self._steps, self._at = known, steps, at
        self.edits.save(self.path)
        self.saved_at = datetime.now(UTC).isoformat(timespec="seconds")
        return self.state()

    def _read(self) -> None:
        """The reading and its gravity under the edits as they are."""
        jobs = self.jobs
        now = self.untouched.edited(self.edits, self.known, jobs) if self.edits.edits else self.untouched
        reading: Reading | None = None
        record: DataTree | None = None
        refusal: IsochronyError | None = None
        try:
            reading = read_traces(now, now.axis(self.known, jobs), self.known, jobs)
            record = make_record(reading, self.known, self.name)
        except RefusedError as fault:
            refusal = fault
        self._now, self.reading, self.record, self.refusal = now, reading, record, refusal
        self._revision += 1
        if record is None:
            self._refining.stop()
            self._gravity = Gravity(refused=str(refusal))
        else:
            self._gravity = going_on(record, self._refining.last)
            self._refining.begin(record)

    def _clock(self, seconds: float) -> str:
        """A time of the record as the clock showed it; seconds from a full minute where that is not known."""
        if not (self.known.states("start_time") or any(getattr(each, "time", None) for each in self.edits.edits)):
            return f"{seconds:+.1f} s"
        begin = datetime.fromisoformat(self.known.description.start_time)
        return (begin + timedelta(seconds=seconds)).strftime("%H:%M:%S.%f")[:-5]


def _listed(values: Any) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), 2) for value in values]


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # no such user is known to the system
        return os.environ.get("USER", "")
