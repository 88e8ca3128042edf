"""One input of a batch: what is to be done with it, doing it, and what became of it, which is told and never raised."""

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import data_schemas
from data_schemas.errors import FileError, IsochronyError, RefusedError, naming
from data_schemas.shield import bounded
from data_schemas.text_files import file_sha256
from data_schemas.writing import sync_folder

if TYPE_CHECKING:
    from xarray import DataTree

Allow = Callable[[int], None]  # Told how many bytes of values an input declares, before they are read
_KEPT = ("requested_method", "method", "status", "error", "gravity_m_s2", "gravity_sigma_mgal", "uncorrected_m_s2",
         "noise_sigma_mgal", "difference_frequency_rad_s", "period_s", "period_sigma_s", "samples_used")  # fmt: skip


def owner_of(folder: Path) -> str:
    """What the names of a batch's temporary files begin with: by its folder, so that one that goes on knows its own."""
    return f"{hashlib.sha256(os.fsencode(os.path.realpath(folder))).hexdigest()[:12]}-"


@dataclass(frozen=True)
class Kind:
    """How an input of one kind becomes a record: all that a further kind (a film, a table) has to bring."""

    name: str  # as told to the user
    endings: tuple[str, ...]  # of its files' names
    record: "Callable[[Path, Config, Allow], DataTree]"  # a function of a module, so that another process finds it
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


def process_record(path: Path, config: Config) -> Outcome:
    """Make the result of an input and write it; whatever goes wrong, a fault of our own too, is told as its outcome."""
    started = time.perf_counter()
    digest = None
    try:
        digest = input_sha256(path, config.kind)
        with bounded(config.memory) as allow:
            outcome = _made(path, config, digest, config.kind.record(path, config, allow))
    except RefusedError as error:
        outcome = failure(config.key, "RefusedError", naming(path, str(error)), digest, "refused")
    except IsochronyError as error:
        outcome = failure(config.key, type(error).__name__, naming(path, str(error)), digest)
    except MemoryError:
        told = f"{path}: needs more memory than is allowed; give it more (--memory, --retry-failed), or split it"
        outcome = failure(config.key, "MemoryError", told, digest)
    except Exception as error:  # ours or a library's: it must cost this record alone, and is told
        told = f"{path}: internal error: {type(error).__name__}: {error}; please report"
        outcome = failure(config.key, type(error).__name__, told, digest)
    return replace(outcome, seconds=round(time.perf_counter() - started, 6))


def input_sha256(path: Path, kind: Kind) -> str:
    """Hexadecimal SHA-256 of an input; where a file beside it is read with it, of both their checksums."""
    digest = file_sha256(path)
    beside = kind.beside(path) if kind.beside is not None else None
    if beside is None or not os.path.isfile(beside):
        return digest
    return hashlib.sha256(f"{digest} {file_sha256(beside)}".encode()).hexdigest()


def _made(path: Path, config: Config, digest: str, record: "DataTree") -> Outcome:
    from pipeline.processing import process
    from pipeline.summary import summaries

    method = config.method[0] if len(config.method) == 1 else list(config.method)
    result = process(
        record, method=method, pair=config.pair, gain_uncertainty=config.gain_uncertainty, accept=config.accept
    )
    rows = summaries(result)
    if not any(row["status"] == "ok" for row in rows):
        return failure(config.key, "RefusedError", naming(path, str(rows[0]["error"])), digest, "refused")
    used = json.loads(result.attrs["configuration"])
    result.attrs["configuration"] = json.dumps(used | json.loads(config.meaning), sort_keys=True)
    result.attrs["command"] = config.command
    _write(result, config)
    kept = tuple(_row(row) for row in rows)
    return Outcome(config.key, "ok", None, None, digest, file_sha256(config.output), kept)


def _write(result: "DataTree", config: Config) -> None:
    folder = config.output.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for depth in range(config.key.count("/")):  # whoever made it may have been killed before it did this
            sync_folder(folder.parents[depth])
    except OSError as error:
        raise FileError(f"{folder}: cannot be made, {error.strerror}; choose another folder with -o") from None
    try:
        data_schemas.write(result, config.output, overwrite=True, owner=owner_of(config.folder))
    except FileError as error:
        raise FileError(f"{error}; then use --retry-failed") from None


def _row(row: dict[str, Any]) -> dict[str, Any]:
    """What the summary keeps of one method: no more than it needs, for a ledger has a million of them."""
    kept = {"record_id": row["record_id"]} | {name: row[name] for name in _KEPT if row.get(name) is not None}
    kept["correction_mgal"] = sum(value for value in row["corrections_mgal"].values() if value == value)
    kept["flags"] = " ".join(row["flags"])
    return {name: None if value != value else value for name, value in kept.items()}  # JSON has no NaN
