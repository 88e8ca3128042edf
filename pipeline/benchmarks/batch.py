"""Suite `batch`: wall and processor time of a record in a batch, one process and two, beside a bare loop; promises."""

import json
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import data_schemas
import synth
from pipeline.batch import ledger
from pipeline.benchmarks import tables
from pipeline.benchmarks.scenes import linear

Way = Callable[[Path, Path], list[float]]
"""From a folder of records and one for results to the instants, s, at which records were done."""

BARE, ONE, TWO = "bare loop of read, process, write", "pool of one", "pool of two"
METHOD = "projection"
DURATION = 1800.0  # s
FULL, QUICK = (240, 3), (60, 1)  # records, rounds
SKIPPED = 20  # first records of a run, while its processes start
_SCALING, _OVERHEAD = 1.85, 10.0  # times, ms a record
_BARE = """\
import json, sys, time
from pathlib import Path
import data_schemas
from pipeline.processing import process
records, out, method = sys.argv[1:]
Path(out).mkdir()
ends = []
for path in sorted(Path(records).iterdir()):
    data_schemas.write(process(data_schemas.read(path), method=method), Path(out) / path.name)
    ends.append(time.perf_counter())
print(json.dumps(ends))"""  # The loop that a user would write, and the instants, s, at which its records were done


def make_records(folder: Path, count: int, duration: float) -> Path:
    """Records of two linear pendulums at 25 Hz, each with a noise of its own; truth is left out."""
    folder.mkdir()
    for number in range(count):
        record, _ = synth.simulate(linear(duration=duration, noise=1e-5, seed=number))
        data_schemas.write(record, folder / f"{number:05d}.record.nc")
    return folder


def _run(*words: object) -> Any:
    """Output of a Python program with BLAS in one thread, as commands have it."""
    return tables.command(sys.executable, *map(str, words), OMP_NUM_THREADS="1")()


def _bare(records: Path, out: Path) -> list[float]:
    return list(json.loads(_run("-c", _BARE, records, out, METHOD)))


def _batch(records: Path, out: Path, jobs: int) -> list[float]:
    _run("-m", "pipeline.cli", "batch", records, "-o", out, "--method", METHOD, "--jobs", jobs)
    events = [json.loads(line) for line in (out / ledger.LOG).read_text().splitlines()]
    return [datetime.fromisoformat(line["time"]).timestamp() for line in events if line["event"] == "record"]


WAYS: Mapping[str, Way] = {BARE: _bare, ONE: partial(_batch, jobs=1), TWO: partial(_batch, jobs=2)}


def run(*, quick: bool, folder: Path | None) -> Iterator[tables.Row]:
    """Yield one row a way, the ways taking turns, then one row a promise; quick: fewer records, one round."""
    count, rounds = QUICK if quick else FULL
    taken: dict[str, list[float]] = {name: [] for name in WAYS}
    spent: dict[str, list[float]] = {name: [] for name in WAYS}
    with tempfile.TemporaryDirectory() as home:
        records = make_records(Path(home) / "records", count, DURATION)
        turns = [(turn, name, way) for turn in range(rounds) for name, way in WAYS.items()]
        for turn, name, way in tables.progress(turns, "batch"):
            ends, used = tables.timed(partial(way, records, Path(home) / f"{name} {turn}"))
            ends = ends[SKIPPED:]
            taken[name].append((ends[-1] - ends[0]) / (len(ends) - 1))
            spent[name].append(used / count)
    for name, paces in taken.items():
        wall, cpu = (1e3 * statistics.median(values) for values in (paces, spent[name]))
        ratio = tables.median_ratio(paces, taken[BARE])
        yield {"way": name, "records": count, "ms_a_record": wall, "of_bare_loop": ratio, "cpu_ms_a_record": cpu}
    overhead = statistics.median(one - bare for one, bare in zip(taken[ONE], taken[BARE], strict=True))
    yield tables.at_most(f"{ONE}, over a {BARE}, a record", 1e3 * overhead, _OVERHEAD, "ms")
    faster = tables.median_ratio(taken[BARE], taken[TWO])
    yield tables.at_least(f"{TWO}: times faster than a {BARE}", faster, _SCALING, tables.RATIO)
