"""One record and one method, or thousands of noisy ones: errors against the truth.

Linear motion and reading noise add, so a scene is simulated once and noise of each seed is laid on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from data_schemas.scene import Scene
from pipeline.arrays import Floats
from pipeline.benchmarks.progress import progress
from pipeline.gravity import MGAL
from pipeline.observation import Observation, observe
from pipeline.prepared import Prepared, prepare
from pipeline.reduction import Reduction, reduce_by
from synth import simulate


@dataclass(frozen=True)
class Outcome:
    """What one method made of one record; mGal, NaN where it refused."""

    error: float
    sigma: float
    flags: tuple[str, ...]
    refusal: str


@dataclass(frozen=True)
class Campaign:
    """Outcomes of one method over many seeds."""

    outcomes: tuple[Outcome, ...]

    @property
    def errors(self) -> Floats:
        """mGal, one a record."""
        return np.array([each.error for each in self.outcomes])

    @property
    def sigmas(self) -> Floats:
        """mGal, one a record."""
        return np.array([each.sigma for each in self.outcomes])

    @property
    def rmse(self) -> float:
        """Root mean square error, mGal; NaN if one record was refused."""
        return float(np.sqrt(np.mean(np.square(self.errors))))

    @property
    def flagged(self) -> float:
        """Share of the records that carry a flag."""
        return float(np.mean([bool(each.flags) for each in self.outcomes]))

    @property
    def raised(self) -> dict[str, int]:
        """How many records carry each flag."""
        names = [name for each in self.outcomes for name in each.flags]
        return {name: names.count(name) for name in sorted(set(names))}

    def covered(self, sigmas: float = 1.959964) -> float:
        """Share of the records whose interval holds the truth; 95 % of a Gaussian by default."""
        return float(np.mean(np.abs(self.errors) < sigmas * self.sigmas))


def outcome(reduction: Reduction, gravity: float) -> Outcome:
    """Compare a reduction with the truth."""
    value = reduction.gravity
    if value is None:
        return Outcome(float("nan"), float("nan"), (), reduction.error)
    return Outcome((value.gravity - gravity) / MGAL, value.sigma, reduction.flags, "")


def prepared(scene: Scene) -> Prepared:
    """A scene's record, simulated and made ready."""
    return prepare(observe(simulate(scene)[0]))


def reduce_all(scene: Scene, methods: Sequence[str]) -> dict[str, Outcome]:
    """Every method on a scene's record."""
    ready = prepared(scene)
    return {name: outcome(reduce_by(name, ready, 0.0), scene.gravity) for name in methods}


def campaign(scene: Scene, methods: Sequence[str], count: int, first_seed: int = 0) -> dict[str, Campaign]:
    """Reduce `count` records of a scene that differ in their reading noise alone."""
    collected: dict[str, list[Outcome]] = {name: [] for name in methods}
    for seen in progress(observations(scene, count, first_seed), scene.record_id, count):
        ready = prepare(seen)
        for name in methods:
            collected[name].append(outcome(reduce_by(name, ready, 0.0), scene.gravity))
    return {name: Campaign(tuple(outcomes)) for name, outcomes in collected.items()}


def observations(scene: Scene, count: int, first_seed: int = 0) -> Iterator[Observation]:
    """Observations of a scene under `count` draws of its noise."""
    recording = scene.recording
    seeds = range(first_seed, first_seed + count)
    noise = recording.noise
    quiet = recording.model_copy(update={"noise": 0.0, "record_uncertainty": False})
    clean = observe(simulate(scene.model_copy(update={"recording": quiet}))[0])
    stated = noise if noise and recording.record_uncertainty is not False else None
    for seed in seeds:
        chance = np.random.default_rng([seed, 1958])
        yield replace(
            clean,
            theta=clean.theta + chance.normal(scale=noise, size=clean.theta.size),
            difference=clean.difference + chance.normal(scale=noise, size=clean.difference.size),
            sigma_theta=stated,
            sigma_difference=stated,
        )
