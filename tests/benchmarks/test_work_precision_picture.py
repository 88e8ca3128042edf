"""Pictures and tables of the suite `integrators`, from points that were never measured."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.benchmarks import bars_integrators, ensemble_race, growth, integrators
from pipeline.benchmarks.growth import Growth
from pipeline.benchmarks.work_precision import Point

pytest.importorskip("matplotlib")

METHODS = (("closed form", True), ("explicit", True), ("heyoka", False), ("CyRK DOP853, Python face", False))


def points(shift: float = 1.0) -> list[Point]:
    found = [
        Point("p", method, own, 10.0**-k, 10.0 ** -(k + shift * i), 10.0**-k, 10.0**-k, (1e-3 * k * (i + 1),))
        for i, (method, own) in enumerate(METHODS)
        for k in (6, 9, 12)
    ]
    return [*found, Point("p", "Radau", True, 1e-9, note="refused: not stiff"), Point("p", "splitting", True, 1e-9)]


def inked(path: Path) -> int:
    """Pixels that are not white."""
    from matplotlib.image import imread

    return int(np.count_nonzero(imread(path)[..., :3].min(axis=-1) < 0.9))


def test_a_line_for_each_method(tmp_path: Path) -> None:
    from pipeline.benchmarks.work_precision_picture import draw

    draw("all", "nothing", points(), tmp_path / "all.png")
    draw("few", "nothing", points()[:3], tmp_path / "few.png")
    draw("close", "nothing", points(0.0), tmp_path / "close.png")
    draw("none", "nothing", points()[-2:], tmp_path / "none.png")
    none, few, every = (inked(tmp_path / f"{name}.png") for name in ("none", "few", "all"))
    assert 0 < none < few < every
    assert inked(tmp_path / "close.png") > few


def grown() -> list[Growth]:
    swings = np.geomspace(1.0, 1e4, 20)
    made = [Growth(case, "explicit", swings, 1e-15 * swings**0.5, 0.5) for case in ("one", "two")]
    return [*made, Growth("two", "Radau", swings, 1e-14 * swings**1.5, 1.5), Growth("two", "x", *np.zeros((2, 0)), 0.5)]


def test_growth_is_drawn(tmp_path: Path) -> None:
    from pipeline.benchmarks.work_precision_picture import draw_growth

    draw_growth(grown(), tmp_path / "growth.png")
    assert inked(tmp_path / "growth.png") > 1000


def test_the_suite_writes_what_it_yields(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = SimpleNamespace(title="a problem")
    monkeypatch.setattr(integrators, "problems", lambda *, quick: {"a problem": problem})
    monkeypatch.setattr(integrators, "reference", lambda given: SimpleNamespace(source="nothing"))
    monkeypatch.setattr(integrators, "sweep", lambda *given, **words: points())
    monkeypatch.setattr(integrators, "compiled", lambda *given: {})
    monkeypatch.setattr(ensemble_race, "race", lambda *, quick: ("many", "nothing", points()))
    monkeypatch.setattr(growth, "grown", lambda *, quick: iter(grown()))
    monkeypatch.setattr(
        bars_integrators, "judged", lambda found: iter([{"bar": "b", "value": 1.0, "limit": ">= 5", "pass": False}])
    )
    yielded = list(integrators.run(quick=True, folder=tmp_path))
    names = {path.name for path in tmp_path.iterdir()}
    assert {"a-problem.png", "growth.png", "work-precision.csv", "growth.csv", "honesty.csv", "bars.csv"} <= names
    tables = ("work-precision", "growth", "honesty", "bars")
    texts = [(tmp_path / f"{name}.csv").read_text(encoding="utf-8") for name in tables]
    written = [list(csv.DictReader(text.splitlines())) for text in texts]
    assert sum(len(table) for table in written) == len(yielded)
    assert len(written[0]) == 2 * len(points())
    assert len(list(integrators.run(quick=True, folder=None))) == len(yielded)
    # short problems are told, not judged
    assert yielded[-1]["pass"] is None
    assert list(integrators.run(quick=False, folder=None))[-1]["pass"] is False
