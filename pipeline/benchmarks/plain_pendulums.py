"""Driven pendulums as a user of a general integrator would write them: a loop over harmonics with Numba's cosine."""

from __future__ import annotations

import math
from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered


class Swell(NamedTuple):
    """Acceleration of a support, `sum a cos(w t + phase)`."""

    amplitude: Floats
    """m/s^2."""
    rate: Floats
    """rad/s."""
    phase: Floats
    """rad."""


class PlainPendulums(NamedTuple):
    """Parameters; state (theta_1, theta_1', theta_2, theta_2', ...)."""

    frequency: Floats
    """rad/s."""
    damping_rate: Floats
    """1/s."""
    gravity: float
    """m/s^2."""
    horizontal: Swell
    """x''."""
    vertical: Swell
    """z''."""
    sine: bool
    """The full law, or its limit of small angles."""


@kernel
def _level(time: float, motion: Swell) -> float:
    total = 0.0
    for k in range(motion.rate.size):
        total += motion.amplitude[k] * math.cos(motion.rate[k] * time + motion.phase[k])
    return total


@registered("derivative", PlainPendulums)
@kernel
def _derivative(time: float, state: Floats, system: PlainPendulums, out: Floats) -> None:
    across = _level(time, system.horizontal) / system.gravity
    along = 1.0 + _level(time, system.vertical) / system.gravity
    for i in range(system.frequency.size):
        angle, speed = state[2 * i], state[2 * i + 1]
        back = along * math.sin(angle) + across * math.cos(angle) if system.sine else along * angle + across
        out[2 * i] = speed
        out[2 * i + 1] = -2.0 * system.damping_rate[i] * speed - system.frequency[i] * system.frequency[i] * back
