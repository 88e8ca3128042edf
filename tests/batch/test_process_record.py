"""One input to one outcome: whatever it is, it is told and never raised."""

from __future__ import annotations

import os
import sys
import zlib
from functools import partial

import h5py
import numpy as np
import pytest
from batch_parts import POISON, alike, config_of, numbers_of, write_record

import data_schemas
from data_schemas import shield as memory
from data_schemas.errors import FileError
from data_schemas.guard import Budget
from data_schemas.text_files import file_sha256
from pipeline.batch import job
from pipeline.batch.executors import small_record
from pipeline.batch.job import Kind, process_record
from pipeline.processing import process


def test_the_result_is_that_of_process_with_its_provenance(small, out):
    config = config_of(out, "deep/a", command="isochrony batch x")
    outcome = process_record(small, config)
    assert (outcome.status, outcome.error, outcome.error_class) == ("ok", None, None)
    assert outcome.input_sha256 == file_sha256(small)
    assert outcome.output_sha256 == file_sha256(config.output)
    assert outcome.seconds > 0
    assert data_schemas.validate(config.output) == []
    result = data_schemas.read(config.output)
    direct = process(data_schemas.read(small), method="projection")
    assert result.attrs["command"] == "isochrony batch x"
    assert '"gain_uncertainty": 0.0' in result.attrs["configuration"]
    np.testing.assert_array_equal(result["gravity"]["gravity"], direct["gravity"]["gravity"])
    assert outcome.rows[0]["gravity_m_s2"] == float(direct["gravity"]["gravity"][0])
    again = config_of(out, "b", command="other")
    process_record(small, again)
    assert alike(numbers_of(again.output), numbers_of(config.output))


def _short(path):
    data_schemas.write(small_record(200), path)


def _sparse(path):
    path.touch()
    os.truncate(path, 1 << 40)


def _truth(path):
    record = small_record()
    record.attrs["schema"] = "isochrony-truth"
    data_schemas.write(record, path)


@pytest.mark.parametrize(
    ("make", "status", "error_class", "told"),
    [
        (lambda _: None, "failed", "FileError", "No such file"),
        (lambda path: path.mkdir(), "failed", "FileError", "is a folder; give one"),
        (os.mkfifo, "failed", "FileError", "not an ordinary file"),
        (lambda path: path.symlink_to("/dev/zero"), "failed", "FileError", "not an ordinary file"),
        (_sparse, "failed", "FileError", "has 1099511627776 bytes, more than"),
        (lambda path: path.write_bytes(b""), "failed", "FileError", "is empty"),
        (lambda path: path.write_text("a,b"), "failed", "FileError", "not netCDF-4"),
        (_truth, "failed", "RecordError", "schema"),
        (_short, "refused", "RefusedError", "swings are too few"),
    ],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_bad_inputs_are_outcomes(tmp_path, out, make, status, error_class, told):
    path = tmp_path / "bad.record.nc"
    make(path)
    outcome = process_record(path, config_of(out, "bad"))
    assert (outcome.status, outcome.error_class) == (status, error_class)
    import re

    assert re.search(told, outcome.error)
    assert outcome.error.isprintable()
    assert len(outcome.error) <= 500
    assert outcome.output_sha256 is None
    assert list(out.iterdir()) == []


def test_every_method_refusing_is_a_refusal(small, out, monkeypatch):
    import pipeline.summary

    told = {"status": "refused", "error": "no swing; give another"}
    monkeypatch.setattr(pipeline.summary, "summaries", lambda _: [told])
    outcome = process_record(small, config_of(out, "a"))
    assert (outcome.status, outcome.error) == ("refused", f"{small}: {told['error']}")
    assert list(out.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "error_class", "told"),
    [("odd", "ZeroDivisionError", "internal error: ZeroDivisionError: two lines; please report"),
     ("greedy", "MemoryError", "needs more memory than is allowed; give it more")],
)  # fmt: skip
def test_faults_of_our_own_are_outcomes(tmp_path, out, name, error_class, told):
    path = write_record(tmp_path / f"{name}-1.record.nc")
    outcome = process_record(path, config_of(out, "a"))
    assert (outcome.status, outcome.error_class) == ("failed", error_class)
    assert told in outcome.error
    assert outcome.input_sha256 == file_sha256(path)


def test_a_result_that_cannot_be_written_is_an_outcome(small, out):
    (out / "file").write_text("")
    outcome = process_record(small, config_of(out / "file", "deep/a"))
    assert outcome.status == "failed"
    assert "cannot be made, " in outcome.error
    (out / "a.result.nc").mkdir()
    assert "not an ordinary file" in process_record(small, config_of(out, "a")).error


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits address space")
def test_memory_grows_with_what_is_declared_and_no_further(small, out):
    """A record may hold twelve times what it declares beside the fixed part."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    seen = []

    def hungry(path, config, allow):
        seen.append(resource.getrlimit(resource.RLIMIT_AS)[0])
        allow(100 << 20)
        seen.append(resource.getrlimit(resource.RLIMIT_AS)[0])
        np.empty(1 << 27)  # 1 GiB: within
        np.empty(1 << 30)  # 8 GiB: beyond

    outcome = process_record(small, config_of(out, "a", kind=Kind("hungry", (".nc",), hungry), memory=512 << 20))
    assert outcome.error_class == "MemoryError"
    assert seen[1] - seen[0] == 12 * (100 << 20)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits address space")
def test_a_bomb_gets_half_of_the_machine_at_most(small, out, tmp_path, monkeypatch):
    """A gibibyte of zeros in a file of a megabyte, read on a machine that has one, by whoever lets such files pass."""
    monkeypatch.setattr("data_schemas.reading.Budget", partial(Budget, packed=2000))
    path = tmp_path / "bomb.record.nc"
    path.write_bytes(small.read_bytes())
    with h5py.File(path, "r+") as file:
        bomb = file.create_dataset("record/bomb", (1 << 27,), "f8", chunks=(1 << 22,), compression=9)
        packed = zlib.compress(bytes(1 << 25), 9)
        for start in range(0, 1 << 27, 1 << 22):
            bomb.id.write_direct_chunk((start,), packed)
    assert path.stat().st_size < 2 << 20
    real = os.sysconf
    monkeypatch.setattr(memory.os, "sysconf", lambda name: (1 << 30) // 4096 if name == "SC_PHYS_PAGES" else real(name))
    outcome = process_record(path, config_of(out, "a", memory=512 << 20))
    assert outcome.error_class == "FileError"
    # of the array, or already of the file where this process is a large one
    assert outcome.error.endswith(": takes more memory than this process may have; give it more")


def test_where_memory_cannot_be_limited_it_is_not(small, out, monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "_STATM", tmp_path / "none")
    assert process_record(small, config_of(out, "a", memory=1)).status == "ok"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits address space")
def test_a_lower_limit_of_the_system_stays(monkeypatch):
    import resource

    set_to = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1000, 2000))
    monkeypatch.setattr(resource, "setrlimit", lambda _, limit: set_to.append(limit))
    with memory.bounded(1 << 40):
        pass
    assert set_to == [(2000, 2000), (1000, 2000)]


def test_an_interrupt_is_no_outcome(small, out, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(job, "_made", stop)
    with pytest.raises(KeyboardInterrupt):
        process_record(small, config_of(out, "a"))


def test_a_checksum_of_what_may_not_be_read(tmp_path):
    with pytest.raises(FileError, match="null byte"):
        file_sha256("a\0b")
    assert POISON.searched
