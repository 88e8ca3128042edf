"""The complex form of (27) on an envelope: least squares for the frequency of the difference pendulum.

With `D exp(-i n0 t)` the envelope of the difference and X that of the first pendulum (Panteleev 1958, (27) in complex
form; non-singular where the amplitude passes through zero)

    D' = [i (n2 - n0) - gamma2] D + [i (n1 - n2) - (gamma1 - gamma2)] X

with X = Z1 + 3/(2 i n1) (Z1' - (i n1 - gamma1) Z1). Its solution
`D(t) = e^{mu t} [D0 + int_0^t e^{-mu s} kappa X ds]` is fitted for D0, n2 and, where it is not known, gamma2.
n1/n2 is held, because the ratio does not depend on gravity: re-inserting the slope as a fixed-point iteration
diverges at (n1-n2)/n2 = 1e-3, Gauss-Newton does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, fill

ITERATIONS = 12
SETTLED = 1e-13  # relative step of the frequency
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
    model: Complexes
    jacobian: Complexes
    influence: Floats
    squares: float


def running_integral(values: Complexes, hop: float) -> Complexes:
    """`int_0^{t_k} f dt` from uniform values by the fourth-order rule hop/24 (-1, 13, 13, -1)."""
    v = np.asarray(values, dtype=np.complex128)
    out = np.zeros(v.size, dtype=np.complex128)
    if v.size < 4:
        np.cumsum(0.5 * hop * (v[:-1] + v[1:]), out=out[1:])
        return out
    steps = out[1:]
    steps[1:-1] = 13.0 * (v[1:-2] + v[2:-1]) - v[:-3] - v[3:]
    steps[0] = 9.0 * v[0] + 19.0 * v[1] - 5.0 * v[2] + v[3]
    steps[-1] = 9.0 * v[-1] + 19.0 * v[-2] - 5.0 * v[-3] + v[-4]
    np.cumsum(hop / 24.0 * steps, out=steps)
    return out


def scaled_inverse(gram: Floats) -> Floats:
    """Inverse of a Gram matrix in columns of unit length; a column without information is left out."""
    size = np.sqrt(np.outer(gram.diagonal(), gram.diagonal()))
    return np.asarray(np.linalg.pinv(gram / size, rcond=1e-14, hermitian=True) / size)


def regression(time: Floats, values: Floats, weight: Floats) -> float:
    """Slope of the weighted straight line."""
    centre = np.average(time, weights=weight)
    return float(np.sum(weight * (time - centre) * values) / np.sum(weight * (time - centre) ** 2))


def phase_slope(time: Floats, envelope: Complexes, weight: Floats) -> float:
    """Regression of the unwrapped phase with weights times |envelope|^2; an instant without weight is not looked at."""
    used = weight > 0.0
    chosen = envelope[used]
    return regression(time[used], np.unwrap(np.angle(chosen)), weight[used] * np.abs(chosen) ** 2)


@dataclass(frozen=True)
class ComplexForm:
    """What is held while the complex form is fitted."""

    time: Floats  # (k,) uniform instants, s
    difference: Complexes  # (k,) envelope relative to the carrier, rad; anything finite where it has no weight
    first: Complexes  # (k,) the same of the first pendulum, without gaps
    first_speed: Complexes  # (k,) its derivative, rad s-1
    weight: Floats  # (k,) of the instants, 0 where missing
    carrier: float  # n0, rad s-1
    ratio: float  # n1/n2
    damping_difference: float  # gamma1 - gamma2, s-1

    def model(self, frequency: float, gamma: float) -> tuple[Complexes, Complexes]:
        """The model (k,) of a trial (n2, gamma2) from the best start D0, and growth `e^{mu t}` (k,)."""
        time, hop = self.time - self.time[0], float(self.time[1] - self.time[0])
        decay = gamma + self.damping_difference
        # damped frequency of the first pendulum
        own = np.sqrt(self.ratio**2 * (frequency**2 + gamma**2) - decay**2)
        mu = complex(-gamma, frequency - self.carrier)
        kappa = complex(-self.damping_difference, own - frequency)
        # X = Z1 + Xi, where Xi = 3/(2 i w1) (Z1' - (i w1 - gamma1) Z1) vanishes for a free swing; both analytic signals
        by_first = kappa * (1.0 + 1.5 * complex(self.carrier - own, -decay) / own)
        drive = by_first * self.first + kappa * (-1.5j / own) * self.first_speed
        growth = np.exp(mu * time)
        response = growth * running_integral(drive / growth, hop)
        conjugate = self.weight * np.conj(growth)
        start = complex((conjugate @ (self.difference - response)) / (conjugate @ growth).real)
        return start * growth + response, growth

    def squares(self, model: Complexes) -> float:
        """Weighted sum of squares of what a model leaves."""
        return float(self.weight @ np.abs(self.difference - model) ** 2)

    def jacobian(self, model: Complexes, growth: Complexes) -> Complexes:
        """Derivatives of the model by (Re D0, Im D0, n2, gamma2), (4, k), unweighted."""
        hop = float(self.time[1] - self.time[0])
        forced = (self.ratio - 1.0) * self.first  # X leaves it as w1 and gamma1 leave the first pendulum's swing
        sources = 1j * (model - 0.5 * forced), 1.5 * forced - model
        by_frequency, by_damping = (growth * running_integral(each / growth, hop) for each in sources)
        return np.stack([growth, 1j * growth, by_frequency, by_damping])


def complex_form(envelope: Envelope, ratio: float, damping_difference: float) -> ComplexForm:
    """The complex form on an envelope; gaps of the input are bridged, those of the difference have no weight."""
    weight = np.where(np.isfinite(envelope.difference), envelope.coverage, 0.0)
    difference = np.where(weight > 0.0, envelope.difference, 0.0)
    inputs = fill(envelope.first), fill(envelope.first_speed)
    return ComplexForm(envelope.time, difference, *inputs, weight, envelope.carrier, ratio, damping_difference)


def fit_narrowband(form: ComplexForm, damping_rate: float | None) -> NarrowbandFit:
    """Fit the complex form of (27).

    Parameters
    ----------
    damping_rate : float or None
        gamma2, s-1; None = fitted.
    """
    time, weight = form.time, form.weight
    gamma = 0.0 if damping_rate is None else damping_rate
    slope, length = phase_slope(time, form.difference, weight), float(time[-1] - time[0])
    frequency = form.carrier + slope
    span = 2.0 * abs(frequency * (form.ratio - 1.0)) * length
    if span > _SCAN_FROM:  # the correction may hide whole turns of phase: try every start
        steps = int(np.ceil(span / _SCAN_STEP))
        trials = frequency + np.arange(-steps, steps + 1) * (_SCAN_STEP / length)
        frequency = float(min(trials, key=lambda trial: form.squares(form.model(trial, gamma)[0])))
    free = 4 if damping_rate is None else 3
    inverse = np.zeros((4, 4))
    for _ in range(ITERATIONS):
        model, growth = form.model(frequency, gamma)
        jacobian = form.jacobian(model, growth)
        weighted = np.conj(jacobian[:free]) * weight
        normal = (weighted @ jacobian[:free].T).real
        inverse[:free, :free] = scaled_inverse(normal)
        change = inverse[:, :free] @ (weighted @ (form.difference - model)).real
        if abs(change[2]) < SETTLED * form.carrier:
            break
        frequency, gamma = frequency + float(change[2]), gamma + float(change[3])
    return NarrowbandFit(frequency, slope, gamma, model, jacobian, influence=inverse[2], squares=form.squares(model))
