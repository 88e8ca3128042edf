"""The suite `batch`: ways that give other summaries do not hold, paces come from the log, a killed batch is resumed."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path

import pytest

from pipeline.batch import ledger
from pipeline.batch.summary import NAMES
from pipeline.benchmarks import batch
from pipeline.benchmarks.batch import BARE, DASK, KILLED, ONE, TWO

SECONDS = 130.0


def pretended(pace: float, summary: str = "a"):
    """A way whose records come at a pace, s, after slow first ones."""

    def way(records: Path, out: Path) -> list[float]:
        out.mkdir()
        for name in NAMES:
            (out / name).write_text(summary)
        count = len(list(records.iterdir()))
        return [10.0 + pace * max(number, batch.SKIPPED) for number in range(count)]

    return way


@pytest.fixture
def pretend(monkeypatch: pytest.MonkeyPatch):
    """Run the suite with ways that only pretend."""

    def run(folder: Path, **ways):
        def resumed(records: Path, out: Path, after: int) -> None:
            assert after == batch.QUICK[0] // 2
            pretended(1.0)(records, out)

        def made(folder: Path, count: int, duration: float) -> Path:
            folder.mkdir()
            for number in range(count):
                (folder / f"{number}.record.nc").touch()
            return folder

        monkeypatch.setattr(batch, "WAYS", ways)
        monkeypatch.setattr(batch, "make_records", made)
        monkeypatch.setattr(batch, "killed_and_resumed", resumed)
        return list(batch.run(quick=True, folder=folder))

    return run


def test_paces_and_promises(pretend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch.importlib.util, "find_spec", lambda name: object())
    ways = {BARE: pretended(0.1), ONE: pretended(0.108), TWO: pretended(0.05), DASK: pretended(0.07)}
    rows = pretend(tmp_path, **ways)
    assert [row["ms_a_record"] for row in rows[:4]] == pytest.approx([100.0, 108.0, 50.0, 70.0])
    assert [row["of_bare_loop"] for row in rows[:4]] == pytest.approx([1.0, 1.08, 0.5, 0.7])
    assert [row["value"] for row in rows[4:]] == pytest.approx([8.0, 2.0, 1.4, 1.0, 1.0])
    assert [row["pass"] for row in rows[4:]] == [True, True, False, True, True]


def test_other_summaries_do_not_hold_and_dask_may_be_absent(pretend, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch.importlib.util, "find_spec", lambda name: None)
    ways = {BARE: pretended(0.1), ONE: pretended(0.12), TWO: pretended(0.05, "b"), DASK: pretended(0.07)}
    rows = pretend(None, **ways)
    assert [row["pass"] for row in rows[3:]] == [False, True, None, False, True]


@pytest.mark.compiled
def test_a_killed_batch_is_resumed_and_the_ways_agree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    records = batch.make_records(tmp_path / "records", 6, SECONDS)
    ends = batch.WAYS[TWO](records, tmp_path / ONE)
    assert len(ends) == 6
    begun = []
    popen = subprocess.Popen
    monkeypatch.setattr(batch.subprocess, "Popen", lambda *a, **b: begun.append(popen(*a, **b)) or begun[-1])
    batch.killed_and_resumed(records, tmp_path / KILLED, 2)
    assert begun[0].returncode == -9
    assert (tmp_path / KILLED / ledger.NAME).read_bytes().count(b"\n") >= 6
    assert batch._same(tmp_path / KILLED, tmp_path / ONE)
    if importlib.util.find_spec("distributed") is not None:
        assert len(batch.WAYS[DASK](records, tmp_path / "by dask")) == 6
        assert batch._same(tmp_path / "by dask", tmp_path / ONE)


@pytest.mark.compiled
def test_the_bare_loop(tmp_path: Path) -> None:
    records = batch.make_records(tmp_path / "records", 2, SECONDS)
    ends = batch.WAYS[BARE](records, tmp_path / "out")
    assert ends == sorted(ends)
    assert [path.name for path in sorted((tmp_path / "out").iterdir())] == ["00000.record.nc", "00001.record.nc"]
