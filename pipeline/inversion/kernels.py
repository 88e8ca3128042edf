"""Compiled recursions of the nonlinear identity: forward for the model, backward for its adjoint."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from synth.kernels.compiled import kernel


@kernel
def recursion(
    integral: Complexes,
    slope: Floats,
    about: Floats,
    response: Floats,
    turn: complex,
    rate: float,
    past: Complexes,
    state: Complexes,
    before: Floats,
    columns: Floats,
) -> None:
    """Difference and its derivatives by start and n2, (4, n), at adjoining samples; other arrays (n,).

    A complex state c carries `z = Im(c)/rate`, `c <- turn c + integral over the interval + taps of the part that is
    linear in the unknown`, d = response + z. `past` (2,) are the taps now and one step before. `state` and `before`
    (4,) hold c and the linear part one step before of model and derivatives, and are left as the next sample needs
    them. The last row of `columns` comes with the forcing of the derivative by n2.
    """
    now, ago = past
    c0, c1, c2, c3 = state
    p0, p1, p2, p3 = before
    unit = 1.0 / rate
    for k in range(slope.size):
        z0, z1, z2, z3 = c0.imag * unit, c1.imag * unit, c2.imag * unit, c3.imag * unit
        q, d = slope[k], response[k] + z0
        s0, s1, s2, s3 = q * (d - about[k]), q * z1, q * z2, q * z3 + columns[3, k]
        columns[0, k], columns[1, k], columns[2, k], columns[3, k] = d, z1, z2, z3
        c0 = turn * c0 + now * s0 + ago * p0 + integral[k]
        c1 = turn * c1 + now * s1 + ago * p1
        c2 = turn * c2 + now * s2 + ago * p2
        c3 = turn * c3 + now * s3 + ago * p3
        p0, p1, p2, p3 = s0, s1, s2, s3
    state[0], state[1], state[2], state[3] = c0, c1, c2, c3
    before[0], before[1], before[2], before[3] = p0, p1, p2, p3


def past_taps(eigenvalue: complex, step: float) -> Complexes:
    """Weights of `int_0^h exp(lam (h - x)) f(x) dx` from f(0) and f(-h), exact for cos and sin at Im(lam); (2,)."""
    gamma, oscillation = -eigenvalue.real, eigenvalue.imag
    turn = np.exp(1j * oscillation * step)
    # of f = exp(+-i w x); the first without the small difference of large numbers
    ahead = turn * (step if gamma == 0.0 else -np.expm1(-gamma * step) / gamma)
    behind = (np.conj(turn) - np.exp(eigenvalue * step)) / (gamma - 2j * oscillation)
    return np.linalg.solve(np.array([[1.0, np.conj(turn)], [1.0, turn]]), np.array([ahead, behind]))


@kernel
def adjoint(influence: Floats, slope: Floats, turn: complex, rate: float, step: float, state: complex, out: Floats) -> complex:
    """`out[k] = sum_{j > k} G(t_j - t_k) influence[j]`, G the response to a unit impulse; all (n,).

    slope is the part of the stiffness that changes with time, as the recursion has it. The recursion runs backwards:
    `state` is what the samples behind the last have left, zero at a record's end; returned is what is left for those
    before the first.
    """
    unit = 1.0 / rate
    for k in range(influence.size - 1, -1, -1):
        out[k] = state.imag * unit
        state = turn * (state + influence[k] + step * slope[k] * state.imag * unit)
    return state
