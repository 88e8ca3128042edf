"""One run of exponential collocation: the length of its intervals, chosen on the first swings and changed where needed."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators.collocation_march import ROUGH, march
from synth.integrators.collocation_remainders import excess_of, linear_part, mirror_of
from synth.integrators.collocation_weights import aligned, weights
from synth.kernels.collocation_remainder import NODES
from synth.phase import Floats, Integers
from synth.propagators.picard_nodes import FINE, gauss_nodes, legendre_tail

_SHORTER = math.sqrt(0.5)
_MOST_LEVELS = 17  # the shortest intervals are 256 times shorter than the longest
_PILOT = 12  # intervals on which a length is tried
_OVERHEAD = 1.5  # what an interval costs beyond its turns, in turns
_STRETCH = 512  # intervals between looks at longer ones
_PATIENCE = 8  # stretches after which longer intervals are tried again
NOTHING, CONTINUED, MIRRORED = 0, 1, 2
"""First guesses of the remainder in an interval."""

FINEST = (1e-15, 1e-14)
COARSEST = (1e-9, 1e-7)


@dataclass(frozen=True)
class Problem:
    """A system with the linear part that is carried exactly.

    Attributes
    ----------
    system : NamedTuple
    square, loss : (components,) float64
        Of the linear part carried, 1/s^2 and 1/s.
    excess : (components, 2) float64
        What these have more than the system's own.
    mirror : (components,) float64
    longest : float
        Length of the longest intervals to try, s: half a swing.
    levels : dict
        Lengths used so far.
    """

    system: Any
    square: Floats
    loss: Floats
    excess: Floats
    mirror: Floats
    longest: float
    levels: dict[float, Level] = field(default_factory=dict)

    @classmethod
    def of(cls, system: Any, carried: tuple[Floats, Floats] | None = None, longest: float | None = None) -> Problem:
        """With the system's own linear part, or another near it; intervals of its own, or given."""
        parts = linear_part(system)
        square, loss = carried or (np.array([float(each) for each, _ in parts]), np.array([float(g) for _, g in parts]))
        swings = square[system.first_angle // 2 :]
        half = math.pi / math.sqrt(max(float(np.mean(np.abs(swings))), 1e-300))
        return cls(system, square, loss, excess_of(system, square, loss), mirror_of(system), longest or half)

    def level(self, depth: int, share: float) -> Level:
        """Intervals `depth` steps shorter than `share` of the longest."""
        interval = _exact(self.longest * share * _SHORTER**depth)
        if interval not in self.levels:
            each = zip(self.square.tolist(), self.loss.tolist(), strict=True)
            parts = zip(*(weights(square, loss, interval) for square, loss in each), strict=True)
            flow, inner, guess, end, propagator, reach = (np.array(part) for part in parts)
            packed = tuple(aligned(each) for each in (flow, np.array([inner, guess]), end, propagator, reach))
            self.levels[interval] = Level(interval, packed)
        return self.levels[interval]


@dataclass(frozen=True)
class Level:
    """One length of intervals, s, with its weights."""

    interval: float
    weights: tuple[Floats, ...]


@dataclass
class Run:
    """Where a run is, and what it has done."""

    problem: Problem
    limits: tuple[float, float]
    time: float
    state: Floats
    amplitude: Floats
    report: Integers = field(default_factory=lambda: np.zeros(4, dtype=np.int64))
    rejected: int = 0

    @classmethod
    def begin(cls, problem: Problem, start: Floats, time: float, limits: tuple[float, float]) -> Run:
        """Stand at the start."""
        frequency = np.sqrt(np.abs(problem.square))
        state = np.zeros((start.size // 2, 4))
        state[:, 0], state[:, 2] = start[0::2], start[1::2]
        swing = np.divide(state[:, 2], frequency, out=np.zeros_like(frequency), where=frequency > 0.0)
        return cls(problem, limits, time, state, state[:, 0] ** 2 + swing**2)

    def __post_init__(self) -> None:
        components = len(self.state)
        self._known, self._room, nodes = (aligned(np.zeros((2, components, NODES))) for _ in range(3))
        self._position, self._rate = nodes
        self._base = aligned(np.zeros((components, 2 * NODES)))

    def copy(self) -> Run:
        """Another run from here on."""
        return Run(self.problem, self.limits, self.time, self.state.copy(), self.amplitude.copy(), self.report.copy())

    def go(self, level: Level, ahead: int, count: int, times: Floats, states: Floats) -> bool:
        """March `count` intervals, or as many as can be done; whether all were."""
        system = self.problem.system
        done = march(
            system,
            getattr(system, "horizontal", None),
            getattr(system, "vertical", None),
            self.problem.excess,
            level.weights,
            _plan(),
            self.time,
            level.interval,
            count,
            self.state,
            self._known,
            self._base,
            self._position,
            self._rate,
            self._room,
            self.amplitude,
            ahead == CONTINUED,
            self.problem.mirror if ahead == MIRRORED else np.zeros(len(self.state)),
            (self.limits[0] ** 2, self.limits[1] ** 2),
            times,
            states,
            self.report,
        )
        self.time += done * level.interval
        return bool(done == count)

    def forget(self) -> None:
        """The remainder of the interval before is of no use at another length."""
        self._known[:] = 0.0


class Choice(NamedTuple):
    """Where to begin among the lengths of intervals, and what to guess ahead with."""

    depth: int
    ahead: int


def chosen(here: Run, share: float) -> Choice:
    """Cheapest on the first swings, counted in turns a second."""
    none = np.empty(0), np.empty((0, 2 * len(here.state)))
    cheapest, best = math.inf, Choice(_MOST_LEVELS - 1, CONTINUED)
    for depth in range(_MOST_LEVELS):
        level = here.problem.level(depth, share)
        cost = math.inf
        for ahead in (NOTHING, CONTINUED, MIRRORED):
            trial = here.copy()
            if trial.go(level, ahead, _PILOT, *none):
                turns = int(trial.report[1] - here.report[1])
                cost = min(cost, (turns / _PILOT + _OVERHEAD) / level.interval)
                if cost < cheapest:
                    cheapest, best = cost, Choice(depth, ahead)
        if cost > cheapest:
            break
    return best


def run(
    problem: Problem,
    start: Floats,
    times: Floats,
    limits: tuple[float, float],
    share: float = 1.0,
    choice: Choice | None = None,
    out: Floats | None = None,
) -> tuple[Floats, Run]:
    """States (k, n) at the times, and the run that found them.

    Parameters
    ----------
    problem : Problem
    start : (n,)
    times : (k,)
        Increasing; the first is the time of the start.
    limits : (float, float)
        What iteration may leave, and what r beyond its last Legendre term may cost, relative to sizes.
    share : float
        Intervals are this much shorter than the problem's.
    choice : Choice, optional
        What to begin with; by default tried out.
    out : (k, n), optional
        Receives the states.

    Raises
    ------
    RefusedError
        Where no interval is short enough.
    """
    states = np.empty((times.size, start.size)) if out is None else out
    here = Run.begin(problem, start, float(times[0]), limits)
    first = choice or chosen(here, share)
    depth, calm, patience = first.depth, 0, _PATIENCE
    while here.report[0] < times.size:
        level = problem.level(depth, share)
        left = math.floor((times[-1] - here.time) / level.interval) + 1
        ahead = first.ahead if depth == first.depth else CONTINUED
        if here.go(level, ahead, min(left, _STRETCH), times, states):
            calm += 1
            if depth > first.depth and calm >= patience:
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
    name = type(here.problem.system).__name__
    difficulty = getattr(here.problem.system, "difficulty", None)
    known = difficulty(here.state[:, [0, 2]].ravel()) if difficulty is not None else None
    rough = "the nodes do not resolve the motion" if here.report[3] == ROUGH else "the iteration does not settle"
    why = known or f"{rough} even in intervals of {level.interval:.3g}; use the propagator radau or explicit"
    return RefusedError(f"collocation, {name} at t = {here.time:.6g}: {why}")


@functools.cache
def _plan() -> tuple[Floats, Floats, Floats, Floats]:
    """What every march needs of the nodes; see `march`."""
    nodes = gauss_nodes() / FINE
    points = np.concatenate([[-1.0], nodes, [1.0]])
    apart = points[:, None] - points
    np.fill_diagonal(apart, 1.0)
    shares = 1.0 / np.prod(2.0 * apart, axis=1)
    return (nodes + 1.0) / 2.0, aligned(legendre_tail()[None, :]), points, shares


def _exact(interval: float) -> float:
    """The interval with 16 bits, so that its multiples are exact."""
    mantissa, exponent = math.frexp(interval)
    return math.ldexp(round(mantissa * 65536), exponent - 16)
