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
    extremes = smooth_extremes(cycles)
    size_of = extremes.size
    amplitude = [np.interp(times, cycles.turning_time, size_of) for times in crossings]

    def factor(values: Floats) -> Floats:
        return np.ones_like(values) if linear else arc_factor(np.clip(values, 0.0, 3.14))

    middle = np.concatenate([0.5 * (times[1:] + times[:-1]) for times in crossings])
    order = np.argsort(middle)
    length = np.concatenate([np.diff(times) for times in crossings])[order]
    size = np.concatenate([0.5 * (a[1:] + a[:-1]) for a in amplitude])[order]
    mean_factor = np.concatenate([_mean_factor(a, 0.0, factor) for a in amplitude])[order]
    reduced = length / mean_factor
    whole = np.abs(length / cycles.rough_period - 1.0) < 0.5  # a missing crossing makes a double cycle

    spread = float(size.max() - size.min())
    try_scale = not linear and spread > LEAST_SPREAD
    period, sigma, scale, scale_sigma = _regress(crossings, amplitude, extremes, factor, cycles.rough_period, try_scale)
    scaled = try_scale and abs(scale) > max(SIGNIFICANT * scale_sigma, LEAST_SCALE)
    if try_scale and not scaled:
        period, sigma, _, _ = _regress(crossings, amplitude, extremes, factor, cycles.rough_period, False)
    window = np.ones(min(SMOOTHING, length.size))
    smooth_reduced = _running_mean(np.where(whole, reduced, np.nan), window)
    return PeriodFit(
        period=period,
        sigma=sigma,
        amplitude_scale=scale,
        amplitude_scale_sigma=scale_sigma,
        scaled=scaled,
        time=middle[order],
        amplitude=size,
        cycle_period=np.where(whole, length, np.nan),
        smoothed=smooth_reduced * mean_factor,
        reduced=np.where(whole, reduced, np.nan),
        rest=cycles.rest,
        trend=float((np.nanmax(smooth_reduced) - np.nanmin(smooth_reduced)) / period),
    )


def _mean_factor(amplitude: Floats, scale: float, factor: Factor) -> Floats:
    scaled = amplitude * (1.0 + scale)
    return np.asarray(0.5 * (factor(scaled[1:]) + factor(scaled[:-1])))


def _regress(
    crossings: Sequence[Floats],
    amplitude: Sequence[Floats],
    extremes: Extremes,
    factor: Factor,
    rough: float,
    fit_scale: bool,
) -> tuple[float, float, float, float]:
    """Weighted least squares on the crossing times; each crossing's error goes as 1 / (amplitude x frequency).

    A missed crossing shifts a whole number of cycles and is counted from the rough period.
    """
    period, scale = rough, 0.0
    for _ in range(6):
        columns, values, weights = [], [], []
        for side, (times, sizes) in enumerate(zip(crossings, amplitude, strict=True)):
            mean = _mean_factor(sizes, scale, factor)
            count = np.maximum(1.0, np.rint(np.diff(times) / (period * mean)))
            total = np.concatenate([[0.0], np.cumsum(count * mean)])
            nudged = np.concatenate([[0.0], np.cumsum(count * _mean_factor(sizes, scale + 1e-4, factor))])
            column = np.zeros((times.size, 4))
            column[:, side] = 1.0
            column[:, 2] = total
            column[:, 3] = period * (nudged - total) / 1e-4
            columns.append(column)
            values.append(times)
            weights.append(sizes)
        matrix = np.concatenate(columns)[:, : 4 if fit_scale else 3]
        weight = np.concatenate(weights)
        value = np.concatenate(values)
        keep = np.ones(value.size, dtype=bool)
        for _ in range(3):
            scaled = matrix[keep] * weight[keep, None]
            solution = np.linalg.lstsq(scaled, value[keep] * weight[keep], rcond=None)[0]
            residual = (value - matrix @ solution) * weight
            limit = REJECTION * float(np.median(np.abs(residual[keep]))) / 0.6745
            keep = np.abs(residual) <= max(limit, 1e-12)
        period = float(solution[2])
        if not fit_scale or abs(solution[3]) < 1e-9:
            break
        scale += float(np.clip(solution[3], -0.05, 0.05))
    sigma = _uncertainty(matrix, weight, value, keep, residual, extremes, factor, period)
    return period, float(sigma[0]), scale, float(sigma[1]) if fit_scale else 0.0


@dataclass(frozen=True)
class Extremes:
    """Turning points: time (s), smoothed amplitude and noise of a single one (rad)."""

    time: Floats
    size: Floats
    noise: float


def smooth_extremes(cycles: Cycles) -> Extremes:
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
    smooth = np.exp(smooth)
    return Extremes(time, smooth, 1.4826 * float(np.median(np.abs(size - smooth))))


def _uncertainty(
    matrix: Floats,
    weight: Floats,
    value: Floats,
    keep: NDArray[np.bool_],
    residual: Floats,
    extremes: Extremes,
    factor: Factor,
    period: float,
) -> Floats:
    """1-sigma of the period, and of the scale where it was fitted.

    The larger of the formal error with the residual's memory and of leaving out blocks in turn, and beside it the
    noise of the amplitudes, which adds up along the record: an error of one extreme shifts all later crossings by
    T0/2 dK/dA of it.
    """
    scaled = matrix[keep] * weight[keep, None]
    kept = residual[keep]
    estimates = []
    for block in np.array_split(np.flatnonzero(keep)[np.argsort(value[keep], kind="stable")], BLOCKS):
        without = keep.copy()
        without[block] = False
        part = matrix[without] * weight[without, None]
        estimates.append(np.linalg.lstsq(part, value[without] * weight[without], rcond=None)[0][2:])
    jackknife = np.sqrt((BLOCKS - 1) * np.var(np.array(estimates), axis=0))
    covariance = np.linalg.inv(scaled.T @ scaled) * float(kept @ kept) / max(kept.size - matrix.shape[1], 1)
    formal = np.sqrt(np.diag(covariance)[2:] * _colour(kept))
    influence = np.linalg.pinv(scaled)[2:] * weight[keep]
    later = np.array([influence[:, value[keep] > moment].sum(axis=1) for moment in extremes.time])
    slope = (factor(extremes.size * (1.0 + 1e-4)) - factor(extremes.size)) / (1e-4 * extremes.size)
    shifts = 0.5 * period * slope[:, None] * later * extremes.noise
    return np.asarray(np.hypot(np.maximum(jackknife, formal), np.sqrt(np.sum(shifts**2, axis=0))))


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
