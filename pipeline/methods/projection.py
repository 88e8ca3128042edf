"""`projection`: least squares on the exact linear identity that eliminates the support's acceleration."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.prepared import LEAST_EXPLAINED, Prepared
from pipeline.projection.identity import ITERATIONS, LinearFit, LinearIdentity

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


def linear_fit(prepared: Prepared, rounds: int = ITERATIONS) -> LinearFit:
    """The linear identity fitted to a record, the damping held where it is stated; see `LinearIdentity.fit`."""
    seen, rough, begin = prepared.observation, prepared.rough, float(prepared.blocks.time[0])
    identity = LinearIdentity(
        seen.theta, seen.difference, seen.step, prepared.nominal, seen.frequency_ratio, seen.damping_difference
    )
    turned = complex(rough.damping_rate, prepared.nominal - rough.frequency) * begin  # back to the first sample
    start = rough.start * complex(np.exp(turned))
    return identity.fit(rough.frequency, rough.damping_rate, start, prepared.known_damping is None, rounds)


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    require_clean(prepared)
    rough = prepared.rough
    fit = linear_fit(prepared)
    colour = residual_colour(fit.residual, fit.frequency, fit.noise, prepared)
    swing = 0.5 * float(np.vdot(rough.model, rough.model).real) / rough.model.size
    explained = swing / (swing + fit.noise**2)
    if explained < LEAST_EXPLAINED:
        raise RefusedError(
            f"difference: a swing at the nominal period explains only {100 * max(explained, 0.0):.0f} % of it; "
            "check instrument/period and that the trace is a difference of two pendulums"
        )
    return Estimate(
        frequency=fit.frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.rough_slope, fit.damping_rate)),
        sigma=float(
            np.hypot(
                fit.noise_gain * fit.noise * np.sqrt(max(colour, 1.0)),
                prepared.theta_error(prepared.rough_budget.noise_theta, fit.noise),
            )
        ),
        noise=fit.noise,
        damping_rate=fit.damping_rate,
        samples=fit.residual.size,
        residual_colour=colour,
    )


def residual_colour(residual: Floats, frequency: float, noise: float, prepared: Prepared) -> float:
    """Power of the residual in blocks near the pendulum's frequency over that of white noise of the same total."""
    if noise == 0.0:
        return 1.0
    step = prepared.observation.step
    rows = max(4, round(prepared.blocks.hop / step))
    count = residual.size // rows
    turn = np.exp(-1j * frequency * step * np.arange(rows))
    blocks = residual[: count * rows].reshape(count, rows)
    power = (blocks @ turn.real) ** 2 + (blocks @ turn.imag) ** 2
    # |sum r e^{-int}|^2 has mean sigma^2 N for white noise
    return float(np.mean(power) / rows / noise**2)
