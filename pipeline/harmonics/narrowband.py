"""The complex form of (27) on an envelope: least squares for the frequency of the difference pendulum.

With `D exp(-i n0 t)` the envelope of the difference and X that of the first pendulum (Panteleev 1958, (27) in complex
form; non-singular where the amplitude passes through zero)

    D' = [i (n2 - n0) - gamma2] D + [i (n1 - n2) - (gamma1 - gamma2)] X + F

with X = Z1 + 3/(2 i n1) (Z1' - i n1 Z1). Its solution `D(t) = e^{mu t} [D0 + int_0^t e^{-mu s} (kappa X + F) ds]` is
fitted for D0, n2 and, where it is not known, gamma2. n1/n2 is held, because the ratio does not depend on gravity:
re-inserting the slope as a fixed-point iteration diverges at (n1-n2)/n2 = 1e-3, Gauss-Newton does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import fill

_ITERATIONS = 12
_RIDGE = 1e-13  # of the unit diagonal
_SCAN_STEP = 1.0  # rad over the record between starts that are tried


@dataclass(frozen=True)
class NarrowbandFit:
    """Result of the fit; `jacobian` has columns (Re D0, Im D0, n2, gamma2), of the complex model."""

    frequency: float
    damping_rate: float
    start: complex
    model: Complexes
    jacobian: Complexes
    residual: Complexes
    squares: float


def running_integral(values: Complexes, hop: float) -> Complexes:
    """`int_0^{t_k} f dt` from uniform values by the fourth-order rule h/24 (-1, 13, 13, -1)."""
    if values.size < 4:
        inner = 0.5 * (values[1:] + values[:-1])
    else:
        inner = np.empty(values.size - 1, dtype=values.dtype)
        inner[1:-1] = (13.0 * (values[1:-2] + values[2:-1]) - values[:-3] - values[3:]) / 24.0
        inner[0] = (9.0 * values[0] + 19.0 * values[1] - 5.0 * values[2] + values[3]) / 24.0
        inner[-1] = (9.0 * values[-1] + 19.0 * values[-2] - 5.0 * values[-3] + values[-4]) / 24.0
    total = np.zeros(values.size, dtype=values.dtype)
    np.cumsum(inner, out=total[1:])
    return hop * total


def phase_slope(time: Floats, envelope: Complexes, weight: Floats) -> tuple[float, Floats]:
    """Weighted regression of the unwrapped phase: slope (rad s-1), and the phase (NaN where missing)."""
    present = np.isfinite(envelope) & (weight > 0.0)
    phase = np.full(envelope.size, np.nan)
    phase[present] = np.unwrap(np.angle(envelope[present]))
    return regression(time[present], phase[present], weight[present] * np.abs(envelope[present]) ** 2), phase


def regression(time: Floats, values: Floats, weight: Floats) -> float:
    """Slope of the weighted straight line."""
    centre = np.average(time, weights=weight)
    return float(np.sum(weight * (time - centre) * values) / np.sum(weight * (time - centre) ** 2))


def fit_narrowband(
    time: Floats,
    difference: Complexes,
    first: Complexes,
    first_speed: Complexes,
    weight: Floats,
    *,
    carrier: float,
    ratio: float,
    damping_rate: float | None,
    damping_difference: float,
    forcing: Complexes | None = None,
    tolerance: float = 1e-13,
) -> NarrowbandFit:
    """Fit the complex form of (27).

    Parameters
    ----------
    time : (k,) array
        Uniform instants, s.
    difference, first, first_speed : (k,) complex arrays
        Envelopes of the difference and of the first pendulum relative to the carrier, rad, and the derivative
        of the latter, rad s-1; NaN in the difference = missing.
    weight : (k,) array
        Weight of each instant (0 = missing).
    carrier : float
        n0, rad s-1.
    ratio : float
        n1/n2.
    damping_rate : float or None
        gamma2, s-1; None = fitted.
    damping_difference : float
        gamma1 - gamma2, s-1.
    forcing : (k,) complex array, optional
        F, a further known input (finite arc), rad s-1.
    tolerance : float
        Relative step of the frequency at which the iteration stops.
    """
    present = np.isfinite(difference) & (weight > 0.0)
    root = np.sqrt(np.where(present, weight, 0.0))
    data = np.where(present, difference, 0.0)
    first, first_speed = fill(first), fill(first_speed)
    elapsed = time - time[0]
    hop = float(elapsed[1])
    known = 0.0 if forcing is None else fill(forcing)
    gamma = 0.0 if damping_rate is None else damping_rate
    free = 4 if damping_rate is None else 3

    def drive(frequency: float) -> Complexes:
        """Z1 + Xi, where Xi = 3/(2 i n1) (Z1' - i n1 Z1): both sides are analytic signals."""
        own = ratio * frequency
        return first * (1.0 + 1.5 * (carrier - own) / own) - 1.5j / own * first_speed

    def model(frequency: float, gamma: float) -> tuple[Complexes, Complexes]:
        """Decaying carrier, and the response to the drive that starts at zero."""
        mu = 1j * (frequency - carrier) - gamma
        kappa = 1j * frequency * (ratio - 1.0) - damping_difference
        growth = np.exp(mu * elapsed)
        return growth, growth * running_integral((kappa * drive(frequency) + known) / growth, hop)

    def best_start(frequency: float, gamma: float) -> tuple[complex, float, Complexes, Complexes]:
        growth, response = model(frequency, gamma)
        wanted = root * (data - response)
        column = root * growth
        start = complex(np.vdot(column, wanted) / np.vdot(column, column).real)
        misfit = wanted - start * column
        return start, float(np.vdot(misfit, misfit).real), growth, response

    slope, _ = phase_slope(time, np.where(present, difference, np.nan), weight)
    frequency = carrier + slope
    span = 2.0 * abs(frequency * (ratio - 1.0)) * float(elapsed[-1])
    if span > _SCAN_STEP:  # the correction may hide whole turns of phase: try every start
        steps = int(np.ceil(span / _SCAN_STEP))
        trials = frequency + np.arange(-steps, steps + 1) * (_SCAN_STEP / float(elapsed[-1]))
        frequency = float(trials[np.argmin([best_start(trial, gamma)[1] for trial in trials])])

    start, squares, growth, response = best_start(frequency, gamma)
    for _ in range(_ITERATIONS):
        swing = start * growth + response
        by_frequency = growth * running_integral((1j * swing + 1j * (ratio - 1.0) * first) / growth, hop)
        by_damping = -growth * running_integral(swing / growth, hop)
        jacobian = np.stack([growth, 1j * growth, by_frequency, by_damping], axis=1)
        residual = root * (data - swing)
        columns = root[:, None] * jacobian[:, :free]
        normal = (columns.conj().T @ columns).real
        scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        ridge = _RIDGE * np.eye(free)
        right = (columns.conj().T @ residual).real * scale
        update = scale * np.linalg.solve(normal * scale[:, None] * scale + ridge, right)
        trial_frequency = frequency + update[2]
        trial_gamma = gamma + (update[3] if free == 4 else 0.0)
        start, trial_squares, growth, response = best_start(trial_frequency, trial_gamma)
        done = abs(update[2]) < tolerance * carrier
        frequency, gamma, squares = trial_frequency, trial_gamma, trial_squares
        if done:
            break
    swing = start * growth + response
    return NarrowbandFit(
        frequency=frequency,
        damping_rate=gamma,
        start=start,
        model=swing,
        jacobian=jacobian[:, :free],
        residual=np.where(present, difference - swing, np.nan),
        squares=squares,
    )
