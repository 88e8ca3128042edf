"""Running the command line in process, and files to run it on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from made_trees import made_record, made_result

import data_schemas
from pipeline.cli.main import main


class Outcome(NamedTuple):
    status: int
    out: str
    err: str

    @property
    def fault(self) -> str:
        """The one line on stderr."""
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("isochrony: ")
        assert "Traceback" not in lines[0]
        return lines[0]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    monkeypatch.delenv("ISOCHRONY_TRACEBACK", raising=False)

    def call(*words: object) -> Outcome:
        status = main([str(word) for word in words])
        return Outcome(status, *capsys.readouterr())

    return call


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "ship.record.nc"
    data_schemas.write(made_record(), path)
    return path


@pytest.fixture
def result_path(tmp_path: Path) -> Path:
    path = tmp_path / "ship.result.nc"
    data_schemas.write(made_result(), path)
    return path


@pytest.fixture
def unchanged(tmp_path: Path) -> Callable[[], bool]:
    """Whether the folder still holds what it held when this was last asked; the first answer is None."""
    seen: list[dict[str, bytes]] = []

    def ask() -> bool:
        now = {str(path): path.read_bytes() for path in sorted(tmp_path.rglob("*")) if path.is_file()}
        seen.append(now)
        return seen[0] == now

    return ask
