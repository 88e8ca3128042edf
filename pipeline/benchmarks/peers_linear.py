"""The same hour by general integrators, each set up as its own manual advises; none is needed to use the package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.linear_hour import GRAVITY, Task
from synth.kernels.compiled import kernel


def heyoka_taylor(given: Task, tolerance: float, *, shared: bool = True) -> Callable[[], Floats]:
    """Adaptive Taylor integration, non-compact mode; compiled here, so that calls time the integration alone.

    Parameters
    ----------
    shared : bool
        Both pendulums are given the same terms of the forcing, which heyoka then evaluates once (twice as fast as
        two sets of terms).

    Raises
    ------
    ImportError
        heyoka is not installed.
    """
    import heyoka as hy

    x1, v1, x2, v2 = hy.make_vars("x1", "v1", "x2", "v2")
    equations: list[Any] = []
    for k, (x, v) in enumerate(((x1, v1), (x2, v2))):
        n, gamma = float(given.frequency[k]), float(given.damping_rate[k])
        turn = 0.0 if shared else 2.0 * np.pi * k  # the same motion, in terms that do not look the same
        drive = hy.sum(
            [
                float(a) / GRAVITY * hy.cos(float(w) * hy.time + float(p + turn))
                for a, w, p in zip(given.amplitude, given.rate, given.phase, strict=True)
            ]
        )
        equations += [(x, v), (v, -2.0 * gamma * v - n * n * (x + drive))]
    start = [given.angle[0], given.speed[0], given.angle[1], given.speed[1]]
    integrator = hy.taylor_adaptive(equations, start, tol=tolerance, compact_mode=False)
    time = given.time

    def call() -> Floats:
        integrator.time = 0.0
        integrator.state[:] = start
        return np.asarray(integrator.propagate_grid(time)[-1])[:, [0, 2]].T

    return call


def scipy_dop853(given: Task, relative: float, absolute: float) -> Callable[[], Floats]:
    """scipy's DOP853 with a compiled right-hand side."""
    from scipy.integrate import solve_ivp

    start = np.array([given.angle[0], given.speed[0], given.angle[1], given.speed[1]])
    constants = (given.frequency, given.damping_rate, given.amplitude / GRAVITY, given.rate, given.phase)
    time = given.time

    def call() -> Floats:
        found = solve_ivp(
            slopes, (0.0, float(time[-1])), start, "DOP853", time, args=constants, rtol=relative, atol=absolute
        )
        return np.asarray(found.y[[0, 2]])

    return call


@kernel
def slopes(
    time: float, state: Floats, frequency: Floats, damping: Floats, amplitude: Floats, rate: Floats, phase: Floats
) -> Floats:
    """Right-hand side for a general integrator."""
    drive = 0.0
    for k in range(rate.size):
        drive += amplitude[k] * np.cos(rate[k] * time + phase[k])
    out = np.empty(4)
    for j in range(2):
        angle, speed = state[2 * j], state[2 * j + 1]
        out[2 * j] = speed
        out[2 * j + 1] = -2.0 * damping[j] * speed - frequency[j] ** 2 * (angle + drive)
    return out
