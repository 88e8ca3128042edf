"""How white noise of the first pendulum's trace reaches n2, by the adjoint of the nonlinear identity."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel


@kernel
def adjoint(influence: Floats, slope: Floats, turn: complex, oscillation: float, step: float, out: Floats) -> None:
    """`out[k] = sum_{j > k} G(t_j - t_k) influence[j]`, G the response to a unit impulse; all (n,).

    slope is the part of the stiffness that changes with time, as the recursion has it.
    """
    count = influence.size
    unit = 1.0 / oscillation
    state = 0.0 + 0.0j
    out[count - 1] = 0.0
    for k in range(count - 2, -1, -1):
        state = turn * (state + influence[k + 1] + step * slope[k + 1] * state.imag * unit)
        out[k] = state.imag * unit


def theta_influence(
    influence: Floats,
    slope: Floats,
    theta: Floats,
    curvature: Floats,
    about: Floats,
    stiffness: Floats,
    step: float,
    eigenvalue: complex,
    ratio: float,
    frequency: float,
) -> Floats:
    """d n2 / d theta1 at every sample, s-1.

    Parameters
    ----------
    influence : (n,) array
        d n2 / d (reading of the difference), s-1.
    slope, theta, curvature, about : (n,) arrays
        Time-varying stiffness s-2, first pendulum, n2^2 w, difference, as the inversion has them.
    stiffness : (n,) array
        n2^2 (1 + zeta), s-2.
    """
    back = np.empty(influence.size)
    adjoint(influence, slope, complex(np.exp(eigenvalue * step)), eigenvalue.imag, step, back)
    sine, less, secant = np.sin(about), np.cos(about) - 1.0, 1.0 / np.cos(theta)
    tangent = np.tan(theta)
    direct = (stiffness * secant * tangent + curvature * secant**2) * sine
    through_curvature = (less + tangent * sine) * back
    r = ratio**-2
    bent = np.zeros(back.size)
    bent[1:-1] = (through_curvature[2:] - 2.0 * through_curvature[1:-1] + through_curvature[:-2]) / step**2
    linear = -(1.0 - r) * frequency**2 * back  # back swings at n2: its second derivative is -n2^2 of it
    # what the model gains, the residual loses
    return np.asarray(-step * (linear - direct * back - r * bent))
