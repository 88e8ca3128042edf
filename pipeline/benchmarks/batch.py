"""Suite `batch`: what a record costs in a batch beside a bare loop, and whether every way gives the same summary.

The first table: one row a way of doing the same records. The second: every promise.
"""

from __future__ import annotations

import filecmp
import importlib.util
import statistics
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipeline.batch.summary import NAMES
from pipeline.benchmarks import batch_ways
from pipeline.benchmarks.bar import at_least, at_most, holds, not_measured
from pipeline.benchmarks.batch_ways import BARE, DASK, KILLED, ONE, TWO, Way
from pipeline.benchmarks.clock import median_ratio
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.progress import progress

DURATION = 1800.0  # s
FULL, QUICK = (240, 3), (60, 1)  # records, rounds
SKIPPED = 20  # first records of a run, while its processes start

_SCALING, _OVERHEAD, _BY_DASK = 1.8, 10.0, 1.3


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a way, then one row a promise; ways take turns, so that a busy machine slows all of them.

    Quick: fewer records, one round. With a folder: both tables as CSV.
    """
    count, rounds = QUICK if quick else FULL
    ways = dict(batch_ways.WAYS)
    if importlib.util.find_spec("distributed") is None:
        del ways[DASK]
    taken: dict[str, list[float]] = {name: [] for name in ways}
    same = True
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        records = batch_ways.make_records(home / "records", count, DURATION)
        turns = [(turn, name, way) for turn in range(rounds) for name, way in ways.items()]
        for turn, name, way in progress(turns, "batch"):
            out = home / f"{name} {turn}"
            taken[name].append(_pace(way, records, out))
            same = same and (name == BARE or _same(out, home / f"{ONE} 0"))
        batch_ways.killed_and_resumed(records, home / KILLED, count // 2)
        resumed = _same(home / KILLED, home / f"{ONE} 0")
    table = [_row(name, count, taken) for name in taken]
    promises = [*_speed(taken), holds("summary.csv and summary.nc, whoever does the work", same, "same bytes"),
                holds("killed with -9 in the middle and resumed: summary", resumed, "same bytes")]  # fmt: skip
    yield from table
    yield from promises
    if folder is not None:
        write(folder / "batch.csv", table)
        write(folder / "batch-bars.csv", promises)


def _pace(way: Way, records: Path, out: Path) -> float:
    """s from one record to the next, once all processes work."""
    ends = way(records, out)[SKIPPED:]
    return (ends[-1] - ends[0]) / (len(ends) - 1)


def _same(one: Path, other: Path) -> bool:
    return not any(filecmp.cmpfiles(one, other, NAMES, shallow=False)[1:])


def _row(name: str, count: int, taken: Mapping[str, list[float]]) -> dict[str, Any]:
    return {
        "way": name,
        "records": count,
        "ms_a_record": 1e3 * statistics.median(taken[name]),
        "of_bare_loop": median_ratio(taken[name], taken[BARE]),
    }


def _speed(taken: Mapping[str, list[float]]) -> Iterator[dict[str, Any]]:
    overhead = statistics.median(one - bare for one, bare in zip(taken[ONE], taken[BARE], strict=True))
    yield at_most(f"{ONE}, over a {BARE}, a record", 1e3 * overhead, _OVERHEAD, "ms")
    yield at_least(f"{TWO}: times faster than a {BARE}", median_ratio(taken[BARE], taken[TWO]), _SCALING)
    bar = f"{DASK}: times the {TWO}"
    if DASK in taken:
        yield at_most(bar, median_ratio(taken[DASK], taken[TWO]), _BY_DASK)
    else:
        yield not_measured(bar, f"<= {_BY_DASK:g}", "not installed: extra 'cluster'")
