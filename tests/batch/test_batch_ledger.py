"""The ledger: what was appended is there, whatever killed, cut or bent it; and nothing else is."""

from __future__ import annotations

import errno
import os
import zlib

import pytest
from batch_parts import config_of

from data_schemas.errors import FileError, UsageError
from pipeline.batch import ledger as module
from pipeline.batch.job import Outcome, failure
from pipeline.batch.ledger import NAME, Index, Ledger, Log, line_of, outcome_content

ONE = Outcome("a.result.nc", "ok", None, None, "11", "22", ({"method": "projection", "gravity_m_s2": 0.1 + 0.2},), 1.5)
TWO = failure("b/c.result.nc", "FileError", "bad\nfile \udcff", "33")
SUMS = {ONE.key: "c1", TWO.key: "c2"}


@pytest.fixture
def written(out):
    with Ledger(out, "{}") as ledger:
        ledger.append([ONE, TWO], SUMS)
    return out / NAME


def test_what_was_appended_is_read_back_to_the_last_bit(out, written):
    index = Index(out, "{}")
    assert list(index.places) == [ONE.key, TWO.key]
    assert index.line(ONE.key)["rows"] == list(ONE.rows)
    assert index.line(TWO.key)["error"] == "bad file \udcff"
    assert index.places[ONE.key].configuration_sha256 == "c1"
    assert index.places[ONE.key].versions == index.versions != Index(out, '{"numpy": "9"}').versions


def test_the_last_line_of_a_key_holds(out, written):
    with Ledger(out, "{}") as ledger:
        ledger.append([Outcome(ONE.key, "refused")], SUMS)
        assert ledger.places[ONE.key].status == "refused"
    assert Index(out, "{}").line(ONE.key)["status"] == "refused"


def test_cut_anywhere_whole_lines_stay_and_the_torn_one_goes(out, written):
    whole = written.read_bytes()
    ends = [0] + [place + 1 for place, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(len(whole)):
        written.write_bytes(whole[:length])
        with Ledger(out, "{}") as ledger:
            lines = sum(end <= length for end in ends[1:])
            assert len(ledger.places) == max(lines - 1, 0), length
            ledger.append([Outcome("z.result.nc", "ok")], {"z.result.nc": ""})
        index = Index(out, "{}")
        assert len(index.places) == max(lines - 1, 0) + 1
        assert index.line("z.result.nc")["status"] == "ok"


def test_no_bent_line_is_believed(out, written):
    whole = written.read_bytes()
    for place in range(len(whole)):
        bent = bytearray(whole)
        bent[place] ^= 1 << place % 8
        written.write_bytes(bent)
        index = Index(out, "{}")
        for one in (ONE, TWO):
            if one.key in index.places:
                assert index.line(one.key)["rows"] == list(one.rows)
                assert index.places[one.key].output_sha256 == one.output_sha256


def test_a_line_damaged_after_the_ledger_was_read_is_told(out, written):
    index = Index(out, "{}")
    written.write_bytes(b"x" * written.stat().st_size)
    with pytest.raises(FileError, match=r"line of a\.result\.nc was damaged meanwhile; use --resume"):
        index.line(ONE.key)


def test_versions_are_told_once_each(out):
    for versions in ("{}", '{"numpy": "1"}', "{}"):
        with Ledger(out, versions) as ledger:
            ledger.append([], {})
    assert len((out / NAME).read_text().splitlines()) == 2


def test_two_batches_never_write_to_one_ledger(out, written):
    with Ledger(out, "{}"), pytest.raises(UsageError, match="another batch writes to it"):
        Ledger(out, "{}")
    with Ledger(out, "{}") as ledger:  # the lock went with its holder
        assert len(ledger.places) == 2


def test_a_system_without_locks_is_trusted(out, written, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "fcntl", None)
    with Ledger(out, "{}"), Ledger(out, "{}") as ledger:
        assert len(ledger.places) == 2


@pytest.mark.parametrize("step", ["write", "fsync", "ftruncate"])
def test_a_disk_that_fails_is_told_and_nothing_is_lost(out, written, monkeypatch, step):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    before = written.read_bytes()
    told = rf"{NAME}: cannot be written, No space left on device; .*go on with --resume"
    if step == "ftruncate":
        monkeypatch.setattr(module.os, step, fail)
        with pytest.raises(FileError, match=told):
            Ledger(out, "{}")
    else:
        with Ledger(out, "{}") as ledger:
            monkeypatch.setattr(module.os, step, fail)
            with pytest.raises(FileError, match=told):
                ledger.append([Outcome("z.result.nc", "ok")], {"z.result.nc": ""})
            assert "z.result.nc" not in ledger.places
    monkeypatch.undo()
    assert written.read_bytes().startswith(before)
    with Ledger(out, "{}") as ledger:  # nobody holds it any more
        assert list(ledger.places)[:2] == [ONE.key, TWO.key]


def test_short_writes_are_finished(out, monkeypatch):
    write = os.write
    with Ledger(out, "{}") as ledger:
        monkeypatch.setattr(module.os, "write", lambda number, data: write(number, data[:7]))
        ledger.append([ONE, TWO], SUMS)
        monkeypatch.undo()
    assert list(Index(out, "{}").places) == [ONE.key, TWO.key]


def test_a_ledger_that_cannot_be_is_told(tmp_path):
    with pytest.raises(FileError, match="cannot be written, No such file"):
        Ledger(tmp_path / "none", "{}")
    with pytest.raises(FileError, match="make it readable"):
        Index(tmp_path / "none", "{}")


def test_configurations_differ_by_what_matters_alone(out):
    one = config_of(out, "a")
    assert one.sha256 == config_of(out.parent, "b", memory=1, command="x").sha256
    for setting in ({"method": ("auto",)}, {"pair": "1-2"}, {"gain_uncertainty": 0.01}, {"member": 1},
                    {"variant": (("gravity", 9.8),)}):  # fmt: skip
        assert config_of(out, "a", **setting).sha256 != one.sha256


FOREIGN = {
    "a text": lambda path: path.write_text("all that I know\nof pendulums"),
    "lines of JSON of others": lambda path: path.write_text('{"a": 1}\n{"b": 2}\n'),
    "one long line": lambda path: path.write_bytes(b"{" * (module.MOST_LINE + 1)),
    "a hole of a tebibyte": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 1 << 40),
    "a pipe": os.mkfifo,
    "a link": lambda path: path.symlink_to(path.with_name("precious")),
    "a link to nothing": lambda path: path.symlink_to("nothing"),
    "a device": lambda path: path.symlink_to("/dev/zero"),
}


@pytest.mark.skipif(os.name != "posix", reason="pipes and links")
@pytest.mark.parametrize("what", FOREIGN)
def test_a_ledger_that_is_not_ours_is_left_as_it_is(what, out):
    (out / "precious").write_bytes(line_of({"versions": "1"}))
    path = out / NAME
    FOREIGN[what](path)
    before = path.lstat()
    for kind in (Index, Ledger):
        with pytest.raises(FileError, match=r"ledger\.jsonl: is no ledger of a batch; move it away"):
            kind(out, "{}")
    after = path.lstat()
    assert (after.st_size, after.st_mtime, after.st_mode) == (before.st_size, before.st_mtime, before.st_mode)
    assert (out / "precious").read_bytes() == line_of({"versions": "1"})
    assert not (out / "nothing").exists()


@pytest.mark.skipif(os.name != "posix", reason="links")
def test_a_log_that_is_a_link_is_not_followed(out):
    (out / "batch.log.jsonl").symlink_to(out / "precious")
    with pytest.raises(FileError, match="cannot be written"):
        Log(out)
    assert not (out / "precious").exists()


BAD = {
    "a field missing": lambda line: line.pop("rows"),
    "a field of another kind": lambda line: line.update(status=1),
    "an unknown status": lambda line: line.update(status="lost"),
    "no list": lambda line: line.update(rows=5),
    "a row of another kind": lambda line: line.update(rows=[1]),
    "text for a number": lambda line: line.update(rows=[{"gravity_m_s2": "g"}]),
    "a number for text": lambda line: line.update(rows=[{"record_id": 5}]),
}


@pytest.mark.parametrize("what", BAD)
def test_a_line_with_other_fields_counts_as_not_there(what, out, written):
    content = outcome_content(ONE, "c1", "v")
    content["key"] = "bad.result.nc"
    BAD[what](content)
    with written.open("ab") as file:
        file.write(line_of(content))
    assert set(Index(out, "{}").places) == set(SUMS)


@pytest.mark.parametrize("text", [b'{"key": ' + b"[" * 100_000, b"[1, 2", b'{"key": }'])
def test_a_line_that_is_no_object_counts_as_not_there(text, out, written):
    crc = f', "crc32": "{zlib.crc32(text):08x}"}}\n'.encode()
    with written.open("ab") as file:
        file.write(text + crc)
    assert set(Index(out, "{}").places) == set(SUMS)
