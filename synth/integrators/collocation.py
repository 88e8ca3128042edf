"""Exponential collocation for clocks on a beam, a frame or a board: smooth, coupled, not stiff.

Linear oscillators are carried exactly, remainders collocated at 16 Gauss nodes of intervals of up to half a swing. The
motion is run twice, the second time with looser limits and shorter intervals; the difference is the estimate.
"""

import functools
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.collocation_march import ORDERS, ROUGH, Level, Nodes, march
from synth.integrators.collocation_remainders import Work, linear_part, mirror_of
from synth.integrators.trajectory import Trajectory, checked, difference, reason, spread
from synth.kernels import collocation as core
from synth.kernels.collocation import NODES
from synth.phase import Floats, Integers
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.terms import apart
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes

SYSTEMS = (ElasticBeam, ReducedBeam, FlexibleFrame, Metronomes)  # types of systems that can be collocated

_LOOSER = 3.0
_LOOSEST = 1e-6  # looser tolerances are integrated as this one: they save next to nothing
_TIGHT = 1e-9
_TIGHTER = 0.25  # power by which tighter tolerances than this ask for more: what a swing errs, the next one repeats
_SHARE = 0.5  # of the difference: the companion errs more than the result
_ALIKE = 1e-13  # limits from which both err by rounding alone
_SWINGS = 3000.0  # records longer than this many swings ask more of each interval
_ROUNDED = 2.2e-16
_CHECKS = 65  # instants at which runs are compared, at least: an error may pass through zero at a single one,
_MOST_CHECKS = 1000  # and at most
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
COMPANION: Ladder = (Fraction(4, 5), Fraction(3, 5))  # lengths that are never the same, a little shorter


def integrate(system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10) -> Trajectory:
    """States of one of `SYSTEMS`, with `Viscous` and `VanDerPolDrive`, at `times`; see `trajectory`.

    Steps are intervals; evaluations are accelerations at single nodes. Refused: too violent or too stiff.
    """
    first, instants = checked(start, times, tolerance)
    every = instants
    if 1 < instants.size < _CHECKS:
        every = np.union1d(instants, np.linspace(instants[0], instants[-1], _CHECKS)[:-1])
    some = np.unique((spread(_MOST_CHECKS) * every.size).astype(np.int64)) if every.size > _MOST_CHECKS else slice(None)
    _check_collocates(system)
    problem = Problem(system)
    local = _local_tolerance(tolerance, instants, problem.longest)
    states, result = run(problem, first, every, _limits_for(local))
    error, counts = math.inf, np.zeros(3, dtype=np.int64)
    for _ in range(2):
        rough, companion = run(problem, first, every[some], _limits_for(_LOOSER * local), COMPANION, result.depth)
        for each in (result, companion):
            counts += [each.report[2], NODES * each.report[1], each.rejected]
        share = _SHARE if local > _ALIKE else 1.0
        error = share * difference(states[some], rough, np.abs(states).max(axis=0)) + _ROUNDED * (
            2.0 + 0.2 * math.sqrt(result.report[2])
        )
        if error <= tolerance or local <= FINEST[0]:
            break
        local = max(FINEST[0], local * min(0.1, 0.3 * tolerance / error))
        states, result = run(problem, first, every, _limits_for(local))

    asked = states if every is instants else states[np.searchsorted(every, instants)]
    return Trajectory(instants, asked, error, *counts.tolist())


def _local_tolerance(tolerance: float, times: Floats, half_swing: float) -> float:
    """What to ask of an interval, so that a record of this length is as good as wanted."""
    asked, swings = min(tolerance, _LOOSEST), float(times[-1] - times[0]) / (2.0 * half_swing)
    return asked * min(1.0, asked / _TIGHT) ** _TIGHTER / (1.0 + swings / _SWINGS)


def _limits_for(local: float) -> tuple[float, float]:
    """What iteration may leave of an interval, and what the nodes may miss of it."""
    return min(max(0.1 * local, FINEST[0]), COARSEST[0]), min(max(10.0 * local, FINEST[1]), COARSEST[1])


def _check_collocates(system: Any) -> None:
    """Refuse systems and terms that are not made for it."""
    fault = None if isinstance(system, SYSTEMS) else f"knows no {type(system).__name__}"
    for each in apart(getattr(system, "terms", None)):
        if not isinstance(each, Viscous | VanDerPolDrive):
            fault = fault or f"wants smooth forces and {type(each).__name__} is none"
    if fault:
        raise RefusedError(f"collocation {fault}; use the propagator explicit")


def integrate_ensemble(
    systems: Sequence[Any], starts: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-9, workers: int | None = None
) -> Floats:
    """Integrate many members, systems of one type and `starts` (members, n), to the same times: (members, k, n).

    As `integrate`, without an estimate of the error. The first member that is refused stops all.
    """
    states = np.array(starts, dtype=np.float64)
    if states.ndim != 2 or not len(states):
        raise UsageError("starts must be one row a member, (members, n)")
    instants = checked(states[0], times, tolerance)[1]
    if len(systems) != len(states) or not np.isfinite(states).all():
        raise UsageError(f"{len(systems)} systems and {len(states)} starts: give one finite start a member")
    _check_collocates(systems[0])

    def member(system: Any, start: Floats) -> Floats:
        problem = Problem(system)
        return run(problem, start, instants, _limits_for(_local_tolerance(tolerance, instants, problem.longest)))[0]

    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(workers or processors) as pool:
        return np.array(list(pool.map(member, systems, states)))


class Problem:
    """A system with its linear part, which is carried exactly."""

    def __init__(self, system: Any) -> None:
        self.system, self.parts = system, linear_part(system)
        self.square = np.array([float(square) for square, _ in self.parts])  # (components,) 1/s^2
        self.mirror = mirror_of(system, len(self.parts))  # (components,) what half a swing does to the remainder
        swings = self.square[system.first_angle // 2 :]
        # length of the longest intervals to try, s: half a swing
        self.longest = math.pi / math.sqrt(max(float(np.mean(np.abs(swings))), 1e-300))

    def shallowest(self, ladder: Ladder) -> int:
        """Depth of the longest intervals in which no component turns further than the weights are exact for."""
        fastest = math.sqrt(float(np.abs(self.square).max()))
        for depth in range(_MOST_LEVELS):
            if fastest * (float(ladder[depth % 2]) / (1 << depth // 2) * self.longest) <= _FARTHEST:
                return depth
        name = type(self.system).__name__
        raise RefusedError(
            f"collocation, {name}: stiff, its fastest part turns {fastest:.3g} rad a second; use the propagator radau"
        )

    def level(self, depth: int, ladder: Ladder) -> Level:
        """Intervals so many steps down a ladder; two steps halve them."""
        part = ladder[depth % 2] / (1 << (depth // 2))
        mantissa, exponent = math.frexp(self.longest * part.numerator / part.denominator)
        interval = math.ldexp(round(mantissa * 65536), exponent - 16)  # of 16 bits: its multiples are exact
        repeats = part.denominator <= _LONGEST_LAG
        mirror = self.mirror if repeats and part.numerator % 2 else np.ones_like(self.mirror)
        return Level(interval, part.denominator if repeats else 1, mirror, *_packed(interval, *self.parts))


class Run:
    """Where a run is: the `time` reached, s, its `work`, a `report` (5,) as for `march`, lengths that failed, the `depth`."""

    def __init__(self, problem: Problem, start: Floats, time: float, limits: tuple[float, float]) -> None:
        self.problem, self.limits, self.time = problem, limits, time
        self.report: Integers = np.zeros(5, dtype=np.int64)
        self.rejected = self.depth = 0
        state, frequency = np.zeros((start.size // 2, 4)), np.sqrt(np.abs(problem.square))
        state[:, 0], state[:, 2] = start[0::2], start[1::2]
        swing = np.divide(state[:, 2], frequency, out=np.zeros_like(frequency), where=frequency > 0.0)
        components, amplitude = len(state), state[:, 0] ** 2 + swing**2
        known, room, (position, rate) = np.zeros((3, 2, components, NODES))
        base, memory = np.zeros((components, 2 * NODES)), np.empty((0, ORDERS, components, NODES))
        self.work = Work(state, amplitude, memory, known, room, base, position, rate)

    def go(self, level: Level, count: int, times: Floats, states: Floats) -> bool:
        """March `count` intervals, or as many as can be done; whether all were."""
        system, memory = self.problem.system, self.work.memory
        if len(memory) != level.lag:
            self.work = self.work._replace(memory=np.zeros((level.lag, *memory.shape[1:])))
        ship = getattr(system, "horizontal", None), getattr(system, "vertical", None)
        limits = self.limits[0] ** 2, self.limits[1] ** 2
        done = march(system, *ship, level, _nodes(), self.work, limits, self.time, count, times, states, self.report)
        self.time += done * level.interval
        return bool(done == count)

    def forget(self) -> None:
        """What the remainder was is of no use at another length of intervals."""
        self.work, self.report[4] = self.work._replace(memory=self.work.memory[:0]), 0


def chosen(problem: Problem, start: Floats, time: float, limits: tuple[float, float], ladder: Ladder = LADDER) -> int:
    """Depth of the intervals that are cheapest on the first swings, counted in turns a second."""
    none = np.empty(0), np.empty((0, start.size))
    cheapest, best = math.inf, _MOST_LEVELS - 1
    for depth in range(problem.shallowest(ladder), _MOST_LEVELS):
        level, trial = problem.level(depth, ladder), Run(problem, start, time, limits)
        if trial.go(level, _PILOT, *none):
            cost = (int(trial.report[1]) / _PILOT + _OVERHEAD) / level.interval
            if cost > cheapest:
                break
            cheapest, best = cost, depth
    return best


def run(
    problem: Problem, start: Floats, times: Floats, limits: tuple[float, float], ladder: Ladder = LADDER,
    depth: int | None = None,
) -> tuple[Floats, Run]:  # fmt: skip
    """States (k, n) at the increasing times, and the run; `RefusedError` where no interval is short enough.

    `limits`: what iteration may leave, and r beyond its last Legendre term cost, relative; `depth`: first intervals'.
    """
    states = np.empty((times.size, start.size))
    begin = float(times[0])
    here = Run(problem, start, begin, limits)
    first = chosen(problem, start, begin, limits, ladder) if depth is None else depth
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
                rough = here.report[3] == ROUGH
                seen = "the nodes do not resolve the motion" if rough else "the iteration does not settle"
                seen += f" even in intervals of {level.interval:.3g}; use the propagator radau or explicit"
                why = reason(problem.system, here.work.state[:, [0, 2]].ravel(), seen)
                raise RefusedError(f"collocation, {type(problem.system).__name__} at t = {here.time:.6g}: {why}")
    return states, here


@functools.cache
def _nodes() -> Nodes:
    points, shares = core.barycentric()
    inside = points[1:-1], shares[1:-1], (float(shares[0]), float(shares[-1]))
    return Nodes(core.legendre_tail()[None, :], core.continuation().T.reshape(1, -1), *inside)


@functools.lru_cache(maxsize=256)
def _packed(interval: float, *parts: tuple[Fraction, Fraction]) -> list[Floats]:
    """Weights of all components, from square and loss of each."""
    columns = zip(*(core.weights(*each, interval) for each in parts), strict=True)
    return [np.array(column) for column in columns]
