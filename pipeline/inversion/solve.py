"""Gauss-Newton on the exact nonlinear identity: one linear recursion with time-varying stiffness an iteration.

With theta1 recorded, the unknown horizontal acceleration drops out and the difference d obeys

    d'' + 2 gamma2 d' = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1' - n2^2 NL(d),
    NL(d) = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),  w = (theta1'' + 2 gamma1 theta1')/n1^2

(the unknown eliminated between the two equations of motion). The linear response to theta1 at a held frequency comes
from the projection, by parts, without derivatives. The rest is expanded about an angle d*: at first the MEASURED
difference, later the model's; expanded about the measured one the start is good to 1e-3 even in heavy motion, where
iterating about a linear model diverges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.inversion.iteration import Iteration
from pipeline.projection.solve import refuse_wild

ITERATIONS = 12
_SETTLED = 1e-9  # of the frequency: what is left after such a step is a thousandth of it at most, 2e-6 mGal
_RIDGE = 1e-14


@dataclass(frozen=True)
class InversionFit:
    """Least squares for (start, n2, gamma2, offset) on the nonlinear identity.

    Attributes
    ----------
    frequency, damping_rate : float
        n2 at infinitesimal arc, rad s-1, and gamma2, s-1.
    noise : float
        1-sigma residual, rad.
    noise_gain : float
        1-sigma of n2 per radian of white noise in the difference, s-1.
    samples : int
        Readings used.
    weights : (5,) array
        Row of the covariance that belongs to n2, s-1.
    """

    frequency: float
    damping_rate: float
    offset: float
    noise: float
    noise_gain: float
    samples: int
    weights: Floats


def fit_inversion(iteration: Iteration, *, fit_damping: bool) -> InversionFit:
    """Fit the nonlinear identity; see `Iteration` for what it is given.

    Parameters
    ----------
    fit_damping : bool
        Whether gamma2 is fitted too.

    Raises
    ------
    RefusedError
        No swing at the nominal period, or a wild reading.
    """
    free = [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]
    for _ in range(ITERATIONS):
        iteration.sweep()
        gram = iteration.moments()
        found = solve(gram, free)
        iteration.improve(found.change)
        if abs(found.change[2]) < _SETTLED * iteration.frequency:
            break
    refuse_wild(iteration.residual(), found.noise, abs(iteration.start))
    return InversionFit(
        frequency=iteration.frequency,
        damping_rate=iteration.damping_rate,
        offset=iteration.offset,
        noise=found.noise,
        noise_gain=float(np.sqrt(found.covariance[2, 2])),
        samples=int(gram[4, 4]),
        weights=found.covariance[2],
    )


@dataclass(frozen=True)
class Solution:
    """Change of the five parameters, 1-sigma residual (rad), covariance per variance of noise."""

    change: Floats
    noise: float
    covariance: Floats


def solve(gram: Floats, free: list[int]) -> Solution:
    """Least squares that the moments stand for, in scaled columns; parameters not free do not change."""
    if not np.all(np.isfinite(gram)) or gram[4, 4] < 2 * len(free):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    chosen = gram[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(chosen))
    inverse = np.linalg.inv(chosen * scale[:, None] * scale + _RIDGE * np.eye(len(free)))
    inverse *= scale[:, None] * scale
    right = gram[free, 5]
    solved = inverse @ right
    change, covariance = np.zeros(5), np.zeros((5, 5))
    change[free], covariance[np.ix_(free, free)] = solved, inverse
    squares = max(float(gram[5, 5] - right @ solved), 0.0)
    return Solution(change, float(np.sqrt(squares / max(gram[4, 4] - len(free), 1.0))), covariance)
