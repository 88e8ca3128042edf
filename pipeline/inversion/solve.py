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
from pipeline.projection.solve import REJECTION

ITERATIONS = 12
_SETTLED = 1e-9  # of the frequency: what is left after such a step is a thousandth of it at most, 2e-6 mGal
_FLOOR = 1e-6  # of the amplitude: what departs less is rounding and quadrature, not a wild reading
_NEAR = 1e-3  # rad over half the record
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
    samples, rejected : int
        Readings used and left out as wild.
    weights : (5,) array
        Row of the covariance that belongs to n2, s-1.
    limit : float
        Departure from which readings count as wild, rad.
    """

    frequency: float
    damping_rate: float
    offset: float
    noise: float
    noise_gain: float
    samples: int
    rejected: int
    weights: Floats
    limit: float


def fit_inversion(iteration: Iteration, *, fit_damping: bool) -> InversionFit:
    """Fit the nonlinear identity; see `Iteration` for what it is given.

    Parameters
    ----------
    fit_damping : bool
        Whether gamma2 is fitted too.
    """
    free = [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]
    limit = np.inf
    for _ in range(ITERATIONS):
        iteration.sweep()
        gram, rejected = iteration.moments(limit)
        found = solve(gram, free)
        iteration.improve(found.change)
        new_limit = max(REJECTION * found.noise, _FLOOR * abs(iteration.start))
        settled = abs(found.change[2]) < _SETTLED * iteration.frequency
        if settled and (new_limit > 0.98 * limit or iteration.wild(new_limit) == 0):
            break
        if abs(found.change[2]) * iteration.half < _NEAR:
            limit = new_limit
    return InversionFit(
        frequency=iteration.frequency,
        damping_rate=iteration.damping_rate,
        offset=iteration.offset,
        noise=found.noise,
        noise_gain=float(np.sqrt(found.covariance[2, 2])),
        samples=int(gram[4, 4]),
        rejected=rejected,
        weights=found.covariance[2],
        limit=limit,
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
