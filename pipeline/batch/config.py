"""What is to be done with one input, with everything its result depends on; and what became of it."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from xarray import DataTree

Allow = Callable[[int], None]  # Told how many bytes of values an input declares, before they are read


def owner_of(folder: Path) -> str:
    """What the names of a batch's temporary files begin with: by its folder, so that one that goes on knows its own."""
    return f"{hashlib.sha256(os.fsencode(os.path.realpath(folder))).hexdigest()[:12]}-"


@dataclass(frozen=True)
class Kind:
    """How an input of one kind becomes a record: all that a further kind (a film, a table) has to bring."""

    name: str  # as told to the user
    endings: tuple[str, ...]  # of its files' names
    record: Callable[[Path, Config, Allow], DataTree]  # a function of a module, so that another process finds it
    searched: bool = True  # whether folders are searched for it
    beside: Callable[[Path], Path] | None = None
    """Path of a file that is read with an input, where there is one: its change changes the input."""


@dataclass(frozen=True)
class Config:
    """One job's settings; `method`, `pair`, `gain_uncertainty` and `accept` as `pipeline.process` takes them."""

    key: str  # name of the job within its batch: that of its output, relative to the batch's folder
    folder: Path  # of the batch
    kind: Kind
    method: tuple[str, ...] = ("auto",)
    pair: str | None = None
    gain_uncertainty: float = 0.0
    accept: tuple[str, ...] = ()
    member: int = 0  # number of the member of a scene, from 1; 0 for the input as it is
    variant: tuple[tuple[str, Any], ...] = ()  # what a sweep sets in a scene
    memory: int | None = None  # bytes the process may hold beside twelve times what the input declares; None = no limit
    allow_paths: bool = False  # whether the tables of a scene may lie outside its folder
    command: str = ""  # As the user gave it, for the result

    @property
    def meaning(self) -> str:
        """What the numbers of the result depend on beside input and versions, as JSON."""
        settings = {name: getattr(self, name) for name in ("method", "pair", "gain_uncertainty", "accept", "member")}
        return json.dumps(settings | {"kind": self.kind.name, "variant": dict(self.variant)}, sort_keys=True)

    @property
    def output(self) -> Path:
        """Where its result goes."""
        return self.folder / self.key

    @cached_property
    def sha256(self) -> str:
        """Of `meaning`; one text for all jobs of like meaning, of which there may be a million."""
        return sys.intern(hashlib.sha256(self.meaning.encode()).hexdigest())


Status = Literal["ok", "refused", "failed"]


@dataclass(frozen=True)
class Outcome:
    """What became of one input; a line of the ledger. "ok": at least one method gave a value."""

    key: str  # Of the job, see `Config`
    status: Status
    error_class: str | None = None
    error: str | None = None
    """Why there is no value, in one line. Beside the names of exceptions: "Crashed", "TimedOut", "WorkerLost"."""
    input_sha256: str | None = None
    output_sha256: str | None = None  # Of the files' bytes, where they were read and written
    rows: tuple[dict[str, Any], ...] = ()  # What the summary says of each method
    seconds: float = 0.0


def failure(
    key: str, error_class: str, error: str, input_sha256: str | None = None, status: Status = "failed"
) -> Outcome:
    """Outcome of an input that gave nothing; the reason on one line of bounded length."""
    line = " ".join(error.split())
    return Outcome(key, status, error_class, line if len(line) <= 500 else line[:497] + "...", input_sha256)
