"""Gauss-Newton step from the Gram matrix of the derivatives and the residual; both exact identities take it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import portions
from pipeline.arrays import Floats
from synth.kernels.compiled import summing_kernel

BLOCK = 256  # samples whose derivatives are multiplied at once
PARAMETERS = 5  # two of the start, n2, gamma2, offset; the residual follows them
OUTLIER = 7.0  # sigmas
_RIDGE = 1e-14  # of the unit diagonal: keeps a column that vanishes from stopping the solution
_FLOOR = 1e-4  # of the amplitude: what departs less may be the quadrature at the ends


@dataclass(frozen=True)
class Step:
    """Change of the five parameters, 1-sigma residual (rad), covariance (5, 5) per variance of white noise."""

    change: Floats
    noise: float
    covariance: Floats


@summing_kernel
def add_gram(rows: Floats, count: int, gram: Floats) -> None:
    """Add products of six rows, the first `count` of each, to the lower half of their Gram matrix (6, 6)."""
    for i in range(6):
        for j in range(i + 1):
            one, other, total = rows[i], rows[j], 0.0
            for m in range(count):
                total += one[m] * other[m]
            gram[i, j] += total


def free_parameters(fit_damping: bool) -> list[int]:
    """Numbers of the parameters that are fitted."""
    return [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]


def solve(gram: Floats, free: list[int]) -> Step:
    """Least squares that a Gram matrix stands for, in scaled columns.

    Parameters
    ----------
    gram : (6, 6) array
        Of the derivatives by (start, start, n2, gamma2, offset) and the residual, lower half; [4, 4] is the number of
        samples.
    free : list of int
        Parameters that are fitted; the others do not change.

    Raises
    ------
    RefusedError
        Too few samples, or samples that are no numbers.
    """
    samples = gram[4, 4]
    if not np.all(np.isfinite(gram)) or samples < 2 * len(free):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    whole = np.tril(gram) + np.tril(gram, -1).T
    chosen = whole[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(chosen), 1e-300))
    inverse = np.linalg.inv(chosen * scale[:, None] * scale + _RIDGE * np.eye(len(free))) * scale[:, None] * scale
    right = whole[free, PARAMETERS]
    solution = inverse @ right
    change, covariance = np.zeros(PARAMETERS), np.zeros((PARAMETERS, PARAMETERS))
    change[free], covariance[np.ix_(free, free)] = solution, inverse
    squares = max(float(gram[PARAMETERS, PARAMETERS] - right @ solution), 0.0)
    return Step(change, float(np.sqrt(squares / max(samples - len(free), 1.0))), covariance)


def require_swing_near(frequency: float, damping_rate: float) -> None:
    """Refuse parameters that the iteration has lost."""
    if not np.isfinite(frequency) or abs(damping_rate) > 0.1 * frequency:
        raise RefusedError("difference: no swing near the nominal period; check instrument/period and the traces")


def refuse_outliers(residual: Floats, noise: float, amplitude: float) -> None:
    """Refuse a residual with an outlier, such as neighbours do not show near a record's ends.

    Parameters
    ----------
    residual : (n,) array
        rad.
    noise, amplitude : float
        Its 1 sigma, and the swing's amplitude, rad.
    """
    limit = max(OUTLIER * noise, _FLOOR * amplitude)
    if any(np.abs(residual[part]).max() > limit for part in portions(residual.size, residual)):
        raise RefusedError("record/elongation: the difference has outliers; use --method joint")
