"""Compiled recursions of the nonlinear identity: forward for the model, backward for its adjoint."""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.projection.identity import BLOCK, add_gram
from pipeline.projection.taps import BEFORE, NODES
from synth.kernels.compiled import kernel


@kernel
def expand(
    about: Floats,
    theta: Floats,
    bend: Floats,
    pull: Floats,
    held: float,
    frequency: float,
    shift: float,
    constant: Floats,
    slope: Floats,
    by_frequency: Floats,
) -> None:
    """Right-hand side of `z'' + 2 gamma2 z' + held^2 z` expanded about an angle of the difference; all arrays (n,).

    It is `constant + slope (d - about)`, with

        held^2 d - n^2 [(1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d)],  n^2 w = `bend`

    `pull` = 1 + zeta; `shift` is what noise of theta1 adds to the factor of sin d on average, taken off;
    `by_frequency` = -d(n^2 [...])/dn.
    """
    for k in range(about.size):
        d, secant = about[k], 1.0 / math.cos(theta[k])
        sine, half = math.sin(d), math.sin(0.5 * d)
        less = -2.0 * half * half  # cos d - 1
        stiff = frequency * frequency * pull[k] * secant
        lever = stiff + bend[k] * math.sin(theta[k]) * secant - shift
        constant[k] = held * held * d - lever * sine - bend[k] * less
        slope[k] = held * held - lever * (1.0 + less) + bend[k] * sine
        by_frequency[k] = -2.0 / frequency * stiff * sine


@kernel
def recursion(
    theta: Floats,
    constant: Floats,
    slope: Floats,
    about: Floats,
    difference: Floats,
    weights: Complexes,
    constants: tuple[float, complex, complex, float],
    past: Complexes,
    start: complex,
    columns: Floats,
    gram: Floats,
) -> None:
    """Difference and its derivatives by start and n2, (4, n), and their products.

    A complex state c carries `z = Im(c)/w`, `c <- turn c + integral over the interval + taps of the part that is
    linear in the unknown`, d = direct theta1 + z.

    Parameters
    ----------
    theta, constant : (n + 7,) arrays
        With the samples that `taps.padded` puts beside them; the other arrays are (n,).
    difference : (n,) array
        Less its zero line.
    weights : (8,) complex array
        Taps of an interval.
    constants : tuple
        1-r, w times the projection's gain, exp(lam h), w.
    past : (2,) complex array
        Taps now and one step before, see `past_taps`.
    start : complex
        c over w at the first sample.
    columns : (4, n) array
        The last row comes with the forcing of the derivative by n2.
    gram : (6, 6) array
        As `identity.solve` takes it; damping counts from the middle, per half the length.
    """
    direct, gain, turn, rate = constants
    now, ago = past
    c0, c1, c2, c3 = rate * start, rate * 1.0j, complex(rate), 0.0j
    p0 = p1 = p2 = p3 = 0.0
    unit, samples = 1.0 / rate, slope.size
    rows = np.ones((6, BLOCK))
    for k in range(samples):
        d = direct * theta[k + BEFORE] + c0.imag * unit
        z1, z2, z3 = c1.imag * unit, c2.imag * unit, c3.imag * unit
        q, forced = slope[k], columns[3, k]
        columns[0, k], columns[1, k], columns[2, k], columns[3, k] = d, z1, z2, z3
        m = k % BLOCK
        rows[0, m], rows[1, m], rows[2, m], rows[5, m] = z1, z2, z3, difference[k] - d
        rows[3, m] = (1.0 - 2.0 * k / (samples - 1)) * d
        if m == BLOCK - 1 or k == samples - 1:
            add_gram(rows, m + 1, gram)
        own = response = 0.0j
        for j in range(NODES):
            own += complex(weights[j].real * constant[k + j], weights[j].imag * constant[k + j])
            response += complex(weights[j].real * theta[k + j], weights[j].imag * theta[k + j])
        s0, s1, s2, s3 = q * (d - about[k]), q * z1, q * z2, q * z3 + forced
        c0 = turn * c0 + now * s0 + ago * p0 + own + gain * response
        c1 = turn * c1 + now * s1 + ago * p1
        c2 = turn * c2 + now * s2 + ago * p2
        c3 = turn * c3 + now * s3 + ago * p3
        p0, p1, p2, p3 = s0, s1, s2, s3


def past_taps(eigenvalue: complex, step: float) -> Complexes:
    """Weights of `int_0^h exp(lam (h - x)) f(x) dx` from f(0) and f(-h), exact for cos and sin at Im(lam); (2,)."""
    gamma, oscillation = -eigenvalue.real, eigenvalue.imag
    turn = np.exp(1j * oscillation * step)
    # of f = exp(+-i w x); the first without the small difference of large numbers
    ahead = turn * (step if gamma == 0.0 else -np.expm1(-gamma * step) / gamma)
    behind = (np.conj(turn) - np.exp(eigenvalue * step)) / (gamma - 2j * oscillation)
    return np.linalg.solve(np.array([[1.0, np.conj(turn)], [1.0, turn]]), np.array([ahead, behind]))


@kernel
def adjoint(influence: Floats, slope: Floats, turn: complex, rate: float, step: float, out: Floats) -> None:
    """`out[k] = sum_{j > k} G(t_j - t_k) influence[j]`, G the response to a unit impulse; all (n,).

    slope is the part of the stiffness that changes with time, as the recursion has it. This one runs backwards.
    """
    unit, state = 1.0 / rate, 0.0j
    for k in range(influence.size - 1, -1, -1):
        out[k] = state.imag * unit
        state = turn * (state + influence[k] + step * slope[k] * state.imag * unit)
