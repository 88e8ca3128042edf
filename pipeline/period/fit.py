"""The infinitesimal period from the times of all crossings: `t_k = t_0 + T0 sum_{j<k} T(A_j)/T(0)`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.period.cycles import Cycles, arc_factor

Factor = Callable[[Floats], Floats]

REJECTION = 4.0  # robust sigmas of a cycle's period
SIGNIFICANT = 5.0  # sigmas of the amplitude scale before it is taken out
LEAST_SCALE = 5e-4  # relative; smaller ones are below what any angle scale is known to
DECAY_REACH = 8  # turning points on each side that smooth an amplitude
BLOCKS = 12  # of crossings, left out in turn for the uncertainty
LEAST_SPREAD = 0.15  # rad between largest and smallest amplitude before an amplitude scale is fitted
SMOOTHING = 9  # cycles


@dataclass(frozen=True)
class PeriodFit:
    """Period of a single pendulum.

    Attributes
    ----------
    period, sigma : float
        Full period at infinitesimal arc and its 1-sigma uncertainty, s.
    amplitude_scale, amplitude_scale_sigma : float
        Relative departure of the true amplitude from the recorded one that the period's trend with amplitude asks for.
    scaled : bool
        Whether `period` was taken with that scale (it is significant and the arcs differ enough).
    time, amplitude, cycle_period, smoothed, reduced : (k,) arrays
        Middle of each cycle (s), amplitude (rad), full period, the same smoothed (the running mean of the
        reduced period times the arc factor), and period over elliptic factor (s).
    rest : float
        Rest position, rad.
    trend : float
        Spread of the reduced period's running mean over the record, relative.
    """

    period: float
    sigma: float
    amplitude_scale: float
    amplitude_scale_sigma: float
    scaled: bool
    time: Floats
    amplitude: Floats
    cycle_period: Floats
    smoothed: Floats
    reduced: Floats
    rest: float
    trend: float


def fit_period(cycles: Cycles, *, linear: bool = False) -> PeriodFit:
    """Fit the finite-arc law to the crossings.

    Parameters
    ----------
    cycles : Cycles
    linear : bool
        The restoring force is linear: no arc factor.
    """
    crossings = [cycles.rising, cycles.falling]
    swing = smooth_amplitude(cycles)
    amplitude = [np.interp(times, cycles.turning_time, swing) for times in crossings]

    def factor(values: Floats) -> Floats:
        return np.ones_like(values) if linear else arc_factor(np.clip(values, 0.0, 3.14))

    def regress(fit_scale: bool) -> tuple[float, float, float, float]:
        return _regress(crossings, amplitude, cycles, swing, factor, fit_scale)

    middle = np.concatenate([_means(times) for times in crossings])
    order = np.argsort(middle)
    length = np.concatenate([np.diff(times) for times in crossings])[order]
    size = np.concatenate([_means(a) for a in amplitude])[order]
    mean_factor = np.concatenate([_means(factor(a)) for a in amplitude])[order]
    whole = np.abs(length / cycles.rough_period - 1.0) < 0.5  # a missing crossing makes a double cycle
    length = np.where(whole, length, np.nan)
    reduced = length / mean_factor

    try_scale = not linear and float(np.ptp(size)) > LEAST_SPREAD
    period, sigma, scale, scale_sigma = regress(try_scale)
    scaled = try_scale and abs(scale) > max(SIGNIFICANT * scale_sigma, LEAST_SCALE)
    if try_scale and not scaled:
        period, sigma, _, _ = regress(False)
    smooth_reduced = _running_mean(reduced, np.ones(min(SMOOTHING, length.size)))
    return PeriodFit(
        period=period,
        sigma=sigma,
        amplitude_scale=scale,
        amplitude_scale_sigma=scale_sigma,
        scaled=scaled,
        time=middle[order],
        amplitude=size,
        cycle_period=length,
        smoothed=smooth_reduced * mean_factor,
        reduced=reduced,
        rest=cycles.rest,
        trend=float(np.ptp(smooth_reduced[np.isfinite(smooth_reduced)]) / period),
    )


def _means(values: Floats) -> Floats:
    """Means of neighbours."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _regress(
    crossings: Sequence[Floats],
    amplitude: Sequence[Floats],
    cycles: Cycles,
    swing: Floats,
    factor: Factor,
    fit_scale: bool,
) -> tuple[float, float, float, float]:
    """Weighted least squares on the crossing times; each crossing's error goes as 1 / (amplitude x frequency).

    A missed crossing shifts a whole number of cycles and is counted from the rough period. Period with its sigma, and
    scale of the amplitudes with its own.
    """
    period, scale = cycles.rough_period, 0.0
    weight, value = np.concatenate(amplitude), np.concatenate(crossings)
    for _ in range(6):
        columns = []
        for side, (times, sizes) in enumerate(zip(crossings, amplitude, strict=True)):
            mean, nudged = (_means(factor(sizes * (1.0 + each))) for each in (scale, scale + 1e-4))
            count = np.maximum(1.0, np.rint(np.diff(times) / (period * mean)))
            column = np.zeros((times.size, 4))
            column[:, side] = 1.0
            column[1:, 2] = np.cumsum(count * mean)
            column[1:, 3] = period * np.cumsum(count * (nudged - mean)) / 1e-4
            columns.append(column)
        matrix = np.concatenate(columns)[:, : 4 if fit_scale else 3]
        keep = np.ones(value.size, dtype=bool)
        for _ in range(3):
            solution = _solve(matrix, weight, value, keep)
            residual = (value - matrix @ solution) * weight
            limit = REJECTION * float(np.median(np.abs(residual[keep]))) / 0.6745
            keep = np.abs(residual) <= max(limit, 1e-12)
        period = float(solution[2])
        if not fit_scale or abs(solution[3]) < 1e-9:
            break
        scale += float(np.clip(solution[3], -0.05, 0.05))
    spread = _scatter(matrix, weight, value, keep, residual[keep])
    # noise of the amplitudes adds up along the record: an error of one extreme shifts all later crossings by T0/2 dK/dA
    influence = np.linalg.pinv(matrix[keep] * weight[keep, None])[2:] * weight[keep]
    later = np.array([influence[:, value[keep] > moment].sum(axis=1) for moment in cycles.turning_time])
    slope = (factor(swing * (1.0 + 1e-4)) - factor(swing)) / (1e-4 * swing)
    noise = 1.4826 * float(np.median(np.abs(np.abs(cycles.turning) - swing)))
    sigma = np.hypot(spread, 0.5 * period * noise * np.linalg.norm(slope[:, None] * later, axis=0))
    return period, float(sigma[0]), scale, float(sigma[1]) if fit_scale else 0.0


def _solve(matrix: Floats, weight: Floats, value: Floats, keep: NDArray[np.bool_]) -> Floats:
    return np.linalg.lstsq(matrix[keep] * weight[keep, None], value[keep] * weight[keep], rcond=None)[0]


def smooth_amplitude(cycles: Cycles) -> Floats:
    """Amplitude at the turning points by a running parabola in its logarithm: noise of single extremes averages out."""
    time, size = cycles.turning_time, np.abs(cycles.turning)
    logarithm = np.log(np.maximum(size, 1e-12))
    smooth = np.empty(size.size)
    for k in range(size.size):
        part = slice(max(0, k - DECAY_REACH), k + DECAY_REACH + 1)
        tau = time[part] - time[k]
        scale = max(float(np.abs(tau).max()), 1e-12)
        degree = min(2, tau.size - 1)
        smooth[k] = np.polynomial.polynomial.polyfit(tau / scale, logarithm[part], degree, w=size[part])[0]
    return np.asarray(np.exp(smooth))


def _scatter(matrix: Floats, weight: Floats, value: Floats, keep: NDArray[np.bool_], kept: Floats) -> Floats:
    """1-sigma of the period, and of the scale where it was fitted, by what the fit leaves.

    The larger of the formal error with the residual's memory and of leaving out blocks in turn.
    """
    estimates = []
    for block in np.array_split(np.flatnonzero(keep)[np.argsort(value[keep], kind="stable")], BLOCKS):
        without = keep.copy()
        without[block] = False
        estimates.append(_solve(matrix, weight, value, without)[2:])
    jackknife = np.sqrt((BLOCKS - 1) * np.var(np.array(estimates), axis=0))
    scaled = matrix[keep] * weight[keep, None]
    covariance = np.linalg.inv(scaled.T @ scaled) * float(kept @ kept) / max(kept.size - matrix.shape[1], 1)
    formal = np.sqrt(np.diag(covariance)[2:] * _colour(kept))
    return np.asarray(np.maximum(jackknife, formal))


def _colour(residual: Floats) -> float:
    """Factor on the variance for residuals that follow each other, (1 + rho)/(1 - rho), at least 1."""
    if residual.size < 8:
        return 1.0
    rho = float(residual[1:] @ residual[:-1] / (residual @ residual)) if np.any(residual) else 0.0
    rho = float(np.clip(rho, 0.0, 0.98))
    return (1.0 + rho) / (1.0 - rho)


def _running_mean(values: Floats, window: Floats) -> Floats:
    present = np.isfinite(values)
    total = np.convolve(np.where(present, values, 0.0), window, mode="same")
    count = np.convolve(present.astype(np.float64), window, mode="same")
    return np.asarray(total / np.maximum(count, 1.0))
