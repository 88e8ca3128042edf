"""Calling a general integrator for a scene, and the next one where it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene_simulation import Propagator
from synth.assembly import Assembly
from synth.integrators.trajectory import Trajectory
from synth.phase import Floats

_MODULES: dict[Propagator, str] = {
    "beam-collocation": "synth.integrators.collocation",
    "explicit": "synth.integrators.explicit",
    "radau": "synth.integrators.radau",
    "splitting": "synth.integrators.splitting",
}
_TIGHTEST = 1e-15
_REPEATS = 2
_AIM = 0.3  # of the tolerance, when an integrator is asked again


def integrated(
    assembly: Assembly, propagators: Sequence[Propagator], seconds: Floats, tolerance: float | None, aim: float
) -> tuple[Floats, float, Propagator]:
    """Integrate by the first of the propagators that does not refuse.

    Parameters
    ----------
    assembly
        What moves.
    propagators
        In the order to be tried.
    seconds : (k,)
        True time of the moments, increasing, none before t = 0.
    tolerance : float or None
        Error wanted, relative: a propagator whose error is estimated to be larger is asked again for less.
    aim : float
        What to ask for where no error is named.

    Returns
    -------
    rows : (pendulums or pendulums + 1, k) float64
        As `Assembly.rows` gives them.
    estimated_error : float
        Of the worst component, relative to its largest size.
    propagator : str
        Who did it.

    Raises
    ------
    RefusedError
        If all refuse; the message holds every reason.
    """
    times = seconds * assembly.time_scale
    begins = times[0] == 0.0
    reasons = []
    for name in propagators:
        try:
            found = _run(name, assembly, times if begins else np.concatenate([[0.0], times]), tolerance, aim)
        except RefusedError as refusal:
            reasons.append(str(refusal))
            continue
        return assembly.rows(found.states[0 if begins else 1 :]), found.estimated_error, name
    raise RefusedError("; ".join(reasons))


def _run(name: Propagator, assembly: Assembly, times: Floats, tolerance: float | None, aim: float) -> Trajectory:
    asked = aim if tolerance is None else tolerance
    best = _once(name, assembly, times, asked)
    for repeat in range(_REPEATS):
        if tolerance is None or best.estimated_error <= tolerance or asked <= _TIGHTEST:
            break
        asked = max(_TIGHTEST, asked * _AIM * tolerance / best.estimated_error)
        asked = min(asked, aim) if repeat == _REPEATS - 1 else asked
        try:
            found = _once(name, assembly, times, asked)
        except RefusedError:  # what there is holds, with the error that is estimated for it
            break
        if found.estimated_error < best.estimated_error:
            best = found
    return best


def _once(name: Propagator, assembly: Assembly, times: Floats, tolerance: float) -> Trajectory:
    if assembly.kicks is not None:
        from synth.integrators.events import integrate_with_events

        return integrate_with_events(assembly.system, assembly.start, times, assembly.kicks, tolerance=tolerance)[0]
    integrate = import_module(_MODULES[name]).integrate  # one, and no other
    found: Trajectory = integrate(assembly.system, assembly.start, times, tolerance=tolerance)
    return found
