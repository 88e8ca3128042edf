"""The recipe: from a cold start to the posterior of gravity, the likelihood choosing what is assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.joint import choice, kernels, spectrum
from pipeline.joint.climb import LEAST_NOISE, grown, refined, window
from pipeline.joint.constants import Constant, starts
from pipeline.joint.gather import Gathered
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Component, Sea, Vibration

STAGES = (25.0, 100.0, 400.0)  # s: stretches on which a cold start is followed
EARTH = 0.004  # 1 sigma of gravity over reference gravity in a cold start
SPARSE = 2.0  # of the swing between readings, rad
COARSE = 0.1  # reading noise of a cold start's first stretch, of the swing
MOST_OUTLIERS = 0.1  # share of the readings
UNSTATED = 1e-4  # rad: reading noise of a cold start where none is stated
GENEROUS = (Sea(0.7, 0.1, 0.02), Vibration(6.0, 1e-3))
"""The ship's motion that a cold start allows for."""
GATE = 7.0  # deviations beyond which a reading is left out


def first_constants(gathered: Gathered) -> tuple[Constant, ...]:
    """Gravity, damping and the start of the free swing, with their priors."""
    problem = gathered.problem
    frequency = np.sqrt(problem.kappa)
    found = [*starts(problem.pendulums, frequency), Constant("gravity", kernels.GRAVITY, 0.02, mean=1.0, value=1.0)]
    if gathered.constants["damping_rate"] is None:
        found.append(Constant("damping", kernels.DAMPING, 1e-3))
        found += [Constant(f"damping of {i}", kernels.DAMPING, 1e-7, i) for i in range(1, problem.pendulums)]
    elif "damping_rate_uncertainty" in gathered.constants["constants"]:
        spread = np.broadcast_to(gathered.constants["constants"]["damping_rate_uncertainty"], problem.kappa.shape)
        found += [Constant(f"damping of {i}", kernels.DAMPING, float(s), i) for i, s in enumerate(spread) if s > 0.0]
    return tuple(found)


def held(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """All but the start held where they are."""
    return tuple(c if c.kind == kernels.START else replace(c, prior=1e-15, mean=c.value) for c in constants)


DIFFERENCE = 0.3  # 1 sigma of an unstated difference of damping over the damping


def released(constants: tuple[Constant, ...], like: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Values of the first, priors of the second."""
    return tuple(replace(b, value=a.value) for a, b in zip(constants, like, strict=True))


def narrowed(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """All but the start and gravity held; gravity within what the Earth has."""
    return tuple(
        replace(c, prior=EARTH) if c.kind == kernels.GRAVITY else (c if c.kind == kernels.START else held((c,))[0])
        for c in constants
    )


def cold_start(problem: Problem, assumed: Assumed, constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Follow the swing over longer and longer stretches, each linear enough for the one before it.

    The first stretches are read as if they were noisier: the ship's motion would else be made to explain what a wrong
    gravity leaves.
    """
    first = constants
    step, nodes = problem.lattice.step, problem.lattice.nodes
    size = float(np.std(problem.lattice.value[~problem.left_out]))
    still = replace(assumed, ship=tuple(c for c in assumed.ship if c.axis == "horizontal"))
    # readings that fall on one phase of the swing show the other only after a while
    between = float(np.median(np.diff(np.unique(problem.lattice.node)))) * step * float(np.sqrt(problem.kappa.mean()))
    stages = STAGES if between < SPARSE else STAGES[1:]
    for number, seconds in enumerate((*stages, np.inf)):
        end = int(min(nodes, np.ceil(seconds / step)))
        coarse = np.maximum(assumed.noise, size * COARSE / 5.0**number if end < nodes else 0.0)
        rough = replace(still if end < nodes else assumed, noise=coarse)
        if number == 0:
            begun = replace(rough, sine=False, noise=np.maximum(coarse, size))
            constants = released(problem.run(begun, held(constants), span=(0, end))[0].constants, first)
        for _ in range(4):
            own = constants if end == nodes else narrowed(constants)
            solution, _ = problem.run(rough, own, span=(0, end))
            constants = released(solution.constants, first)
            if np.all(np.abs(solution.step) < 0.1 * np.sqrt(np.diag(solution.covariance))):
                break
        if end == nodes:
            break
    return constants


def without_outliers(problem: Problem, assumed: Assumed, constants: tuple[Constant, ...]) -> Problem:
    """Leave out what lies far from the prediction, by the errors' own scale; what is common is no outlier."""
    _, of = problem.run(assumed, constants)
    gate = GATE * max(float(np.nanmedian(np.abs(of.errors))) / 0.6745, 1.0)
    for _ in range(4):
        _, of = problem.run(assumed, constants, gate=gate)
        out = ~np.isfinite(of.whitened)
        if np.mean(out) < MOST_OUTLIERS + np.mean(problem.left_out):
            return replace(problem, left_out=out)
        gate *= 3.0
    return problem


def with_difference(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Where no damping is stated: the prior of its difference, from the common rate."""
    common = next((abs(c.value) for c in constants if c.name == "damping"), None)
    if common is None:
        return constants
    width = max(DIFFERENCE * common, 1e-9)
    return tuple(replace(c, prior=width) if c.name.startswith("damping of") else c for c in constants)


@dataclass(frozen=True)
class Outcome:
    """Posterior of gravity, every explanation weighed.

    Attributes
    ----------
    fit : choice.Fitted
        The best explanation.
    close : list of choice.Candidate
        Those that stay close to it.
    mean, sigma : float
        Gravity over reference gravity, mean over the record, and its 1 sigma from the readings.
    spread : float
        Factor in `sigma` by which the prediction errors exceed the model; 1: they are white.
    left_out : int
        Readings that were not used.
    """

    fit: choice.Fitted
    close: list[choice.Candidate]
    mean: float
    sigma: float
    spread: float
    left_out: int

    @property
    def words(self) -> str:
        """The best explanation, and how close others come."""
        model = self.fit.model
        law = "sine" if model.assumed.sine else "linear"
        parts = [f"restoring = {law}", *model.words]
        near = [
            f"{(other.words or ('nothing else',))[-1]} at {value - self.fit.solution.log_likelihood:+.1f}"
            for value, other, _ in self.close
        ]
        return "; ".join(parts) + (f" (close in log-likelihood: {', '.join(near)})" if near else "")


def reduce(gathered: Gathered) -> Outcome:
    """Fit the stated law, or both where none is stated, and weigh all explanations.

    Raises
    ------
    RefusedError
        No explanation is left of which the readings do not deny the most part, or two that are close disagree.
    """
    laws = [gathered.law != "linear"] if gathered.law else [True, False]
    try:
        found = [fitted(gathered, sine=sine) for sine in laws]
    except np.linalg.LinAlgError as error:
        raise RefusedError(
            f"elongation: no swing at the stated period can be followed ({error}); check instrument/period and "
            "record/combination"
        ) from None
    found.sort(key=lambda pair: -pair[0].solution.log_likelihood)
    fit, close = found[0]
    for other, others in found[1:]:
        behind = other.solution.log_likelihood - fit.solution.log_likelihood
        if behind > -choice.PAYS:
            close = [*close, (other.solution.log_likelihood, other.model, other.solution), *others]
    mean, sigma = choice.averaged(fit, close)
    spread = choice.unexplained(fit)
    if spread > MOST_SPREAD:
        raise RefusedError(
            f"elongation: the readings are {spread:.0f} times farther from the best explanation than their noise allows; "
            "check instrument/period, record/combination and the unit of the elongations (rad)"
        )
    if abs(mean - 1.0) > CAPTURE:
        raise RefusedError(
            f"instrument/period: gravity would be {100.0 * (mean - 1.0):+.1f} % off reference_gravity; "
            "check period, reference_gravity and the time axis"
        )
    return Outcome(fit, close, mean, sigma, spread, int(fit.model.problem.left_out.sum()))


MOST_SPREAD = 30.0
CAPTURE = 0.02  # of gravity, from the reference


def fitted(gathered: Gathered, *, sine: bool) -> tuple[choice.Fitted, list[choice.Candidate]]:
    """Fit one law: cold start, outliers, the ship's spectrum, then what else the likelihood pays for."""
    problem = gathered.problem
    unknown_heave = sine and not gathered.heave
    base = int(np.argmax(np.abs(problem.lattice.combination.sum(axis=1))))
    stated = np.where(np.isfinite(gathered.noise), gathered.noise, UNSTATED)
    noise = np.concatenate([np.maximum(stated, LEAST_NOISE), [UNSTATED, UNSTATED]])
    ship: tuple[Component, ...] = GENEROUS
    if unknown_heave:
        ship = (*ship, replace(GENEROUS[0], axis="vertical", rms=0.5 * GENEROUS[0].rms))
    assumed = Assumed(ship, np.zeros(problem.pendulums), noise, sine, gathered.heave_noise)
    constants = cold_start(problem, assumed, first_constants(gathered))
    problem = without_outliers(problem, assumed, constants)
    floors = [spectrum.noise_floor(problem, j) for j in range(problem.traces)]
    for j, floor in enumerate(floors):
        if not np.isfinite(gathered.noise[j]) and np.isfinite(floor):
            noise[j] = max(floor, LEAST_NOISE)
    start = spectrum.begin(problem, base, max(float(np.nanmin([*floors, 1.0])), LEAST_NOISE))
    if unknown_heave:
        swell = start[0]
        assert isinstance(swell, Sea)
        start = (*start, replace(swell, axis="vertical", rms=0.5 * swell.rms))
    assumed = replace(assumed, ship=start, noise=noise)
    constants = with_difference(constants)
    path, _ = problem.smooth(assumed, constants)
    solution, _ = problem.run(assumed, constants, about=path)
    assumed, _ = refined(problem, assumed, solution.constants, path, window(problem))
    model = choice.Model((), assumed, with_difference(solution.constants), problem, assumed.ship)
    return choice.settle(choice.fitted(model, grown(path, problem.pendulums, assumed.ship), passes=1))
