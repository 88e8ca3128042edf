"""Kernels made ahead: what is done is told, a second run is at once, and a first command says why it takes long."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli import main, small
from synth.kernels import cache


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(small, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(cache, "WATCHERS", watchers := [])
    monkeypatch.setattr(small, "WATCHERS", watchers)
    return tmp_path


def compile_two() -> None:
    """As a kernel does."""
    for name in ("sweep", "smooth"):
        for watcher in cache.WATCHERS:
            watcher(name)


def test_steps_are_told_and_a_second_run_is_at_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "ready-0123").touch()
    monkeypatch.setattr(small, "_steps", lambda _: iter([("process", compile_two), ("digitise", lambda: None)]))
    assert main.main(["warm"]) == 0
    told = capsys.readouterr()
    assert told.err.startswith("1 of 2: process: 2 kernels compiled, ")
    assert "2 of 2: digitise: 0 kernels compiled, " in told.err
    assert told.out.startswith("all kernels are ready: 2 compiled in ")
    assert len(list(folder.iterdir())) == 1
    monkeypatch.setattr(small, "_steps", None)
    assert main.main(["warm"]) == 0
    assert capsys.readouterr().out == "all kernels are ready\n"


def test_steps_cover_every_scene(tmp_path: Path) -> None:
    import synth

    names = [what for what, _ in small._steps(tmp_path)]
    assert {f"simulate {name}" for name in synth.scenes()} < set(names)
    assert names[0] == "process"
    assert names[-1] == "digitise"


def test_a_compilation_is_told_once(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(small, "explain", lambda _: compile_two() or 0)
    assert main.main(["explain"]) == 0
    assert capsys.readouterr().err.count("compiling kernels, once") == 1
