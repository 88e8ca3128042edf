"""The picture of the suite `integrators`, from points that were never measured."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

METHODS = ("closed form", "explicit", "heyoka", "scipy DOP853")


def rows(shift: float = 1.0) -> list[dict[str, Any]]:
    shared = {"problem": "a problem", "reference": "nothing", "note": ""}
    found = [
        shared | {"method": method, "error": 10.0 ** -(k + shift * i), "ms": float(k * (i + 1))}
        for i, method in enumerate(METHODS)
        for k in (6, 9, 12)
    ]
    absent = {"method": "CyRK RADAU", "error": math.nan, "ms": math.nan, "note": "not installed: extra 'peers'"}
    return [*found, shared | absent]


def inked(path: Path) -> int:
    """Pixels that are not white."""
    from matplotlib.image import imread

    return int(np.count_nonzero(imread(path)[..., :3].min(axis=-1) < 0.9))


def test_a_line_for_each_method(tmp_path: Path) -> None:
    from pipeline.benchmarks.integrators import draw

    for name, some in (("all", rows()), ("few", rows()[:3]), ("none", rows()[-1:])):
        draw({"a problem": some}, tmp_path / f"{name}.png")
    none, few, every = (inked(tmp_path / f"{name}.png") for name in ("none", "few", "all"))
    assert 0 < none < few < every


def test_every_method_has_a_look() -> None:
    from pipeline.benchmarks.integrators import LOOKS, PEERS
    from pipeline.benchmarks.problems import OWN

    assert set(LOOKS) == {*OWN, *PEERS}
