"""The ship's parameters and the reading noise, climbed to where a stretch of the record is likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kernels, spectrum
from pipeline.joint.constants import Constant
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Component

WINDOW = 150.0  # s
LEAST_NOISE = 1e-6  # rad: readings are taken for no better
STEP = 0.5  # first step of each logarithm
ROUNDS = 2
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
    noise: bool = True,
) -> tuple[Assumed, float]:
    """Climb the likelihood of a stretch by coordinates: the ship's parameters and the reading noise."""
    traces = problem.traces if noise else 0
    best = np.concatenate([spectrum.parameters(assumed.ship), np.log(assumed.noise[:traces])])
    centre = best.copy()
    spread = np.concatenate([spectrum.spreads(assumed.ship), np.full(traces, NOISE_SPREAD)])
    here = grown(path, problem.pendulums, assumed.ship)
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
    for _ in range(ROUNDS):
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


def shifted(constants: tuple[Constant, ...], path: Floats, begin: int) -> tuple[Constant, ...]:
    """Constants whose start is the path's at a later node."""
    return tuple(replace(c, value=float(path[begin, c.index])) if c.kind == kernels.START else c for c in constants)
