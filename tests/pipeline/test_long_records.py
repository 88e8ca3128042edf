"""Long records: they stay as they were, and what a further sample takes in memory is bounded."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from made_records import simulate

from pipeline import process
from pipeline.methods.exact import linear_fit
from pipeline.observation import observe
from pipeline.prepared import prepare

SMALL_ARC: dict[str, Any] = {"free": ((1e-4, 0.4), (5e-5, 2.2)), "motion": [], "noise": 1e-6}
"""Swings for which linear and real pendulums are the same."""
MOST = 2.0**30 / (25.0 * 86400.0)  # bytes a sample: 1 GiB for a day at 25 Hz


def test_a_record_stays_as_it_was() -> None:
    record, _ = simulate()
    before = record["record"]["elongation"].values.copy()
    linear_fit(prepare(observe(record)))
    assert np.array_equal(record["record"]["elongation"].values, before, equal_nan=True)


def growth(method: str, restoring: str, hours: tuple[float, float], **recording: Any) -> float:
    """Bytes of memory for each further sample at 25 Hz."""

    def peak(hours: float) -> tuple[int, int]:
        record, _ = simulate(**{"duration": 3600.0 * hours, "sampling_rate": 25, "noise": 1e-5} | recording)
        record["instrument"].attrs["restoring"] = restoring
        process(record, method=method)  # libraries and kernels are loaded
        tracemalloc.start()
        try:
            process(record, method=method)
            return tracemalloc.get_traced_memory()[1], record["time"].size
        finally:
            tracemalloc.stop()

    (small, few), (large, many) = peak(hours[0]), peak(hours[1])
    return (large - small) / (many - few)


@pytest.mark.compiled
def test_memory_of_the_linear_identity() -> None:
    """Some twenty numbers a sample: 340 MiB a day."""
    assert growth("projection", "linear", (1.0, 2.0)) < MOST


@pytest.mark.compiled
def test_memory_of_the_nonlinear_identity() -> None:
    """Some twenty-eight numbers a sample: 470 MiB a day."""
    assert growth("shooting", "sine", (0.25, 0.5), **SMALL_ARC) < MOST
