"""Motions with kicks, and the instants of the kicks; a kick of no energy is a mere watch."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synth.integrators.events import Escapement, escapement
from synth.integrators.explicit import integrate, refine
from synth.integrators.trajectory import Trajectory
from synth.phase import Floats, Integers


class Events(NamedTuple):
    """What happened, in order of time."""

    times: Floats
    watches: Integers


def integrate_with_events(
    system: Any, start: ArrayLike, times: ArrayLike, event: Escapement, *, tolerance: float
) -> tuple[Trajectory, Events]:
    found = integrate(system, start, times, tolerance=tolerance, event=event)
    made = refine(system, event, np.array(start, dtype=float), found.times, tolerance)
    return found, Events(*made.runs[-1].happenings)


def crossings(system: Any, level: float, direction: int = 1) -> Escapement:
    """Of the first pendulum: note when its angle passes a level."""
    return escapement(system, 0, level, 0.0, direction)
