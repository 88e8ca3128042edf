"""Pendulums on a ship that sways: integrated by DOP853 of SciPy, joined by splines of degree 7.

theta_i'' + 2 gamma theta_i' = -n_i^2 [sin theta_i + u cos theta_i],   u = x''/g
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline, make_interp_spline

from .kinds import Case

Floats = NDArray[np.float64]

REFERENCE = 9.81
"""m/s^2, at which the periods are stated."""
_RATE = 50.0  # Hz: 1e-10 of the swing between the knots of a spline of degree 7
_HARMONICS = 6


@dataclass(frozen=True)
class World:
    """What swings, and where."""

    gravity: float
    """m/s^2."""
    periods: Floats
    """s, (pendulums,), of infinitesimal arc at the reference gravity."""
    damping: float
    """1/s, of every pendulum."""
    angles: BSpline
    """Of time in s: (times, pendulums) rad."""


def swing(case: Case, combinations: Floats, begin: float, end: float, random: np.random.Generator) -> World:
    """Draw gravity, periods, phases and a swell, and integrate from `begin` to `end` in s.

    `combinations` (traces, pendulums) and the amplitudes on the film, which `case` gives, fix the arcs.
    """
    count = combinations.shape[1]
    gravity = random.uniform(9.78, 9.83)
    splits = random.choice([-1, 1], count) * 10.0 ** random.uniform(-4.3, -3.3, count)
    periods = random.uniform(0.97, 1.04) * (1.0 + np.where(np.arange(count) > 0, splits, 0.0))
    natural = 2.0 * np.pi / periods * math.sqrt(gravity / REFERENCE)
    # in opposite phases the amplitudes of a difference add
    arcs = np.linalg.pinv(np.abs(combinations)) @ (
        case.amplitudes_of(len(combinations)) / case.levers_of(len(combinations))
    )
    arcs = np.maximum(arcs, 0.1 * arcs.max()) * random.uniform(0.95, 1.05, count)
    phases = random.uniform(0.0, 2.0 * np.pi) + np.pi * (np.arange(count) % 2) + random.uniform(-0.4, 0.4, count)
    rates = 2.0 * np.pi / random.uniform(7.0, 14.0, _HARMONICS)
    sizes = random.rayleigh(size=_HARMONICS)
    sizes *= case.swell / gravity / math.sqrt(0.5 * float(sizes @ sizes))
    shifts = random.uniform(0.0, 2.0 * np.pi, _HARMONICS)

    def slope(time: float, state: Floats) -> Floats:
        push = float(sizes @ np.cos(rates * time + shifts))
        angle, speed = state[:count], state[count:]
        pull = natural**2 * (np.sin(angle) + push * np.cos(angle))
        return np.concatenate([speed, -2.0 * case.damping * speed - pull])

    rest = -float(sizes @ np.cos(rates * begin + shifts))
    start = np.concatenate([rest + arcs * np.cos(phases), -natural * arcs * np.sin(phases)])
    knots = np.arange(math.floor(begin * _RATE) - 4, math.ceil(end * _RATE) + 5) / _RATE
    solution = solve_ivp(slope, knots[[0, -1]], start, method="DOP853", t_eval=knots, rtol=1e-10, atol=1e-13)
    return World(gravity, periods, case.damping, make_interp_spline(knots, solution.y[:count].T, k=7))
