"""The picture of the suite `integrators`, from points that were never measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.benchmarks.integrators import Point

pytest.importorskip("matplotlib")

METHODS = (("closed form", True), ("explicit", True), ("heyoka", False), ("scipy DOP853", False))


def points(shift: float = 1.0) -> list[Point]:
    found = [
        Point("p", method, own, 10.0**-k, 10.0 ** -(k + shift * i), 10.0**-k, (1e-3 * k * (i + 1),))
        for i, (method, own) in enumerate(METHODS)
        for k in (6, 9, 12)
    ]
    return [*found, Point("p", "CyRK RADAU", False, 1e-9, note="not installed: extra 'peers'")]


def inked(path: Path) -> int:
    """Pixels that are not white."""
    from matplotlib.image import imread

    return int(np.count_nonzero(imread(path)[..., :3].min(axis=-1) < 0.9))


def test_a_line_for_each_method(tmp_path: Path) -> None:
    from pipeline.benchmarks.integrators import draw

    for name, some in (("all", points()), ("few", points()[:3]), ("none", points()[-1:])):
        draw({"a problem": ("nothing", some)}, tmp_path / f"{name}.png")
    none, few, every = (inked(tmp_path / f"{name}.png") for name in ("none", "few", "all"))
    assert 0 < none < few < every


def test_every_method_has_a_look() -> None:
    from pipeline.benchmarks.integrators import LOOKS, PEERS
    from pipeline.benchmarks.problems import OWN

    assert set(LOOKS) == {*OWN, *PEERS}
