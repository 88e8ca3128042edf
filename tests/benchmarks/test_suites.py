"""Each suite runs: small and uncompiled for its machinery, whole and compiled for its claims."""

from __future__ import annotations

import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.benchmarks import bars, paper, scenes
from pipeline.benchmarks.tables import RATIO, command
from pipeline.cli.benchmark import SUITES
from pipeline.methods import PAIR_METHODS


@pytest.mark.parametrize("suite", SUITES)
def test_registered_suite_can_be_run(suite: str) -> None:
    assert callable(importlib.import_module(f"pipeline.benchmarks.{suite}").run)


@pytest.mark.usefixtures("short")
def test_bars_of_accuracy_are_yielded() -> None:
    rows = list(bars.accuracy())
    assert len({row["bar"] for row in rows}) == len(rows) == 4
    assert {tuple(row) for row in rows} == {("bar", "value", "limit", "unit", "pass")}


@pytest.mark.compiled
def test_bars_of_speed_are_yielded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars, "DURATION", 30.0)
    short = replace(bars.BASE, duration=120.0, rate=10.0, swell=(0.015, 0.0), states_heave=False)
    monkeypatch.setattr(bars, "FITS", {"short": (short, 1e6, 0.0, 1e6)})
    asked: list[tuple[str, ...]] = []

    monkeypatch.setattr(bars, "command", lambda *words: asked.append(words))
    monkeypatch.setattr(bars, "rounds", lambda calls, *_, **__: {name: [1.0, 2.0, 3.0] for name in calls})
    rows = {row["bar"]: row for row in bars.costs(quick=True)}
    assert len(rows) == 12
    ratios = [row for row in rows.values() if row["unit"].startswith(RATIO)]
    assert [(row["value"], row["unit"]) for row in ratios] == [(1.0, "times, 1 to 1")] * 8
    assert [row["pass"] for row in ratios] == [True, True, None, None, True, False, True, False]
    assert [row["value"] for bar, row in rows.items() if "read, reduced, written" in bar] == [2000.0] * 2
    assert [words[1] for words in asked] == ["-m", "-c"] * 2


@pytest.mark.compiled
@pytest.mark.usefixtures("short")
def test_scatter_is_compared_with_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars, "RATES", (10,))
    found = []
    for bound in (0.05, 0.1):
        monkeypatch.setattr(bars, "BOUNDS", {"linear": (bound,), "real": (2.0 * bound,)})
        rows = list(bars.efficiency(2))
        assert ["linear" in row["bar"] for row in rows] == [True, False]
        found.append([row["value"] for row in rows])
    assert np.all(np.isfinite(found))
    assert found[0] == pytest.approx(2.0 * np.array(found[1]))


# xarray imports dask wherever it is installed, so it is hidden: ours must not
PROBE = """\
import sys; sys.modules['dask'] = None; {}; \
import json; print(json.dumps([name for name, module in sys.modules.items() if module]))"""
SIMULATE = "from data_schemas.scene import Scene; import synth; synth.simulate(Scene.model_validate_json(sys.argv[1]))"
PROCESS = """\
import data_schemas; from pipeline.processing import process; from pipeline.summary import summaries; \
result = process(data_schemas.read(sys.argv[1]), method=sys.argv[2].split(',')); summaries(result); \
data_schemas.write(result, sys.argv[1] + '.result.nc', overwrite=True)"""


def modules(program: str, *words: str) -> set[str]:
    """What a process of its own has imported after a program."""
    return set(json.loads(command(sys.executable, "-c", PROBE.format(program), *words)()))


def in_vain(loaded: set[str], forbidden: tuple[str, ...]) -> list[str]:
    """Which forbidden modules, or packages of modules, were loaded."""
    return [name for name in forbidden if any(f"{each}.".startswith(f"{name}.") for each in loaded)]


@pytest.mark.parametrize(
    "methods",
    [("projection",), pytest.param(PAIR_METHODS, marks=pytest.mark.campaign)],
)
def test_process_leaves_out_what_it_does_not_use(methods: tuple[str, ...], tmp_path: Path) -> None:
    import data_schemas
    from synth import simulate

    path = tmp_path / "x.record.nc"
    data_schemas.write(simulate(scenes.linear(duration=30.0, noise=1e-5))[0], path)
    loaded = modules(PROCESS, str(path), ",".join(methods))
    assert in_vain(loaded, ("scipy.signal", "matplotlib", "dask", "pydantic")) == []
    if methods == ("projection",):
        others = ("general", "vening_meinesz")
        assert loaded.isdisjoint(f"pipeline.methods.{name}" for name in others)


def test_a_linear_scene_leaves_out_what_belongs_to_other_terms() -> None:
    others = ("numba", "scipy", "synth.assembly", "synth.integrators", "synth.systems", "synth.propagators.picard")
    assert in_vain(modules(SIMULATE, scenes.linear(duration=10.0).model_dump_json()), others) == []


def test_paper_yields_every_claim_on_short_records_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "DURATION", 300.0)  # five marks
    rows = list(paper.run(quick=True, folder=None))
    assert len({row["claim"] for row in rows}) == len(rows) == 24
    assert all(row["pass"] for row in rows if "psi1-psi2 on film" in row["claim"])


@pytest.mark.compiled
def test_every_claim_of_the_paper_is_reproduced() -> None:
    rows = list(paper.run(quick=True, folder=None))
    assert [row["claim"] for row in rows if not row["pass"]] == []
