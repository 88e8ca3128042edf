"""Memory: a worker stays within its bound, the parent hardly grows with the number of records."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from batch_parts import METHODS, config_of

from pipeline.batch import campaign
from pipeline.batch.campaign import Tally
from pipeline.batch.executors import Isolated
from pipeline.batch.job import Kind, Outcome
from pipeline.batch.ledger import Ledger, Log
from pipeline.cli.batch import read_record

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
    pytest.mark.compiled,
]
ROW = {"record_id": "a", "method": "projection", "gravity_m_s2": 9.8, "flags": "", "samples_used": 45000}


def held(which="VmRSS"):
    """MiB of this process."""
    text = Path("/proc/self/status").read_text()
    return int(text.partition(f"{which}:")[2].split()[0]) / 1024


def outcomes(jobs):
    for _, config in jobs:
        yield [Outcome(config.key, "ok", None, None, "0" * 64, "1" * 64, (ROW,), 0.1)]


def test_the_parent_grows_by_less_than_a_mebibyte_in_a_hundred_records(out, small):
    def many(count, start):
        jobs = [(small, config_of(out, f"{start + number:06d}")) for number in range(count)]
        campaign.run(jobs, ledger, outcomes, log, Tally(count))

    with Ledger(out, "{}") as ledger, Log(out) as log:
        many(500, 0)
        before = held()
        many(1000, 500)
        assert held() - before < 10.0


def peak(path, config, allow):
    """Writes the peak so far beside the result, and reads."""
    config.output.with_suffix(".peak").write_text(str(held("VmHWM")))
    return read_record(path, config, allow)


@pytest.mark.campaign
def test_a_worker_stays_within_its_bound(out, tmp_path):
    """Half an hour at 25 Hz by every method, again and again: no more than 512 MiB and twelve times the record."""
    import synth
    from data_schemas.scene import load_scene
    from pipeline.methods import METHODS as ALL

    path = tmp_path / "ship.record.nc"
    synth.simulate_to(load_scene(synth.scene_path("ship")), path, tmp_path / "ship.truth.nc")
    every = tuple(name for name in ALL if name != "auto")
    bound = 512 + 12 * path.stat().st_size / 2**20
    config = config_of(out, "a", kind=Kind("record", (".nc",), peak), method=every, memory=512 << 20)
    with Isolated(every, 600.0) as child:
        for _ in range(30):
            assert child.run(path, config).status == "ok"
    assert float(config.output.with_suffix(".peak").read_text()) <= bound


@pytest.mark.parametrize("method", [METHODS])
def test_a_worker_that_does_the_least_stays_within_its_bound(out, small, method):
    config = config_of(out, "a", kind=Kind("record", (".nc",), peak), method=method, memory=512 << 20)
    with Isolated(method, 600.0) as child:
        for _ in range(5):
            assert child.run(small, config).status == "ok"
    assert float(config.output.with_suffix(".peak").read_text()) <= 512


FAULTS = """
import resource
import numpy as np
from pipeline.batch import executors
{keep}
for _ in range(3): np.ones(1 << 18)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100): np.ones(1 << 18)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of the GNU C library")
@pytest.mark.parametrize(("keep", "least", "most"), [("", 25_600, 10**9), ("executors._keep_memory()", 0, 2_560)])
def test_memory_is_kept_between_records_where_dask_wants_it_given_back(keep, least, most):
    """Two MiB a hundred times: 512 pages each time, or hardly any."""
    environment = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}
    done = subprocess.run([sys.executable, "-c", FAULTS.format(keep=keep)], env=environment, capture_output=True)
    assert least <= int(done.stdout) <= most
