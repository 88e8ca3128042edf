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
from pipeline.joint.constants import Constant, Solution, solve
from pipeline.joint.course import Course, best_course, is_knot, knots, prior_root, weights
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Engine, Sea

PAYS = 5.0  # in log-likelihood
ROUNDS = 8
KICKS = np.array([1e-8, 1e-7, 1e-6, 1e-5])
"""rad s-1/2, tried where none is assumed."""
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
    """

    words: tuple[str, ...]
    assumed: Assumed
    constants: tuple[Constant, ...]
    problem: Problem
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

    @property
    def mean(self) -> tuple[float, float]:
        """Mean of gravity over the record over reference gravity, and its 1 sigma."""
        lattice = self.model.problem.lattice
        row = weights(self.solution.constants, np.linspace(0.0, lattice.step * (lattice.nodes - 1), 512)).mean(axis=0)
        values = np.array([each.value for each in self.solution.constants])
        return float(row @ values), float(np.sqrt(row @ self.solution.covariance @ row))


def fitted(model: Model, about: Floats, passes: int = 2) -> Fitted:
    """Gauss-Newton about the smoothed path."""
    root = prior_root(model.constants, model.course)
    constants = model.constants
    for _ in range(passes):
        path, _ = model.problem.smooth(model.assumed, constants, about=about)
        solution, of = model.problem.run(model.assumed, constants, about=path, root=root)
        about, constants = path, solution.constants
        if np.all(np.abs(solution.step) < 0.05 * np.sqrt(np.diag(solution.covariance))):
            break
    return Fitted(replace(model, constants=constants), solution, path, of.whitened)


def likelihood(model: Model, about: Floats) -> float:
    """Of a model, linearised about a path."""
    try:
        root = prior_root(model.constants, model.course)
        return model.problem.run(model.assumed, model.constants, about=about, root=root)[0].log_likelihood
    except np.linalg.LinAlgError:
        return -np.inf


def candidates(fit: Fitted) -> Iterator[tuple[float, Model]]:
    """Explanations that add one thing to a fitted one, with their log-likelihoods."""
    yield from _constants(fit)
    yield from _kicks(fit)
    yield from _components(fit)


def _constants(fit: Fitted) -> Iterator[tuple[float, Model]]:
    """Friction, a course of gravity, and knocks, all priced by one pass."""
    model = fit.model
    problem, own = model.problem, model.constants
    duration = problem.lattice.step * (problem.lattice.nodes - 1)
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
        yield found.log_likelihood, replace(model, words=(*model.words, each.name), constants=found.constants)
    track = tuple(each for each in extra if is_knot(each))
    if track:
        some, normal = part(track)
        course, found = best_course(some, normal, of.totals, duration)
        words = (*model.words, "gravity changes")
        # two more parameters, of the prior
        yield found.log_likelihood - 2.0, replace(model, words=words, constants=found.constants, course=course)


def _kicks(fit: Fitted) -> Iterator[tuple[float, Model]]:
    model = fit.model
    now = model.assumed.kick
    words = (*(w for w in model.words if w != "kicks"), "kicks")

    def of(kick: Floats) -> tuple[float, Model]:
        trial = replace(model, words=words, assumed=replace(model.assumed, kick=kick))
        return likelihood(trial, fit.path), trial

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


def _components(fit: Fitted) -> Iterator[tuple[float, Model]]:
    """Lines of the ship's motion where the whitened errors have one."""
    model = fit.model
    problem, lattice = model.problem, model.problem.lattice
    swing = float(np.sqrt(problem.kappa.mean()))
    for trace in range(problem.traces):
        used = (lattice.trace == trace) & np.isfinite(fit.whitened)
        if used.sum() < 256:
            continue
        step = max(float(np.median(np.diff(lattice.time[used]))), 1e-3)
        grid = np.rint(lattice.time[used] / step).astype(np.int64)
        series = np.zeros(int(grid[-1]) + 1)
        series[grid] = fit.whitened[used]
        power = np.abs(np.fft.rfft(series)) ** 2
        smooth = np.convolve(power, np.ones(5) / 5.0, "same")
        smooth[:3] = 0.0
        at = int(np.argmax(smooth))
        if smooth[at] < PEAK / 2.0 * power.mean():
            continue
        frequency = 2.0 * np.pi * at / (series.size * step)
        options = [("horizontal", frequency)]
        if model.assumed.sine:
            options += [("vertical", f) for f in (frequency + swing, abs(frequency - swing)) if f > 0.2]
        for axis, own in options:
            for rms in (1e-4, 1e-3):
                for line in (Engine(own, 0.01, rms, axis), Sea(own, 0.1 * own, 3.0 * rms, axis)):  # type: ignore[arg-type]
                    ship = (*model.assumed.ship, line)
                    trial = replace(
                        model,
                        words=(*model.words, f"{axis} motion at {own / (2.0 * np.pi):.2f} Hz"),
                        assumed=replace(model.assumed, ship=ship),
                    )
                    size = fit.path.shape[1] + line.system()[1].size
                    about = np.zeros((fit.path.shape[0], size))
                    about[:, : fit.path.shape[1]] = fit.path
                    yield likelihood(trial, about) - 3.0, trial


def settle(fit: Fitted) -> tuple[Fitted, list[tuple[float, Fitted]]]:
    """Add what pays, the best first; the last fit, and those that stay close to it with their log-likelihoods."""
    close: list[tuple[float, Fitted]] = []
    for _ in range(ROUNDS):
        base = fit.solution.log_likelihood
        found = sorted(candidates(fit), key=lambda pair: -pair[0])
        best, model = found[0]
        if best - base < PAYS:
            for value, other in found[:3]:
                if value > base - PAYS:
                    close.append((value, fitted(other, grown(fit.path, other), passes=1)))
            break
        fit = fitted(model, grown(fit.path, model))
    return fit, close


def grown(path: Floats, model: Model) -> Floats:
    """A path with room for the states that a model adds."""
    size = 2 * model.problem.pendulums + sum(each.system()[1].size for each in model.assumed.ship)
    if size == path.shape[1]:
        return path
    out = np.zeros((path.shape[0], size))
    out[:, : path.shape[1]] = path
    return out


def averaged(fit: Fitted, close: list[tuple[float, Fitted]]) -> tuple[float, float]:
    """Gravity over reference gravity and its 1 sigma, over the explanations that stay close."""
    parts = [(fit.solution.log_likelihood, *fit.mean)] + [(value, *other.mean) for value, other in close]
    logs = np.array([part[0] for part in parts])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    values, sigmas = np.array([part[1] for part in parts]), np.array([part[2] for part in parts])
    mean = float(share @ values)
    return mean, float(np.sqrt(share @ (sigmas**2 + (values - mean) ** 2)))
