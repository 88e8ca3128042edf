"""`joint` among the methods: its outcome as an estimate with ledger and flags, its path as the harmonics' source."""

from __future__ import annotations

import time as clock
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.flags import flags
from pipeline.gravity import MGAL, gravity
from pipeline.joint import apparatus, budget
from pipeline.joint.course import mean_gravity, weights
from pipeline.joint.explanation import angles
from pipeline.joint.fit import Outcome, reduce
from pipeline.joint.gather import Gathered, gather
from pipeline.joint.ship import Ship
from pipeline.ledger import eotvos
from pipeline.observation import Observation, choose_pair, instrument
from pipeline.prepared import Prepared
from pipeline.reduction import Reduction

if TYPE_CHECKING:
    from xarray import DataTree

KINDS = {"kicks": "random-kicks", "gravity changes": "gravity-changes"}
MOST_TURN = 0.7  # rad of the swing between samples of the path, for its third harmonic to show
WIDENED = 1.1  # factor in sigma from which the flag says so


@dataclass(frozen=True)
class Joint:
    """The method's outcome on a record.

    Attributes
    ----------
    reduction : Reduction
    prepared : Prepared or None
        The smoothed pendulums of the pair, even and without gaps; None where the method refused.
    outcome : Outcome or None
    """

    reduction: Reduction
    prepared: Prepared | None = None
    outcome: Outcome | None = None

    @property
    def eotvos(self) -> str:
        """What was done about the Eotvos effect, in words."""
        assert self.prepared is not None
        constants = self.prepared.observation.constants
        if any(name not in constants for name in eotvos.NEEDS):
            return "not reduced: latitude, speed or course is not stated"
        changing = any(f"{name}_course" in constants for name in eotvos.NEEDS)
        return "reduced as it changes along the track" if changing else "reduced as a constant"

    def course(self, time: Floats) -> DataTree:
        """Group `course` of a result: gravity with its band at instants of the record's own time, s, (n,)."""
        from xarray import Dataset, DataTree

        from data_schemas.variables import attributes

        assert self.prepared is not None  # of a record that was not refused
        assert self.outcome is not None
        assert self.reduction.gravity is not None
        outcome, reference = self.outcome, self.prepared.observation.reference_gravity
        solution, lattice = outcome.fit.solution, outcome.fit.model.problem.lattice
        rows = weights(solution.constants, np.clip(time - lattice.start, 0.0, lattice.duration))
        values = np.array([each.value for each in solution.constants])
        own, sigma = mean_gravity(solution, lattice.duration)
        band = np.einsum("ij,jk,ik->i", rows, solution.covariance, rows)
        # what explanations that stay close add to the variance of the mean, they add to that of each instant
        band = (band + max(outcome.sigma**2 - sigma**2, 0.0)) * outcome.spread**2
        track = outcome.fit.model.course
        return DataTree(
            Dataset(
                {
                    "gravity_course": (
                        "time",
                        self.reduction.gravity.gravity + reference * (rows @ values - own),
                        attributes("course/gravity_course"),
                    ),
                    "gravity_course_sigma": (
                        "time",
                        reference * np.sqrt(band) / MGAL,
                        attributes("course/gravity_course_sigma"),
                    ),
                },
                attrs={
                    "correlation_length_s": float("inf") if track is None else track.length,
                    "eotvos": self.eotvos,
                },
            )
        )


def reduce_jointly(record: DataTree, pair: str | None, gain_uncertainty: float) -> Joint:
    """Fit the joint model to a record.

    Raises
    ------
    RecordError, RefusedError, UsageError
        As `pipeline.process`.
    """
    started = clock.perf_counter()
    gathered = gather(record)
    named = choose_pair(list(gathered.pendulums), gathered.problem.lattice.combination, pair)
    outcome = reduce(gathered)
    prepared = _prepared(record, gathered, outcome, named)
    seen, model = prepared.observation, outcome.fit.model
    second = gathered.pendulums.index(seen.second)
    frequency = float(np.sqrt(outcome.fit.model.problem.kappa[second] * outcome.mean))
    damping = model.problem.flow(model.assumed, outcome.fit.solution.constants).damping
    one = gathered.pendulums.index(seen.first)
    trace = int(np.argmax(~np.isclose(gathered.problem.lattice.combination.sum(axis=1), 1.0)))
    estimate = Estimate(
        frequency=frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.fine.slope, damping[second])),
        sigma=0.5 * frequency * outcome.sigma * outcome.spread / outcome.mean,
        noise=float(model.assumed.noise[trace]),
        damping_rate=float(damping[second]),
        samples=int(model.problem.lattice.node.size - outcome.left_out),
        acceleration_reduced=model.assumed.sine,
        of_mean=True,
        parts=budget.parts(outcome.fit, seen.reference_gravity) | _tilt(record, gathered, outcome, one),
        shares=budget.shares(outcome.fit, outcome.sigma**2),
    )
    value = gravity(estimate, prepared, gain_uncertainty)
    raised = [*flags(prepared, estimate, value), *(name for words, name in KINDS.items() if words in model.words)]
    if any("friction" in words for words in model.words):
        raised.append("friction-not-viscous")
    if apparatus.found(outcome.fit.solution) or outcome.still:
        raised.append("apparatus-fault")
    if outcome.spread > WIDENED:
        raised.append("errors-not-white")
    elapsed = clock.perf_counter() - started
    reduction = Reduction("joint", "joint", outcome.words, estimate, value, tuple(dict.fromkeys(raised)), "", elapsed)
    return Joint(reduction, prepared, outcome)


def _tilt(record: DataTree, gathered: Gathered, outcome: Outcome, first: int) -> dict[str, tuple[float, float, str]]:
    """The ledger's entry of a case from which the record measures."""
    stored, lattice, path = record["record"].dataset, gathered.problem.lattice, outcome.fit.path
    if gathered.tilts:
        tilt = path[:, 2 * gathered.problem.pendulums :] @ Ship.of(outcome.fit.model.assumed.ship).tilt
    elif "case_tilt" in stored and stored.attrs.get("reference") != "vertical":
        values, time = np.asarray(stored["case_tilt"].values), np.asarray(record.dataset["time"].values)
        known, nodes = np.isfinite(values), lattice.start + lattice.step * np.arange(lattice.nodes)
        tilt = np.interp(nodes, time[known], values[known])
    else:
        return {}
    return budget.of_tilt(path[:, 2 * first], tilt, float(gathered.constants["reference_gravity"]))


def _prepared(record: DataTree, gathered: Gathered, outcome: Outcome, pair: tuple[str, str]) -> Prepared:
    """The smoothed path of a pair of pendulums as an observation like any other."""
    problem = outcome.fit.model.problem
    first, second = pair
    one, two = gathered.pendulums.index(first), gathered.pendulums.index(second)
    parts = int(np.ceil(problem.lattice.step * problem.swing / MOST_TURN))
    step = problem.lattice.step / parts
    time = step * np.arange(parts * (problem.lattice.nodes - 1) + 1)
    path = angles(outcome.fit, time)
    constants = instrument(record, (first, second))
    vertical = None
    if problem.heave is not None:
        vertical = problem.heave(time) * constants["reference_gravity"]
    observation = Observation(
        first=first,
        second=second,
        start=problem.lattice.start,
        time=time,
        step=step,
        theta=path[:, one],
        difference=path[:, one] - path[:, two],
        sigma_theta=None,
        sigma_difference=None,
        vertical=vertical,
        **constants,
    )
    return Prepared(observation)


def refused(reason: str, elapsed: float) -> Joint:
    """The method's refusal."""
    return Joint(Reduction("joint", "joint", "", None, None, (), reason, elapsed))
