"""One input to one result file; whatever goes wrong is told, never raised."""

from __future__ import annotations

import hashlib
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import data_schemas
from data_schemas.contents import shown
from data_schemas.errors import FileError, IsochronyError, RefusedError, naming
from data_schemas.shield import bounded
from data_schemas.text_files import MOST_BYTES, ordinary_size
from data_schemas.writing import sync_folder
from pipeline.batch.config import Config, Kind, Outcome, failure, owner_of

if TYPE_CHECKING:
    from xarray import DataTree

_KEPT = ("requested_method", "method", "status", "error", "gravity_m_s2", "gravity_sigma_mgal", "uncorrected_m_s2",
         "noise_sigma_mgal", "difference_frequency_rad_s", "period_s", "period_sigma_s", "samples_used")  # fmt: skip


def process_record(path: Path, config: Config) -> Outcome:
    """Make the result of one input and write it; the function that every executor runs.

    There is an outcome also of an input that is missing, hostile, damaged or too large, and of a fault of our own.
    """
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


def file_sha256(path: str | os.PathLike[str]) -> str:
    """Hexadecimal SHA-256 of an ordinary file.

    `FileError` where there is none, it may not be read, is larger than any that is read, or a folder, a FIFO, a device:
    nothing that could hang.
    """
    ordinary_size(path, MOST_BYTES, "give one")
    try:
        with open(path, "rb", buffering=0) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{shown(path, 400)}: {error.strerror}; give the path of a file that can be read") from None


def _made(path: Path, config: Config, digest: str, record: DataTree) -> Outcome:
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


def _write(result: DataTree, config: Config) -> None:
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
