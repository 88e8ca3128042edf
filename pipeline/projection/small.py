"""The small least squares inside the moments: Gauss-Newton in five parameters, compiled as it runs at every sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from synth.kernels.compiled import kernel

ROUNDS = 6
RIDGE = 1e-14  # of the unit diagonal: keeps a column that vanishes from stopping the solution


@dataclass(frozen=True)
class SmallFit:
    """Solution of the least squares that the moments stand for, linear in the change of frequency and damping."""

    coefficient: Floats
    frequency_change: float
    damping_change: float
    noise: float
    noise_gain: float


def solve_moments(gram: Floats, coefficient: Floats, half: float, fit_damping: bool) -> SmallFit:
    """Solve the least squares that the moments stand for; see `gauss_newton`.

    Raises
    ------
    RefusedError
        Too few readings, or readings that are no numbers.
    """
    free = 5 if fit_damping else 4
    if not np.all(np.isfinite(gram)) or gram[2, 2] < 2 * free:
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    parameters = np.empty(5)
    left, variance = gauss_newton(gram, coefficient, half, free, parameters)
    return SmallFit(
        coefficient=parameters[:3],
        frequency_change=float(parameters[3] / half),
        damping_change=float(parameters[4] / half),
        noise=float(np.sqrt(left / max(gram[2, 2] - free, 1.0))),
        noise_gain=float(np.sqrt(variance) / half),
    )


@kernel
def gauss_newton(gram: Floats, coefficient: Floats, half: float, free: int, parameters: Floats) -> tuple[float, float]:
    """Fit (A, B, offset, dn half, dgamma half) to the Gram matrix of `kernels.moments`.

    The column of dn is `t (B cos - A sin) + slope / half`, that of dgamma `-t (A cos + B sin) + slope_damping / half`,
    both times `half`: bilinear in (A, B), so a few rounds are taken.

    Parameters
    ----------
    gram : (8, 8) array
        Symmetric.
    coefficient : (3,) array
        (A, B, offset) that the residual was formed with.
    half : float
        Half the record's length, s.
    free : int
        4 with the damping held, 5 with it fitted.
    parameters : (5,) array, out

    Returns
    -------
    float, float
        Sum of squares that is left, and the variance of the fourth parameter per variance of a sample.
    """
    parameters[:] = 0.0
    start = np.empty((3, 3))
    for i in range(3):
        parameters[i] = coefficient[i]
        for j in range(3):
            start[i, j] = gram[i, j]
    lower = np.zeros((5, 5))
    inverse = np.empty((5, 5))
    invert(start, 3, lower, inverse)
    for i in range(3):
        for j in range(3):
            parameters[i] += inverse[i, j] * gram[j, 7]
    columns = np.zeros((7, 5))
    change = np.zeros(7)
    normal = np.empty((5, 5))
    right = np.empty(5)
    for _ in range(ROUNDS):
        cos, sin, _offset, speed, decay = parameters
        columns[0, 0] = columns[1, 1] = columns[2, 2] = 1.0
        columns[3, 0], columns[4, 0] = -decay, -speed
        columns[3, 1], columns[4, 1] = speed, -decay
        columns[3, 3], columns[4, 3], columns[5, 3] = sin, -cos, 1.0 / half
        columns[3, 4], columns[4, 4], columns[6, 4] = -cos, -sin, 1.0 / half
        amplitudes(parameters, coefficient, half, change)
        for i in range(free):
            right[i] = 0.0
            for k in range(7):
                if columns[k, i] != 0.0:
                    residual = gram[k, 7]
                    for m in range(7):
                        residual -= gram[k, m] * change[m]
                    right[i] += columns[k, i] * residual
            for j in range(free):
                total = 0.0
                for k in range(7):
                    if columns[k, i] != 0.0:
                        for m in range(7):
                            total += columns[k, i] * gram[k, m] * columns[m, j]
                normal[i, j] = total
        invert(normal, free, lower, inverse)
        update = 0.0
        for i in range(free):
            step = 0.0
            for j in range(free):
                step += inverse[i, j] * right[j]
            parameters[i] += step
            if i == 3:
                update = step
        if abs(update) <= 1e-6 * abs(parameters[3]) or abs(parameters[3]) < 1e-7:
            break
    amplitudes(parameters, coefficient, half, change)
    left = gram[7, 7]
    for k in range(7):
        left -= 2.0 * change[k] * gram[k, 7]
        for m in range(7):
            left += change[k] * gram[k, m] * change[m]
    return max(left, 0.0), max(inverse[3, 3], 0.0)


@kernel
def amplitudes(parameters: Floats, coefficient: Floats, half: float, out: Floats) -> None:
    """Amplitudes of the seven columns, less those that the residual already holds."""
    cos, sin, offset, speed, decay = parameters
    out[0], out[1], out[2] = cos - coefficient[0], sin - coefficient[1], offset - coefficient[2]
    out[3], out[4] = speed * sin - decay * cos, -speed * cos - decay * sin
    out[5], out[6] = speed / half, decay / half


@kernel
def invert(matrix: Floats, size: int, lower: Floats, inverse: Floats) -> None:
    """Inverse of a positive definite matrix, scaled to a unit diagonal, by Cholesky."""
    scale = np.empty(size)
    for i in range(size):
        scale[i] = 1.0 / np.sqrt(max(matrix[i, i], 1e-300))
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j] * scale[i] * scale[j]
            if i == j:
                total += RIDGE
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, i] = np.sqrt(max(total, RIDGE))
            else:
                lower[i, j] = total / lower[j, j]
    work = np.empty(size)
    for column in range(size):
        for i in range(size):
            total = 1.0 if i == column else 0.0
            for k in range(i):
                total -= lower[i, k] * work[k]
            work[i] = total / lower[i, i]
        for i in range(size - 1, -1, -1):
            total = work[i]
            for k in range(i + 1, size):
                total -= lower[k, i] * work[k]
            work[i] = total / lower[i, i]
        for i in range(size):
            inverse[i, column] = work[i] * scale[i] * scale[column]
