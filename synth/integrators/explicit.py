"""The explicit integrator of order 8: for violent, driven and escaping motion that is not stiff."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from synth.integrators.events import Escapement
from synth.integrators.explicit_error import decided, refine
from synth.integrators.explicit_run import Walk
from synth.integrators.trajectory import Onward, Stream, Trajectory, checked, streamed
from synth.phase import Floats


def integrate(
    system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10, event: Escapement | None = None
) -> Trajectory:
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
    event : Escapement, optional
        Kicks to give; the motion restarts after each. Crossings are found on the dense polynomial by a method that
        cannot miss one (`events_roots`), the step is then made anew up to the crossing, and the rest removed along
        the tangent: instants are as good as the states.

    Returns
    -------
    Trajectory

    Raises
    ------
    RefusedError
        Stiff motion, a singularity, numbers that are not finite; a crossing so near to a touch that the tolerance does
        not decide whether the escapement fires.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> swing = integrate(plain(2.0), [0.1, 0.0], [0.0, 1.0], tolerance=1e-12)
    >>> round(float(swing.states[1, 0]), 6)
    -0.041508
    """
    return _solve(system, start, times, tolerance, event)[0]


def stream(
    system: Any,
    start: ArrayLike,
    chunks: Iterable[Floats],
    span: tuple[float, float],
    *,
    tolerance: float = 1e-10,
    event: Escapement | None = None,
) -> Stream:
    """As `integrate`, for times that come in chunks (`trajectory.streamed`); how they are cut changes no bit.

    Examples
    --------
    >>> from synth.systems.driven_pendulums import plain
    >>> pieces = stream(plain(2.0), [0.1, 0.0], [np.array([0.0, 0.5]), np.array([1.0])], (0.0, 1.0))
    >>> [round(float(states[-1, 0]), 6) for states in pieces]
    [0.054091, -0.041508]
    """
    return streamed(_solve(system, start, span, tolerance, event), chunks, span)


def _solve(
    system: Any, start: ArrayLike, times: ArrayLike, tolerance: float, event: Escapement | None
) -> tuple[Trajectory, Callable[[], Onward]]:
    first, instants = checked(start, times, tolerance)
    made = refine(system, event, first, instants, tolerance)
    if event is not None:
        decided(made, event)
    best = made.runs[-1]
    steps, rejected, evaluations = made.costs
    states = best.states[np.searchsorted(best.times, instants)]
    found = Trajectory(instants, states, made.estimated_error, steps, evaluations, rejected)
    return found, lambda: Walk(system, event, first, float(instants[0]), float(instants[-1]), best.tolerance).onward
