"""The complex form of (27) on an envelope: least squares for the frequency of the difference pendulum.

With `D exp(-i n0 t)` the envelope of the difference and X that of the first pendulum (Panteleev 1958, (27) in complex
form; non-singular where the amplitude passes through zero)

    D' = [i (n2 - n0) - gamma2] D + [i (n1 - n2) - (gamma1 - gamma2)] X

with X = Z1 + 3/(2 i n1) (Z1' - (i n1 - gamma1) Z1). Its solution
`D(t) = e^{mu t} [D0 + int_0^t e^{-mu s} kappa X ds]` is fitted for D0, n2 and, where it is not known, gamma2.
n1/n2 is held, because the ratio does not depend on gravity: re-inserting the slope as a fixed-point iteration
diverges at (n1-n2)/n2 = 1e-3, Gauss-Newton does not.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, fill

ITERATIONS = 12
SETTLED = 1e-13  # relative step of the frequency
_SCAN_STEP = 1.0  # rad over the record between starts that are tried
_SCAN_FROM = 4.0  # rad over the record that the correction may reach before more than one start is tried
_SCAN_WHOLE, _PART, _AGAIN = 64.0, 4, 8.0  # rad at most at once; of it, where it is more; rad about what a part gave


@dataclass(frozen=True)
class NarrowbandFit:
    """Result of the fit.

    `jacobian` (3 or 4, k) is that of the complex model by (Re D0, Im D0, n2, gamma2 where it is fitted); its weighted
    products with a residual change n2 by `influence`. `slope` is that of the phase before any correction, less the
    carrier, rad s-1.
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


def fit_narrowband(
    envelope: Envelope, ratio: float, damping_difference: float, damping_rate: float | None
) -> NarrowbandFit:
    """Fit the complex form of (27); gaps of the input are interpolated, those of the difference have no weight.

    `ratio` is n1/n2, `damping_difference` gamma1 - gamma2, `damping_rate` gamma2, s-1; None = fitted.
    """
    time, hop, carrier = envelope.time - envelope.time[0], envelope.hop, envelope.carrier
    weight = np.where(np.isfinite(envelope.difference), envelope.coverage, 0.0)
    difference = np.where(weight > 0.0, envelope.difference, 0.0)
    first, first_speed = fill(envelope.first), fill(envelope.first_speed)

    def modelled(frequency: float, gamma: float, count: int = time.size) -> tuple[Complexes, Complexes]:
        """The model of the first instants from the best start D0, and growth `e^{mu t}`, (count,) each."""
        decay = gamma + damping_difference
        own = np.sqrt(ratio**2 * (frequency**2 + gamma**2) - decay**2)  # damped frequency of the first pendulum
        kappa = complex(-damping_difference, own - frequency)
        # X = Z1 + Xi, where Xi = 3/(2 i w1) (Z1' - (i w1 - gamma1) Z1) vanishes for a free swing; both analytic signals
        by_first = kappa * (1.0 + 1.5 * complex(carrier - own, -decay) / own)
        drive = by_first * first[:count] + kappa * (-1.5j / own) * first_speed[:count]
        growth = np.exp(complex(-gamma, frequency - carrier) * time[:count])
        response = growth * running_integral(drive / growth, hop)
        conjugate = weight[:count] * np.conj(growth)
        start = complex((conjugate @ (difference[:count] - response)) / (conjugate @ growth).real)
        return start * growth + response, growth

    def squares(model: Complexes) -> float:
        return float(weight[: model.size] @ np.abs(difference[: model.size] - model) ** 2)

    gamma, length = 0.0 if damping_rate is None else damping_rate, float(time[-1])
    slope = phase_slope(envelope.time, difference, weight)
    frequency = carrier + slope
    span = 2.0 * abs(frequency * (ratio - 1.0)) * length
    if span > _SCAN_FROM:  # the correction may hide whole turns of phase: try every start, of a part first
        parts = [time.size]
        while span > _SCAN_WHOLE:
            parts.append(parts[-1] // _PART)
            span /= _PART
        for count in reversed(parts):
            if count < time.size and np.mean(weight[:count] > 0.0) < 0.5:  # mostly missing: a longer part
                span *= _PART
                continue
            steps, step = int(np.ceil(span / _SCAN_STEP)), _SCAN_STEP / float(time[count - 1])
            trials = frequency + step * np.arange(-steps, steps + 1)
            frequency = float(min(trials, key=lambda trial: squares(modelled(trial, gamma, count)[0])))
            span = _AGAIN
    forced = (ratio - 1.0) * first  # X leaves it as w1 and gamma1 leave the first pendulum's swing
    for _ in range(ITERATIONS):
        model, growth = modelled(frequency, gamma)
        sources = [1j * (model - 0.5 * forced)] + [1.5 * forced - model] * (damping_rate is None)
        columns = [growth * running_integral(each / growth, hop) for each in sources]
        jacobian = np.stack([growth, 1j * growth, *columns])
        weighted = np.conj(jacobian) * weight
        inverse = scaled_inverse((weighted @ jacobian.T).real)
        change = inverse @ (weighted @ (difference - model)).real
        if abs(change[2]) < SETTLED * carrier:
            break
        frequency, gamma = frequency + float(change[2]), gamma + float(change[3:].sum())
    return NarrowbandFit(frequency, slope, gamma, model, jacobian, influence=inverse[2], squares=squares(model))


@dataclass(frozen=True)
class Budget:
    """Sensitivities of the frequency of the difference pendulum, all linear."""

    noise_difference: float  # 1 sigma of the frequency, rad s-1, per radian of white reading noise in the series
    noise_theta: float
    by_ratio: float  # d n2 / d (n1/n2), rad s-1
    by_gain: float  # d n2 / d ln(gain of the first pendulum's trace), rad s-1
    by_damping: float  # d n2 / d (gamma1 - gamma2)
    influence: Complexes  # (k,) g of `d n2 = Re sum conj(g) dD` over the envelope's instants, s-1


def budget(envelope: Envelope, fit: NarrowbandFit, ratio: float, damping_difference: float) -> Budget:
    """Propagate noise, ratio and gain through the least-squares fit of the complex form.

    Noise of the first pendulum enters through the running integral, hence by the adjoint: the influence of one instant
    of it is the tail sum of the influences of all later instants of the difference.
    """
    weight = np.where(np.isfinite(envelope.difference), envelope.coverage, 0.0)
    influence: Complexes = weight * (fit.influence @ fit.jacobian)
    growth = fit.jacobian[0]
    kappa = 1j * fit.frequency * (ratio - 1.0) - damping_difference
    tail = np.cumsum((np.conj(influence) * growth)[::-1]) / growth[::-1]
    # what the first pendulum's envelope does to the difference
    response = np.conj(influence) @ (growth * running_integral(fill(envelope.first) / growth, envelope.hop))
    samples_theta, samples_difference = envelope.samples
    spread = np.abs(influence[weight > 0.0]) ** 2 / weight[weight > 0.0]
    return Budget(
        noise_difference=float(np.sqrt(2.0 / samples_difference * np.sum(spread))),
        noise_theta=abs(kappa) * envelope.hop * float(np.sqrt(2.0 / samples_theta * np.sum(np.abs(tail) ** 2))),
        by_ratio=-float((1j * fit.frequency * response).real),
        by_gain=-float((kappa * response).real),
        by_damping=float(response.real),
        influence=influence,
    )
