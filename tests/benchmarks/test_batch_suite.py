"""The suite `batch`: paces come from the log, promises from the paces."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.benchmarks import batch
from pipeline.benchmarks.batch import BARE, ONE, TWO

SECONDS = 130.0


def pretended(pace: float):
    """A way whose records come at a pace, s, after slow first ones."""

    def way(records: Path, out: Path) -> list[float]:
        count = len(list(records.iterdir()))
        return [10.0 + pace * max(number, batch.SKIPPED) for number in range(count)]

    return way


def test_paces_and_promises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def made(folder: Path, count: int, duration: float) -> Path:
        folder.mkdir()
        for number in range(count):
            (folder / f"{number}.record.nc").touch()
        return folder

    monkeypatch.setattr(batch, "WAYS", {BARE: pretended(0.1), ONE: pretended(0.108), TWO: pretended(0.06)})
    monkeypatch.setattr(batch, "make_records", made)
    rows = list(batch.run(quick=True, folder=tmp_path))
    assert [row["ms_a_record"] for row in rows[:3]] == pytest.approx([100.0, 108.0, 60.0])
    assert [row["of_bare_loop"] for row in rows[:3]] == pytest.approx([1.0, 1.08, 0.6])
    assert [row["value"] for row in rows[3:]] == pytest.approx([8.0, 1.0 / 0.6])
    assert [row["pass"] for row in rows[3:]] == [True, False]


@pytest.mark.compiled
def test_every_way_does_every_record(tmp_path: Path) -> None:
    records = batch.make_records(tmp_path / "records", 2, SECONDS)
    for name in (BARE, TWO):
        ends = batch.WAYS[name](records, tmp_path / name)
        assert len(ends) == 2
        assert ends == sorted(ends)
        names = {path.name.partition(".")[0] for path in (tmp_path / name).glob("0*.nc")}
        assert names == {"00000", "00001"}
