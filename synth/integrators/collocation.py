"""Exponential collocation for clocks on a beam, a frame or a board: smooth, coupled, not stiff.

Every component is a linear oscillator, carried exactly, plus a remainder that is collocated at 16 Gauss nodes of
intervals of up to half a swing (Picard iteration, `collocation_march`). The motion is run twice, the second time with
looser limits and shorter intervals; the difference is the estimate.

Of an ensemble, members share weights and lengths of intervals, and threads share members. A member's own arithmetic
already fills vector registers (the nodes of an interval are its lanes). What members share is the rest: the linear part
that is carried is rounded to ten bits, so that few weights serve all, and what was rounded off returns exactly through
the remainder; lengths of intervals are tried out once, on the first member. So a member's last bits depend on the first
member, but on no other and not on the number of threads.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.collocation_remainders import linear_part
from synth.integrators.collocation_run import COARSEST, COMPANION, FINEST, Problem, Run, chosen, run
from synth.integrators.trajectory import Trajectory, checked, difference, spread
from synth.kernels.collocation import NODES
from synth.phase import Floats
from synth.systems.metronomes import Metronomes
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.terms import apart
from synth.systems.yielding import ElasticBeam, FlexibleFrame

SYSTEMS = (ElasticBeam, ReducedBeam, FlexibleFrame, Metronomes)
"""Types of systems that can be collocated."""

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
_BITS = 10  # of the linear part that the members of an ensemble carry


def integrate(system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10) -> Trajectory:
    """Integrate clocks on a yielding support and return their states at `times`; see `trajectory`.

    The system is one of `SYSTEMS`; terms may be `Viscous` and `VanDerPolDrive`. Steps are intervals; evaluations are
    accelerations at single nodes. Refused is what cannot be collocated, or is too violent or too stiff.

    Examples
    --------
    >>> frame = FlexibleFrame(2.0, np.full(2, 0.2), np.array([0.25, 0.24]), 150.0, 0.0, 9.81)
    >>> swing = integrate(frame, [0.0, 0.0, 0.1, 0.0, -0.1, 0.0], [0.0, 1.0], tolerance=1e-12)
    >>> swing.states.shape, swing.estimated_error < 1e-12
    ((2, 6), True)
    """
    first, instants = checked(start, times, tolerance)
    every = instants
    if 1 < instants.size < _CHECKS:
        every = np.union1d(instants, np.linspace(instants[0], instants[-1], _CHECKS)[:-1])
    some = np.unique((spread(_MOST_CHECKS) * every.size).astype(np.int64)) if every.size > _MOST_CHECKS else slice(None)
    _check_collocates(system)
    problem = Problem.of(system)
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
    asked = min(tolerance, _LOOSEST)
    return (
        asked
        * min(1.0, asked / _TIGHT) ** _TIGHTER
        / (1.0 + float(times[-1] - times[0]) / (2.0 * half_swing * _SWINGS))
    )


def _limits_for(local: float) -> tuple[float, float]:
    """What iteration may leave of an interval, and what the nodes may miss of it."""
    return min(max(0.1 * local, FINEST[0]), COARSEST[0]), min(max(10.0 * local, FINEST[1]), COARSEST[1])


def _check_collocates(system: Any) -> None:
    """Refuse systems and terms that are not made for it."""
    if not isinstance(system, SYSTEMS):
        raise RefusedError(f"collocation knows no {type(system).__name__}; use the propagator explicit")
    for each in apart(getattr(system, "terms", None)):
        if not isinstance(each, Viscous | VanDerPolDrive):
            raise RefusedError(
                f"collocation wants smooth forces and {type(each).__name__} is none; use the propagator explicit"
            )


def integrate_ensemble(
    systems: Sequence[Any], starts: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-9, workers: int | None = None
) -> Floats:
    """Integrate many members to the same times; their states, (members, k, n).

    Parameters
    ----------
    systems : sequence of NamedTuples
        One a member, all of one type; as for `integrate`.
    starts : (members, n) array
        States at the first of `times`.
    times : (k,) array
        Increasing, s.
    tolerance : float
        Error wanted, relative to the size of each component. It is not estimated here: integrate a member alone.
    workers : int, optional
        Threads; by default one a processor.

    Raises
    ------
    RefusedError
        As `integrate`; the first member that is refused stops all.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> from synth.systems.metronomes import Metronomes
    >>> pairs = [Metronomes(np.array([6.0, 6.1]), 0.01), Metronomes(np.array([6.0, 6.2]), 0.02)]
    >>> integrate_ensemble(pairs, [[0.1, 0.0, 0.0, 0.0]] * 2, [0.0, 0.5, 1.0]).shape
    (2, 3, 4)
    """
    states = np.array(starts, dtype=np.float64)
    if states.ndim != 2 or not len(states):
        raise UsageError("starts must be one row a member, (members, n)")
    first, instants = checked(states[0], times, tolerance)
    if len(systems) != len(states) or not np.isfinite(states).all():
        raise UsageError(f"{len(systems)} systems and {len(states)} starts: give one finite start a member")
    _check_collocates(systems[0])
    carried = [_rounded(system) for system in systems]
    longest = Problem.of(systems[0], carried[0]).longest
    limits = _limits_for(_local_tolerance(tolerance, instants, longest))
    depth = chosen(Run.begin(Problem.of(systems[0], carried[0], longest), first, float(instants[0]), limits))
    result = np.empty((len(states), instants.size, first.size))

    def member(index: int) -> None:
        problem = Problem.of(systems[index], carried[index], longest)
        run(problem, states[index], instants, limits, depth=depth, out=result[index])

    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with ThreadPoolExecutor(workers or processors) as pool:
        for done in [pool.submit(member, index) for index in range(len(states))]:
            done.result()
    return result


def _rounded(system: Any) -> tuple[Floats, Floats]:
    """The linear part with few bits."""
    parts = np.array([[float(each) for each in pair] for pair in linear_part(system)])
    mantissa, exponent = np.frexp(parts)
    rounded = np.ldexp(np.round(np.ldexp(mantissa, _BITS)), exponent - _BITS)
    return rounded[:, 0].copy(), rounded[:, 1].copy()
