"""The ship's parameters and the reading noise, climbed to where a stretch of the record is likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kernels, spectrum
from pipeline.joint.constants import Constant
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Axis, Component

WINDOW = 150.0  # s
STEP = 0.05  # of a logarithm, for its slope
MOST_STEP = 1.5
ROUNDS, HALVINGS = 4, 3
ENOUGH = 1.0  # in log-likelihood
NOISE_SPREAD = 0.3  # 1 sigma of the logarithm of the reading noise


def grown(path: Floats, pendulums: int, ship: tuple[Component, ...]) -> Floats:
    """A path with room for the states of a ship with more components, at rest: they act linearly."""
    size = 2 * pendulums + sum(each.system()[1].size for each in ship)
    if size == path.shape[1]:
        return path
    out = np.zeros((path.shape[0], size))
    kept = min(size, path.shape[1])
    out[:, :kept] = path[:, :kept]
    return out


def window(problem: Problem, seconds: float = WINDOW) -> tuple[int, int]:
    """The stretch of that length with the most readings."""
    nodes = problem.lattice.nodes
    length = int(min(nodes, np.ceil(seconds / problem.lattice.step)))
    used = problem.lattice.node[~problem.left_out]
    counts = np.concatenate([[0], np.cumsum(np.bincount(used, minlength=nodes))])
    starts = np.arange(0, nodes - length + 1, max(1, length // 8))
    begin = int(starts[np.argmax(counts[starts + length] - counts[starts])])
    return begin, begin + length


def refined(
    problem: Problem,
    assumed: Assumed,
    constants: tuple[Constant, ...],
    path: Floats,
    span: tuple[int, int],
    moves: Floats | None = None,
) -> Assumed:
    """Climb the likelihood of a stretch: the ship's parameters and the reading noise.

    Scoring: the slope by differences, the curvature from the spread of the readings' own slopes (Berndt, Hall, Hall and
    Hausman 1974), so that a step costs one pass over the stretch a parameter.

    Parameters
    ----------
    moves : (m, q) array, optional
        Directions in the logarithms of the q parameters, the noise of each trace last; each by itself, by default.
    """
    ship, traces = spectrum.parameters(assumed.ship), problem.traces
    centre = np.concatenate([ship, np.log(assumed.noise[:traces])])
    spread = np.concatenate([spectrum.spreads(assumed.ship), np.full(traces, NOISE_SPREAD)])
    moves = np.eye(centre.size) if moves is None else moves
    here = grown(path, problem.pendulums, assumed.ship)
    at_start = shifted(constants, here, span[0])

    def make(vector: Floats) -> Assumed:
        size = assumed.noise.copy()
        size[:traces] = np.maximum(np.exp(vector[ship.size :]), spectrum.LEAST_NOISE)
        return replace(assumed, ship=spectrum.assemble(assumed.ship, vector[: ship.size]), noise=size)

    def value(vector: Floats) -> tuple[float, Floats]:
        try:
            solution, of = problem.run(make(vector), at_start, span=span, about=here)
        except np.linalg.LinAlgError:
            return -np.inf, np.zeros(0)
        prior = -0.5 * float(np.sum(((vector - centre) / spread) ** 2))
        return solution.log_likelihood + prior, -np.log(of.scale) - 0.5 * of.whitened**2

    best = centre
    top, parts = value(best)
    for _ in range(ROUNDS):
        slope, rows = np.zeros(len(moves)), np.zeros((len(moves), parts.size))
        for k, move in enumerate(moves):
            moved, each = value(best + STEP * move)
            if np.isfinite(moved):
                slope[k], rows[k] = (moved - top) / STEP, np.nan_to_num(each - parts) / STEP
        curvature = rows @ rows.T + moves @ np.diag(spread**-2.0) @ moves.T
        by = moves.T @ np.linalg.solve(curvature, slope)
        by *= min(1.0, MOST_STEP / max(float(np.abs(by).max()), 1e-12))
        before = top
        for _ in range(HALVINGS):
            trial = value(best + by)
            if trial[0] > top:
                best, (top, parts) = best + by, trial
                break
            by *= 0.3
        if top - before < ENOUGH:
            break
    return make(best)


def of_an_axis(problem: Problem, ship: tuple[Component, ...], axis: Axis) -> Floats:
    """Directions in which the components of an axis, and the noise of each trace, move."""
    moved = [each.axis == axis for each in ship for _ in spectrum.parameters((each,))]
    return np.eye(len(moved) + problem.traces)[[*moved, *[True] * problem.traces]]


def of_the_last(problem: Problem, ship: tuple[Component, ...]) -> Floats:
    """Directions in which the last component alone moves."""
    count, own = spectrum.parameters(ship).size, spectrum.parameters(ship[-1:]).size
    return np.eye(count + problem.traces)[count - own : count]


def of_sizes(problem: Problem, ship: tuple[Component, ...]) -> Floats:
    """Directions in which each component grows."""
    moves = np.zeros((len(ship), spectrum.parameters(ship).size + problem.traces))
    ends = np.cumsum([spectrum.parameters((each,)).size for each in ship])
    moves[np.arange(len(ship)), ends - 1] = 1.0
    return moves


def shifted(constants: tuple[Constant, ...], path: Floats, begin: int) -> tuple[Constant, ...]:
    """Constants whose start is the path's at a later node."""
    return tuple(replace(c, value=float(path[begin, c.index])) if c.kind == kernels.START else c for c in constants)
