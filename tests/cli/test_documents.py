"""Commands that the documents show are commands that there are: all parse as they stand, and run on small files."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import synth
from data_schemas import load_scene, read, write
from pipeline import process
from pipeline.cli.parser import parser_of
from pipeline.synchronism.recipe import synchrony

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def commands() -> list[str]:
    """Each command of an indented or fenced block, without what is said of it."""
    found = []
    for document in DOCUMENTS:
        for line in document.read_text().splitlines():
            if line.strip().startswith(("isochrony ", "$ isochrony ")):
                command = re.split(r"\s{2,}|\s#\s", line.strip().removeprefix("$ "))[0]
                found += [part.strip() for part in command.split("&&") if part.strip().startswith("isochrony ")]
    return list(dict.fromkeys(found))


def test_there_are_commands() -> None:
    assert len(commands()) > 30


@pytest.mark.parametrize("command", commands())
def test_a_command_parses(command: str) -> None:
    verb, *words = [word for word in shlex.split(command)[1:] if word not in ("...", "|", "VERB")]
    if verb.startswith("-"):
        return
    if "--help" not in words:
        parser_of(verb).parse_strictly(words)


SECONDS = 120  # of what the shipped scenes last here
ELSEWHERE = (
    "benchmark", "--scheduler", "--repeat", "--strips", "--resume", "scan.png", "--retry-failed", "kill", "--table",
    "--edits", "isochrony warm",
)  # fmt: skip
"""Of commands that take minutes, another machine, or several scans: their own tests run them."""


SCENES = ("demo", "film", "cruise", "rough-sea", "clocks-on-beam")


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of every name that the commands read."""
    made = tmp_path_factory.mktemp("documents")
    (made / "scenes").mkdir()
    for name in SCENES:
        text = re.sub(r"(?m)^duration *=.*$", f"duration = {SECONDS}", synth.scene_path(name).read_text())
        (made / "scenes" / f"{name}.toml").write_text(text)
    shutil.copy(made / "scenes" / "demo.toml", made / "scene.toml")
    shutil.copy(made / "scenes" / "film.toml", made / "night.toml")
    for scene, name in (("film", "ship"), ("film", "film"), ("film", "cruise"), ("clocks-on-beam", "clocks-on-beam")):
        given = load_scene(made / "scenes" / f"{scene}.toml")
        reading = given.recording.model_copy(update={"vertical_acceleration": True})
        record, _ = synth.simulate(given.model_copy(update={"recording": reading}))
        write(record, made / f"{name}.record.nc")
    whole, half = read(made / "ship.record.nc"), round(0.5 * SECONDS / 0.04)
    for name, part in (("night-1", slice(0, half)), ("night-2", slice(half, None))):
        write(whole.isel(time=part), made / f"{name}.record.nc")
    write(process(made / "ship.record.nc", method="projection"), made / "ship.result.nc")
    write(synchrony(read(made / "clocks-on-beam.record.nc")), made / "clocks-on-beam.result.nc")
    synth.expose_to(load_scene(made / "night.toml"), "typical", made / "ship.film.tif")
    for name in ("cruises/north/day-1", "cruises/north/day-2", "records/one"):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(made / "ship.record.nc", made / f"{name}.record.nc")
    time = np.arange(0.0, 90.0, 0.05)
    swings = [size * np.cos(2.0 * np.pi * time / period) for size, period in ((0.02, 1.029), (0.015, 1.0292))]
    for name, columns in (("swing.csv", swings[:1]), ("ship.csv", [*swings, 0.01 * np.sin(time)])):
        header = ",".join(["time", "1", "2", "az"][: len(columns) + 1])
        np.savetxt(made / name, np.column_stack([time, *columns]), delimiter=",", header=header, comments="")
    (made / "frame.toml").write_text("reference_gravity = 9.81\nperiod = {1 = 1.029, 2 = 1.0292}\n")
    return made


@pytest.mark.compiled
@pytest.mark.parametrize("command", [each for each in commands() if not any(word in each for word in ELSEWHERE)])
def test_a_command_runs(
    command: str, prepared: Path, tmp_path: Path, run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("synth.scene_path", lambda name: prepared / "scenes" / f"{name}.toml")
    words = [word for word in shlex.split(command)[1:] if word not in ("...", "FILE")]
    words = ["ship.record.nc" if word == "FILE..." else word for word in words]
    for word, before in zip(words, ["", *words], strict=False):
        if before != "-o":
            beside = word.replace(".tif", ".*") if word.endswith(".film.tif") else word
            for source in prepared.glob(beside) if "*" in beside else [prepared / word]:
                target = tmp_path / source.relative_to(prepared)
                if source.is_dir():
                    shutil.copytree(source, target)
                elif source.is_file():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(source, target)
    if words[0] == "process" and any("*" in word for word in words):
        (tmp_path / "clocks-on-beam.record.nc").unlink()  # driven: refused, as no pendulum that swings freely
        words = [each for word in words for each in (sorted(map(str, tmp_path.glob(word))) if "*" in word else [word])]
    outcome = run(*words)
    assert outcome.status == 0, outcome.err
