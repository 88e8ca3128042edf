"""Calling a general integrator for a scene, and the next one where it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene_simulation import Propagator
from synth.assembly import Assembly
from synth.phase import Floats

_MODULES: dict[Propagator, str] = {
    "beam-collocation": "synth.integrators.collocation",
    "explicit": "synth.integrators.explicit",
    "radau": "synth.integrators.radau",
}


def integrated(
    assembly: Assembly, propagators: Sequence[Propagator], seconds: Floats, tolerance: float
) -> tuple[Floats, float, Propagator]:
    """Integrate by the first of the propagators that does not refuse.

    `RefusedError` if all refuse; the message holds every reason.

    Parameters
    ----------
    assembly
        What moves.
    propagators
        In the order to be tried.
    seconds : (k,)
        The moments, increasing, none before t = 0, s.
    tolerance : float
        Error wanted, relative.

    Returns
    -------
    rows : (pendulums or pendulums + 1, k) float64
        As `Assembly.rows` gives them.
    estimated_error : float
        Of the worst component, relative to its largest size.
    propagator : str
        Who did it.
    """
    times = seconds * assembly.time_scale
    begins = int(times[0] > 0.0)  # states are wanted from t = 0 on
    instants = np.concatenate([[0.0], times]) if begins else times
    event: dict[str, Any] = {} if assembly.kicks is None else {"event": assembly.kicks}  # of the explicit one alone
    reasons = []
    for name in propagators:
        integrate = import_module(_MODULES[name]).integrate  # one, and no other
        try:
            found = integrate(assembly.system, assembly.start, instants, tolerance=tolerance, **event)
        except RefusedError as refusal:
            reasons.append(str(refusal))
        else:
            return assembly.rows(found.states[begins:]), found.estimated_error, name
    raise RefusedError("; ".join(reasons))
