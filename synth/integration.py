"""Calling a general integrator for a scene, and the next one where it refuses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene_simulation import Propagator
from synth.assembly import Assembly
from synth.phase import Floats
from synth.recording.clock import Clock

_MODULES: dict[Propagator, str] = {
    "beam-collocation": "synth.integrators.collocation",
    "explicit": "synth.integrators.explicit",
    "radau": "synth.integrators.radau",
}
_AT_ONCE = 1 << 18
"""Moments up to which a record is integrated in one piece; longer ones are marched twice and not held."""

Found = tuple[Iterator[Floats], float, Propagator]


def integrated(
    assembly: Assembly, propagators: Sequence[Propagator], parts: Sequence[Clock], tolerance: float
) -> Found:
    """Integrate by the first of the propagators that does not refuse.

    Parameters
    ----------
    assembly
        What moves.
    propagators
        In the order to be tried.
    parts : sequence of Clock
        The moments, portion by portion, in order of time, none before t = 0.
    tolerance : float
        Error wanted, relative.

    Returns
    -------
    rows : iterator of (pendulums or pendulums + 1, k) float64
        As `Assembly.rows` gives them: one piece, or one for each part.
    estimated_error : float
        Of the worst component, relative to its largest size.
    propagator : str
        Who did it.

    Raises
    ------
    RefusedError
        If all refuse; the message holds every reason.
    """
    long = sum(part.count for part in parts) > _AT_ONCE
    reasons = []
    for name in propagators:
        try:
            if long and name in _MODULES:
                return _streamed(name, assembly, parts, tolerance)
            return _whole(name, assembly, parts, tolerance)
        except RefusedError as refusal:
            reasons.append(str(refusal))
    raise RefusedError("; ".join(reasons))


def _whole(name: Propagator, assembly: Assembly, parts: Sequence[Clock], tolerance: float) -> Found:
    times = np.concatenate([part.true_seconds for part in parts]) * assembly.time_scale
    begins = times[0] == 0.0
    instants = times if begins else np.concatenate([[0.0], times])
    integrate = import_module(_MODULES[name]).integrate  # one, and no other
    found = integrate(assembly.system, assembly.start, instants, tolerance=tolerance, **_event(assembly))
    return iter([assembly.rows(found.states[0 if begins else 1 :])]), found.estimated_error, name


def _streamed(name: Propagator, assembly: Assembly, parts: Sequence[Clock], tolerance: float) -> Found:
    chunks = (part.true_seconds * assembly.time_scale for part in parts)
    span = (0.0, parts[-1].true_end * assembly.time_scale)
    stream = import_module(_MODULES[name]).stream
    found = stream(assembly.system, assembly.start, chunks, span, tolerance=tolerance, **_event(assembly))
    return (assembly.rows(states) for states in found), found.estimated_error, name


def _event(assembly: Assembly) -> dict[str, Any]:
    """The kicks, which the explicit integrator alone knows."""
    return {} if assembly.kicks is None else {"event": assembly.kicks}
