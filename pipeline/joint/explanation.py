"""One explanation of a record, fitted: a model of what is random, its constants, and the path that it gives."""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import apparatus, kinds, passes
from pipeline.joint.constants import Constant, Constants, Solution, solve
from pipeline.joint.course import Course, mean_gravity, prior_root
from pipeline.joint.lattice import LONG_GAP
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Component, Ship

MOST_FITS = 6
PAYS = 5.0  # in log-likelihood
OUTLIER = float(np.log(0.01 / 0.1))  # of a reading in a hundred, over .1 rad
BROKEN = 200.0  # in log-likelihood, that pendulums which were knocked at a node must be worth
STRAIGHT = 0.02  # of the reading noise
CONTRACTION = 0.01  # of what bends, a pass


@dataclass(frozen=True)
class Model:
    """One explanation."""

    words: tuple[str, ...]  # What it adds to the plainest one
    assumed: Assumed
    constants: Constants
    problem: Problem
    begun: tuple[Component, ...]  # The ship before any was added or moved
    course: Course | None = None

    def adding(self, words: str, **changes: Any) -> "Model":
        """With something more, named by these words."""
        return replace(self, words=(*self.words, words), **changes)


class Candidate(NamedTuple):
    """A model that was not fitted for itself yet."""

    value: float  # Log-likelihood, less what its own parameters cost
    model: Model
    solution: Solution


@dataclass(frozen=True)
class Fitted:
    """An explanation with what it gives."""

    model: Model
    solution: Solution
    path: Floats  # (k, d)
    of: passes.Pass  # The last pass: prediction errors at the solution, and the products of their derivatives
    about: Constants  # What it went about
    doubt: float = 0.0
    """Of gravity over itself, from a path that does not settle: in long gaps the ship's is hardly known."""
    bent: float = 0.0  # See `bend`, between the last two paths
    spectra: dict[object, object] = field(default_factory=dict, init=False)
    """Of the errors, once they are asked for; see `whiteness`."""

    @property
    def gravity(self) -> tuple[float, float]:
        """Mean over the record over reference gravity, and its 1 sigma."""
        return mean_gravity(self.solution, self.model.problem.lattice.duration)

    def used(self, trace: int) -> np.ndarray:
        """Places of a trace's readings that were used."""
        own = self.model.problem.lattice.of_trace[trace]
        return np.asarray(own[np.isfinite(self.of.whitened[own])])

    @property
    def standing(self) -> float:
        """Log-likelihood of all readings, those left out included: rejected ones fall anywhere."""
        return self.solution.log_likelihood + OUTLIER * float(self.model.problem.left_out.sum()) - self.knocked

    @property
    def knocked(self) -> float:
        """What pendulums that were knocked must be worth, in log-likelihood."""
        return BROKEN * len({node for node, _ in self.model.assumed.breaks})

    def candidate(self, cost: float = 0.0) -> Candidate:
        """What it is worth beside others."""
        return Candidate(self.solution.log_likelihood - cost, self.model, self.solution)

    def without(self, constant: Constant) -> "Fitted":
        """The same without a constant that hardly differs from zero, or all of its name: by the last pass."""
        at = [k for k, each in enumerate(self.about) if each.name == constant.name]
        rest = tuple(each for each in self.about if each.name != constant.name)
        turned = np.delete(np.eye(len(self.about) + 1), at, axis=1)
        turned[at, -1] = [-self.about[k].value for k in at]
        normal, totals = turned.T @ self.of.normal @ turned, self.of.totals
        solution = solve(rest, normal, totals[0], totals[1], prior_root(rest, self.model.course))
        model = replace(self.model, constants=solution.constants)
        return Fitted(model, solution, self.path, self.of._replace(normal=normal), rest, self.doubt, self.bent)


def fitted(model: Model, about: Floats, *, smooth: bool = False, most: int = MOST_FITS) -> Fitted:
    """Gauss-Newton about the smoothed path, until it is straight between the last two, or so many passes are done.
    Paths contract a thousandfold a pass, but in long gaps: the last needs no smoothing. That of linear pendulums only
    scales derivatives: smoothed under the ship's own spectrum, it stays."""
    model = _of_known_scale(model)
    about = grown(about, model.problem.pendulums, model.assumed.ship)
    root = prior_root(model.constants, model.course)
    constants, left, doubt = model.constants, np.inf if model.assumed.sine or smooth else 0.0, 0.0
    contraction = 1.0 if model.problem.lattice.longest_gap > LONG_GAP else CONTRACTION
    for _ in range(most):
        before = constants
        solution, of, path = model.problem.fit(
            model.assumed, before, about=about, root=root, smooth=bool(left * contraction > STRAIGHT)
        )
        constants, doubt = solution.constants, 0.0
        if path is about:
            left = 0.0
            break
        left = bend(model, path, about)
        if left < STRAIGHT:
            break
        doubt, about = astray(model, path, about), path
    of = of._replace(whitened=of.whitened.astype(np.float32))  # from here on that is enough, and long records have many
    return Fitted(replace(model, constants=constants), solution, path, of, before, doubt, left)


def _of_known_scale(model: Model) -> Model:
    """Where unknown vertical motion is assumed, which passes for a scale of all angles, that is as stated: its sigma
    counts by the arcs (`unfollowed.doubt_by_scale`)."""
    if not model.assumed.heaves:
        return model
    known = tuple(
        replace(each, prior=apparatus.EXACT, value=each.mean) if each.kind == kinds.GAIN and each.index < 0 else each
        for each in model.constants
    )
    return replace(model, constants=known)


def attempted(model: Model, about: Floats, *, smooth: bool = False, most: int = MOST_FITS) -> Fitted | None:
    """The same; None where a model cannot be followed."""
    try:
        return fitted(model, about, smooth=smooth, most=most)
    except np.linalg.LinAlgError:
        return None


def likelier(fit: Fitted, other: Fitted | None) -> Fitted:
    """The one of two fits that the readings are likelier under, if there is another."""
    return fit if other is None or other.standing <= fit.standing else other


def grown(path: Floats, pendulums: int, ship: tuple[Component, ...]) -> Floats:
    """A path with room for the states of a ship with more components, at rest: they act linearly."""
    size = 2 * pendulums + sum(each.system()[1].size for each in ship)
    if size == path.shape[1]:
        return path
    out = np.zeros((path.shape[0], size), dtype=path.dtype)
    kept = min(size, path.shape[1])
    out[:, :kept] = path[:, :kept]
    return out


def path_on(fit: Fitted, ship: tuple[Component, ...]) -> Floats:
    """The path of a fit, its pendulums' alone where the ship is made of other components."""
    path, pendulums, own = fit.path, fit.model.problem.pendulums, fit.model.assumed.ship
    if [type(each) for each in ship] != [type(each) for each in own]:
        path = path[:, : 2 * pendulums]
    return grown(path, pendulums, ship)


def shifted(constants: Constants, path: Floats, begin: int) -> Constants:
    """Constants whose start is the path's at a later node."""
    return tuple(replace(c, value=float(path[begin, c.index])) if c.kind == kinds.START else c for c in constants)


def angles(fit: Fitted, times: Floats, weights: Floats) -> Floats:
    """Angles of pendulums in combinations, weights (p,) or (p, m), at times since the first node, s, (n,) or (n, m): a
    cubic and a swing, exact for a swing."""
    model, problem, two = fit.model, fit.model.problem, 2 * fit.model.problem.pendulums
    flow, ship = problem.flow(model.assumed, fit.solution.constants), Ship.of(model.assumed.ship)
    lattice, path = problem.lattice, fit.path.astype(np.float64)
    angle, speed = path[:, :two:2], path[:, 1:two:2]
    across, aside, along = (path[:, two:] @ row for row in (ship.horizontal, ship.transverse, ship.vertical))
    across = across[:, None] + aside[:, None] * (np.arange(two // 2) > 0)
    if problem.heave is not None:
        along = along + problem.heave(lattice.step * np.arange(lattice.nodes))
    if model.assumed.sine:
        pull = (flow.gravity + along[:, None]) * np.sin(angle) + across * np.cos(angle)
    else:
        pull = flow.gravity * angle + across
    step, turn = lattice.step, problem.swing * lattice.step
    known = np.stack([angle, step * speed, -(step**2) * (flow.kappa * pull + 2.0 * flow.damping * speed)])
    cosine, sine = np.cos(turn), np.sin(turn)
    ends = [  # of 1, t, t^2, t^3, cos and sin of what the swing turns in t: value and two derivatives
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, turn],
        [0.0, 0.0, 2.0, 0.0, -(turn**2), 0.0],
        [1.0, 1.0, 1.0, 1.0, cosine, sine],
        [0.0, 1.0, 2.0, 3.0, -turn * sine, turn * cosine],
        [0.0, 0.0, 2.0, 6.0, -(turn**2) * cosine, -(turn**2) * sine],
    ]
    shares = np.tensordot(np.linalg.inv(ends), np.concatenate([known[:, :-1], known[:, 1:]]) @ weights, axes=1)
    k = np.clip((times / step).astype(np.int64), 0, lattice.nodes - 2)
    t = (times / step - k).reshape(-1, *[1] * (weights.ndim - 1))
    out = np.asarray(shares[3][k])
    for share in shares[2::-1]:
        out *= t
        out += share[k]
    out += np.cos(turn * t) * shares[4][k]
    out += np.sin(turn * t) * shares[5][k]
    return out


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
    read = problem.lattice.apart < LONG_GAP  # what is amiss in a long gap, `unfollowed.gaps` holds
    mean = float(np.mean(read * off * (vertical + angle * (off + horizontal))))
    return mean * turns / float(model.assumed.noise[: problem.traces].min())


def astray(model: Model, path: Floats, about: Floats) -> float:
    """The change of gravity over itself that does as much as what linearising about one path leaves out of another."""
    two, ship, worst = 2 * model.problem.pendulums, Ship.of(model.assumed.ship), 0.0
    (u, z), (across, along) = (
        [each[:, two:] @ row for row in (ship.horizontal, ship.vertical)] for each in (path, about)
    )
    for i in range(0, two, 2):
        angle, at = path[:, i], about[:, i]
        sine, cosine = np.sin(at), np.cos(at)
        rest = (1.0 + z) * (np.sin(angle) - sine) + u * (np.cos(angle) - cosine)
        rest -= ((1.0 + along) * cosine - across * sine) * (angle - at)
        rest *= model.problem.lattice.apart < LONG_GAP
        worst = max(worst, abs(float(rest @ angle) / float(angle @ angle)))
    return worst


def priced(model: Model, about: Floats, cost: float = 0.0, span: tuple[int, int] | None = None) -> Candidate:
    """A model with its log-likelihood less what its own parameters cost, linearised about a path."""
    root = prior_root(model.constants, model.course)
    about = grown(about, model.problem.pendulums, model.assumed.ship)
    try:
        solution, _ = model.problem.run(model.assumed, model.constants, about=about, root=root, span=span)
    except np.linalg.LinAlgError:
        return Candidate(-np.inf, model, NO_SOLUTION)
    return Candidate(solution.log_likelihood - cost, model, solution)


NO_SOLUTION = Solution((), np.zeros(0), np.zeros((0, 0)), -np.inf)
