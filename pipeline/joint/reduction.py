"""`joint` among the methods: its outcome as an estimate with ledger and flags, its path as the harmonics' source."""

import time as clock
from dataclasses import dataclass

import numpy as np
from xarray import DataTree

from pipeline.arrays import Floats
from pipeline.conditions import MGAL
from pipeline.joint import apparatus, budget
from pipeline.joint.course import weights
from pipeline.joint.explanation import Fitted, angles
from pipeline.joint.fit import Outcome, reduce
from pipeline.joint.gather import Gathered, gather
from pipeline.joint.ship import Ship
from pipeline.ledger import earth
from pipeline.ledger.own import CASE_TILT
from pipeline.observation import Observation, choose_pair, instrument
from pipeline.prepared import Estimate, Prepared
from pipeline.reduction import Reduction, flags, gravity

KINDS = {"kicks": "random-kicks", "gravity changes": "gravity-changes"}
MOST_TURN = 0.7  # rad of the swing between samples of the path, for its third harmonic to show
WIDENED = 1.1  # factor in sigma from which the flag says so


@dataclass(frozen=True)
class Joint:
    """The method's outcome on a record."""

    reduction: Reduction
    prepared: Prepared  # The smoothed pendulums of the pair, even and without gaps
    outcome: Outcome
    columns: tuple[int, int]  # (int, int) places of the pair among the pendulums

    @property
    def eotvos(self) -> str:
        """What was done about the Eotvos effect, in words."""
        constants = self.prepared.observation.constants
        if any(name not in constants for name in earth.WAY):
            return "not reduced: latitude, speed or course is not stated"
        changing = any(f"{name}_course" in constants for name in earth.WAY)
        return "reduced as it changes along the track" if changing else "reduced as a constant"

    def course(self, time: Floats) -> tuple[dict[str, Floats], dict[str, float | str]]:
        """Group `course` of a result: gravity with its band at instants of the record's own time, s, (n,)."""
        assert self.reduction.gravity is not None
        outcome, reference = self.outcome, self.prepared.observation.reference_gravity
        solution, lattice = outcome.fit.solution, outcome.fit.model.problem.lattice
        rows = weights(solution.constants, np.clip(time - lattice.start, 0.0, lattice.duration))
        values = np.array([each.value for each in solution.constants])
        own, sigma = outcome.fit.gravity
        band = np.einsum("ij,jk,ik->i", rows, solution.covariance, rows)
        # what explanations that stay close add to the variance of the mean, they add to that of each instant
        band = (band + max(outcome.sigma**2 - sigma**2, 0.0)) * outcome.spread**2
        track = outcome.fit.model.course
        course = {
            "gravity_course": self.reduction.gravity.gravity + reference * (rows @ values - own),
            "gravity_course_sigma": reference * np.sqrt(band) / MGAL,
        }
        length = float("inf") if track is None else track.length
        return course, {"correlation_length_s": length, "eotvos": self.eotvos}

    def ship(self, time: Floats) -> dict[str, Floats]:
        """Group `ship` of a result: the accelerations of the support at instants of the record's own time."""
        model, path = self.outcome.fit.model, self.outcome.fit.path
        reference = self.prepared.observation.reference_gravity
        lattice, ship = model.problem.lattice, Ship.of(model.assumed.ship)
        nodes, states = lattice.start + lattice.step * np.arange(lattice.nodes), path[:, 2 * model.problem.pendulums :]
        across, along = (np.interp(time, nodes, states @ row) for row in (ship.horizontal, ship.vertical))
        if model.problem.heave is not None:
            along = along + model.problem.heave(np.clip(time - lattice.start, 0.0, lattice.duration))
        return {"horizontal_acceleration": reference * across, "vertical_acceleration": reference * along}

    def pendulums(self, time: Floats) -> Floats:
        """Angles of the pair at instants of the record's own time, (2, n), rad; NaN outside the fit."""
        fit, lattice = self.outcome.fit, self.outcome.fit.model.problem.lattice
        path = angles(fit, time - lattice.start, np.eye(fit.model.problem.pendulums)[:, list(self.columns)])
        path[(time < lattice.start - lattice.step) | (time > lattice.start + lattice.duration + lattice.step)] = np.nan
        return path.T

    def residual(self, weights: Floats, time: Floats) -> Floats:
        """What the fit leaves of a combination of the traces, (t,) weights, at the record's own times, (n,); rad."""
        fit, problem = self.outcome.fit, self.outcome.fit.model.problem
        lattice, constants = problem.lattice, fit.solution.constants
        read, out = problem.readings(fit.model.assumed, constants), np.zeros(time.size)
        for trace in np.flatnonzero(weights):
            own, left = lattice.of_trace[trace], np.full(time.size, np.nan)
            path = angles(fit, lattice.step * lattice.node[own] + read.offset[own], lattice.combination[trace])
            at = np.rint(np.interp(lattice.start + lattice.time[own], time, np.arange(time.size))).astype(np.int64)
            left[at] = (1.0 + problem.gain(constants)[trace]) * (read.value[own] - path)
            out += weights[trace] * left
        return out


def reduce_jointly(record: DataTree, pair: str | None, gain_uncertainty: float) -> Joint:
    """Fit the joint model to a record; RecordError, RefusedError, UsageError as `pipeline.process`."""
    started = clock.perf_counter()
    gathered = gather(record)
    lattice = gathered.problem.lattice
    names = choose_pair(list(gathered.pendulums), lattice.combination, pair)
    one, second = (gathered.pendulums.index(name) for name in names)
    outcome = reduce(gathered)
    fit, model = outcome.fit, outcome.fit.model
    prepared = _prepared(record, fit, names, (one, second))
    reference = prepared.observation.reference_gravity
    frequency = float(np.sqrt(model.problem.kappa[second] * outcome.mean))
    damping = model.problem.flow(model.assumed, fit.solution.constants).damping
    trace = int(np.argmax(~np.isclose(lattice.combination.sum(axis=1), 1.0)))
    estimate = Estimate(
        frequency=frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.fine.slope, damping[second])),
        sigma=0.5 * frequency * outcome.sigma * outcome.spread / outcome.mean,
        noise=float(model.assumed.noise[trace]), damping_rate=float(damping[second]),
        samples=int(np.sum(~model.problem.left_out)), acceleration_reduced=model.assumed.sine, of_mean=True,
        parts=budget.parts(fit, reference) | _tilt(record, gathered, fit, one),
        shares=budget.shares(fit, outcome.sigma**2),
    )  # fmt: skip
    value = gravity(estimate, prepared, gain_uncertainty)
    knocked = any(words.startswith("knock") for words in model.words)
    raised = {
        **dict.fromkeys(flags(prepared, estimate, value), True),
        **{name: words in model.words for words, name in KINDS.items()},
        "friction-not-viscous": any("friction" in words for words in model.words),
        "apparatus-fault": bool(knocked or apparatus.faults_found(fit.solution) or outcome.still),
        "errors-not-white": outcome.spread > WIDENED,
    }
    elapsed = clock.perf_counter() - started
    named = tuple(name for name, is_raised in raised.items() if is_raised)
    reduction = Reduction("joint", "joint", outcome.words, estimate, value, named, "", elapsed)
    return Joint(reduction, prepared, outcome, (one, second))


def _tilt(record: DataTree, gathered: Gathered, fit: Fitted, first: int) -> dict[str, tuple[float, float, str]]:
    """The ledger's entry of a case from which the record measures."""
    stored, lattice = record["record"].dataset, fit.model.problem.lattice
    if gathered.tilts:
        tilt = fit.path[:, 2 * gathered.problem.pendulums :] @ Ship.of(fit.model.assumed.ship).tilt
    elif "case_tilt" in stored and stored.attrs.get("reference") != "vertical":
        values, time = np.asarray(stored["case_tilt"].values), np.asarray(record.dataset["time"].values)
        known, nodes = np.isfinite(values), lattice.start + lattice.step * np.arange(lattice.nodes)
        tilt = np.interp(nodes, time[known], values[known])
    else:
        return {}
    reference, angle = float(gathered.constants["reference_gravity"]), fit.path[:, 2 * first]
    value = -0.5 * reference * float(np.mean(2.0 * angle * tilt - tilt**2)) / MGAL
    return {CASE_TILT.NAME: (value, 0.0, f"rms {1e3 * float(np.std(tilt)):.2f} mrad")}


def _prepared(record: DataTree, fit: Fitted, names: tuple[str, str], columns: tuple[int, int]) -> Prepared:
    """The smoothed path of a pair of pendulums as an observation like any other."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    parts = int(np.ceil(lattice.step * problem.swing / MOST_TURN))
    step = lattice.step / parts
    time = step * np.arange(parts * (lattice.nodes - 1) + 1)
    theta, other = angles(fit, time, np.eye(problem.pendulums)[:, list(columns)]).T
    constants = instrument(record, names)
    observation = Observation(
        first=names[0], second=names[1], start=lattice.start, time=time, step=step,
        theta=theta, difference=theta - other, sigma_theta=None, sigma_difference=None,
        vertical=problem.heave(time) * constants["reference_gravity"] if problem.heave else None, **constants,
    )  # fmt: skip
    return Prepared(observation)
