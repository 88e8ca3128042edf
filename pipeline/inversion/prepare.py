"""From a prepared record to its nonlinear inversion: the grid, the linear start, the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, sum_of_squares
from pipeline.inversion.influence import theta_influence
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.motion import motion
from pipeline.methods.projection import linear_fit, residual_colour
from pipeline.prepared import Prepared
from pipeline.projection.identity import LinearFit

NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better reckoned
COLOURED = 3.0  # power of the residual near the swing over white, from which the identity does not fit
EXCESS = 2.0  # residual over the reading noise, the same
FLOOR = 1e-5  # of the amplitude: a smaller residual shows nothing
RIPPLE, COARSE, ORDER = 3e-9, 5e-6, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between readings; measured on simulated records (five motions, six rates)."""


@dataclass(frozen=True)
class Inverted:
    """What the nonlinear inversion found.

    Attributes
    ----------
    frequency, damping_rate : float
        n2 at infinitesimal arc, rad s-1; gamma2, s-1.
    sigma : float
        1-sigma of n2 from the noise of both traces and from the numerical method, rad s-1.
    noise, colour : float
        1-sigma residual, rad; its power near the swing over that of white noise.
    samples : int
        Readings of the difference that were used.
    """

    frequency: float
    damping_rate: float
    sigma: float
    noise: float
    colour: float
    samples: int


def invert(prepared: Prepared) -> Inverted:
    """Invert the nonlinear identity.

    Raises
    ------
    RefusedError
        No swing at the nominal period, wild readings, or a heave that is not recorded.
    """
    iteration = begin(prepared, linear_fit(prepared, rounds=1))
    fit = iteration.fit(fit_damping=prepared.known_damping is None)
    colour = residual_colour(iteration.residual(), iteration.frequency, fit.noise, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if iteration.motion.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(iteration.start)):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    own = float(np.sqrt(fit.covariance[2, 2])) * fit.noise * np.sqrt(max(colour, 1.0))
    from_theta = theta_sigma(prepared, iteration, iteration.influence(fit.covariance[2]), fit.noise)
    return Inverted(
        frequency=iteration.frequency,
        damping_rate=iteration.damping_rate,
        sigma=float(np.linalg.norm([own, from_theta, numerical_error(iteration)])),
        noise=fit.noise,
        colour=colour,
        samples=iteration.count,
    )


def begin(prepared: Prepared, held: LinearFit) -> Iteration:
    """The iteration before its first sweep."""
    seen, envelope = prepared.observation, prepared.blocks
    noise = theta_noise(prepared)
    # the third harmonic is read where the readings show it better than the swing's amplitude tells it
    read = noise < NOISY * float(np.nanmedian(np.abs(envelope.first)))
    moved = motion(
        seen.theta,
        seen.vertical,
        seen.step,
        held.frequency,
        seen.frequency_ratio,
        held.damping_rate + seen.damping_difference,
        noise,
        None if read else envelope,
    )
    return Iteration(seen, moved, held, prepared.gravity_of)


def numerical_error(iteration: Iteration) -> float:
    """What filters, quadrature and interpolation may do to n2, rad s-1."""
    slope = iteration.slope
    strength = float(np.sqrt(sum_of_squares(slope) / slope.size)) / (2.0 * iteration.frequency)
    return strength * (RIPPLE + COARSE * (iteration.frequency * iteration.step) ** ORDER)


def theta_noise(prepared: Prepared) -> float:
    """White reading noise of the first pendulum, rad: estimated from neighbours, or as stated, or zero."""
    if np.isfinite(prepared.noise_theta):
        return prepared.noise_theta
    return prepared.observation.sigma_theta or 0.0


def theta_sigma(prepared: Prepared, iteration: Iteration, influence: Floats, fallback: float) -> float:
    """1-sigma of n2 from the noise of the first pendulum, rad s-1."""
    seen, gravity = prepared.observation, prepared.gravity_of(iteration.frequency)
    through = theta_influence(iteration, influence, gravity, seen.frequency_ratio, seen.damping_difference)
    return prepared.theta_error(float(np.sqrt(sum_of_squares(through))), fallback)
