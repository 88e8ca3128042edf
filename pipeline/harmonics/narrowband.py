"""The complex form of (27) on an envelope: least squares for the frequency of the difference pendulum.

With `D exp(-i n0 t)` the envelope of the difference and X that of the first pendulum (Panteleev 1958, (27) in complex
form; non-singular where the amplitude passes through zero)

    D' = [i (n2 - n0) - gamma2] D + [i (n1 - n2) - (gamma1 - gamma2)] X + F

with X = Z1 + 3/(2 i n1) (Z1' - (i n1 - gamma1) Z1). Its solution
`D(t) = e^{mu t} [D0 + int_0^t e^{-mu s} (kappa X + F) ds]` is fitted for D0, n2 and, where it is not known, gamma2.
n1/n2 is held, because the ratio does not depend on gravity: re-inserting the slope as a fixed-point iteration
diverges at (n1-n2)/n2 = 1e-3, Gauss-Newton does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics import narrowband_kernels as kernels
from pipeline.harmonics.envelope import fill

_SCAN_STEP = 1.0  # rad over the record between starts that are tried
_SCAN_FROM = 4.0  # rad over the record that the correction may reach before more than one start is tried


@dataclass(frozen=True)
class NarrowbandFit:
    """Result of the fit.

    `jacobian` (4, k) is that of the complex model by (Re D0, Im D0, n2, gamma2); its weighted products with a residual
    change n2 by `influence` (4,). `slope` is that of the phase before any correction, less the carrier, rad s-1.
    """

    frequency: float
    slope: float
    damping_rate: float
    start: complex
    model: Complexes
    jacobian: Complexes
    influence: Floats
    squares: float


def running_integral(values: Complexes, hop: float) -> Complexes:
    """`int_0^{t_k} f dt` from uniform values by the fourth-order rule hop/24 (-1, 13, 13, -1)."""
    out = np.empty(values.size, dtype=np.complex128)
    kernels.running_integral(np.asarray(values, dtype=np.complex128), hop, out)
    return out


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
    weight = np.where(np.isfinite(difference), weight, 0.0)
    data = np.where(weight > 0.0, difference, 0.0)
    first, first_speed = fill(first), fill(first_speed)
    known = np.zeros(time.size, dtype=np.complex128) if forcing is None else fill(forcing)
    hop, length = float(time[1] - time[0]), float(time[-1] - time[0])
    constants = (carrier, ratio, damping_difference)
    series = (data, weight, first, first_speed, known, hop, constants)
    model = np.empty(time.size, dtype=np.complex128)
    jacobian = np.empty((4, time.size), dtype=np.complex128)
    inverse = np.empty((4, 4))
    gamma = 0.0 if damping_rate is None else damping_rate
    slope = float(kernels.phase_slope(time, data, weight))
    frequency = carrier + slope
    span = 2.0 * abs(frequency * (ratio - 1.0)) * length
    if span > _SCAN_FROM:  # the correction may hide whole turns of phase: try every start
        steps = int(np.ceil(span / _SCAN_STEP))
        trials = frequency + np.arange(-steps, steps + 1) * (_SCAN_STEP / length)
        spare = model, jacobian, inverse, np.empty(4)
        frequency = float(trials[np.argmin([kernels.sweep(*series, trial, gamma, *spare)[1] for trial in trials])])
    free = 4 if damping_rate is None else 3
    frequency, gamma, start, squares = kernels.descend(
        *series, frequency, gamma, free, tolerance * carrier, model, jacobian, inverse
    )
    return NarrowbandFit(
        frequency=frequency,
        slope=slope,
        damping_rate=gamma,
        start=start,
        model=model,
        jacobian=jacobian,
        influence=inverse[2],
        squares=squares,
    )
