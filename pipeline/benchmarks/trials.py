"""One record and one method: its error against the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks.honesty.case import Case
from pipeline.benchmarks.honesty.records import Made
from pipeline.gravity import MGAL
from pipeline.observation import observe
from pipeline.prepared import Prepared, prepare
from pipeline.reduction import Reduction, reduce_by
from synth import simulate


class Outcome(NamedTuple):
    """What one method made of one record; mGal, NaN where it refused."""

    error: float
    flags: tuple[str, ...]
    refusal: str


def outcome(reduction: Reduction, gravity: float) -> Outcome:
    """Compare a reduction with the truth."""
    value = reduction.gravity
    if value is None:
        return Outcome(float("nan"), (), reduction.error)
    return Outcome((value.gravity - gravity) / MGAL, reduction.flags, "")


def prepared(scene: Scene) -> Prepared:
    """A scene's record, simulated and made ready."""
    return prepare(observe(simulate(scene)[0]))


def reduce_all(scene: Scene, methods: Sequence[str]) -> dict[str, Outcome]:
    """Every method on a scene's record."""
    ready = prepared(scene)
    return {name: outcome(reduce_by(name, ready, 0.0), scene.gravity) for name in methods}


def made(scene: Scene) -> Made:
    """A scene's record as the suite `honesty` has its own; gravity does not change."""
    return Made(simulate(scene)[0], scene.gravity, Case(), scene.gravity * np.eye(6)[0])
