"""`projection`: least squares on the exact linear identity that eliminates the support's acceleration."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import portions, release
from pipeline.estimate import Estimate
from pipeline.prepared import LEAST_EXPLAINED, Prepared
from pipeline.projection.sampling import linear_fit
from pipeline.projection.solve import ProjectionFit

TOGETHER = 512  # blocks of uneven readings, after which their memory is given back


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held, the damping held where the record states it."""
    rough = prepared.rough
    fit = linear_fit(prepared)
    colour = residual_colour(fit, prepared)
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
                prepared.theta_error(prepared.rough_budget, fit.noise, cut=True),
            )
        ),
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
    if seen.step is not None:
        rows = max(4, round(prepared.blocks.hop / seen.step))
        count = residual.size // rows
        turn = np.exp(-1j * fit.frequency * seen.step * np.arange(rows))
        power, counts = np.empty(count), np.full(count, float(rows))
        for part in portions(count * rows, residual, unit=rows):
            blocks, here = residual[part].reshape(-1, rows), slice(part.start // rows, part.stop // rows)
            if fit.samples < seen.time.size:
                present = np.isfinite(blocks)
                blocks, counts[here] = np.where(present, blocks, 0.0), present.sum(axis=1)
            power[here] = (blocks @ turn.real) ** 2 + (blocks @ turn.imag) ** 2
    else:
        edges = np.arange(0.0, float(seen.time[-1]), prepared.blocks.hop)
        power, counts = np.empty((2, edges.size))
        for begin in range(0, edges.size, TOGETHER):
            bounds = np.searchsorted(seen.time, edges[begin : begin + TOGETHER + 1])
            here = slice(begin, min(begin + TOGETHER, edges.size))
            end = max(bounds[-1], bounds[-2] + 1) if here.stop < edges.size else residual.size
            bounds, part = bounds[: here.stop - begin] - bounds[0], slice(bounds[0], end)
            present = np.isfinite(residual[part])
            turn = np.exp(-1j * fit.frequency * seen.time[part])
            turned = np.where(present, residual[part], 0.0) * turn
            power[here] = np.abs(np.add.reduceat(turned, bounds)) ** 2
            counts[here] = np.add.reduceat(present.astype(np.float64), bounds)
            release(seen.time, residual)
    used = counts > 0.5 * counts.max()
    # |sum r e^{-int}|^2 has mean sigma^2 N for white noise
    return float(np.mean(power[used] / counts[used]) / fit.noise**2)
