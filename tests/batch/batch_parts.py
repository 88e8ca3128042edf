"""Small batches to try things on: records, a kind of input that misbehaves by its name, configs."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

import data_schemas
from pipeline.batch.config import Config, Kind
from pipeline.batch.warming import small_record
from pipeline.cli.batch_kinds import read_record

METHODS = ("projection",)


def poisoned(path: Path, config: Config, allow: Any) -> Any:
    """A record, unless the name says what is to happen instead."""
    word = path.name.partition("-")[0]
    if word == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if word == "leave":
        os._exit(3)
    if word == "hang":
        time.sleep(1000.0)
    if word == "greedy":
        np.ones(1 << 40)
    if word == "gone":
        raise SystemExit("not an Exception")
    if word == "odd":
        raise ZeroDivisionError("two\nlines")
    return read_record(path, config, allow)


POISON = Kind("record", (".record.nc",), poisoned)


def write_record(path: Path, number: int = 0) -> Path:
    """One of many records that differ."""
    record = small_record()
    record.attrs["record_id"] = f"small-{number}"
    record["record"]["elongation"].values[:] *= 1.0 + 0.01 * number
    data_schemas.write(record, path)
    return path


def config_of(folder: Path, name: str, **settings: Any) -> Config:
    """Settings of one job."""
    key = f"{name}.result.nc"
    return Config(key=key, output=folder / key, **{"kind": POISON, "method": METHODS, **settings})


def numbers_of(path: Path) -> str:
    """Checksum of a result without what differs from run to run."""
    result = data_schemas.read(path)
    for name in ("elapsed_s", "command"):
        result.attrs.pop(name, None)
    result["gravity"]["elapsed"].values[:] = 0.0
    return data_schemas.content_sha256(result)
