"""Small batches to try things on: records, a kind of input that misbehaves by its name, configs."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

import data_schemas
from pipeline.batch.executors import small_record
from pipeline.batch.job import Config, Kind
from pipeline.cli.batch import read_record

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
    elongation = record["record"]["elongation"].values
    elongation *= 1.0 + 0.01 * number
    elongation += 1e-5 * np.random.default_rng(number).standard_normal(elongation.shape)  # else sigma is rounding alone
    data_schemas.write(record, path)
    return path


def config_of(folder: Path, name: str, **settings: Any) -> Config:
    """Settings of one job."""
    key = f"{name}.result.nc"
    return Config(key=key, folder=folder, **{"kind": POISON, "method": METHODS, **settings})


def numbers_of(path: Path) -> dict[str, Any]:
    """Values of a result by group and name, without what differs from run to run; compare by `alike`."""
    result = data_schemas.read(path)
    result["gravity"]["elapsed"].values[:] = 0.0
    return {f"{group.path}/{name}": values.values for group in result.subtree for name, values in group.dataset.items()}


def alike(one: Any, other: Any) -> bool:
    """Whether the same work gave both; the last digits of a sum depend on where its terms lie in memory."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(alike(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    one, other = np.asarray(one), np.asarray(other)
    if one.dtype.kind not in "fc":
        return bool(np.array_equal(one, other))
    return np.allclose(one, other, rtol=1e-6, atol=1e-9 * np.nanmax(np.abs(one), initial=0.0), equal_nan=True)


class Processes:
    """In place of multiprocessing: processes that play parts, in this one, with their ends of true pipes."""

    Pipe = staticmethod(multiprocessing.Pipe)

    def __init__(self, *parts: Callable[[Connection], object], code: int | None = None) -> None:
        self.parts, self.code = iter(parts), code
        self.made: list[Played] = []

    def get_context(self, how: str) -> Processes:
        assert how == "spawn"
        return self

    def Process(self, *, args: tuple[Any, ...], **_: object) -> Played:
        self.made.append(Played(next(self.parts), args, self.code))
        return self.made[-1]


class Played:
    """Its end of the pipe stays open for as long as there is no part that closes it."""

    def __init__(self, part: Callable[[Connection], object], args: tuple[Any, ...], code: int | None) -> None:
        self.part, (self.pipe, *self.given), self.exitcode = part, args, code
        self.pid: int | None = None
        self.killed = False

    def start(self) -> None:
        self.pipe = Connection(os.dup(self.pipe.fileno()))
        self.part(self.pipe)
        self.pid = 1

    def kill(self) -> None:
        self.killed = True

    def join(self, timeout: float) -> None: ...
