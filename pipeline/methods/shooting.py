"""`shooting`: exact inversion of the nonlinear identity, all finite arcs and the support's acceleration included."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.inversion.iteration import Iteration, theta_influence
from pipeline.inversion.motion import motion
from pipeline.methods import projection
from pipeline.prepared import Prepared
from pipeline.projection.identity import LinearFit

NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better computed
COLOURED = 3.0  # power of the residual near the swing over white, from which the identity does not fit
EXCESS = 2.0  # residual over the reading noise, the same
FLOOR = 1e-5  # of the amplitude: a smaller residual shows nothing
RIPPLE, COARSE, ORDER = 3e-9, 5e-6, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between samples; measured on simulated records (five motions, six rates)."""


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held; vertical acceleration from the record, or none.

    Where the record says `restoring = linear`, the nonlinear identity is the linear one.
    """
    if prepared.observation.restoring == "linear":
        return projection.estimate(prepared)
    projection.require_clean(prepared)
    return invert(prepared)


def invert(prepared: Prepared) -> Estimate:
    """Invert the nonlinear identity; sigma holds the noise of both traces and the numerical error.

    Raises
    ------
    RefusedError
        No swing at the nominal period, outliers, or a heave that is not recorded.
    """
    seen = prepared.observation
    iteration = begin(prepared, projection.linear_fit(prepared, rounds=1))
    fit = iteration.fit(fit_damping=prepared.known_damping is None)
    colour = projection.residual_colour(iteration.residual(), iteration.frequency, fit.noise, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if iteration.motion.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(iteration.start)):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    own = float(np.sqrt(fit.covariance[2, 2])) * fit.noise * np.sqrt(max(colour, 1.0))
    through = theta_influence(
        iteration,
        iteration.influence(fit.covariance[2]),
        prepared.gravity_of(iteration.frequency),
        seen.frequency_ratio,
        seen.damping_difference,
    )
    from_theta = prepared.theta_error(float(np.linalg.norm(through)), fit.noise)
    return Estimate(
        frequency=iteration.frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.rough_slope, iteration.damping_rate)),
        sigma=float(np.linalg.norm([own, from_theta, numerical_error(iteration)])),
        noise=fit.noise,
        damping_rate=iteration.damping_rate,
        samples=iteration.count,
        residual_colour=colour,
        acceleration_reduced=True,
    )


def begin(prepared: Prepared, held: LinearFit) -> Iteration:
    """The iteration before its first sweep."""
    seen, envelope = prepared.observation, prepared.blocks
    noise = prepared.noise_theta if np.isfinite(prepared.noise_theta) else seen.sigma_theta or 0.0
    # the third harmonic is read where the samples give it better than the swing's amplitude does
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
    strength = float(np.linalg.norm(iteration.slope) / np.sqrt(iteration.count)) / (2.0 * iteration.frequency)
    return strength * (RIPPLE + COARSE * (iteration.frequency * iteration.step) ** ORDER)
