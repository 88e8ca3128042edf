"""The ship's parameters and the reading noise, climbed to where pieces of the record are likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kernels, spectrum
from pipeline.joint.constants import Constant
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Axis, Component

PIECES, PIECE = 2, 150.0  # all along a record; s of readings in each
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


Span = tuple[int, int]
"""First node of a stretch and the one behind its last."""


def pieces(problem: Problem) -> list[Span]:
    """Stretches all along the record, in each part of it the one with the most readings; all of a short record."""
    nodes = problem.lattice.nodes
    read = np.bincount(problem.lattice.node[~problem.left_out], minlength=nodes)
    length = int(np.ceil(PIECE / problem.lattice.step / np.mean(read > 0)))
    if PIECES * length >= nodes:
        return [(0, nodes)]
    counts = np.concatenate([[0], np.cumsum(read)])
    found = []
    for part in np.array_split(np.arange(nodes - length + 1), PIECES):
        starts = part[: max(part.size - length, 1) : max(1, length // 8)]
        begin = int(starts[np.argmax(counts[starts + length] - counts[starts])])
        found.append((begin, begin + length))
    return found


def refined(
    problem: Problem,
    assumed: Assumed,
    constants: tuple[Constant, ...],
    path: Floats,
    spans: list[Span],
    moves: Floats | None = None,
) -> Assumed:
    """Climb the likelihood of some stretches: the ship's parameters and the reading noise.

    Scoring: the slope by differences, the curvature from the spread of the readings' own slopes (Berndt, Hall, Hall and
    Hausman 1974), so that a step costs one pass over them a parameter.

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
    begun = [shifted(constants, here, span[0]) for span in spans]

    def make(vector: Floats) -> Assumed:
        size = assumed.noise.copy()
        size[:traces] = np.maximum(np.exp(vector[ship.size :]), spectrum.LEAST_NOISE)
        return replace(assumed, ship=spectrum.assemble(assumed.ship, vector[: ship.size]), noise=size)

    def value(vector: Floats) -> tuple[float, Floats]:
        total, parts, assumed = -0.5 * float(np.sum(((vector - centre) / spread) ** 2)), [], make(vector)
        for span, at_start in zip(spans, begun, strict=True):
            try:
                solution, of = problem.run(assumed, at_start, span=span, about=here)
            except np.linalg.LinAlgError:
                return -np.inf, np.zeros(0)
            total += solution.log_likelihood
            rows = slice(*np.searchsorted(problem.lattice.node, span))
            parts.append(-np.log(of.scale[rows]) - 0.5 * of.whitened[rows] ** 2)
        return total, np.concatenate(parts)

    best = centre
    top, parts = value(best)
    for _ in range(ROUNDS):
        slope, rows = np.zeros(len(moves)), np.zeros((len(moves), parts.size))
        for k, move in enumerate(moves):
            moved, each = value(best + STEP * move)
            if np.isfinite(moved):
                slope[k], rows[k] = (moved - top) / STEP, np.nan_to_num(each - parts) / STEP
        curvature = rows @ rows.T + moves @ np.diag(spread**-2.0) @ moves.T
        step = np.linalg.solve(curvature, slope)
        if 0.5 * float(slope @ step) < 0.5 * ENOUGH:
            break
        by = moves.T @ step
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
