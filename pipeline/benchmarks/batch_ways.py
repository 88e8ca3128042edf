"""Ways of doing the same records: a bare loop, the pool, a dask cluster, and a batch that is killed and resumed."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import data_schemas
import synth
from pipeline.batch import ledger_index, log
from pipeline.benchmarks.clock import tree_environment
from pipeline.benchmarks.scenes import linear

Way = Callable[[Path, Path], list[float]]
"""From a folder of records and one for results to the instants, s, at which records were done."""

BARE, ONE, TWO = "bare loop of read, process, write", "pool of one", "pool of two"
DASK, KILLED = "dask, two workers of one thread", "killed"
METHOD = "projection"


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
print(json.dumps(ends))"""
"""The loop that a user would write, and the instants, s, at which its records were done."""


def _environment() -> dict[str, str]:
    """BLAS in one thread everywhere, as commands have it."""
    return tree_environment() | {"OMP_NUM_THREADS": "1"}


def _bare(records: Path, out: Path) -> list[float]:
    words = [sys.executable, "-c", _BARE, str(records), str(out), METHOD]
    done = subprocess.run(words, env=_environment(), check=True, capture_output=True, text=True)
    ends: list[float] = json.loads(done.stdout)
    return ends


def _command(records: Path, out: Path, *words: str) -> list[str]:
    return [sys.executable, "-m", "pipeline.cli", "batch", str(records), "-o", str(out), "--method", METHOD, *words]


def _batch(records: Path, out: Path, words: Sequence[str]) -> list[float]:
    subprocess.run(_command(records, out, *words), env=_environment(), check=True, capture_output=True)
    events = [json.loads(line) for line in (out / log.NAME).read_text().splitlines()]
    return [datetime.fromisoformat(line["time"]).timestamp() for line in events if line["event"] == "record"]


def _by_dask(records: Path, out: Path) -> list[float]:
    with cluster(out.with_name("dask")) as address:
        return _batch(records, out, ("--scheduler", address))


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """Start a scheduler and two workers of one thread, as separate processes on the loopback; yield the address."""
    start = partial(subprocess.Popen, env=_environment(), stderr=subprocess.PIPE, text=True)
    here = ("--no-dashboard", "--host", "127.0.0.1")
    with contextlib.ExitStack() as ends:

        def started(program: str, *words: str) -> subprocess.Popen[str]:
            process = start([sys.executable, "-m", f"distributed.cli.{program}", *words, *here])
            ends.enter_context(process)
            ends.callback(process.terminate)
            return process

        scheduler = started("dask_scheduler", "--port", "0")
        address = _said(scheduler, r"tcp://127\.0\.0\.1:\d+")
        each = ("--nworkers", "2", "--nthreads", "1", "--local-directory", str(folder))
        workers = started("dask_worker", address, *each)
        for _ in range(2):
            _said(workers, "Starting established connection")
        yield address


def _said(process: subprocess.Popen[str], pattern: str) -> str:
    """What a program says of itself, once it does."""
    assert process.stderr is not None
    for line in process.stderr:
        if found := re.search(pattern, line):
            return found[0]
    raise ChildProcessError(f"{process.args!r}: ended before it said '{pattern}'")


def killed_and_resumed(records: Path, out: Path, after: int) -> None:
    """Kill a batch of two processes with -9 once so many records are in its ledger, and resume it."""
    words = _command(records, out, "--jobs", "2")
    with subprocess.Popen(words, env=_environment(), stderr=subprocess.DEVNULL) as begun:
        while begun.poll() is None and _lines(out / ledger_index.NAME) < after:
            time.sleep(0.01)
        begun.kill()
    subprocess.run([*words, "--resume"], env=_environment(), check=True, capture_output=True)


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.exists() else 0


WAYS: Mapping[str, Way] = {
    BARE: _bare,
    ONE: partial(_batch, words=("--jobs", "1")),
    TWO: partial(_batch, words=("--jobs", "2")),
    DASK: _by_dask,
}
