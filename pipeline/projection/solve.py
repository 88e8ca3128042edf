"""Gauss-Newton on the frequency of the second pendulum by full sweeps over the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.projection.pieces import solve_pieces
from pipeline.projection.small import solve_moments

REJECTION = 4.0  # sigmas
ITERATIONS = 12
_FLOOR = 1e-6  # of the amplitude: what departs less is rounding and quadrature, not a wild reading
_SETTLED = 2e-5  # rad over half the record: what is left after such a step is its square
_NEAR = 1e-3  # rad over half the record: from here on the residual is the readings' and wild ones can be told


@dataclass(frozen=True)
class ProjectionFit:
    """Least squares for (A, B, offset, n2, gamma2); `noise_gain` is sigma of n2 per radian of white noise in d.

    `coefficient` is that of the first piece where long gaps part the record.
    """

    frequency: float
    damping_rate: float
    coefficient: Floats
    noise: float
    noise_gain: float
    samples: int
    rejected: int
    residual: Floats


class Problem(Protocol):
    """What the fit needs of a sampling: the model's response at the samples, and the moments of what it leaves."""

    half: float
    """Half the record's length, s."""
    pieces: list[slice]
    """Samples of the difference that take part; each piece swings freely with an amplitude of its own."""

    @property
    def residual(self) -> Floats:
        """What the last `moments` found at every sample, NaN where missing or beyond the limit."""

    def respond(self, frequency: float, gamma: float) -> None:
        """Compute the response to the first pendulum, and its slopes, at (n2, gamma2)."""

    def nudge(self, frequency_change: float, damping_change: float) -> None:
        """Take the response to nearby (n2, gamma2) by its slopes."""

    def moments(self, frequency: float, gamma: float, coefficient: Floats, limit: float) -> tuple[Floats, int]:
        """Gram matrices (pieces, 8, 8) as `kernels.moments` has them, and the number of samples beyond the limit.

        `coefficient` (pieces, 3) is each piece's (A, B, offset).
        """


def fit_projection(
    problem: Problem,
    frequency: float,
    gamma: float,
    fit_damping: bool,
    rounds: int = ITERATIONS,
    steps: Floats | None = None,
) -> ProjectionFit:
    """Fit the exact linear identity.

    Parameters
    ----------
    problem : Problem
        The samples.
    frequency, gamma : float
        Start, within a fraction of a turn over the record; gamma2 is held unless `fit_damping`.
    rounds : int
        At most so many; one is enough for a start of the nonlinear identity.
    steps : (pieces - 1,) array
        1 sigma of each part of the step of the free swing from piece to piece, rad.
    """
    half = problem.half
    coefficient = np.zeros((len(problem.pieces), 3))
    noise = 0.0
    limit, rejected, settled = np.inf, 0, False
    problem.respond(frequency, gamma)
    for last in range(rounds - 1, -1, -1):
        gram, beyond = problem.moments(frequency, gamma, coefficient, limit)
        if settled and beyond == rejected:
            break  # the same samples as before
        rejected = beyond
        if steps is None:
            small = solve_moments(gram[0], coefficient[0], half, fit_damping)
        else:
            small = solve_pieces(gram, coefficient, half, fit_damping, steps, noise)
        noise = small.noise
        # the moments' time runs about the middle of the record, the coefficients' about its start
        turn = np.exp(complex(small.damping_change, -small.frequency_change) * half)
        for own, found in zip(coefficient, np.atleast_2d(small.coefficient), strict=True):
            turned = complex(found[0], -found[1]) * turn
            own[:] = turned.real, -turned.imag, found[2]
        frequency += small.frequency_change
        gamma += small.damping_change
        if not np.isfinite(frequency) or abs(gamma) > 0.1 * frequency:
            raise RefusedError("difference: no swing near the nominal period; check instrument/period and the traces")
        if last == 0:
            break
        new_limit = max(REJECTION * small.noise, _FLOOR * max(abs(complex(*own[:2])) for own in coefficient))
        settled = max(abs(small.frequency_change), abs(small.damping_change)) * half <= _SETTLED
        if not settled:
            near = abs(small.frequency_change) * half < _NEAR
            limit = new_limit if near or np.isfinite(limit) else np.inf
            problem.respond(frequency, gamma)
            continue
        problem.nudge(small.frequency_change, small.damping_change)
        if new_limit > 0.98 * limit:
            break
        limit = new_limit
    samples = int(gram[:, 2, 2].sum())
    free = 2 + 2 * len(gram) + fit_damping
    return ProjectionFit(
        frequency=float(frequency),
        damping_rate=float(gamma),
        coefficient=coefficient[0],
        noise=float(np.sqrt(gram[:, 7, 7].sum() / max(samples - free, 1))),
        noise_gain=small.noise_gain,
        samples=samples,
        rejected=rejected,
        residual=problem.residual,
    )
