"""What is kept: same input, settings, versions, an output as it was written; never because a file exists."""

from __future__ import annotations

import errno
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from batch_parts import POISON, config_of

from data_schemas.errors import FileError
from pipeline.batch.campaign import holds, remove_leftovers
from pipeline.batch.job import failure, owner_of, process_record
from pipeline.batch.ledger import NAME, Ledger
from pipeline.batch.summary import write_summary


@pytest.fixture
def done(small, out, tmp_path):
    """A job that was done, and its ledger."""
    path = Path(shutil.copy(small, tmp_path / "a.record.nc"))
    config = config_of(out, "a")
    with Ledger(out, "{}") as ledger:
        ledger.append([process_record(path, config)], {config.key: config.sha256})
        yield path, config, ledger


def test_what_was_done_holds(done):
    assert holds(*done)
    assert holds(*done, retry_failed=True)


def test_an_output_alone_is_not_enough(done, out):
    path, config, _ = done
    os.rename(out / "ledger.jsonl", out / "aside")
    with Ledger(out, "{}") as empty:
        assert holds(path, config, empty) is False


@pytest.mark.parametrize("which", ["input", "output"])
def test_a_single_bit_of_input_or_output_counts(done, which):
    path, config, ledger = done
    target = path if which == "input" else config.output
    whole = bytearray(target.read_bytes())
    whole[len(whole) // 2] ^= 1
    target.write_bytes(whole)
    assert holds(path, config, ledger) is False


@pytest.mark.parametrize("which", ["input", "output"])
def test_what_is_gone_does_not_hold(done, which):
    path, config, ledger = done
    (path if which == "input" else config.output).unlink()
    assert holds(path, config, ledger) is False


def test_other_settings_and_versions_do_not_hold(done, out):
    path, _, ledger = done
    assert holds(path, config_of(out, "a", gain_uncertainty=0.01), ledger) is False
    ledger.versions = "other"
    assert holds(path, config_of(out, "a"), ledger) is False


def test_a_film_is_what_it_was_only_with_its_description(done, out):
    path, _, ledger = done
    beside = path.with_suffix(".toml")
    config = config_of(out, "a", kind=replace(POISON, beside=lambda _: beside))
    for text in (None, "speed = 1", "speed = 2"):
        if text is not None:
            beside.write_text(text)
            assert holds(path, config, ledger) is False
        ledger.append([process_record(path, config)], {config.key: config.sha256})
        assert holds(path, config, ledger)
    beside.unlink()
    assert holds(path, config, ledger) is False


def test_failures_hold_until_they_are_to_be_tried_again(done):
    path, config, ledger = done
    for status, again in (("failed", False), ("refused", True)):
        line = failure(config.key, "RecordError", "bad", ledger.places[config.key].input_sha256)
        ledger.append([type(line)(line.key, status, "x", "bad", line.input_sha256)], {config.key: config.sha256})
        assert holds(path, config, ledger)
        assert holds(path, config, ledger, retry_failed=True) == again


def test_an_input_that_was_not_there_and_still_is_not(done):
    path, config, ledger = done
    path.unlink()
    ledger.append([failure(config.key, "FileError", "No such file")], {config.key: config.sha256})
    assert holds(path, config, ledger)


def test_leftovers_of_killed_processes_of_this_batch_go_and_nothing_else(out):
    """Two batches in nested folders deleted each other's: 11 of 52 records failed."""
    own, other = owner_of(out), owner_of(out / "nested")
    for name in ("deep", "nested", "copied"):
        (out / name).mkdir()
    with Ledger(out / "nested", "{}"), Ledger(out / "copied", "{}"):
        gone = {f".isochrony-{own}1.part", f"deep/.isochrony-{own}2.part"}
        stay = {f"nested/.isochrony-{other}1.part", f".isochrony-{other}2.part", f"copied/.isochrony-{own}3.part"}
        stay |= {".isochrony-1.part", f".isochrony-{own}1", "mine.part", "a.result.nc"}
        for name in gone | stay:
            (out / name).write_text("")
        assert remove_leftovers(out) == 2
        left = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file() and path.name != NAME}
        assert left == stay


def test_what_a_batch_writes_is_its_own(out, monkeypatch, small):
    names = []
    monkeypatch.setattr("data_schemas.writing._flushed", lambda path, image: names.append(path.name) or full(path))

    def full(_path):
        raise OSError(errno.ENOSPC, "No space left on device")

    config = config_of(out, "deep/a")
    assert process_record(small, config).status == "failed"
    with pytest.raises(FileError, match=r"summary\.csv: cannot be written, No space left"), Ledger(out, "{}") as ledger:
        write_summary([], ledger, out)
    assert len(names) == 2
    assert all(name.startswith(f".isochrony-{owner_of(out)}") for name in names)


def test_a_leftover_that_stays_is_told(out, monkeypatch):
    (out / f".isochrony-{owner_of(out)}1.part").write_text("")

    def fail(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(os, "unlink", fail)
    with pytest.raises(FileError, match="cannot be removed, Read-only file system; remove it yourself"):
        remove_leftovers(out)
