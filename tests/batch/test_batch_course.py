"""What a batch tells on its way, and how a process is readied for it."""

from __future__ import annotations

import errno
import gc
import json
import os
import sys
import warnings

import pytest
from batch_parts import METHODS, config_of

from data_schemas.errors import FileError
from pipeline.batch import campaign, executors
from pipeline.batch.campaign import Tally
from pipeline.batch.executors import serial
from pipeline.batch.ledger import LOG as NAME
from pipeline.batch.ledger import Ledger, Log


def test_progress_and_log_tell_of_every_input(small, out):
    jobs = [(small, config_of(out, name)) for name in "abc"]
    seen = []
    with Ledger(out, "{}") as ledger, Log(out) as log:
        tally = Tally(3)
        campaign.run(jobs[:1], ledger, serial, log, tally)
        campaign.run(
            jobs, ledger, serial, log, Tally(3), progress=lambda done, total, note: seen.append((done, total, note))
        )
    assert seen == [(2, 3, ""), (3, 3, "")]
    events = [json.loads(line) for line in (out / NAME).read_text().splitlines()]
    assert [event["key"] for event in events] == [config.key for _, config in jobs]
    assert all(event["seconds"] > 0 and event["time"].endswith("+00:00") for event in events)


def test_a_log_that_cannot_be_written_is_told(out, tmp_path):
    with pytest.raises(FileError, match="cannot be written, No such file"):
        Log(tmp_path / "none")

    class Full:
        def write(self, _):
            raise OSError(errno.ENOSPC, "No space left on device")

        def close(self):
            pass

    with Log(out) as log:
        log._file.close()
        log._file = Full()
        with pytest.raises(FileError, match="No space left on device"):
            log.event("x")


def test_a_process_is_readied_once_and_what_it_holds_is_passed_over():
    try:
        executors.warm((*METHODS, "panteleev"))
        assert gc.get_freeze_count() > 1000
    finally:
        gc.unfreeze()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its parent")
@pytest.mark.parametrize(("parent", "status"), [("its own", 0), ("gone", 1)])
def test_a_process_without_its_parent_ends(parent, status):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork of a process with threads
        here = os.getpid()
        child = os.fork()
    if child == 0:
        executors._die_with(here if parent == "its own" else 1 << 22)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == status


def test_elsewhere_nothing_is_asked_of_the_system(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    executors._die_with(-1)
