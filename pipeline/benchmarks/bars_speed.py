"""Bars on speed, as ratios within one run."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.benchmarks import speed
from pipeline.benchmarks.bar import Row, at_most


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the bars of speed."""
    yield from _estimation(quick=quick)
    yield from _start_up(quick=quick)


def _estimation(*, quick: bool) -> Iterator[Row]:
    for row in speed.estimation(quick=quick):
        if row["error_mgal"] is not None:
            yield at_most(f"{row['what']}: share of the time of {row['rival']}", row["share_of_rival"], 1.0)
            yield at_most(f"{row['what']}: error, noise-free", row["error_mgal"], 1e-6, "mGal")


def _start_up(*, quick: bool) -> Iterator[Row]:
    for row in speed.start_up(quick=quick):
        limit = 3.0 if "--help" in row["what"] else 2.5
        yield at_most(f"{row['what']}, start to exit: times {row['rival']}", row["share_of_rival"], limit)
