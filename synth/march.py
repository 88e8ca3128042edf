"""Evaluating a plan: angles, free harmonics and acceleration at every reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock


@dataclass(frozen=True)
class Course:
    """What happened.

    Attributes
    ----------
    theta : (pendulums, readings) float64
        Angles, rad.
    free : (pendulums, readings) complex128
        Free harmonics Z, near-resonant beats included, rad.
    horizontal_acceleration : (readings,) float64
        m/s^2
    """

    theta: Floats
    free: Phasors
    horizontal_acceleration: Floats


def march(plan: Plan, clock: Clock) -> Course:
    """Evaluate the closed form at the clock's moments."""
    w = plan.motion.angular_frequency
    times = plan.times
    return Course(
        times.elongation(plan.responses, w)[:, clock.kept],
        np.array([times.free_harmonic(response, w)[clock.kept] for response in plan.responses]),
        times.series(w, plan.motion.acceleration[None, :])[0, clock.kept],
    )
