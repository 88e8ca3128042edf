"""The explicit integrator of order 8: for violent, driven and escaping motion that is not stiff."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.integrators.explicit_error import Refinement, refine
from synth.integrators.trajectory import Trajectory
from synth.phase import Floats

_CHECKS = 65


def integrate(system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10) -> Trajectory:
    """Integrate a system and return its states at `times`.

    Parameters
    ----------
    system : NamedTuple
        Registered with a derivative (`synth.systems`).
    start : (n,) array
        State at the first of `times`.
    times : (k,) array
        Increasing, s. They do not change the steps.
    tolerance : float
        Error wanted at the end, relative to the size of each component.

    Returns
    -------
    Trajectory

    Raises
    ------
    RefusedError
        Stiff motion, a singularity, numbers that are not finite.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> swing = integrate(plain(2.0), [0.1, 0.0], [0.0, 1.0], tolerance=1e-12)
    >>> round(float(swing.states[1, 0]), 6)
    -0.041508
    """
    first, instants = checked(start, times, tolerance)
    return trajectory(refine(system, None, first, instants, tolerance), instants)


def with_checks(times: Floats) -> Floats:
    """More instants where few are asked for: an error may pass through zero at a single one."""
    if times.size == 1 or times.size >= _CHECKS:
        return times
    return np.union1d(times, np.linspace(times[0], times[-1], _CHECKS)[:-1])


def trajectory(made: Refinement, times: Floats) -> Trajectory:
    """What is returned of the marches made, at the instants asked for."""
    best = made.runs[-1]
    states = best.states[np.searchsorted(best.times, times)]
    return Trajectory(times, states, made.estimated_error, made.cost(0), made.cost(2), made.cost(1))


def checked(start: ArrayLike, times: ArrayLike, tolerance: float) -> tuple[Floats, Floats]:
    """Arguments as arrays, or UsageError."""
    first = np.array(start, dtype=np.float64)
    instants = np.array(times, dtype=np.float64)
    if first.ndim != 1 or first.size == 0 or not np.isfinite(first).all():
        raise UsageError("start must be one row of finite numbers, one for each component of the state")
    if instants.ndim != 1 or instants.size == 0 or not np.isfinite(instants).all() or np.any(np.diff(instants) <= 0.0):
        raise UsageError("times must be finite and increasing, and begin with the time of the start")
    if not 0.0 < tolerance <= 1.0:
        raise UsageError(f"tolerance = {tolerance!r}: give a relative error above 0, such as 1e-10")
    return first, instants
