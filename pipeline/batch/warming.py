"""Readies a process for records: libraries imported, kernels loaded, before any clock or memory limit counts."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import IsochronyError

if TYPE_CHECKING:
    from xarray import DataTree

_PR_SET_PDEATHSIG = 1
_M_TRIM_THRESHOLD, _KEPT = -1, 16 << 20  # bytes that malloc may keep between records,
_M_MMAP_THRESHOLD, _MAPPED = -3, 8 << 20  # and blocks it asks of the system one by one


def warm(methods: Sequence[str], parent: int | None = None) -> None:
    """Import what processing needs, run every method once, and let garbage collection pass over all that.

    `parent` is a process without which this one is to end: an orphan would write results nobody waits for.
    """
    if parent is not None:
        _die_with(parent)
    _keep_memory()
    import data_schemas.writing  # noqa: F401  # with what reads
    from pipeline.processing import process

    record = small_record()
    for method in methods:
        with contextlib.suppress(IsochronyError):  # a method may decline this record: its kernels are loaded anyway
            process(record, method=method)
    gc.collect()
    gc.freeze()


def small_record(count: int = 2250) -> DataTree:
    """Two free pendulums, `count` readings at 25 Hz; a minute and a half is the least that every method takes."""
    from xarray import Dataset

    from data_schemas import adopted

    time = np.arange(count) * 0.04
    period = np.array([1.00966, 1.009760966])
    swing = 0.01 * np.cos(2.0 * np.pi / period[:, None] * time + np.array([[0.4], [2.2]]))
    swing[1] = swing[0] - swing[1]
    values = {"elongation": (("trace", "time"), swing), "period": ("pendulum", period), "reference_gravity": 9.81}
    said = {"record_id": "warm", "restoring": "sine"}  # not left open, so few swings do not tell it
    return adopted(Dataset(values, {"trace": ["1", "1-2"], "pendulum": ["1", "2"], "time": time}, said))


def _die_with(parent: int) -> None:
    """End with the process that started this one; where the system cannot, the closed pipe ends it after its record."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before we asked
            os._exit(1)


def _keep_memory() -> None:
    """Tell GNU's C library to keep some memory between records; others have no such call.

    Dask has its workers, and so what they start, give all back at once, and a record then spends a sixth of its time
    in getting it again.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_M_TRIM_THRESHOLD, _KEPT)
        mallopt(_M_MMAP_THRESHOLD, _MAPPED)
