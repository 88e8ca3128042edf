"""Batches on a simulated system: killed, cut off from power, out of space, with a disk that fails and workers that die.

Nothing is lost, doubled or silently wrong, and a failure replays from its seed: see `simulated_batch`.
"""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("fcntl")

from simulated_batch import violation, violations
from simulated_disk import ROOT, Disk
from simulated_system import FAULTS, MET, Killed, System, calls_replaced
from simulated_workers import FATES

from data_schemas import writing
from pipeline.batch import campaign, ledger
from pipeline.batch.job import Outcome, input_sha256
from pipeline.batch.ledger import Ledger

FOUND = {
    50: "a ledger that a power loss left as NULs was no ledger of a batch",
    580: "the same, NULs after its first letters",
    11135: "the same, the end of its first line behind NULs",
    156: "a ledger that could not be read for the summary was an internal error",
    995: "the same",
    19: "a log that could not be written was an internal error on closing it",
    25: "the same",
    36: "a folder of results was not brought to the disk",
    59: "the same, of two levels",
    7: "the folder of -o, made with those above it, was not brought to the disk",
    9: "the same",
}
"""Seeds that showed faults of ours, and what they were."""


def test_nothing_is_lost_doubled_or_wrong():
    MET.clear()
    assert list(violations(range(200))) == []
    assert MET.keys() >= {*FAULTS, *(f"worker {fate}" for fate in ("well", *FATES))}


@pytest.mark.parametrize("seed", FOUND)
def test_what_was_found_stays_mended(seed):
    with calls_replaced():
        assert violation(seed) is None


@pytest.mark.campaign
def test_nothing_is_lost_doubled_or_wrong_in_very_many():
    assert list(violations(range(20_000))) == []


def traced(seed):
    lines = []
    with calls_replaced():
        assert violation(seed, lines.append) is None
    return lines


def test_a_seed_replays_call_by_call():
    assert traced(11) == traced(11)
    assert len(traced(11)) > 100


def unflushed(temporary, image):
    """As `writing._flushed`, which waits for the disk."""
    with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb") as file:
        file.write(image)


def written_alone(book, lines):
    """As `Ledger._write`, which waits for the disk."""
    left = b"".join(lines)
    book._size += len(left)
    while left:
        left = left[os.write(book._file, left) :]


def row_before_result(path, config, book, **settings):
    """As `holds`, and what does not is in the ledger before it is done."""
    held = campaign.holds(path, config, book, **settings)
    if not held:
        row = {"record_id": "?", "status": "ok"}
        digest = input_sha256(path, config.kind)
        book.append([Outcome(config.key, "ok", None, None, digest, None, (row,))], {config.key: config.sha256})
    return held


def by_existence(path, config, book, **_):
    """As `holds`, which looks at the bytes."""
    found = book.places.get(config.key)
    return found is not None and found.fits(config, book.versions) and config.output.exists()


BROKEN = {
    "results are not brought to the disk": (writing, "_flushed", unflushed),
    "lines are not brought to the disk": (Ledger, "_write", written_alone),
    "folders are not brought to the disk": (writing, "sync_folder", lambda _: None),
    "a row is written before its result": (campaign, "holds", row_before_result),
    "a result is kept because it exists": (campaign, "holds", by_existence),
    "a torn end stays": (ledger.os, "ftruncate", lambda *_: None),
    "leftovers stay": (campaign, "remove_leftovers", lambda _: 0),
    "leftovers of others go": (campaign, "owner_of", lambda _: ""),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_batch_is_seen(what):
    with calls_replaced(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(*BROKEN[what])
        assert any(violation(seed) is not None for seed in range(200))


@pytest.fixture
def system():
    """One whose calls are replaced, with a folder."""
    with calls_replaced(), pytest.MonkeyPatch.context() as patch:
        made = System(Random(1))
        patch.setattr(System, "mounted", made)
        made.disk.add(f"{ROOT}/a/old", b"old")
        yield made


def write(path, data, *, sync):
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT), "wb") as file:
        file.write(data)
        file.flush()
        if sync:
            os.fsync(file.fileno())


@pytest.mark.parametrize(("file", "folder"), [(True, True), (True, False), (False, True), (False, False)])
def test_what_is_brought_to_the_disk_outlives_the_power(system, file, folder):
    ends = set()
    for seed in range(200):
        disk = system.disk = Disk()
        disk.add(f"{ROOT}/a/old", b"old")
        write(f"{ROOT}/a/new", b"new!", sync=file)
        if folder:
            writing.sync_folder(Path(f"{ROOT}/a"))
        disk.lose_power(Random(seed))
        ends.add(dict(disk.files()).get(f"{ROOT}/a/new"))
    assert (None in ends) == (not folder)
    assert ends - {None} >= ({b"new!"} if file else {b"new!", b"", bytes(4)})
    assert not file or ends <= {b"new!", None}
    assert dict(disk.files())[f"{ROOT}/a/old"] == b"old"


def test_a_name_is_given_in_one_step(system):
    for seed in range(200):
        disk = system.disk = Disk()
        disk.add(f"{ROOT}/a/old", b"old")
        write(f"{ROOT}/a/part", b"new", sync=True)
        os.replace(f"{ROOT}/a/part", f"{ROOT}/a/old")
        disk.lose_power(Random(seed))
        assert dict(disk.files())[f"{ROOT}/a/old"] in (b"old", b"new")


def test_a_process_that_ends_takes_nothing_along(system):
    path = Path(f"{ROOT}/a/new")
    write(path, b"new", sync=False)
    system.boot({1: "kill"})
    with pytest.raises(Killed):
        path.unlink()
    with pytest.raises(Killed):
        path.unlink()
    system.boot({2: "eio", 3: "full"})
    with path.open("rb") as file, pytest.raises(OSError, match="Input/output error"):
        file.read()
    with pytest.raises(OSError, match=f"Errno {errno.ENOSPC}"):
        write(f"{ROOT}/a/newer", b"new", sync=False)
    system.boot({})
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("goes_on", [False, True])
@pytest.mark.parametrize("moment", range(1, 8))
def test_what_an_opened_ledger_knows_outlives_the_power(system, moment, goes_on):
    """Whoever wrote it was killed, perhaps before it had brought that to the disk."""
    folder, one = Path(f"{ROOT}/a"), Outcome("a", "ok")
    for seed in range(20):
        system.disk = Disk()
        system.disk.add(f"{folder}/old", b"old")
        system.boot({-moment: "kill"})
        with contextlib.suppress(Killed), Ledger(folder, "{}") as book:
            book.append([one], {"a": ""})
        system.boot({})
        with Ledger(folder, "{}") as book:
            if goes_on:
                book.append([one], {"a": ""})
            known = book.places
        system.boot({})
        system.disk.lose_power(Random(seed))
        with Ledger(folder, "{}") as book:
            assert book.places == known


def test_a_line_is_read_behind_one_that_the_disk_lost(system):
    folder, line = Path(f"{ROOT}/a"), ledger.line_of(ledger.outcome_content(Outcome("a", "ok"), "", ""))
    system.disk.add(f"{folder}/{ledger.NAME}", ledger.line_of({"versions": "x"}) + bytes(100) + line)
    with Ledger(folder, "{}") as book:
        assert book.line("a")["status"] == "ok"
