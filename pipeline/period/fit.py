"""The infinitesimal period from the times at which a pendulum passes its rest.

    t_k = t_0 + T0 sum_{j<k} T(A_j)/T(0) -+ (rest + drift)/v_k + delta/v_k,    v = 2 n sin(A/2)

The rest, its drift and the scale of the angles are not known: they have priors. Dry friction lays the middle of each
half swing delta behind the rest: the smaller the arc, the later it is passed. What the law misses, it misses for long:
sigma is that of leaving out long stretches in turn.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.period.cycles import Cycles, arc_factor, decay

Factor = Callable[[Floats], Floats]

REJECTION = 4.0  # robust sigmas of a cycle's period
SIGNIFICANT = 5.0  # sigmas of the amplitude scale before it is flagged
LEAST_SCALE = 5e-4  # relative; smaller ones are below what any angle scale is known to
SCALE, REST = 5e-3, 5e-3  # 1 sigma of a scale that is not stated; of the rest and of its drift, rad
DECAY_REACH = 8  # turning points on each side that smooth an amplitude
BLOCKS = 6  # of crossings, left out in turn for the uncertainty
SMOOTHING = 9  # cycles
ROUNDS = 8


def fit_period(cycles: Cycles, *, linear: bool = False, scale_uncertainty: float = SCALE) -> dict[str, Any]:
    """Fit the finite-arc law to the crossings; none where the restoring force is `linear`.

    `scale_uncertainty` is relative, 1 sigma, of the scale of the angles. Returns the variables of /period, and whether
    the period's trend asks for another scale of the angles, `scaled`.
    """
    extremes, noise = smooth_extremes(cycles)

    def factor(values: Floats) -> Floats:
        return np.ones_like(values) if linear else arc_factor(np.clip(values, 0.0, 3.14))

    amplitude = [np.interp(times, cycles.turning_time, extremes) for times in cycles.crossings]
    middle = np.concatenate([0.5 * (times[1:] + times[:-1]) for times in cycles.crossings])
    order = np.argsort(middle)
    length = np.concatenate([np.diff(times) for times in cycles.crossings])[order]
    mean_factor = np.concatenate([_mean_factor(a, 0.0, factor) for a in amplitude])[order]
    whole = np.abs(length / cycles.rough_period - 1.0) < 0.5  # a missing crossing makes a double cycle
    friction = decay(cycles.turning_time, np.abs(cycles.turning), extremes, cycles.rough_period)
    dry, prior = friction["knife_edge"], max(scale_uncertainty, 1e-9)
    period, scale, drift, sigma = _regress(cycles, extremes, noise, factor, dry, prior)
    window = np.ones(min(SMOOTHING, length.size))
    reduced = length / mean_factor
    present, count = (np.convolve(each, window, mode="same") for each in (np.where(whole, reduced, 0.0), 1.0 * whole))
    smoothed = present / np.maximum(count, 1.0)
    return friction | {
        "period": period,
        "period_sigma": sigma[PERIOD],
        "amplitude_scale": scale,
        "amplitude_scale_sigma": sigma[SCALED],
        "scaled": not linear and abs(scale) > max(SIGNIFICANT * sigma[SCALED], LEAST_SCALE),
        "rest_position": cycles.rest,
        "rest_drift": drift,
        "rest_drift_sigma": sigma[DRIFT],
        "trend": float((np.nanmax(smoothed) - np.nanmin(smoothed)) / period),
        "cycle_time": middle[order],
        "amplitude": np.concatenate([0.5 * (a[1:] + a[:-1]) for a in amplitude])[order],
        "cycle_period": np.where(whole, length, np.nan),
        "cycle_period_smoothed": smoothed * mean_factor,
        "cycle_period_infinitesimal": np.where(whole, reduced, np.nan),
    }


PERIOD, SCALED, DRIFT = 2, 3, 5  # columns of the regression, behind those of the two sides' first crossings


def _mean_factor(amplitude: Floats, scale: float, factor: Factor) -> Floats:
    scaled = amplitude * (1.0 + scale)
    return np.asarray(0.5 * (factor(scaled[1:]) + factor(scaled[:-1])))


def _regress(
    cycles: Cycles, extremes: Floats, scatter: float, factor: Factor, dry: float, scale_prior: float
) -> tuple[float, float, float, list[float]]:
    """Period, scale, drift and sigma by column: least squares on crossing times, errors as 1/v, missed ones counted."""
    period, scale = cycles.rough_period, 0.0
    prior = np.array([scale_prior, REST, REST])
    for _ in range(ROUNDS):
        columns, values, weights = [], [], []
        for side, times in enumerate(cycles.crossings):
            sizes = np.interp(times, cycles.turning_time, extremes)
            speed = 4.0 * np.pi / period * np.sin(0.5 * np.clip(sizes, 1e-6, np.pi))
            mean = _mean_factor(sizes, scale, factor)
            count = np.maximum(1.0, np.rint(np.diff(times) / (period * mean)))
            total = np.concatenate([[0.0], np.cumsum(count * mean)])
            nudged = np.concatenate([[0.0], np.cumsum(count * _mean_factor(sizes, scale + 1e-4, factor))])
            column = np.zeros((times.size, 6))
            column[:, side] = 1.0
            column[:, PERIOD] = total
            column[:, SCALED] = period * (nudged - total) / 1e-4
            column[:, 4] = (2.0 * side - 1.0) / speed
            column[:, DRIFT] = column[:, 4] * (times - cycles.turning_time.mean()) / np.ptp(cycles.turning_time)
            columns.append(column)
            values.append(times - dry / speed)
            weights.append(speed)
        matrix, value, weight = (np.concatenate(each) for each in (columns, values, weights))
        keep, noise = np.ones(value.size, dtype=bool), 1e-3
        known = np.concatenate([np.zeros((3, 3)), np.diag(1.0 / prior)], axis=1), np.array([-scale, 0.0, 0.0]) / prior
        for _ in range(4):
            solution = _solved(matrix[keep], value[keep], weight[keep] / noise, known)
            residual = (value - matrix @ solution) * weight
            keep = np.abs(residual) <= max(REJECTION * float(np.median(np.abs(residual[keep]))) / 0.6745, 1e-12)
            noise = max(float(np.sqrt(np.mean(residual[keep] ** 2))), 1e-13)
        period, change = float(solution[PERIOD]), float(np.clip(solution[SCALED], -0.05, 0.05))
        scale += change
        if abs(change) < 1e-9:
            break
    order = np.flatnonzero(keep)[np.argsort(value[keep], kind="stable")]
    own = weight[keep] / noise / np.sqrt(_colour(residual[order]))
    scaled = np.concatenate([matrix[keep] * own[:, None], known[0]])
    spread = np.linalg.norm(scaled, axis=0)
    inverse = np.linalg.pinv(scaled / spread) / spread[:, None]
    without = []
    for block in np.array_split(order, BLOCKS):
        some = keep.copy()
        some[block] = False
        without.append(_solved(matrix[some], value[some], weight[some] / noise, known))
    jackknife = np.sqrt((BLOCKS - 1) * np.var(np.array(without), axis=0))
    # an error of one extreme shifts all later crossings by T0/2 dK/dA of it: beside the others
    influence = inverse[:, : own.size] * own
    later = np.array([influence[:, value[keep] > moment].sum(axis=1) for moment in cycles.turning_time])
    slope = (factor(extremes * (1.0 + 1e-4)) - factor(extremes)) / (1e-4 * extremes)
    shifts = 0.5 * period * slope[:, None] * later * scatter
    formal = np.linalg.norm(inverse, axis=1)
    sigma = np.hypot(np.maximum(jackknife, formal), np.sqrt(np.sum(shifts**2, axis=0)))
    return period, scale, float(solution[DRIFT]), sigma.tolist()


def _solved(matrix: Floats, value: Floats, weight: Floats, known: tuple[Floats, Floats]) -> Floats:
    """Least squares with what is known of the last columns beforehand."""
    rows = np.concatenate([matrix * weight[:, None], known[0]])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    right = np.concatenate([value * weight, known[1]])
    return np.asarray(np.linalg.lstsq(rows / size, right, rcond=None)[0] / size)


def smooth_extremes(cycles: Cycles) -> tuple[Floats, float]:
    """Amplitude at the turning points by a running parabola in its logarithm, and the noise of a single one, rad."""
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
    return smooth, 1.4826 * float(np.median(np.abs(size - smooth)))


def _colour(residual: Floats) -> float:
    """Factor on the variance for residuals that follow each other, (1 + rho)/(1 - rho), at least 1."""
    if residual.size < 8:
        return 1.0
    rho = float(residual[1:] @ residual[:-1] / (residual @ residual)) if np.any(residual) else 0.0
    rho = float(np.clip(rho, 0.0, 0.98))
    return (1.0 + rho) / (1.0 - rho)
