"""Suite `batch`: what a record costs in a batch beside a bare loop, and whether every way gives the same summary.

The first table: one row a way of doing the same records: wall time from one record to the next, which is what several
cores shorten, and processor time of all processes, start included. The second: every promise.
"""

from __future__ import annotations

import filecmp
import importlib.util
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import data_schemas
import synth
from pipeline.batch import ledger
from pipeline.batch.summary import NAMES
from pipeline.benchmarks import tables
from pipeline.benchmarks.scenes import linear

Way = Callable[[Path, Path], list[float]]
"""From a folder of records and one for results to the instants, s, at which records were done."""

BARE, ONE, TWO = "bare loop of read, process, write", "pool of one", "pool of two"
DASK, KILLED = "dask, two workers of one thread", "killed"
METHOD = "projection"
DURATION = 1800.0  # s
FULL, QUICK = (240, 3), (60, 1)  # records, rounds
SKIPPED = 20  # first records of a run, while its processes start

_SCALING, _OVERHEAD, _BY_DASK = 1.85, 10.0, 1.3


def make_records(folder: Path, count: int, duration: float) -> Path:
    """Records of two linear pendulums at 25 Hz, each with a noise of its own; truth is left out."""
    folder.mkdir()
    for number in range(count):
        record, _ = synth.simulate(linear(duration=duration, noise=1e-5, seed=number))
        data_schemas.write(record, folder / f"{number:05d}.record.nc")
    return folder


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


def _environment() -> dict[str, str]:
    """BLAS in one thread everywhere, as commands have it."""
    return tables.tree_environment() | {"OMP_NUM_THREADS": "1"}


def _bare(records: Path, out: Path) -> list[float]:
    words = [sys.executable, "-c", _BARE, str(records), str(out), METHOD]
    done = subprocess.run(words, env=_environment(), check=True, capture_output=True, text=True)
    return list(json.loads(done.stdout))


def _command(records: Path, out: Path, *words: str) -> list[str]:
    return [sys.executable, "-m", "pipeline.cli", "batch", str(records), "-o", str(out), "--method", METHOD, *words]


def _batch(records: Path, out: Path, words: Sequence[str]) -> list[float]:
    subprocess.run(_command(records, out, *words), env=_environment(), check=True, capture_output=True)
    events = [json.loads(line) for line in (out / ledger.LOG).read_text().splitlines()]
    return [datetime.fromisoformat(line["time"]).timestamp() for line in events if line["event"] == "record"]


def _by_dask(records: Path, out: Path) -> list[float]:
    """A scheduler here, and two workers of one thread as separate processes on the loopback."""
    from distributed import LocalCluster

    work = {"n_workers": 2, "threads_per_worker": 1, "env": _environment(), "dashboard_address": None}
    with LocalCluster(**work, local_directory=str(out.with_name("dask"))) as cluster:
        return _batch(records, out, ("--scheduler", cluster.scheduler_address))


def killed_and_resumed(records: Path, out: Path, after: int) -> None:
    """Kill a batch of two processes with -9 once so many records are in its ledger, and resume it."""
    words = _command(records, out, "--jobs", "2")
    with subprocess.Popen(words, env=_environment(), stderr=subprocess.DEVNULL) as begun:
        kept = out / ledger.NAME
        while begun.poll() is None and (not kept.exists() or kept.read_bytes().count(b"\n") < after):
            time.sleep(0.01)
        begun.kill()
    subprocess.run([*words, "--resume"], env=_environment(), check=True, capture_output=True)


WAYS: Mapping[str, Way] = {
    BARE: _bare,
    ONE: partial(_batch, words=("--jobs", "1")),
    TWO: partial(_batch, words=("--jobs", "2")),
    DASK: _by_dask,
}


def run(*, quick: bool, folder: Path | None) -> Iterator[tables.Row]:
    """Yield one row a way, then one row a promise; ways take turns, so that a busy machine slows all of them.

    Quick: fewer records, one round.
    """
    count, rounds = QUICK if quick else FULL
    ways = {name: way for name, way in WAYS.items() if name != DASK or importlib.util.find_spec("distributed")}
    taken: dict[str, list[float]] = {name: [] for name in ways}
    spent: dict[str, list[float]] = {name: [] for name in ways}
    same = True
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        records = make_records(home / "records", count, DURATION)
        turns = [(turn, name, way) for turn in range(rounds) for name, way in ways.items()]
        for turn, name, way in tables.progress(turns, "batch"):
            out = home / f"{name} {turn}"
            ends, used = tables.timed(partial(way, records, out))
            ends = ends[SKIPPED:]
            taken[name].append((ends[-1] - ends[0]) / (len(ends) - 1))
            spent[name].append(used / count)
            same = same and (name == BARE or _same(out, home / f"{ONE} 0"))
        killed_and_resumed(records, home / KILLED, count // 2)
        resumed = _same(home / KILLED, home / f"{ONE} 0")
    for name, paces in taken.items():
        wall, cpu = (1e3 * statistics.median(values) for values in (paces, spent[name]))
        ratio = tables.median_ratio(paces, taken[BARE])
        yield {"way": name, "records": count, "ms_a_record": wall, "of_bare_loop": ratio, "cpu_ms_a_record": cpu}
    overhead = statistics.median(one - bare for one, bare in zip(taken[ONE], taken[BARE], strict=True))
    yield tables.at_most(f"{ONE}, over a {BARE}, a record", 1e3 * overhead, _OVERHEAD, "ms")
    faster = tables.median_ratio(taken[BARE], taken[TWO])
    yield tables.at_least(f"{TWO}: times faster than a {BARE}", faster, _SCALING, tables.RATIO)
    bar = f"{DASK}: times the {TWO}"
    if DASK in taken:
        yield tables.at_most(bar, tables.median_ratio(taken[DASK], taken[TWO]), _BY_DASK, tables.RATIO)
    else:
        yield tables.not_measured(bar, f"<= {_BY_DASK:g}", "not installed: extra 'cluster'")
    yield tables.holds("summary.csv and summary.nc, whoever does the work", same, "same bytes")
    yield tables.holds("killed with -9 in the middle and resumed: summary", resumed, "same bytes")


def _same(one: Path, other: Path) -> bool:
    return not any(filecmp.cmpfiles(one, other, NAMES, shallow=False)[1:])
