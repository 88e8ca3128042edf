"""`projection` and `shooting`: least squares on the exact identities that eliminate the support's acceleration.

`projection` takes the pendulums as linear, `shooting` as real ones with finite arcs and the support's acceleration.
"""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import COLOUR_SECONDS, Estimate
from pipeline.identity.fit import Fit, Identity, linear
from pipeline.identity.motion import Motion, motion
from pipeline.prepared import LEAST_EXPLAINED, Prepared

FINE_ANGLE = 0.8  # swing between readings, at most: eight readings a swing
NOISY = 3e-4  # reading noise of the first pendulum over its swing, from which its third harmonic is better computed
COLOURED = 3.0  # power of the residual near the swing over white, from which the identity does not fit
EXCESS = 2.0  # residual over the reading noise, the same
FLOOR = 1e-5  # of the amplitude: a smaller residual shows nothing
RIPPLE, COARSE, ORDER = 3e-9, 5e-6, 8
"""Numerical error, in parts of the strength of the nonlinear terms: the filters' ripple, and the quadrature's, which
grows with that power of the swing's turn between samples; measured on simulated records (five motions, six rates)."""


def require_clean(prepared: Prepared) -> None:
    """Refuse what the exact identities, which integrate both series, do not take."""
    angle = prepared.observation.step * prepared.nominal
    if angle > FINE_ANGLE:
        raise RefusedError(f"time: {2.0 * np.pi / angle:.1f} readings a swing are fewer than eight; use --method joint")
    prepared.require_whole("theta", "difference", "vertical")


def linear_fit(prepared: Prepared) -> Fit:
    """The linear identity fitted to a record, the damping held where it is stated."""
    rough = prepared.fine
    identity = Identity(prepared.observation, rough.frequency, linear(rough.frequency))
    return identity.fit(rough.damping_rate, fit_damping=prepared.known_damping is None)


def projection(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    require_clean(prepared)
    fit, rough = linear_fit(prepared), prepared.fine.model
    swing = 0.5 * float(np.vdot(rough, rough).real) / rough.size
    explained = swing / (swing + fit.noise**2)
    if explained < LEAST_EXPLAINED:
        raise RefusedError(
            f"difference: a swing at the nominal period explains only {100 * max(explained, 0.0):.0f} % of it; "
            "check instrument/period and that the trace is a difference of two pendulums"
        )
    from_theta = prepared.theta_error(prepared.fine_budget.noise_theta, fit.noise)
    return as_estimate(prepared, fit, residual_colour(fit, prepared), from_theta)


def as_estimate(prepared: Prepared, fit: Fit, colour: float, *others: float, reduced: bool = False) -> Estimate:
    """A fit with the noise of its own residual, coloured as it is, and other parts of its 1 sigma of n2, rad s-1."""
    own = float(np.linalg.norm(fit.influence)) * fit.noise * np.sqrt(max(colour, 1.0))
    return Estimate(
        frequency=fit.frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.fine.slope, fit.damping_rate)),
        sigma=float(np.linalg.norm([own, *others])),
        noise=fit.noise,
        damping_rate=fit.damping_rate,
        samples=fit.residual.size,
        residual_colour=colour,
        acceleration_reduced=reduced,
    )


def residual_colour(fit: Fit, prepared: Prepared) -> float:
    """Power of the residual in blocks near the pendulum's frequency over that of white noise of the same total."""
    if fit.noise == 0.0:
        return 1.0
    step = prepared.observation.step
    rows = max(4, round(COLOUR_SECONDS / step))
    blocks: Floats = fit.residual[: fit.residual.size // rows * rows].reshape(-1, rows)
    power = np.abs(blocks @ np.exp(-1j * fit.frequency * step * np.arange(rows))) ** 2
    # |sum r e^{-int}|^2 has mean sigma^2 N for white noise
    return float(np.mean(power) / rows / fit.noise**2)


def shooting(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held; vertical acceleration from the record, or none; of linear pendulums `projection`."""
    if prepared.observation.restoring == "linear":
        return projection(prepared)
    require_clean(prepared)
    return invert(prepared)


def invert(prepared: Prepared) -> Estimate:
    """Invert the nonlinear identity; sigma holds the noise of both traces and the numerical error.

    `RefusedError`: no swing at the nominal period, outliers, or a heave that is not recorded.
    """
    moved, fit = nonlinear_fit(prepared)
    colour = residual_colour(fit, prepared)
    # short heave lies beside what the colour looks at, but above what neighbours call noise
    coloured = colour > COLOURED or (colour > 1.0 and fit.noise > EXCESS * prepared.noise_difference)
    if prepared.observation.vertical is None and coloured and fit.noise > FLOOR * float(np.abs(fit.model).max()):
        raise RefusedError(
            "record/vertical_acceleration: not recorded, and the residual is not that of real pendulums on a support "
            "that does not heave; use --method joint"
        )
    from_theta = prepared.theta_error(float(np.linalg.norm(moved.influence(fit))), fit.noise)
    numerical = numerical_error(fit, prepared.observation.step)
    return as_estimate(prepared, fit, colour, from_theta, numerical, reduced=True)


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
