"""A session of the table without a reader: a small film, its courses by formula, edits kept in memory."""

from __future__ import annotations

import io
import json
import threading
from dataclasses import dataclass
from functools import cache
from http.client import HTTPConnection, HTTPResponse
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from PIL import Image
from pydantic import ValidationError

from data_schemas.errors import RecordError
from data_schemas.film_edits import FilmEdits
from data_schemas.scene_fields import one_line

ROWS, COLUMNS, INTERVAL, PERIOD, OFFSET = 6000, 640, 60, 124.0, 7.0  # px; two marks and a swing are about a second


def course(rows: Any, trace: int) -> Any:
    """Columns of a trace."""
    return 110.0 + 200.0 * trace + 85.0 * np.sin(2.0 * np.pi * rows / (PERIOD + trace) + trace)


@cache
def film() -> np.ndarray:
    """Two dark lines with a gap at each mark, some grain."""
    rows = np.arange(ROWS) + 0.5
    image = np.random.default_rng(1).normal(205.0, 9.0, (ROWS, COLUMNS))
    for trace in (1, 2):
        slope = np.hypot(1.0, np.gradient(course(rows, trace)))
        away = (np.arange(COLUMNS) + 0.5 - course(rows, trace)[:, None]) / slope[:, None]
        lit = np.abs((rows - OFFSET * (trace - 1)) % INTERVAL - INTERVAL / 2) < INTERVAL / 2 - 2
        image -= np.where(lit, 150.0 / slope**0.5, 0.0)[:, None] * np.exp(-0.5 * (away / 1.8) ** 2)
    return np.clip(image, 0, 255).astype(np.uint8)


_DOUBTFUL = [
    {"first_row": 3900.0, "last_row": 4230.0, "trace": 2, "what": "lost in a scratch", "harm_mgal": 2.31},
    {"first_row": 1270.0, "last_row": 1290.0, "trace": None, "what": "a mark is missing", "harm_mgal": 0.482},
    {"first_row": 5100.0, "last_row": 5140.0, "trace": 1, "what": "two lines cross", "harm_mgal": None},
]


class StandInSession:
    """What `pipeline.film.table.server.Session` asks for."""

    levels = 6

    def __init__(self) -> None:
        self.who, self.revision, self.change, self.refining, self.sigma = "", 0, None, False, 0.52
        self.edits: list[dict[str, Any]] = []
        self.undone: list[dict[str, Any]] = []
        self.gate = threading.Event()  # cleared: edits take until it is set
        self.gate.set()
        self.steps: list[int] = []
        self._film = Image.fromarray(film())
        self._sizes = {level: self._film.reduce(2**level) for level in range(self.levels)}

    def state(self) -> dict[str, Any]:
        value = 9.8123456 + 1e-5 * self._shift(len(self.edits))
        return {
            "name": "ship.film.tif", "rows": ROWS, "columns": COLUMNS, "edits": list(self.edits),
            "traces": [{"number": 1, "name": "1"}, {"number": 2, "name": "1-2"}],
            "can_undo": bool(self.edits), "can_redo": bool(self.undone), "revision": self.revision,
            "gravity": {"value_m_s2": value, "sigma_mgal": self.sigma, "change_mgal": self.change, "method": "joint",
                        "refining": self.refining,
                        "refused": None},
            "reading": {"samples": 1250, "accepted_fraction": 0.987, "flags": ["marks-many-missing"],
                        "notes": ["lever assumed 2000 mm/rad"], "refused": None},
            "doubtful": [{**each, "time": self._label(each["first_row"])} for each in _DOUBTFUL],
            "saved": "/films/ship.edits.toml", "saved_at": "1937-01-02T12:00:00+00:00" if self.revision else None,
        }  # fmt: skip

    def overlay(self, first_row: int, last_row: int, most: int) -> dict[str, Any]:
        rows = np.arange(first_row, last_row, max(1, -(-(last_row - first_row) // most))) + 0.5
        courses = [np.round(course(rows, trace), 2).tolist() for trace in (1, 2)]
        read = [
            [None if int(row) % 9 == 0 else column for row, column in zip(rows, each, strict=True)] for each in courses
        ]
        marks = [float(row) for row in range(0, ROWS, INTERVAL) if first_row <= row < last_row]
        gone = {(edit["row"], edit.get("trace", 1)) for edit in self.edits if edit["kind"] == "no-mark"}
        return {
            "rows": rows.tolist(), "courses": courses, "read": read,
            "marks": [
                {"row": row, "label": self._label(row), "minute": row == 1200.0, "trace_rows": [
                    None if (place, trace) in gone else [place, float(course(place, trace))]
                    for trace, place in ((1, row), (2, row + OFFSET))]}
                for row in marks
            ],
        }  # fmt: skip

    def tile(self, level: int, down: int, across: int) -> bytes:
        size, out = self._sizes[level], io.BytesIO()
        x, y = 512 * across, 512 * down
        size.crop((x, y, min(x + 512, size.width), min(y + 512, size.height))).save(out, "PNG", compress_level=1)
        return out.getvalue()

    def edit(self, *made: dict[str, Any]) -> dict[str, Any]:
        self.gate.wait(20)
        edits = [*self.edits, *({**each, "by": self.who, "at": "1937-01-02T12:00:00+00:00"} for each in made)]
        try:
            FilmEdits.model_validate({"sha256": ["0" * 64], "edits": edits})
        except ValidationError as error:
            raise RecordError(f"the edit is refused: {one_line(error, FilmEdits)}") from None
        self.undone, self.steps = [], [*self.steps, len(made)]
        return self._now(edits)

    def undo(self) -> dict[str, Any]:
        if not self.edits:
            raise RecordError("there is nothing to undo")
        *self.steps, size = self.steps
        self.undone.append(self.edits[-size:])
        return self._now(self.edits[:-size])

    def redo(self) -> dict[str, Any]:
        if not self.undone:
            raise RecordError("there is nothing to redo")
        again = self.undone.pop()
        self.steps = [*self.steps, len(again)]
        return self._now([*self.edits, *again])

    def csv(self) -> str:
        return "time,1,1-2\n0.0,0.01,0.02\n"

    def _now(self, edits: list[dict[str, Any]]) -> dict[str, Any]:
        self.change = self._shift(len(edits)) - self._shift(len(self.edits))
        self.edits = edits
        self.revision += 1
        return self.state()

    @staticmethod
    def _shift(edits: int) -> float:
        return -0.31 * edits

    @staticmethod
    def _label(row: float) -> str:
        seconds = 43190.0 + row * 0.5 / INTERVAL
        return f"{int(seconds // 3600):02d}:{int(seconds // 60) % 60:02d}:{seconds % 60:04.1f}"


@dataclass
class Served:
    """A stand-in that is served, and how to ask for it as a program would."""

    session: StandInSession
    url: str
    thread: threading.Thread

    @property
    def token(self) -> str:
        return parse_qs(urlsplit(self.url).query)["token"][0]

    @property
    def port(self) -> int:
        return urlsplit(self.url).port or 0

    def ask(self, path: str, content: Any = None, **changed: str | None) -> tuple[int, bytes, HTTPResponse]:
        """Status, body and response; headers are those of the page, but for those that `changed` names."""
        body = content if content is None or isinstance(content, bytes) else json.dumps(content).encode()
        named = {name.replace("_", "-"): value for name, value in changed.items()}
        usual = {"X-Token": self.token} | ({"Content-Type": "application/json"} if body is not None else {})
        headers = {name: value for name, value in (usual | named).items() if value is not None}
        connection = HTTPConnection("127.0.0.1", self.port, timeout=20)
        try:
            connection.request("GET" if body is None else "POST", path, body, headers)
            response = connection.getresponse()
            return response.status, response.read(), response
        finally:
            connection.close()

    def end(self) -> None:
        """End the server as the page does."""
        if self.thread.is_alive():
            self.ask("/done", {})
        self.thread.join(15)
