"""Compiled fit of the complex form: model, best start, residual and Jacobian for one trial of (n2, gamma2); descent."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.projection.small import invert
from synth.kernels.compiled import kernel

ITERATIONS = 12


@kernel
def running_integral(values: Complexes, hop: float, out: Complexes) -> None:
    """`out[k] = int_0^{t_k} f dt` from uniform values by the fourth-order rule hop/24 (-1, 13, 13, -1)."""
    count = values.size
    out[0] = 0.0
    if count < 4:
        for k in range(1, count):
            out[k] = out[k - 1] + 0.5 * hop * (values[k - 1] + values[k])
        return
    out[1] = hop / 24.0 * (9.0 * values[0] + 19.0 * values[1] - 5.0 * values[2] + values[3])
    for k in range(1, count - 2):
        inner = 13.0 * (values[k] + values[k + 1]) - values[k - 1] - values[k + 2]
        out[k + 1] = out[k] + hop / 24.0 * inner
    last = count - 1
    inner = 9.0 * values[last] + 19.0 * values[last - 1] - 5.0 * values[last - 2] + values[last - 3]
    out[last] = out[last - 1] + hop / 24.0 * inner


@kernel
def phase_slope(time: Floats, envelope: Complexes, weight: Floats) -> float:
    """Regression of the unwrapped phase with weights times |envelope|^2; an instant without weight is not looked at."""
    phase = np.empty(time.size)
    last = total = centre = 0.0
    for k in range(time.size):
        if weight[k] > 0.0:
            angle = np.angle(envelope[k])
            last += (angle - last + np.pi) % (2.0 * np.pi) - np.pi
            phase[k] = last
            square = weight[k] * (envelope[k].real ** 2 + envelope[k].imag ** 2)
            total += square
            centre += square * time[k]
    centre /= total
    top = bottom = 0.0
    for k in range(time.size):
        if weight[k] > 0.0:
            square = weight[k] * (envelope[k].real ** 2 + envelope[k].imag ** 2)
            top += square * (time[k] - centre) * phase[k]
            bottom += square * (time[k] - centre) ** 2
    return top / bottom


@kernel
def descend(
    data: Complexes,
    weight: Floats,
    first: Complexes,
    first_speed: Complexes,
    known: Complexes,
    hop: float,
    constants: tuple[float, float, float],
    frequency: float,
    gamma: float,
    free: int,
    tolerance: float,
    model: Complexes,
    jacobian: Complexes,
    inverse: Floats,
) -> tuple[float, float, complex, float]:
    """Gauss-Newton from a start: n2, gamma2 (held where `free` is 3), D0 and the sum of squares; see `sweep`.

    `inverse` (4, 4) gets the inverse of the normal equations, zero for what is held; `tolerance` is n2's, rad s-1.
    """
    normal, right = np.empty((4, 4)), np.empty(4)
    lower = np.empty((4, 4))
    inverse[:] = 0.0
    for _ in range(ITERATIONS):
        start, squares = sweep(
            data, weight, first, first_speed, known, hop, constants, frequency, gamma, model, jacobian, normal, right
        )
        invert(normal, free, lower, inverse)
        change = damping_change = 0.0
        for k in range(4):
            change += inverse[2, k] * right[k]
            damping_change += inverse[3, k] * right[k]
        if abs(change) < tolerance:
            break
        frequency += change
        gamma += damping_change
    return frequency, gamma, start, squares


@kernel
def sweep(
    data: Complexes,
    weight: Floats,
    first: Complexes,
    first_speed: Complexes,
    known: Complexes,
    hop: float,
    constants: tuple[float, float, float],
    frequency: float,
    gamma: float,
    model: Complexes,
    jacobian: Complexes,
    normal: Floats,
    right: Floats,
) -> tuple[complex, float]:
    """Best start D0 for a trial of (n2, gamma2), its weighted sum of squares, and the normal equations at that point.

    Parameters
    ----------
    data, weight : (k,) arrays
        Envelope of the difference and its weight (0 = missing, where data is finite but unused).
    first, first_speed, known : (k,) complex arrays
        Z1, Z1', and further known forcing F.
    constants : tuple of float
        n0, n1/n2, gamma1 - gamma2.
    model : (k,) complex array, out
        `D0 e^{mu t} + response`.
    jacobian : (4, k) complex array, out
        Rows (Re D0, Im D0, n2, gamma2), unweighted.
    normal, right : (4, 4) and (4,) arrays, out
        Real normal equations of the weighted residual.
    """
    carrier, ratio, apart = constants
    decay = gamma + apart
    own = np.sqrt(ratio**2 * (frequency**2 + gamma**2) - decay**2)  # damped frequency of the first pendulum
    mu = complex(-gamma, frequency - carrier)
    kappa = complex(-apart, own - frequency)
    # X = Z1 + Xi, where Xi = 3/(2 i w1) (Z1' - (i w1 - gamma1) Z1) vanishes for a free swing; both are analytic signals
    by_first, by_speed = 1.0 + 1.5 * complex(carrier - own, -decay) / own, -1.5j / own
    count = data.size
    growth = jacobian[0]
    decline, work, response = np.empty_like(data), np.empty_like(data), np.empty_like(data)
    factor, back = np.exp(mu * hop), np.exp(-mu * hop)
    value = inverse = 1.0 + 0.0j
    for k in range(count):
        if k % 64 == 0:  # a product of many factors drifts
            value, inverse = np.exp(mu * (hop * k)), np.exp(-mu * (hop * k))
        growth[k], decline[k] = value, inverse
        work[k] = (kappa * (by_first * first[k] + by_speed * first_speed[k]) + known[k]) * inverse
        value *= factor
        inverse *= back
    running_integral(work, hop, response)
    top, bottom = 0.0 + 0.0j, 0.0
    for k in range(count):
        response[k] *= growth[k]
        top += weight[k] * np.conj(growth[k]) * (data[k] - response[k])
        bottom += weight[k] * (growth[k].real ** 2 + growth[k].imag ** 2)
    start = top / bottom
    slope = 1j * (ratio - 1.0)
    for k in range(count):
        model[k] = start * growth[k] + response[k]
        work[k] = (1j * model[k] + slope * first[k]) * decline[k]
    running_integral(work, hop, jacobian[2])
    for k in range(count):
        work[k] = model[k] * decline[k]
    running_integral(work, hop, jacobian[3])
    normal[:] = 0.0
    right[:] = 0.0
    squares = 0.0
    for k in range(count):
        jacobian[1, k] = 1j * growth[k]
        jacobian[2, k] *= growth[k]
        jacobian[3, k] *= -growth[k]
        residual = data[k] - model[k]
        squares += weight[k] * (residual.real**2 + residual.imag**2)
        for i in range(4):
            left = np.conj(jacobian[i, k]) * weight[k]
            right[i] += (left * residual).real
            for j in range(i, 4):
                normal[i, j] += (left * jacobian[j, k]).real
    for i in range(4):
        for j in range(i):
            normal[i, j] = normal[j, i]
    return start, squares
