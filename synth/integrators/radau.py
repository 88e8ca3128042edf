"""Radau IIA of variable order (5, 9, 13) for stiff systems of a few unknowns, with an honest error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.radau_march import (
    DONE,
    ENDLESS,
    EVALUATIONS,
    LOOSE,
    REJECTED,
    STEPS,
    STUCK,
    UNDEFINED,
    march,
    room,
)
from synth.integrators.trajectory import Trajectory, relative_error
from synth.phase import Floats, Integers

_TIGHTEST, _LOOSEST = 1e-15, 1e-2
_USUAL = 1e-6  # looser saves next to nothing and errs erratically
_COMPANION, _COARSEST = 10.0, 1e-5  # tolerance of the second integration over that of the first, and at most
_MARGIN = 2.0  # two errors may partly cancel in their difference
_ROUNDED = 2.0**-52

_REASONS = {
    STUCK: "the step fell below 1e-14 of the span: Newton's iteration or the error test fails however short it is "
    "(a jump, or a solution that grows without bound)",
    UNDEFINED: "the derivative is not finite there",
    ENDLESS: "more than 1e8 steps: ask for a shorter span or a looser tolerance",
}


def integrate(
    system: Any,
    start: ArrayLike,
    times: ArrayLike,
    *,
    tolerance: float = 1e-10,
    stages: tuple[int, int] | None = None,
) -> Trajectory:
    """States of a stiff system at `times`.

    The integration is done twice, the second time at a tolerance ten times looser; twice the difference is the
    estimate. It measures the looser one, and so errs on the side of caution. Tolerances above 1e-6 are integrated as
    1e-6: looser ones save next to nothing.

    Parameters
    ----------
    system : NamedTuple
        Of a type registered with a derivative and a Jacobian; see `synth.systems.dispatch`.
    start : (n,) array
        State at the first of `times`; n up to about 12.
    times : (k,) increasing array
        Instants to read at, s. They do not shorten steps.
    tolerance : float
        Error wanted, relative to the largest size of each component, from 1e-15 to 1e-2.
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
    state = np.array(start, dtype=np.float64)
    instants = np.array(times, dtype=np.float64)
    _check(state, instants, tolerance)
    sharper = min(_USUAL, tolerance)
    looser = min(_COARSEST, _COMPANION * sharper)
    states, largest, counts = _march(system, state, instants, sharper, stages)
    other, _, more = _march(system, state, instants, looser, stages)
    return Trajectory(
        times=instants,
        states=states,
        estimated_error=max(_MARGIN * relative_error(states - other, largest), _ROUNDED),
        steps=int(counts[STEPS]),
        evaluations=int(counts[EVALUATIONS] + more[EVALUATIONS]),
        rejected=int(counts[REJECTED]),
    )


def _check(start: Floats, times: Floats, tolerance: float) -> None:
    if start.ndim != 1 or start.size == 0 or not math.isfinite(start @ start):
        raise UsageError("start: give one finite number for each component of the state")
    if times.ndim != 1 or times.size == 0:
        raise UsageError("times: give one row of instants, the first that of the start")
    if not math.isfinite(times[-1] - times[0]) or not (times[1:] > times[:-1]).all():
        raise UsageError("times: give finite, increasing instants, the first that of the start")
    if not _TIGHTEST <= tolerance <= _LOOSEST:
        raise UsageError(f"tolerance: {tolerance} is outside {_TIGHTEST} to {_LOOSEST}")


def _march(
    system: Any, start: Floats, times: Floats, tolerance: float, stages: tuple[int, int] | None
) -> tuple[Floats, Floats, Integers]:
    orders = stages or (3, 5 if tolerance > LOOSE else 7)
    out = np.empty((times.size, start.size))
    largest = np.empty(start.size)
    counts = np.zeros(3, dtype=np.int64)
    stop = np.zeros(1)
    n = start.size
    space, places = np.empty(room(n)), np.empty(14 * n, dtype=np.int64)
    outcome = march(start, times, tolerance, orders, (0,) * n, system, space, places, out, largest, counts, stop)
    if outcome != DONE:
        raise RefusedError(f"radau: stopped at t = {stop[0]:.6g} s after {counts[STEPS]} steps: {_REASONS[outcome]}")
    return out, largest, counts
