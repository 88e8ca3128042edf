"""`projection`: least squares on the exact linear identity that eliminates the support's acceleration."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.prepared import LEAST_EXPLAINED, Prepared
from pipeline.projection.sampling import problem
from pipeline.projection.solve import ProjectionFit, fit_projection


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    seen = prepared.observation
    rough = prepared.rough
    fit = fit_projection(problem(prepared), rough.frequency, rough.damping_rate, prepared.known_damping is None)
    shared = prepared.rough_budget
    colour = residual_colour(fit, prepared)
    explained = 1.0 - fit.noise**2 / float(np.nanvar(seen.difference))
    if explained < LEAST_EXPLAINED:
        raise RefusedError(
            f"difference: a swing at the nominal period explains only {100 * max(explained, 0.0):.0f} % of it; "
            "check instrument/period and that the trace is a difference of two pendulums"
        )
    theta_noise = prepared.noise_theta if np.isfinite(prepared.noise_theta) else fit.noise
    return Estimate(
        frequency=fit.frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.rough_slope, fit.damping_rate)),
        sigma=float(np.hypot(fit.noise_gain * fit.noise * np.sqrt(max(colour, 1.0)), shared.noise_theta * theta_noise)),
        noise=fit.noise,
        damping_rate=fit.damping_rate,
        samples=fit.samples,
        residual_colour=colour,
    )


def residual_colour(fit: ProjectionFit, prepared: Prepared) -> float:
    """Power of the residual in blocks near the pendulum's frequency over that of white noise of the same total."""
    seen = prepared.observation
    if fit.noise == 0.0:
        return 1.0
    residual = fit.residual
    if residual.size != seen.time.size:  # marks on a finer grid
        residual = residual[:: (residual.size - 1) // (seen.time.size - 1)]
    present = np.isfinite(residual)
    edges = np.append(
        prepared.blocks.time - 0.5 * prepared.blocks.hop, prepared.blocks.time[-1] + 0.5 * prepared.blocks.hop
    )
    turned: Floats = np.where(present, residual, 0.0)
    sums = block_sums(turned * np.exp(-1j * fit.frequency * seen.time), seen.time, edges)
    counts = block_sums(present.astype(np.complex128), seen.time, edges).real
    used = counts > 0.5 * counts.max()
    # |sum r e^{-int}|^2 has mean sigma^2 N for white noise
    return float(np.mean(np.abs(sums[used]) ** 2 / counts[used]) / fit.noise**2)


def block_sums(values: np.ndarray, time: Floats, edges: Floats) -> np.ndarray:
    """Sums of values between successive edges."""
    bounds = np.searchsorted(time, edges)
    total = np.concatenate([np.zeros(1, dtype=values.dtype), np.cumsum(values)])
    return np.asarray(total[bounds[1:]] - total[bounds[:-1]])
