"""Gauss-Newton on the frequency of the second pendulum by full sweeps over the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import portions
from pipeline.arrays import Floats
from pipeline.projection.small import solve_moments
from pipeline.projection.uniform import UniformProblem

WILD = 7.0  # sigmas
ITERATIONS = 12
_FLOOR = 1e-4  # of the amplitude: what departs less may be the quadrature at the ends
_SETTLED = 2e-5  # rad over half the record: what is left after such a step is its square


@dataclass(frozen=True)
class ProjectionFit:
    """Least squares for (A, B, offset, n2, gamma2); `noise_gain` is sigma of n2 per radian of white noise in d."""

    frequency: float
    damping_rate: float
    coefficient: Floats
    noise: float
    noise_gain: float
    samples: int
    residual: Floats


def fit_projection(
    problem: UniformProblem, frequency: float, gamma: float, fit_damping: bool, rounds: int = ITERATIONS
) -> ProjectionFit:
    """Fit the exact linear identity.

    Parameters
    ----------
    problem : UniformProblem
        The samples.
    frequency, gamma : float
        Start, within a fraction of a turn over the record; gamma2 is held unless `fit_damping`.
    rounds : int
        At most so many; one is enough for a start of the nonlinear identity.

    Raises
    ------
    RefusedError
        No swing at the nominal period, or a wild reading.
    """
    half = problem.half
    coefficient = np.zeros(3)
    settled = False
    for _ in range(rounds):
        if not settled:
            problem.respond(frequency, gamma)
        gram = problem.moments(frequency, gamma, coefficient)
        small = solve_moments(gram, coefficient, half, fit_damping)
        # the moments' time runs about the middle of the record, the coefficients' about its start
        turn = np.exp(complex(small.damping_change, -small.frequency_change) * half)
        turned = complex(small.coefficient[0], -small.coefficient[1]) * turn
        coefficient[:] = turned.real, -turned.imag, small.coefficient[2]
        frequency += small.frequency_change
        gamma += small.damping_change
        if not np.isfinite(frequency) or abs(gamma) > 0.1 * frequency:
            raise RefusedError("difference: no swing near the nominal period; check instrument/period and the traces")
        if settled:
            refuse_wild(problem.residual, small.noise, abs(complex(*coefficient[:2])))
            break
        settled = max(abs(small.frequency_change), abs(small.damping_change)) * half <= _SETTLED
        if settled:
            problem.nudge(small.frequency_change, small.damping_change)
    return ProjectionFit(
        frequency=float(frequency),
        damping_rate=float(gamma),
        coefficient=coefficient,
        noise=small.noise,
        noise_gain=small.noise_gain,
        samples=problem.residual.size,
        residual=problem.residual,
    )


def refuse_wild(residual: Floats, noise: float, amplitude: float) -> None:
    """Refuse a residual with a wild reading, such as neighbours do not show near a record's ends.

    Parameters
    ----------
    residual : (n,) array
        rad.
    noise, amplitude : float
        Its 1 sigma, and that of the swing, rad.
    """
    limit = max(WILD * noise, _FLOOR * amplitude)
    if any(np.abs(residual[part]).max() > limit for part in portions(residual.size, residual)):
        raise RefusedError("record/elongation: the difference has outliers; use --method joint")
