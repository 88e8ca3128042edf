"""Two real pendulums in a seaway, integrated by scipy's DOP853: shares no code with the inversion or the simulator."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from pipeline.observation import Observation

G = 9.805
REFERENCE = 9.81
PERIODS = (1.00985, 1.00995)
DAMPING = (2e-4, 1.6e-4)
SWELL = ((0.35, 0.65, 0.3), (0.2, 0.9, 1.1), (0.1, 0.42, 2.0))  # m/s^2, rad/s, rad
HEAVE = ((0.25, 0.7, 0.9), (0.1, 0.5, 0.1))
START = (0.02, 0.1, 0.012, -0.05)  # theta1, theta1', theta2, theta2'


def acceleration(terms: tuple[tuple[float, float, float], ...], time: np.ndarray | float) -> Any:
    return sum(size * np.cos(rate * np.asarray(time) + phase) for size, rate, phase in terms)


@functools.cache
def angles(length: float, step: float, heave: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and both angles, (n,), right to 1e-11."""
    time = np.arange(round(length / step)) * step
    square = (2 * np.pi / np.array(PERIODS)) ** 2 * G / REFERENCE
    decay = 2.0 * np.array(DAMPING)

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        u = acceleration(SWELL, t) / G
        zeta = acceleration(HEAVE, t) / G if heave else 0.0
        angle, rate = y[::2], y[1::2]
        bent = -square * ((1.0 + zeta) * np.sin(angle) + u * np.cos(angle)) - decay * rate
        return np.array([rate[0], bent[0], rate[1], bent[1]])

    found = solve_ivp(slope, (0.0, time[-1]), START, "DOP853", time, rtol=3e-13, atol=1e-15)
    return time, found.y[0], found.y[2]


def observe(length: float, step: float, *, heave: bool, recorded: bool = True, **changes: Any) -> Observation:
    """The pair as an `Observation`; `heave` moves the support up and down, `recorded` says so."""
    time, one, two = angles(length, step, heave)
    given: dict[str, Any] = {
        "first": "1",
        "second": "2",
        "start": 0.0,
        "time": time,
        "step": step,
        "theta": one.copy(),
        "difference": one - two,
        "sigma_theta": None,
        "sigma_difference": None,
        "frequency_reference": 2 * np.pi / np.array(PERIODS),
        "damping_rate": np.array(DAMPING),
        "reference_gravity": REFERENCE,
        "period_relative_uncertainty": np.zeros(2),
        "chronometer_rate": 0.0,
        "restoring": "sine",
        "vertical": acceleration(HEAVE, time) if heave and recorded else None,
    }
    return Observation(**(given | changes))
