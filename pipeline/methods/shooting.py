"""`shooting`: exact inversion of the nonlinear identity, all finite arcs and the support's acceleration included."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.identity.fit import Fit, Identity
from pipeline.identity.motion import Motion, motion
from pipeline.methods import projection
from pipeline.prepared import Prepared

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
    moved, fit = nonlinear_fit(prepared)
    colour = projection.residual_colour(fit, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if prepared.observation.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(fit.model).max()):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    from_theta = prepared.theta_error(float(np.linalg.norm(moved.influence(fit))), fit.noise)
    numerical = numerical_error(fit, prepared.observation.step)
    return projection.as_estimate(prepared, fit, colour, from_theta, numerical, reduced=True)


def nonlinear_fit(prepared: Prepared) -> tuple[Motion, Fit]:
    """The identity of real pendulums fitted to a record, the damping held where it is stated."""
    seen, rough, envelope = prepared.observation, prepared.fine, prepared.sliding
    noise = prepared.theta_error(1.0, 0.0)
    # the third harmonic is read where the samples give it better than the swing's amplitude does
    read = noise < NOISY * float(np.nanmedian(np.abs(envelope.first)))
    moved = motion(seen, rough.frequency, rough.damping_rate, noise, None if read else envelope)
    identity = Identity(seen, rough.frequency, moved.expand, moved.inside)
    return moved, identity.fit(rough.damping_rate, fit_damping=prepared.known_damping is None)


def numerical_error(fit: Fit, step: float) -> float:
    """What filters, quadrature and interpolation may do to n2, rad s-1."""
    strength = float(np.sqrt(np.mean(fit.stiffness**2))) / (2.0 * fit.frequency)
    return strength * (RIPPLE + COARSE * (fit.frequency * step) ** ORDER)
