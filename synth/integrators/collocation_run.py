"""One run of exponential collocation: the length of its intervals, chosen on the first swings and changed where needed."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators.collocation_march import ORDERS, ROUGH, Level, Nodes, march
from synth.integrators.collocation_remainders import Work, excess_of, linear_part, mirror_of
from synth.integrators.trajectory import reason
from synth.kernels.collocation import NODES
from synth.kernels.collocation_weights import (
    FINE,
    aligned,
    barycentric,
    continuation,
    gauss_nodes,
    legendre_tail,
    weights,
)
from synth.phase import Floats, Integers

_MOST_LEVELS = 17  # the shortest intervals are 256 times shorter than the longest
_FARTHEST = 10.0  # rad a component may turn in an interval
_PILOT = 12  # intervals on which a length is tried
_OVERHEAD = 1.5  # what an interval costs beyond its turns, in turns
_STRETCH = 512  # intervals between looks at longer ones
_PATIENCE = 8  # stretches after which longer intervals are tried again
_LONGEST_LAG = 32  # intervals; where more make whole half swings, guesses go by the interval before
FINEST = (1e-15, 1e-14)
COARSEST = (1e-7, 1e-5)

Ladder = tuple[Fraction, Fraction]
LADDER: Ladder = (Fraction(1), Fraction(2, 3))
"""Lengths of intervals, in half swings, and all halves of them: few intervals make whole half swings."""
COMPANION: Ladder = (Fraction(4, 5), Fraction(3, 5))
"""Lengths that are never the same, a little shorter."""


@dataclass(frozen=True)
class Problem:
    """A system with the linear part that is carried exactly."""

    system: Any
    square: Floats
    loss: Floats
    """(components,) of the linear part carried, 1/s^2 and 1/s."""
    excess: Floats
    """(components, 2) what these have more than the system's own."""
    mirror: Floats
    """(components,) what half a swing does to the remainder, 1 or -1."""
    longest: float
    """Length of the longest intervals to try, s: half a swing."""

    @classmethod
    def of(cls, system: Any, carried: tuple[Floats, Floats] | None = None, longest: float | None = None) -> Problem:
        """With the system's own linear part, or another near it; intervals of its own, or given."""
        parts = linear_part(system)
        square, loss = carried or (np.array([float(each) for each, _ in parts]), np.array([float(g) for _, g in parts]))
        swings = square[system.first_angle // 2 :]
        half = math.pi / math.sqrt(max(float(np.mean(np.abs(swings))), 1e-300))
        return cls(system, square, loss, excess_of(parts, square, loss), mirror_of(system, len(parts)), longest or half)

    def shallowest(self, ladder: Ladder) -> int:
        """Depth of the longest intervals in which no component turns further than the weights are exact for."""
        fastest = math.sqrt(float(np.abs(self.square).max()))
        lengths = (float(ladder[depth % 2]) / (1 << depth // 2) * self.longest for depth in range(_MOST_LEVELS))
        for depth, length in enumerate(lengths):
            if fastest * length <= _FARTHEST:
                return depth
        name = type(self.system).__name__
        raise RefusedError(
            f"collocation, {name}: stiff, its fastest part turns {fastest:.3g} rad a second; use the propagator radau"
        )

    def level(self, depth: int, ladder: Ladder) -> Level:
        """Intervals so many steps down a ladder; two steps halve them."""
        part = ladder[depth % 2] / (1 << (depth // 2))
        interval, repeats = _exact(self.longest * part.numerator / part.denominator), part.denominator <= _LONGEST_LAG
        mirror = self.mirror if repeats and part.numerator % 2 else np.ones_like(self.mirror)
        packed = _packed(interval, *zip(self.square.tolist(), self.loss.tolist(), strict=True))
        return Level(interval, part.denominator if repeats else 1, mirror, *packed)


class Run:
    """Where a run is: the `time` reached, s, its `work`, a `report` (5,) as for `march`, lengths that failed, the `depth`."""

    def __init__(self, problem: Problem, limits: tuple[float, float], time: float, state: Floats, amplitude: Floats):
        self.problem, self.limits, self.time = problem, limits, time
        self.report: Integers = np.zeros(5, dtype=np.int64)
        self.rejected = self.depth = 0
        components = len(state)
        known, room, (position, rate) = (aligned(np.zeros((2, components, NODES))) for _ in range(3))
        base, memory = aligned(np.zeros((components, 2 * NODES))), np.empty((0, ORDERS, components, NODES))
        self.work = Work(state, amplitude, problem.excess, memory, known, room, base, position, rate)

    @classmethod
    def begin(cls, problem: Problem, start: Floats, time: float, limits: tuple[float, float]) -> Run:
        """Stand at the start."""
        frequency = np.sqrt(np.abs(problem.square))
        state = np.zeros((start.size // 2, 4))
        state[:, 0], state[:, 2] = start[0::2], start[1::2]
        swing = np.divide(state[:, 2], frequency, out=np.zeros_like(frequency), where=frequency > 0.0)
        return cls(problem, limits, time, state, state[:, 0] ** 2 + swing**2)

    def go(self, level: Level, count: int, times: Floats, states: Floats) -> bool:
        """March `count` intervals, or as many as can be done; whether all were."""
        system, memory = self.problem.system, self.work.memory
        if len(memory) != level.lag:
            self.work = self.work._replace(memory=aligned(np.zeros((level.lag, *memory.shape[1:]))))
        ship = getattr(system, "horizontal", None), getattr(system, "vertical", None)
        limits = self.limits[0] ** 2, self.limits[1] ** 2
        done = march(system, *ship, level, _nodes(), self.work, limits, self.time, count, times, states, self.report)
        self.time += done * level.interval
        return bool(done == count)

    def forget(self) -> None:
        """What the remainder was is of no use at another length of intervals."""
        self.work, self.report[4] = self.work._replace(memory=self.work.memory[:0]), 0


def chosen(here: Run, ladder: Ladder = LADDER) -> int:
    """Depth of the intervals that are cheapest on the first swings, counted in turns a second."""
    none = np.empty(0), np.empty((0, 2 * len(here.work.state)))
    cheapest, best = math.inf, _MOST_LEVELS - 1
    for depth in range(here.problem.shallowest(ladder), _MOST_LEVELS):
        level, begun = here.problem.level(depth, ladder), here.work
        trial = Run(here.problem, here.limits, here.time, begun.state.copy(), begun.amplitude.copy())
        if trial.go(level, _PILOT, *none):
            cost = (int(trial.report[1]) / _PILOT + _OVERHEAD) / level.interval
            if cost > cheapest:
                break
            cheapest, best = cost, depth
    return best


def run(
    problem: Problem, start: Floats, times: Floats, limits: tuple[float, float], ladder: Ladder = LADDER,
    depth: int | None = None, out: Floats | None = None,
) -> tuple[Floats, Run]:  # fmt: skip
    """States (k, n) at the increasing times, the first that of the start, and the run that gave them.

    `RefusedError` where no interval is short enough.

    Parameters
    ----------
    limits : (float, float)
        What iteration may leave, and what r beyond its last Legendre term may cost, relative to sizes.
    ladder : Ladder
        Lengths to go through.
    depth : int, optional
        Of the intervals to begin with; by default tried out.
    out : (k, n), optional
        Receives the states.
    """
    states = np.empty((times.size, start.size)) if out is None else out
    here = Run.begin(problem, start, float(times[0]), limits)
    first = chosen(here, ladder) if depth is None else depth
    depth, calm, patience = first, 0, _PATIENCE
    while here.report[0] < times.size:
        here.depth = depth
        level = problem.level(depth, ladder)
        left = math.floor((times[-1] - here.time) / level.interval) + 1
        if here.go(level, min(left, _STRETCH), times, states):
            calm += 1
            if depth > first and calm >= patience:
                depth, calm = depth - 1, 0
                here.forget()
        else:
            patience = 2 * patience if calm == 0 else patience
            depth, calm = depth + 1, 0
            here.rejected += 1
            here.forget()
            if depth == _MOST_LEVELS:
                raise _refused(here, level)
    return states, here


def _refused(here: Run, level: Level) -> RefusedError:
    system = here.problem.system
    rough = "the nodes do not resolve the motion" if here.report[3] == ROUGH else "the iteration does not settle"
    seen = f"{rough} even in intervals of {level.interval:.3g}; use the propagator radau or explicit"
    why = reason(system, here.work.state[:, [0, 2]].ravel(), seen)
    return RefusedError(f"collocation, {type(system).__name__} at t = {here.time:.6g}: {why}")


@functools.cache
def _nodes() -> Nodes:
    points, shares = barycentric()
    continued, tail = aligned(continuation().T.reshape(1, -1)), aligned(legendre_tail()[None, :])
    middle = aligned(points[1:-1]), aligned(shares[1:-1]), (float(shares[0]), float(shares[-1]))
    return Nodes((gauss_nodes() / FINE + 1.0) / 2.0, tail, continued, *middle)


@functools.lru_cache(maxsize=256)
def _packed(interval: float, *parts: tuple[float, float]) -> list[Floats]:
    """Weights of all components, from square and loss of each."""
    return [aligned(np.array(column)) for column in zip(*(weights(*each, interval) for each in parts), strict=True)]


def _exact(interval: float) -> float:
    """The interval with 16 bits, so that its multiples are exact."""
    mantissa, exponent = math.frexp(interval)
    return math.ldexp(round(mantissa * 65536), exponent - 16)
