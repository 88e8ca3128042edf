"""Cycle by cycle: crossings of the rest position, turning points, and what they say of amplitude, period and friction.

A half swing of amplitude A loses energy to viscous, quadratic (turbulent air) and dry (knife edge) friction,

    sin A dA = 2 (gamma/n) int sqrt(2 (cos x - cos A)) dx + c int 2 (cos x - cos A) dx + 2 delta A,    delta = f/n^2

which at small arcs is `dA = pi (gamma/n) A + (4/3) c A^2 + 2 delta`; by least squares, each only where the likelihood
pays for it.
"""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipkm1

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats

LEAST_SAMPLES = 16  # a swing: four about each turning point
LEAST_CYCLES, LEAST_READINGS = 5, 30
CROSSING_SHARE = 0.125  # of a period, on each side of a crossing or turning point, that its fit takes in
LAWS = ("viscous", "quadratic", "knife-edge")


def arc_factor(amplitude: ArrayLike) -> NDArray[np.float64]:
    """T(A)/T(0) = (2/pi) K(sin(A/2)) of the greatest angle from the rest position, rad, 0 <= A < pi.

    Examples
    --------
    >>> round(float(arc_factor(3.1)), 10)
    3.3484964456
    """
    return np.asarray(2.0 / np.pi * ellipkm1(np.cos(0.5 * np.asarray(amplitude, dtype=np.float64)) ** 2))


@dataclass(frozen=True)
class Cycles:
    """Crossings of the rest position and the turning points between them."""

    crossings: tuple[Floats, Floats]  # times, s, of the rising ones and the falling ones
    turning_time: Floats  # (m,) s, of maxima and minima in turn
    turning: Floats  # (m,) elongation there, rad
    rest: float  # rest position, rad
    rough_period: float  # median distance of rising crossings, s


def find_cycles(time: Floats, theta: Floats) -> Cycles:
    """Crossings and turning points of theta (n,), rad, NaN = missing, at times (n,), s; `RefusedError`: too few."""
    present = np.isfinite(theta)
    time, theta = time[present], theta[present]
    if theta.size < LEAST_READINGS:
        raise RefusedError(f"record/elongation: {theta.size} readings are too few for a period; give more than 30")
    rest = 0.5 * float(np.quantile(theta, 0.99) + np.quantile(theta, 0.01))
    up, _ = _changes(theta - rest)
    if up.size < LEAST_CYCLES + 1:
        raise RefusedError(
            f"record/elongation: only {max(up.size - 1, 0)} whole swings found; a period needs at least {LEAST_CYCLES}"
        )
    period = float(np.median(np.diff(time[up])))
    if period < LEAST_SAMPLES * float(np.median(np.diff(time))):
        raise RefusedError(
            f"time: fewer than {LEAST_SAMPLES} samples a swing; a single pendulum's period needs denser readings"
        )
    _, turning = _turning_points(time, theta, time[np.sort(np.concatenate(_changes(theta - rest)))], period)
    if turning.size >= 3:  # halves of successive extremes cancel under slow decay by (1, 2, 1) weights
        rest = float(np.median(0.25 * (turning[:-2] + 2.0 * turning[1:-1] + turning[2:])))
    rising, falling = (_crossings(time, theta - rest, near, period) for near in _changes(theta - rest))
    turning_time, turning = _turning_points(time, theta, np.sort(np.concatenate([rising, falling])), period)
    return Cycles((rising, falling), turning_time, turning - rest, rest, period)


def _changes(values: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Where the sign rises and falls, with hysteresis of 5 % of the swing, so that noise about zero does not."""
    threshold = 0.05 * float(np.quantile(np.abs(values), 0.5))
    signs = np.where(values > threshold, 1.0, np.where(values < -threshold, -1.0, 0.0))
    signs = signs[np.maximum.accumulate(np.where(signs != 0.0, np.arange(signs.size), 0))]
    before, after = signs[:-1], signs[1:]
    return np.flatnonzero((after > 0) & (before < 0)), np.flatnonzero((after < 0) & (before > 0))


def _about(time: Floats, values: Floats, centre: float, period: float) -> tuple[Floats, Floats]:
    """Samples within `CROSSING_SHARE` of a time: distances in periods, values."""
    part = slice(*np.searchsorted(time, centre + period * CROSSING_SHARE * np.array([-1.0, 1.0])))
    return (time[part] - centre) / period, values[part]


def _crossings(time: Floats, values: Floats, near: np.ndarray, period: float) -> Floats:
    """Zero of the cubic fitted about each change of sign."""
    found = []
    for index in near:
        if time[index + 1] - time[index] > CROSSING_SHARE * period:
            continue  # a gap: where it crossed is not known
        before, after = values[index : index + 2]
        centre = float(time[index] - before * (time[index + 1] - time[index]) / ((after - before) or 1.0))
        for _ in range(2):
            tau, near_by = _about(time, values, centre, period)
            if tau.size < 3 or tau[0] >= 0.0 or tau[-1] <= 0.0:
                break
            fit = polynomial.polyfit(tau, near_by, 3 if tau.size >= 8 else 1)
            centre -= period * float(fit[0] / fit[1])
        found.append(centre)
    return np.asarray(found)


def _turning_points(time: Floats, theta: Floats, crossings: Floats, period: float) -> tuple[Floats, Floats]:
    """Extreme of the quartic fitted about the middle between successive crossings."""
    times, values = [], []
    for left, right in itertools.pairwise(crossings):
        if right - left > 0.8 * period:
            continue  # a gap
        centre = 0.5 * (left + right)
        tau, near_by = _about(time, theta, centre, period)
        if tau.size < 4:
            continue
        fit = polynomial.polyfit(tau, near_by, 4 if tau.size >= 10 else 2)
        top = -0.5 * fit[1] / fit[2] if fit[2] != 0.0 else 0.0
        top = float(np.clip(top, -CROSSING_SHARE, CROSSING_SHARE))
        times.append(centre + top * period)
        values.append(float(polynomial.polyval(top, fit)))
    return np.asarray(times), np.asarray(values)


def decay(time: Floats, amplitude: Floats, smooth: Floats, period: float) -> dict[str, Any]:
    """Laws of friction by the likelihood of the turning points' amplitudes (m,), rad, at times (m,), s.

    Losses follow from the smoothed amplitudes (m,). Returns gamma, c, delta and the laws that pay, as /period has them.
    """
    from scipy.optimize import nnls

    middle = 0.5 * (smooth[1:] + smooth[:-1])
    swings = np.maximum(1.0, np.rint(2.0 * np.diff(time) / period))  # in a gap there are more
    losses = swings[:, None] * _losses(np.clip(middle, 1e-9, 3.1))
    # the first amplitude less what is lost since
    lost = -np.concatenate([np.zeros((1, 3)), np.cumsum(losses, axis=0)])
    best, found = np.inf, np.zeros(3)
    for count in range(4):
        for some in itertools.combinations(range(3), count):
            matrix = np.concatenate([np.ones((amplitude.size, 1)), lost[:, some]], axis=1)
            size = np.linalg.norm(matrix, axis=0)
            solution, rest = nnls(matrix / size, amplitude)
            noise = max(rest, 1e-12 * float(amplitude.max())) / np.sqrt(amplitude.size)
            price = amplitude.size * np.log(noise) + 0.5 * count * np.log(amplitude.size)
            if price < best:
                best, found = price, np.zeros(3)
                found[list(some)] = solution[1:] / size[1:]
    viscous, quadratic, dry = found.tolist()
    laws = ", ".join(law for law, size in zip(LAWS, found, strict=True) if size) or "none"
    damping_rate = 2.0 * np.pi / period * viscous
    return {"damping_rate": damping_rate, "quadratic_damping": quadratic, "knife_edge": dry, "friction": laws}


def _losses(amplitude: Floats) -> Floats:
    """Of amplitude in a half swing, (m, 3), for gamma/n, c and delta of one."""
    point, weight = np.polynomial.legendre.leggauss(24)
    turn = 0.5 * np.pi * point  # x = A sin(turn), where the root is smooth
    across = amplitude[:, None] * np.sin(turn)
    root = np.sqrt(np.maximum(2.0 * (np.cos(across) - np.cos(amplitude)[:, None]), 0.0))
    viscous = 2.0 * (root * np.cos(turn)) @ weight * 0.5 * np.pi * amplitude
    quadratic = 4.0 * (np.sin(amplitude) - amplitude * np.cos(amplitude))
    return np.stack([viscous, quadratic, 2.0 * amplitude], axis=1) / np.sin(amplitude)[:, None]
