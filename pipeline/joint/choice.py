"""Competing explanations of a record, weighed by their likelihood: each pays for what it adds.

One pass with the derivatives by every candidate constant prices them all at once; what changes the noise itself (kicks,
components of the ship's motion) costs a pass of its own. The best is taken, the record fitted anew, and so on until
nothing pays. Explanations that stay close are averaged into value and sigma.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kernels
from pipeline.joint.climb import grown, refined, shifted, window
from pipeline.joint.constants import Constant, Solution, solve
from pipeline.joint.course import Course, best_course, is_knot, knots, prior_root, weights
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Axis, Component, Engine, Sea, Ship

MOST_FITS = 6
STRAIGHT = 0.02  # of the reading noise
PAYS = 5.0  # in log-likelihood
ROUNDS = 8
KICKS = np.array([1e-8, 1e-7, 1e-6, 1e-5])
"""rad s-1/2, tried where none is assumed."""
FEIGNED = 2.0  # in log-likelihood
MOST_COMPONENTS = 3
CALM = 0.5  # of the swing's frequency: below it lines of the sea are left, which cost nothing
SHAPES = (
    (Engine, 1e-3, 1e-4),
    (Engine, 1e-3, 1e-3),
    (Engine, 0.01, 1e-4),
    (Engine, 0.01, 1e-3),
    (Sea, 0.1, 3e-4),
    (Sea, 0.1, 3e-3),
)
"""Kind, relative damping and size of the components that are tried at a line."""
SPARSE = 2.0  # of the swing between readings, rad: above it a line cannot be told from its aliases
SAME_LINE = 0.2  # in the logarithm of the frequency
QUIET = 0.3  # of the power that white errors of unit variance have
PEAK = 14.0  # of a whitened spectrum over its mean: chance reaches it once in a thousand records


@dataclass(frozen=True)
class Model:
    """One explanation.

    Attributes
    ----------
    words : tuple of str
        What it adds to the plainest one.
    assumed : Assumed
    constants : tuple of Constant
    course : Course or None
    problem : Problem
    first_ship : tuple of Component
        Before any was added.
    """

    words: tuple[str, ...]
    assumed: Assumed
    constants: tuple[Constant, ...]
    problem: Problem
    first_ship: tuple[Component, ...]
    course: Course | None = None


@dataclass(frozen=True)
class Fitted:
    """An explanation with what it gives.

    Attributes
    ----------
    model : Model
    solution : Solution
    path : (k, d) array
    whitened : (r,) array
    """

    model: Model
    solution: Solution
    path: Floats
    whitened: Floats


def fitted(model: Model, about: Floats) -> Fitted:
    """Gauss-Newton about the smoothed path, until it is straight between the last two."""
    root = prior_root(model.constants, model.course)
    constants = model.constants
    for _ in range(MOST_FITS):
        solution, of, path = model.problem.fit(model.assumed, constants, about=about, root=root)
        constants, left = solution.constants, bend(model, path, about)
        about = path
        if left < STRAIGHT:
            break
    return Fitted(replace(model, constants=constants), solution, path, of.whitened)


def bend(model: Model, path: Floats, about: Floats) -> float:
    """What linearising about one path leaves out of another, as if it added up all along, over the reading noise."""
    problem, two = model.problem, 2 * model.problem.pendulums
    if not model.assumed.sine:
        return 0.0
    ship = Ship.of(model.assumed.ship)
    away = path - about
    horizontal, vertical = (np.abs(away[:, two:] @ row) for row in (ship.horizontal, ship.vertical))
    angle = np.abs(path[:, :two:2]).max(axis=1)
    # within a step the angle follows what is assumed of the ship at its start
    within = 0.5 * float(problem.kappa.max()) * problem.lattice.step**2
    off = np.abs(away[:, :two:2]).max(axis=1) + within * (horizontal + angle * vertical)
    turns = float(np.sqrt(problem.kappa.max())) * problem.lattice.duration / 2.0
    mean = float(np.mean(off * (vertical + angle * (off + horizontal))))
    return mean * turns / float(model.assumed.noise[: problem.traces].min())


Candidate = tuple[float, Model, Solution]


def priced(model: Model, about: Floats, cost: float = 0.0, span: tuple[int, int] | None = None) -> Candidate:
    """A model with its log-likelihood less what its own parameters cost, linearised about a path."""
    root = prior_root(model.constants, model.course)
    try:
        solution, _ = model.problem.run(model.assumed, model.constants, about=about, root=root, span=span)
    except np.linalg.LinAlgError:
        return -np.inf, model, NO_SOLUTION
    return solution.log_likelihood - cost, model, solution


NO_SOLUTION = Solution((), np.zeros(0), np.zeros((0, 0)), -np.inf, np.inf, 0)


def candidates(fit: Fitted) -> list[Candidate]:
    """Explanations that add one thing to a fitted one, with their log-likelihoods."""
    found = list(_constants(fit))
    # random kicks show as a course or a friction that they feign: what nothing feigns is not there
    if np.any(fit.model.assumed.kick) or max(each[0] for each in found) > fit.solution.log_likelihood + FEIGNED:
        found += _kicks(fit)
    added = len(fit.model.assumed.ship) - len(fit.model.first_ship)
    if added < MOST_COMPONENTS:
        found += _components(fit)
    return found


def _constants(fit: Fitted) -> Iterator[Candidate]:
    """Friction, a course of gravity, and knocks, all priced by one pass."""
    model = fit.model
    problem, own = model.problem, model.constants
    duration = problem.lattice.duration
    kinds = {each.kind for each in own}
    extra: list[Constant] = []
    if kernels.QUADRATIC not in kinds:
        extra.append(Constant("quadratic friction", kernels.QUADRATIC, 1e-2))
    if kernels.DRY not in kinds:
        extra.append(Constant("knife-edge friction", kernels.DRY, 1e-4))
    if not any(is_knot(each) for each in own):
        extra += knots(duration)
    whole = (*own, *extra)
    base = prior_root(own, model.course)
    root = np.zeros((len(whole), len(whole)))
    root[: len(own), : len(own)] = base
    root[len(own) :, len(own) :] = np.diag([each.prior for each in extra])
    _, of = problem.run(model.assumed, whole, about=fit.path, root=root)

    def part(chosen: tuple[Constant, ...]) -> tuple[tuple[Constant, ...], Floats]:
        names = {each.name for each in own} | {each.name for each in chosen}
        rows = [k for k, each in enumerate(whole) if each.name in names]
        return tuple(whole[k] for k in rows), of.normal[np.ix_([*rows, -1], [*rows, -1])]

    for each in extra:
        if is_knot(each):
            continue
        some, normal = part((each,))
        sub = np.zeros((len(some), len(some)))
        sub[: len(own), : len(own)] = base
        sub[-1, -1] = each.prior
        found = solve(some, normal, float(of.totals[0]), float(of.totals[1]), sub)
        yield found.log_likelihood, replace(model, words=(*model.words, each.name), constants=found.constants), found
    track = tuple(each for each in extra if is_knot(each))
    if track:
        some, normal = part(track)
        course, found = best_course(some, normal, of.totals, duration)
        words = (*model.words, "gravity changes")
        # two more parameters, of the prior
        yield found.log_likelihood - 2.0, replace(model, words=words, constants=found.constants, course=course), found


def _kicks(fit: Fitted) -> Iterator[Candidate]:
    model = fit.model
    now = model.assumed.kick
    words = (*(w for w in model.words if w != "kicks"), "kicks")

    def of(kick: Floats) -> Candidate:
        trial = replace(model, words=words, assumed=replace(model.assumed, kick=kick))
        return priced(trial, fit.path, cost=1.0)

    if not np.any(now):
        found = [of(np.full(now.size, size)) for size in KICKS]
        yield max(found, key=lambda pair: pair[0])
        return
    for i in range(now.size):
        for factor in (0.1, 0.5, 2.0):
            kick = now.copy()
            kick[i] *= factor
            yield of(kick)
    for factor in (0.6, 1.7):
        yield of(now * factor)


def _components(fit: Fitted) -> Iterator[Candidate]:
    """Lines of the ship's motion where the whitened errors have one."""
    model = fit.model
    problem, lattice = model.problem, model.problem.lattice
    swing = float(np.sqrt(problem.kappa.mean()))
    for trace in range(problem.traces):
        used = (lattice.trace == trace) & np.isfinite(fit.whitened)
        if used.sum() < LEAST_READINGS:
            continue
        step = max(float(np.median(np.diff(lattice.time[used]))), 1e-3)
        if step * swing > SPARSE:
            continue
        grid = np.rint(lattice.time[used] / step).astype(np.int64)
        series = np.zeros(int(grid[-1]) + 1)
        series[grid] = fit.whitened[used]
        power = np.abs(np.fft.rfft(series)) ** 2
        smooth = np.convolve(power, np.ones(5) / 5.0, "same")
        smooth[: 3 + int(CALM * swing / (2.0 * np.pi) * series.size * step)] = 0.0
        at = int(np.argmax(smooth))
        # errors far below their own scale need no explanation
        if smooth[at] < PEAK / 2.0 * max(float(np.median(power)) / np.log(2.0), QUIET * float(used.sum())):
            continue
        frequency = 2.0 * np.pi * at / (series.size * step)
        options: list[tuple[Axis, float]] = [("horizontal", frequency)]
        if model.assumed.sine and not problem.recorded.size:
            options += [("vertical", f) for f in (frequency + swing, abs(frequency - swing)) if f > 0.2]
        # a vertical motion acts by the angle
        lever = {"horizontal": 1.0, "vertical": float(np.std(fit.path[:, : 2 * problem.pendulums : 2]))}
        lines = [
            make(own, width * own, rms / lever[axis], axis) for axis, own in options for make, width, rms in SHAPES
        ]
        span = window(problem)
        found: tuple[float, tuple[Component, ...]] = (-np.inf, ())
        for line in lines:
            ship = (*model.assumed.ship, line)
            about = grown(fit.path, problem.pendulums, ship)
            trial = replace(
                model, assumed=replace(model.assumed, ship=ship), constants=shifted(model.constants, about, span[0])
            )
            found = max(found, (priced(trial, about, span=span)[0], ship), key=lambda each: each[0])
        about = grown(fit.path, problem.pendulums, found[1])
        assumed = refined(problem, replace(model.assumed, ship=found[1]), model.constants, about, span, last=True)
        added = assumed.ship[-1]
        if abs(np.log(added.peak / found[1][-1].peak)) > SAME_LINE:
            continue  # it went off to better what is there already
        words = f"{added.axis} motion at {added.peak / (2.0 * np.pi):.2f} Hz"
        yield priced(replace(model, words=(*model.words, words), assumed=assumed), about, cost=15.0)


def settle(fit: Fitted) -> tuple[Fitted, list[Candidate]]:
    """Add what pays, the best first; the last fit, and the explanations that stay close to it."""
    close: list[Candidate] = []
    for _ in range(ROUNDS):
        base = fit.solution.log_likelihood
        found = sorted(candidates(fit), key=lambda each: -each[0])
        close = [each for each in found if base - PAYS < each[0] < base + PAYS]
        better = next(
            (new for each in found if each[0] > base + PAYS and (new := _taken(fit, each[1])) is not None), None
        )
        if better is None:
            break
        fit = better
    return fit, close


def _taken(fit: Fitted, model: Model) -> Fitted | None:
    """A candidate fitted anew; None where that makes it no better."""
    try:
        found = fitted(model, grown(fit.path, model.problem.pendulums, model.assumed.ship))
    except np.linalg.LinAlgError:
        return None
    return found if found.solution.log_likelihood > fit.solution.log_likelihood else None


def averaged(fit: Fitted, close: list[Candidate]) -> tuple[float, float]:
    """Gravity over reference gravity and its 1 sigma, over the explanations that stay close."""
    duration = fit.model.problem.lattice.duration
    parts = [(fit.solution.log_likelihood, *mean_gravity(fit.solution, duration))]
    parts += [(value, *mean_gravity(solution, duration)) for value, _, solution in close]
    logs = np.array([part[0] for part in parts])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    values, sigmas = np.array([part[1] for part in parts]), np.array([part[2] for part in parts])
    mean = float(share @ values)
    return mean, float(np.sqrt(share @ (sigmas**2 + (values - mean) ** 2)))


def mean_gravity(solution: Solution, duration: float) -> tuple[float, float]:
    """Mean of gravity over the record over reference gravity, and its 1 sigma."""
    row = weights(solution.constants, np.linspace(0.0, duration, 512)).mean(axis=0)
    values = np.array([each.value for each in solution.constants])
    return float(row @ values), float(np.sqrt(row @ solution.covariance @ row))


def unexplained(fit: Fitted) -> float:
    """Factor by which the prediction errors exceed the model, in the worst stretch or near the swing; at least 1.

    Sums over a tenth of the record, and over a narrow band, scatter by chance: only what exceeds that counts.
    """
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    swing = float(np.sqrt(problem.kappa.mean()))
    worst = 1.0
    for trace in range(problem.traces):
        used = (lattice.trace == trace) & np.isfinite(fit.whitened)
        if used.sum() < LEAST_READINGS:
            continue
        errors, time = fit.whitened[used], lattice.time[used]
        parts = np.array_split(errors, 10)
        worst = max(worst, *(float(np.mean(part**2)) / (1.0 + 5.0 * np.sqrt(2.0 / part.size)) for part in parts))
        turned = [
            np.abs(np.sum(part)) ** 2 / part.size for part in np.array_split(errors * np.exp(-1j * swing * time), 30)
        ]
        worst = max(worst, float(np.mean(turned)) / (1.0 + 5.0 / np.sqrt(30.0)))
    return float(np.sqrt(worst))


LEAST_READINGS = 100
