"""How long a step may be: its local error, and the guess for the first one."""

from __future__ import annotations

import math
from typing import Any

from synth.integrators.radau_linear import solve
from synth.integrators.radau_newton import Work
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel
from synth.systems.dispatch import derivative

_E3, _E5, _E7 = THREE.error, FIVE.error, SEVEN.error
_R3, _R5, _R7 = THREE.rates, FIVE.rates, SEVEN.rates
_CAREFUL = 0.1  # share of every time scale at the start that the first step may take


@kernel
def _size(size: Any, values: Any, scale: Any) -> float:
    total = 0.0
    for c in range(len(size)):
        total += (values[c] * scale[c]) * (values[c] * scale[c])
    return math.sqrt(total / len(size))


@kernel
def local_error(
    s: int, time: float, step: float, state: Any, slope: Any, scale: Any, again: float, size: Any, work: Work,
    system: Any,
) -> float:  # fmt: skip
    """Difference from an embedded formula of order s, filtered by (gamma/h - J)^-1.

    Hairer and Wanner (1996), IV.8, (8.19) and (8.20).

    Where it exceeds `again` it is filtered once more, with the slope at the corrected start: the first filter
    overestimates what a stiff component has before it settled.
    """
    n, z, f, point, other = len(size), work.z, work.f, work.point, work.slope
    weights = _E3 if s == 3 else _E5 if s == 5 else _E7
    gain = (_R3 if s == 3 else _R5 if s == 5 else _R7)[0].real / step
    for c in range(n):
        total = 0.0
        for i in range(s):
            total += weights[i] * z[i * n + c]
        f[n + c] = gain * total
        f[c] = slope[c] + f[n + c]
    solve(size, work.stack, work.exchanges, f)
    error = _size(size, f, scale)
    if error > again:
        for c in range(n):
            point[c] = state[c] + f[c]
        derivative(time, point, system, other)
        for c in range(n):
            f[c] = other[c] + f[n + c]
        solve(size, work.stack, work.exchanges, f)
        error = _size(size, f, scale)
    return error


@kernel
def first_step(state: Any, slope: Any, curvature: Any, span: float, size: Any) -> float:
    """A tenth of the shortest time in which state, slope and curvature (J slope) change one another by their size."""
    n = len(size)
    step = 1e-2 * span
    for c in range(n):
        bend = 0.0
        for j in range(n):
            bend += curvature[c * n + j] * slope[j]
        y, f, b = abs(state[c]), abs(slope[c]), abs(bend)
        if f > 0.0 and b > 0.0:
            step = min(step, _CAREFUL * f / b)
        if f > 0.0 and y > 0.0:
            step = min(step, _CAREFUL * y / f)
        if b > 0.0 and y > 0.0:
            step = min(step, _CAREFUL * math.sqrt(y / b))
    return step
