"""The inversion beside a true shooting: scipy's DOP853 on the exact identity with its variational equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from heavy_pair import DAMPING, HEAVE, PERIODS, REFERENCE, G, acceleration, angles, observe
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from pipeline.methods.exact import design, invert
from pipeline.prepared import prepare

LENGTH, STEP, NOISE = 80.0, 0.04, 2e-5
RATIO = PERIODS[1] / PERIODS[0]


class Shooting:
    """Least squares for (n2, d0, d0', offset) by integrating the identity and its three variations."""

    def __init__(self, time: np.ndarray, readings: np.ndarray) -> None:
        fine, one, _ = angles(LENGTH, 0.01, True)
        self.theta = make_interp_spline(fine, one, k=7)
        self.rate, self.bend = self.theta.derivative(), self.theta.derivative(2)
        self.time, self.readings = time, readings

    def slope(self, t: float, y: np.ndarray, n: float) -> np.ndarray:
        gamma1, gamma2 = DAMPING
        r = RATIO**-2
        theta, rate, bend = float(self.theta(t)), float(self.rate(t)), float(self.bend(t))
        zeta = float(acceleration(HEAVE, t)) / G
        w = (bend + 2.0 * gamma1 * rate) / (RATIO * n) ** 2
        d = y[0]
        pull = (1.0 + zeta) / np.cos(theta) + w * np.tan(theta)
        value = pull * np.sin(d) + w * (np.cos(d) - 1.0)
        # n^2 w does not depend on n: of the pull only heave's part is left in the derivative by n
        by_n = 2.0 * n * (1.0 + zeta) * np.sin(d) / np.cos(theta)
        by_d = n**2 * (pull * np.cos(d) - w * np.sin(d))
        forced = (1.0 - r) * bend + 2.0 * (gamma2 - r * gamma1) * rate
        out = np.empty(8)
        out[0], out[1] = y[1], forced - 2.0 * gamma2 * y[1] - n**2 * value
        for k, extra in ((2, by_n), (4, 0.0), (6, 0.0)):
            out[k], out[k + 1] = y[k + 1], -2.0 * gamma2 * y[k + 1] - by_d * y[k] - extra
        return out

    def fit(self, n: float, start: tuple[float, float]) -> tuple[float, float]:
        """n2 and its 1 sigma per radian of noise."""
        parameters = np.array([n, *start, 0.0])
        for _ in range(4):
            first = [parameters[1], parameters[2], 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]
            span = (self.time[0], self.time[-1])
            found = solve_ivp(
                self.slope, span, first, "DOP853", self.time, args=(parameters[0],), rtol=1e-9, atol=1e-12
            )
            tangents = np.stack([found.y[2], found.y[4], found.y[6], np.ones(self.time.size)], axis=-1)
            residual = self.readings - found.y[0] - parameters[3]
            parameters += np.linalg.lstsq(tangents, residual, rcond=None)[0]
        return float(parameters[0]), float(np.sqrt(np.linalg.inv(tangents.T @ tangents)[0, 0]))


def test_inversion_is_what_true_shooting_finds() -> None:
    """The same readings of the difference, the same sigma: apart by a hundredth of it."""
    seen = observe(LENGTH, STEP, heave=True)
    noisy = seen.difference + np.random.default_rng(8).normal(0.0, NOISE, seen.difference.size)
    prepared = prepare(replace(seen, difference=noisy))
    start, found = prepared.fine, invert(prepared)
    nominal = 2.0 * np.pi / PERIODS[1] * np.sqrt(G / REFERENCE)
    reach = design(start.frequency * RATIO, STEP, start.damping_rate)[0].size // 2
    rows = slice(reach, seen.time.size - reach)
    assert found.samples == seen.time[rows].size
    begin = rows.start
    rate = (seen.difference[begin + 1] - seen.difference[begin - 1]) / (2.0 * STEP)
    n, gain = Shooting(seen.time[rows], noisy[rows]).fit(nominal * (1.0 + 1e-5), (seen.difference[begin], rate))
    assert abs(found.frequency - n) < 0.01 * gain * NOISE
    assert abs(found.frequency - nominal) < 4.0 * gain * NOISE
    # the product adds the noise that its own residual shows
    assert gain * NOISE < 1.1 * found.sigma
