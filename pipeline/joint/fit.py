"""The recipe: from a cold start to the posterior of gravity, the likelihood choosing what is assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.joint import choice, kernels, spectrum
from pipeline.joint.constants import Constant, Solution, starts
from pipeline.joint.gather import Gathered
from pipeline.joint.problem import NONE2, Assumed, Problem
from pipeline.joint.ship import Component, Engine, Sea, Vibration

LEAST_NOISE = 3e-7  # rad: readings are taken for no better
WINDOW = 150.0  # s on which the ship's parameters are refined
STAGES = (25.0, 100.0, 400.0)  # s: stretches on which a cold start is followed
COARSE = 0.1  # reading noise of a cold start's first stretch, of the swing
GATE = 7.0  # deviations beyond which a reading is left out


@dataclass(frozen=True)
class Fit:
    """What was found under one set of assumptions.

    Attributes
    ----------
    assumed : Assumed
    solution : Solution
    path : (k, d) array
        Smoothed states at the nodes.
    whitened : (r,) array
        Prediction errors, white and of unit variance where the model holds.
    """

    assumed: Assumed
    solution: Solution
    path: Floats
    whitened: Floats


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


def released(constants: tuple[Constant, ...], like: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Values of the first, priors of the second."""
    return tuple(replace(b, value=a.value) for a, b in zip(constants, like, strict=True))


def cold_start(problem: Problem, assumed: Assumed, constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Follow the swing over longer and longer stretches, each linear enough for the one before it.

    The first stretches are read as if they were noisier: the ship's motion would else be made to explain what a wrong
    gravity leaves.
    """
    first = constants
    step, nodes = problem.lattice.step, problem.lattice.nodes
    size = float(np.std(problem.lattice.value[~problem.left_out]))
    still = replace(assumed, ship=tuple(c for c in assumed.ship if c.axis == "horizontal"))
    for number, seconds in enumerate((*STAGES, np.inf)):
        end = int(min(nodes, np.ceil(seconds / step)))
        coarse = np.maximum(assumed.noise, size * COARSE / 5.0**number if end < nodes else 0.0)
        rough = replace(still if end < nodes else assumed, noise=coarse)
        if number == 0:
            begun = replace(rough, sine=False, noise=np.maximum(coarse, size))
            constants = released(problem.run(begun, held(constants), span=(0, end))[0].constants, first)
        for _ in range(4):
            solution, _ = problem.run(rough, constants, span=(0, end))
            constants = solution.constants
            if np.all(np.abs(solution.step) < 0.1 * np.sqrt(np.diag(solution.covariance))):
                break
        if end == nodes:
            break
    return constants


def without_outliers(problem: Problem, assumed: Assumed, constants: tuple[Constant, ...]) -> Problem:
    """Leave out what lies far from the prediction, by the errors' own scale."""
    _, of = problem.run(assumed, constants)
    scale = max(float(np.nanmedian(np.abs(of.errors))) / 0.6745, 1.0)
    _, of = problem.run(assumed, constants, gate=GATE * scale)
    return replace(problem, left_out=~np.isfinite(of.whitened))


def relinearised(
    problem: Problem, assumed: Assumed, constants: tuple[Constant, ...], about: Floats = NONE2, passes: int = 3, gate: float = 0.0
) -> Fit:
    """Gauss-Newton about the smoothed path until the constants stand."""
    for _ in range(passes):
        constants = with_difference(constants)
        path, _ = problem.smooth(assumed, constants, about=about, gate=gate)
        solution, of = problem.run(assumed, constants, about=path, gate=gate)
        about, constants = path, solution.constants
        if np.all(np.abs(solution.step) < 0.05 * np.sqrt(np.diag(solution.covariance))):
            break
    return Fit(assumed, solution, path, of.whitened)


def with_difference(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Where no damping is stated: the prior of its difference, from the common rate."""
    common = next((abs(c.value) for c in constants if c.name == "damping"), None)
    if common is None:
        return constants
    width = max(DIFFERENCE * common, 1e-9)
    return tuple(replace(c, prior=width) if c.name.startswith("damping of") else c for c in constants)


def window(problem: Problem, seconds: float = WINDOW) -> tuple[int, int]:
    """The stretch of that length with the most readings."""
    nodes = problem.lattice.nodes
    length = int(min(nodes, np.ceil(seconds / problem.lattice.step)))
    used = problem.lattice.node[~problem.left_out]
    counts = np.concatenate([[0], np.cumsum(np.bincount(used, minlength=nodes))])
    starts = np.arange(0, nodes - length + 1, max(1, length // 8))
    begin = int(starts[np.argmax(counts[starts + length] - counts[starts])])
    return begin, begin + length


STEP = 0.5
NOISE_SPREAD = 0.3
DIFFERENCE = 0.3  # 1 sigma of an unstated difference of damping over the damping


def refined(
    problem: Problem, assumed: Assumed, constants: tuple[Constant, ...], path: Floats, span: tuple[int, int], noise: bool = True
) -> tuple[Assumed, float]:
    """Climb the likelihood of a stretch by coordinates: the ship's parameters and the reading noise."""
    traces = problem.traces if noise else 0
    best = np.concatenate([spectrum.parameters(assumed.ship), np.log(assumed.noise[:traces])])
    centre = best.copy()
    spread = np.concatenate([spectrum.spreads(assumed.ship), np.full(traces, NOISE_SPREAD)])
    here = padded(problem, path, assumed)
    at_start = shifted(constants, here, span[0])

    def make(vector: Floats) -> Assumed:
        ship = spectrum.assemble(assumed.ship, vector[: vector.size - traces])
        size = assumed.noise.copy()
        size[:traces] = np.maximum(np.exp(vector[vector.size - traces :]), LEAST_NOISE)
        return replace(assumed, ship=ship, noise=size)

    def value(vector: Floats) -> float:
        if np.any(vector > 6.0) or np.any(vector < -25.0):
            return -np.inf
        try:
            prior = -0.5 * float(np.sum(((vector - centre) / spread) ** 2))
            return problem.run(make(vector), at_start, span=span, about=here)[0].log_likelihood + prior
        except np.linalg.LinAlgError:
            return -np.inf

    top = value(best)
    step = np.full(best.size, STEP)
    for _ in range(2):
        before = top
        for k in range(best.size):
            around = []
            for sign in (1.0, -1.0):
                trial = best.copy()
                trial[k] += sign * step[k]
                around.append(value(trial))
            up, down = around
            curve = up + down - 2.0 * top
            move = 0.5 * step[k] * (down - up) / curve if curve < 0.0 and np.isfinite(curve) else np.nan
            options = [(top, 0.0), (up, step[k]), (down, -step[k])]
            if np.isfinite(move) and abs(move) < 2.0 * step[k]:
                trial = best.copy()
                trial[k] += move
                options.append((value(trial), move))
            top, by = max(options)
            best[k] += by
            step[k] = max(0.25 * step[k], min(2.0 * abs(by), 2.0)) if by else 0.4 * step[k]
        if top - before < 1.0:
            break
    return make(best), top


def padded(problem: Problem, path: Floats, assumed: Assumed) -> Floats:
    """A path with room for other states of the ship: their place along the path does not matter where they act linearly."""
    two = 2 * problem.pendulums
    size = two + sum(component.system()[1].size for component in assumed.ship)
    if size == path.shape[1]:
        return path
    out = np.zeros((path.shape[0], size))
    kept = min(size, path.shape[1])
    out[:, :kept] = path[:, :kept]
    return out


def shifted(constants: tuple[Constant, ...], path: Floats, begin: int) -> tuple[Constant, ...]:
    """Constants whose start is the path's at a later node."""
    return tuple(replace(c, value=float(path[begin, c.index])) if c.kind == kernels.START else c for c in constants)


def reduce(gathered: Gathered, *, sine: bool, verbose: bool = False) -> tuple[choice.Fitted, list[tuple[float, choice.Fitted]]]:
    """Fit one law."""
    problem = gathered.problem
    constants = first_constants(gathered)
    unknown_heave = sine and not gathered.heave
    base = int(np.argmax(np.abs(problem.lattice.combination.sum(axis=1))))
    # a generous ship first
    stated = np.where(np.isfinite(gathered.noise), gathered.noise, 1e-4)
    noise = np.concatenate([np.maximum(stated, LEAST_NOISE), [1e-4, 1e-4]])
    ship: tuple[Component, ...] = (Sea(0.7, 0.15, 0.02), Vibration(6.0, 1e-3))
    if unknown_heave:
        ship = (*ship, Sea(0.7, 0.15, 0.01, "vertical"))
    assumed = Assumed(ship, np.zeros(problem.pendulums), noise, sine, gathered.heave_noise)
    constants = cold_start(problem, assumed, constants)
    problem = without_outliers(problem, assumed, constants)
    floors = [spectrum.noise_floor(problem, j) for j in range(problem.traces)]
    for j, floor in enumerate(floors):
        if not np.isfinite(gathered.noise[j]) and np.isfinite(floor):
            noise[j] = max(floor, LEAST_NOISE)
    if verbose:
        print('floors', floors, 'cold', constants[2 * problem.pendulums].value, np.nanstd(of.whitened))
    start = spectrum.begin(problem, base, max(float(np.nanmin([*floors, 1.0])), LEAST_NOISE))
    if unknown_heave:
        swell = start[0]
        assert isinstance(swell, Sea)
        start = (*start, replace(swell, axis="vertical", rms=0.5 * swell.rms))
    assumed = replace(assumed, ship=start, noise=noise)
    if verbose: print(start)
    first = relinearised(problem, assumed, constants, passes=1)
    span = window(problem)
    assumed, top = refined(problem, assumed, first.solution.constants, first.path, span)
    if verbose: print('refined', top, assumed)
    model = choice.Model((), assumed, with_difference(first.solution.constants), problem)
    fit = choice.fitted(model, padded(problem, first.path, assumed))
    fit, close = choice.settle(fit)
    return fit, close
