"""Compiled sweep of the complex form: model, best start, residual and Jacobian for one trial of (n2, gamma2)."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from synth.kernels.compiled import kernel


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
def sweep(
    data: Complexes,
    root: Floats,
    drive: Complexes,
    drive_slope: Complexes,
    known: Complexes,
    hop: float,
    mu: complex,
    kappa: complex,
    model: Complexes,
    jacobian: Complexes,
    normal: Floats,
    right: Floats,
) -> tuple[complex, float]:
    """Best start D0 for the trial, its weighted sum of squares, and the normal equations at that point.

    Parameters
    ----------
    data, root : (k,) arrays
        Envelope of the difference and root of its weight (0 = missing, where data is finite but unused).
    drive, drive_slope, known : (k,) complex arrays
        X; its share in the slope by n2, `i (n1/n2 - 1) Z1`; further known forcing F.
    mu, kappa : complex
        Exponent `i (n2 - n0) - gamma2` and coefficient of the drive.
    model : (k,) complex array, out
        `D0 e^{mu t} + response`.
    jacobian : (k, 4) complex array, out
        Columns (Re D0, Im D0, n2, gamma2), unweighted.
    normal, right : (4, 4) and (4,) arrays, out
        Real normal equations of the weighted residual.
    """
    count = data.size
    growth = np.empty(count, dtype=np.complex128)
    work = np.empty(count, dtype=np.complex128)
    response = np.empty(count, dtype=np.complex128)
    factor = np.exp(mu * hop)
    value = 1.0 + 0.0j
    for k in range(count):
        if k % 64 == 0:  # a product of many factors drifts
            value = np.exp(mu * (hop * k))
        growth[k] = value
        value *= factor
        work[k] = (kappa * drive[k] + known[k]) / growth[k]
    running_integral(work, hop, response)
    top, bottom = 0.0 + 0.0j, 0.0
    for k in range(count):
        response[k] *= growth[k]
        square = root[k] * root[k]
        top += square * np.conj(growth[k]) * (data[k] - response[k])
        bottom += square * (growth[k].real ** 2 + growth[k].imag ** 2)
    start = top / bottom
    for k in range(count):
        model[k] = start * growth[k] + response[k]
        work[k] = (1j * model[k] + drive_slope[k]) / growth[k]
    running_integral(work, hop, response)
    for k in range(count):
        jacobian[k, 0] = growth[k]
        jacobian[k, 1] = 1j * growth[k]
        jacobian[k, 2] = growth[k] * response[k]
        work[k] = model[k] / growth[k]
    running_integral(work, hop, response)
    normal[:] = 0.0
    right[:] = 0.0
    squares = 0.0
    for k in range(count):
        jacobian[k, 3] = -growth[k] * response[k]
        weight = root[k] * root[k]
        residual = data[k] - model[k]
        squares += weight * (residual.real**2 + residual.imag**2)
        for i in range(4):
            left = np.conj(jacobian[k, i]) * weight
            right[i] += (left * residual).real
            for j in range(i, 4):
                normal[i, j] += (left * jacobian[k, j]).real
    for i in range(4):
        for j in range(i):
            normal[i, j] = normal[j, i]
    return start, squares
