"""Exponential collocation for clocks on a beam, a frame or a board: smooth, coupled, not stiff.

Every component is a linear oscillator, carried exactly, plus a remainder that is collocated at 16 Gauss nodes of
intervals of up to half a swing (Picard iteration, `collocation_march`). The motion is run twice, the second time with
looser limits and shorter intervals; the difference is the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError
from synth.integrators.collocation_run import COARSEST, COMPANION, FINEST, Problem, Run, run
from synth.integrators.explicit import checked, with_checks
from synth.integrators.trajectory import Stream, Trajectory, onward, rehearsal, relative_error
from synth.kernels.collocation_remainder import NODES
from synth.phase import Floats
from synth.systems.metronomes import Metronomes
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.terms import Both
from synth.systems.yielding import ElasticBeam, FlexibleFrame

SYSTEMS = (ElasticBeam, ReducedBeam, FlexibleFrame, Metronomes)
"""Types of systems that can be collocated."""

_LOOSER = 3.0
_LOOSEST = 1e-9  # looser tolerances are integrated as this one: they save next to nothing
_TIGHTER = 0.25  # power by which tight tolerances ask for more: what a swing errs, the next one repeats
_SHARE = 0.5  # of the difference: the companion errs more than the result
_ALIKE = 1e-13  # limits from which both err by rounding alone
_SWINGS = 3000.0  # records longer than this many swings ask more of each interval
_NEGLIGIBLE = 1e-14  # a component smaller than this share of the largest is rounding noise
_ROUNDED = 2.2e-16


def integrate(system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10) -> Trajectory:
    """Integrate clocks on a yielding support and return their states at `times`.

    Parameters
    ----------
    system : NamedTuple
        One of `SYSTEMS`; terms may be `Viscous` and `VanDerPolDrive`.
    start : (n,) array
        State at the first of `times`.
    times : (k,) array
        Increasing, s. They do not change the intervals.
    tolerance : float
        Error wanted at the end, relative to the size of each component.

    Returns
    -------
    Trajectory
        Steps are intervals; evaluations are accelerations at single nodes.

    Raises
    ------
    RefusedError
        A system that cannot be collocated, or a motion that is too violent or too stiff.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> frame = FlexibleFrame(2.0, np.full(2, 0.2), np.array([0.25, 0.24]), 150.0, 0.0, 9.81)
    >>> swing = integrate(frame, [0.0, 0.0, 0.1, 0.0, -0.1, 0.0], [0.0, 1.0], tolerance=1e-12)
    >>> swing.states.shape, swing.estimated_error < 1e-12
    ((2, 6), True)
    """
    first, instants = checked(start, times, tolerance)
    every = with_checks(instants)
    made = refined(system, first, every, tolerance)
    found = made.states if every.size == instants.size else made.states[np.searchsorted(every, instants)]
    return Trajectory(instants, found, made.error, made.steps, made.evaluations, made.rejected)


def stream(
    system: Any, start: ArrayLike, chunks: Iterable[Floats], span: tuple[float, float], *, tolerance: float = 1e-10
) -> Stream:
    """As `integrate`, for times that come in chunks.

    The limits and the error are found by marches that keep few states; the motion is then marched once more, from the
    end of one chunk to that of the next.

    Parameters
    ----------
    system, start, tolerance
        As there.
    chunks : iterable of (k,) arrays
        Increasing times, over all chunks.
    span : (float, float)
        Time of the start, and a time that no chunk goes beyond.

    Examples
    --------
    >>> frame = FlexibleFrame(2.0, np.full(2, 0.2), np.array([0.25, 0.24]), 150.0, 0.0, 9.81)
    >>> pieces = stream(frame, [0, 0, 0.1, 0, -0.1, 0], [np.array([0.0, 0.5]), np.array([1.0])], (0.0, 1.0))
    >>> [piece.states.shape for piece in pieces]
    [(2, 6), (1, 6)]
    """
    first, instants = rehearsal(start, span)
    made = refined(system, first, instants, tolerance)

    def march(state: Floats, times: Floats) -> Floats:
        return run(made.problem, state, times, made.run.limits, depth=made.run.depth)[0]

    return Stream(onward(march, first, span[0], chunks), made.error, made.steps, made.evaluations, made.rejected)


class Refined(NamedTuple):
    """The best run of several, how good it is, and what all cost."""

    problem: Problem
    run: Run
    states: Floats
    error: float
    steps: int
    evaluations: int
    rejected: int


def refined(system: Any, start: Floats, times: Floats, tolerance: float) -> Refined:
    """Run twice, and where the error is larger than was asked for, with tighter limits once more."""
    check_collocates(system)
    problem = Problem.of(system)
    local = local_tolerance(tolerance, times, problem.longest)
    states, result = run(problem, start, times, limits_for(local))
    error = math.inf
    counts = np.zeros(3, dtype=np.int64)
    for _ in range(2):
        rough, companion = run(problem, start, times, limits_for(_LOOSER * local), COMPANION, result.depth)
        for each in (result, companion):
            counts += [each.report[2], NODES * each.report[1], each.rejected]
        share = _SHARE if local > _ALIKE else 1.0
        error = share * difference(states, rough) + _ROUNDED * (2.0 + 0.2 * math.sqrt(result.report[2]))
        if error <= tolerance or local <= FINEST[0]:
            break
        local = max(FINEST[0], local * min(0.1, 0.3 * tolerance / error))
        states, result = run(problem, start, times, limits_for(local))
    return Refined(problem, result, states, error, *counts.tolist())


def difference(states: Floats, others: Floats) -> float:
    """Largest difference of two runs, relative to the size of each component."""
    largest = np.abs(states).max(axis=0)
    size = np.where(largest > _NEGLIGIBLE * np.max(largest), largest, 0.0)
    return relative_error(others - states, size)


def local_tolerance(tolerance: float, times: Floats, half_swing: float) -> float:
    """What to ask of an interval, so that a record of this length is as good as wanted."""
    asked = min(tolerance, _LOOSEST)
    return asked * (asked / _LOOSEST) ** _TIGHTER / (1.0 + float(times[-1] - times[0]) / (2.0 * half_swing * _SWINGS))


def limits_for(local: float) -> tuple[float, float]:
    """What iteration may leave of an interval, and what the nodes may miss of it."""
    return min(max(0.1 * local, FINEST[0]), COARSEST[0]), min(max(10.0 * local, FINEST[1]), COARSEST[1])


def check_collocates(system: Any) -> None:
    """Refuse systems and terms that are not made for it."""
    if not isinstance(system, SYSTEMS):
        raise RefusedError(f"collocation knows no {type(system).__name__}; use the propagator explicit")
    for each in _single(getattr(system, "terms", None)):
        if not isinstance(each, Viscous | VanDerPolDrive):
            raise RefusedError(
                f"collocation wants smooth forces and {type(each).__name__} is none; use the propagator explicit"
            )


def _single(term: Any) -> list[Any]:
    if isinstance(term, Both):
        return _single(term.first) + _single(term.second)
    return [] if term is None else [term]
