"""`projection`: least squares on the exact linear identity that eliminates the support's acceleration."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import COLOUR_SECONDS, Estimate
from pipeline.identity.fit import Fit, Identity, linear
from pipeline.prepared import LEAST_EXPLAINED, Prepared

FINE_ANGLE = 0.8  # swing between readings, at most: eight readings a swing


def require_clean(prepared: Prepared) -> None:
    """Refuse what the exact identities, which integrate both series, do not take."""
    seen = prepared.observation
    if seen.step * prepared.nominal > FINE_ANGLE:
        raise RefusedError(
            f"time: {2.0 * np.pi / (seen.step * prepared.nominal):.1f} readings a swing are fewer than eight; "
            "use --method joint"
        )
    prepared.require_whole("theta", "difference", "vertical")


def linear_fit(prepared: Prepared) -> Fit:
    """The linear identity fitted to a record, the damping held where it is stated."""
    rough = prepared.fine
    identity = Identity(prepared.observation, rough.frequency, linear(rough.frequency))
    return identity.fit(rough.damping_rate, fit_damping=prepared.known_damping is None)


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    require_clean(prepared)
    rough = prepared.fine
    fit = linear_fit(prepared)
    colour = residual_colour(fit, prepared)
    swing = 0.5 * float(np.vdot(rough.model, rough.model).real) / rough.model.size
    explained = swing / (swing + fit.noise**2)
    if explained < LEAST_EXPLAINED:
        raise RefusedError(
            f"difference: a swing at the nominal period explains only {100 * max(explained, 0.0):.0f} % of it; "
            "check instrument/period and that the trace is a difference of two pendulums"
        )
    from_theta = prepared.theta_error(prepared.fine_budget.noise_theta, fit.noise)
    return as_estimate(prepared, fit, colour, from_theta)


def as_estimate(prepared: Prepared, fit: Fit, colour: float, *others: float, reduced: bool = False) -> Estimate:
    """A fit with the noise of its own residual, coloured as it is, and other parts of its 1 sigma of n2, rad s-1."""
    own = fit.noise_gain * fit.noise * np.sqrt(max(colour, 1.0))
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
