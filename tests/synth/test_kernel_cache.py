"""Compiled code is kept for whoever comes next, and only what he can read."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from synth.kernels import compiled
from synth.systems.resistance import Viscous


class Foreign(NamedTuple):
    """As a user's script may define one."""

    rate: float


def add_one(value: Any) -> Any:
    """What is compiled."""
    return value[0] + 1.0


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("argument", "kept"),
    [
        (Viscous(np.array([1.0])), True),
        ((1.0, 2.0), True),
        (Foreign(1.0), False),
        ((1.0, Foreign(2.0)), False),
    ],
)
def test_only_types_of_the_project_are_kept(
    argument: Any, kept: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An index that names a module which is not there cannot be read by anybody else."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
    made = compiled.kernel(add_one)
    assert np.all(made(argument) == 2.0)
    assert bool(list(tmp_path.rglob("*.nbi"))) == kept
    if kept:
        again: Any = compiled.kernel(add_one)
        again(argument)
        assert sum(again.stats.cache_hits.values()) == 1
