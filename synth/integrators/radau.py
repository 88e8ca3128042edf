"""Radau IIA of variable order (5, 9, 13) for stiff systems of a few unknowns, with an honest error."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.radau_pair import COMPANION, NEAR, Pair, Problem, swing_of_bobs
from synth.integrators.trajectory import Trajectory
from synth.phase import Floats

_TIGHTEST, _LOOSEST = 1e-15, 1e-2
_LOOSE = 1e-7  # of a march: looser saves next to nothing and errs erratically
_USUAL = 30.0  # tolerance over that of a march which meets it in tens of swings, the looser one of its pair included
_FINEST = 1e-18  # tolerance of a march: its steps then err by less than they are rounded
_AGAIN = 2  # times, where the tolerance was missed
_AIM = 0.3  # of the tolerance, then
_FAR = 300.0  # times short of the tolerance from which a march next to the last is no use


def integrate(
    system: Any,
    start: ArrayLike,
    times: ArrayLike,
    *,
    tolerance: float = 1e-10,
    stages: tuple[int, int] | None = None,
) -> Trajectory:
    """States of a stiff system at `times`.

    Two marches, one at a tolerance ten times looser, are compared. The estimate is half of their difference, which is
    the error of the looser one, and as many roundings as the root of the number of steps. Steps are held to a tolerance
    one by one: where the estimate shows that errors have added up to more than was asked for, tighter marches
    follow, twice at most. What is left then, of rounding above all, the estimate tells.

    Parameters
    ----------
    system : NamedTuple
        Of a type registered with a derivative and a Jacobian; see `synth.systems.dispatch`.
    start : (n,) array
        State at the first of `times`; n up to about 12.
    times : (k,) increasing array
        Instants to read at, s. They do not shorten steps.
    tolerance : float
        Error wanted anywhere, relative to the largest size of each component, from 1e-15 to 1e-2. That of a yielding
        support may be the share of the swing of the bobs (`swing_of_bobs`); the estimate is relative to its own.
    stages : tuple, optional
        Fewest and most stages (3, 5 or 7); by default chosen from 3 up to what the tolerance is worth.

    Returns
    -------
    Trajectory

    Raises
    ------
    UsageError
        Arguments that cannot be meant.
    RefusedError
        The integration came to a stop; the message says when and why.

    Notes
    -----
    Hairer and Wanner (1999), J. Comput. Appl. Math. 111, 93-111. Jumps of the derivative are integrated over at the
    cost of short steps, not located.

    Examples
    --------
    >>> from synth.systems.van_der_pol import VanDerPol
    >>> fast = integrate(VanDerPol(1000.0), [2.0, 0.0], [0.0, 1.0], tolerance=1e-9)
    >>> round(float(fast.states[1, 0]), 9)
    1.999333371
    """
    state, instants = np.array(start, dtype=np.float64), np.array(times, dtype=np.float64)
    made = refined(system, state, instants, tolerance, stages)
    steps, _, rejected = made.pair.fine.counts.tolist()
    return Trajectory(instants, made.pair.fine.states, made.pair.error, steps, made.evaluations, rejected)


class Refined(NamedTuple):
    """The best pair of marches, the tolerance of its readings, and what all cost."""

    problem: Problem
    pair: Pair
    reading: float
    evaluations: int


def refined(
    system: Any, start: Floats, times: Floats, tolerance: float, stages: tuple[int, int] | None = None
) -> Refined:
    """March in pairs until the error is what was asked for, three at most."""
    _check(start, times, tolerance)
    problem = Problem(system, start, times, swing_of_bobs(system, start), stages)
    local = reading = min(_LOOSE, tolerance / _USUAL)
    latest = problem.pair(local, reading)
    best = Refined(problem, latest, reading, 0)
    evaluations = latest.evaluations
    for _ in range(_AGAIN):
        if latest.missed <= tolerance or local <= _FINEST:
            break
        short = latest.missed / (_AIM * tolerance)
        local = max(_FINEST, local / (short if short > _FAR else min(max(short, COMPANION), NEAR)))
        reading = max(local, reading / COMPANION)  # errors inside steps do not add up
        try:
            latest = problem.pair(local, reading, latest.fine)
        except RefusedError:  # steps too short for this: what there is holds, with the error that is estimated for it
            break
        evaluations += latest.evaluations
        if latest.error < best.pair.error:
            best = Refined(problem, latest, reading, 0)
    return best._replace(evaluations=evaluations)


def _check(start: Floats, times: Floats, tolerance: float) -> None:
    if start.ndim != 1 or start.size == 0 or not math.isfinite(start @ start):
        raise UsageError("start: give one finite number for each component of the state")
    if not _TIGHTEST <= tolerance <= _LOOSEST:
        raise UsageError(f"tolerance: {tolerance} is outside {_TIGHTEST} to {_LOOSEST}")
    if times.ndim != 1 or times.size == 0:
        raise UsageError("times: give one row of instants, the first that of the start")
    if not math.isfinite(times[-1] - times[0]) or not (times[1:] > times[:-1]).all():
        raise UsageError("times: give finite, increasing instants, the first that of the start")
