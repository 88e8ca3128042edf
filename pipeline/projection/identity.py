"""Least squares on the linear identity: one recursion over the samples gives the model and its derivatives.

The difference is a free swing beside the response to the recorded first pendulum,

    d(t) = Re[s exp(lam t)] + (1-r) theta1 + Im[gain c(t)] + offset,   c(t) = int_0^t exp(lam (t-u)) theta1(u) du,

lam = -gamma2 + i w, w^2 = n2^2 - gamma2^2 (the two integrals of the formula sheet's W1, W2 by parts, section 1.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Complexes, Floats
from pipeline.projection.taps import BEFORE, NODES, padded, stencil, taps
from synth.kernels.compiled import kernel, summing_kernel

BLOCK = 256  # samples whose derivatives are multiplied at once
PARAMETERS = 5  # two of the start, n2, gamma2, offset; the residual follows them
OUTLIER = 7.0  # sigmas
_RIDGE = 1e-14  # of the unit diagonal: keeps a column that vanishes from stopping the solution
_FLOOR = 1e-4  # of the amplitude: what departs less may be the quadrature at the ends
ITERATIONS = 12
_SETTLED = 1e-7  # of amplitude and phase at the record's end: what is left after such a step is of its square


@dataclass(frozen=True)
class Step:
    """Change of the five parameters, 1-sigma residual (rad), covariance (5, 5) per variance of white noise."""

    change: Floats
    noise: float
    covariance: Floats


@summing_kernel
def add_gram(rows: Floats, count: int, gram: Floats) -> None:
    """Add products of six rows, the first `count` of each, to the lower half of their Gram matrix (6, 6)."""
    for i in range(6):
        for j in range(i + 1):
            one, other, total = rows[i], rows[j], 0.0
            for m in range(count):
                total += one[m] * other[m]
            gram[i, j] += total


def free_parameters(fit_damping: bool) -> list[int]:
    """Numbers of the parameters that are fitted."""
    return [0, 1, 2, 3, 4] if fit_damping else [0, 1, 2, 4]


def solve(gram: Floats, free: list[int]) -> Step:
    """Least squares that a Gram matrix stands for, in scaled columns.

    Parameters
    ----------
    gram : (6, 6) array
        Of the derivatives by (start, start, n2, gamma2, offset) and the residual, lower half; [4, 4] is the number of
        samples.
    free : list of int
        Parameters that are fitted; the others do not change.

    Raises
    ------
    RefusedError
        Too few samples, or samples that are no numbers.
    """
    samples = gram[4, 4]
    if not np.all(np.isfinite(gram)) or samples < 2 * len(free):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    whole = np.tril(gram) + np.tril(gram, -1).T
    chosen = whole[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(chosen), 1e-300))
    inverse = np.linalg.inv(chosen * scale[:, None] * scale + _RIDGE * np.eye(len(free))) * scale[:, None] * scale
    right = whole[free, PARAMETERS]
    solution = inverse @ right
    change, covariance = np.zeros(PARAMETERS), np.zeros((PARAMETERS, PARAMETERS))
    change[free], covariance[np.ix_(free, free)] = solution, inverse
    squares = max(float(gram[PARAMETERS, PARAMETERS] - right @ solution), 0.0)
    return Step(change, float(np.sqrt(squares / max(samples - len(free), 1.0))), covariance)


def require_swing_near(frequency: float, damping_rate: float) -> None:
    """Refuse parameters that the iteration has lost."""
    if not np.isfinite(frequency) or abs(damping_rate) > 0.1 * frequency:
        raise RefusedError("difference: no swing near the nominal period; check instrument/period and the traces")


def refuse_outliers(residual: Floats, noise: float, amplitude: float) -> None:
    """Refuse a residual with an outlier, such as neighbours do not show near a record's ends.

    Parameters
    ----------
    residual : (n,) array
        rad.
    noise, amplitude : float
        Its 1 sigma, and the swing's amplitude, rad.
    """
    limit = max(OUTLIER * noise, _FLOOR * amplitude)
    if np.abs(residual).max() > limit:
        raise RefusedError("record/elongation: the difference has outliers; use --method joint")


@dataclass(frozen=True)
class LinearFit:
    """Least squares for (start, n2, gamma2, offset).

    Attributes
    ----------
    frequency, damping_rate : float
        n2, rad s-1, and gamma2, s-1.
    start : complex
        s, rad, at the first sample.
    offset, noise : float
        Zero line and 1-sigma residual, rad.
    noise_gain : float
        1-sigma of n2 per radian of white noise in the difference, s-1.
    residual : (n,) array
        rad.
    """

    frequency: float
    damping_rate: float
    start: complex
    offset: float
    noise: float
    noise_gain: float
    residual: Floats


Constants = tuple[complex, complex, complex, complex, complex]


def response_constants(frequency: float, gamma: float, ratio: float, damping_difference: float) -> Constants:
    """Eigenvalue lam, direct gain 1-r, gain of c, and the gain's derivatives by w and gamma2.

    gain = [(1-r) lam^2 + 2 (gamma2 - r gamma1) lam] / w, r = (n2/n1)^2 = 1/ratio^2.
    """
    r = ratio**-2
    oscillation = np.sqrt(frequency**2 - gamma**2)
    eigenvalue = complex(-gamma, oscillation)
    drag = 2.0 * (gamma * (1.0 - r) - r * damping_difference)
    gain = ((1.0 - r) * eigenvalue**2 + drag * eigenvalue) / oscillation
    # d/dw of gain at fixed gamma: d lam = i dw
    slope = (2.0j * (1.0 - r) * eigenvalue + 1j * drag) / oscillation - gain / oscillation
    return eigenvalue, 1.0 - r, gain, slope, -drag / oscillation


@kernel
def add_products(
    theta: Floats,
    difference: Floats,
    weights: Complexes,
    step: float,
    start: complex,
    offset: float,
    constants: Constants,
    residual: Floats,
    gram: Floats,
) -> None:
    """Residual (n,), and the lower half of the Gram matrix of `solve`, added to what is there.

    `theta` (n + 7,) is padded as by `taps.padded`, `weights` (8,) are those of an interval.
    """
    eigenvalue, direct, gain, by_frequency, by_damping = constants
    turn = np.exp(eigenvalue * step)
    c, age, free = 0.0j, 0.0j, complex(1.0)  # c, dc/dlam and exp(lam t)
    rows = np.ones((6, BLOCK))  # derivatives by Re s, Im s, n2, gamma2 and offset, which stays 1, and the residual
    for k in range(difference.size):
        m, time, swing = k % BLOCK, k * step, start * free
        rows[0, m], rows[1, m] = free.real, -free.imag
        rows[2, m] = (by_frequency * c).imag + (gain * age).real - time * swing.imag
        rows[3, m] = (by_damping * c - gain * age).imag - time * swing.real
        rows[5, m] = difference[k] - direct.real * theta[k + BEFORE] - (gain * c).imag - swing.real - offset
        residual[k] = rows[5, m]
        if m == BLOCK - 1 or k == difference.size - 1:
            add_gram(rows, m + 1, gram)
        real = imag = 0.0
        for j in range(NODES):
            real += weights[j].real * theta[k + j]
            imag += weights[j].imag * theta[k + j]
        integral = complex(real, imag)
        # an interval's content is on average half a step old at its end
        age = turn * (age + step * c) + 0.5 * step * integral
        c = turn * c + integral
        free *= turn


@dataclass(frozen=True)
class LinearIdentity:
    """A record as the identity sees it; all samples are there.

    Attributes
    ----------
    theta, difference : (n,) arrays
        First pendulum and difference, rad.
    step : float
        s.
    nominal : float
        n2 about which the quadrature is exact, rad s-1.
    ratio, damping_difference : float
        n1/n2; gamma1 - gamma2, s-1.
    """

    theta: Floats
    difference: Floats
    step: float
    nominal: float
    ratio: float
    damping_difference: float

    def sweep(self, frequency: float, gamma: float, start: complex, offset: float, residual: Floats) -> Floats:
        """Residual (n,) at some parameters, and the Gram matrix (6, 6) of `solve`."""
        constants = response_constants(frequency, gamma, self.ratio, self.damping_difference)
        weights = taps(stencil(self.nominal, self.step), constants[0], self.step)
        theta, gram = padded(self.theta, self.nominal, self.step), np.zeros((6, 6))
        add_products(theta, self.difference, weights, self.step, complex(start), offset, constants, residual, gram)
        return gram

    def fit(
        self, frequency: float, gamma: float, start: complex, fit_damping: bool, rounds: int = ITERATIONS
    ) -> LinearFit:
        """Fit by Gauss-Newton; one round is enough for a start of the nonlinear identity.

        Parameters
        ----------
        frequency, gamma, start
            Where to begin, within a fraction of a turn over the record; gamma2 is held unless `fit_damping`.

        Raises
        ------
        RefusedError
            No swing at the nominal period, or an outlier.
        """
        residual, offset = np.empty(self.theta.size), 0.0
        free, length = free_parameters(fit_damping), self.step * self.theta.size
        for _ in range(rounds):
            found = solve(self.sweep(frequency, gamma, start, offset, residual), free)
            real, imaginary, turned, decayed, moved = found.change
            size = abs(start)
            frequency, gamma, offset = frequency + turned, gamma + decayed, offset + moved
            start += complex(real, imaginary)
            require_swing_near(frequency, gamma)
            if max(np.hypot(real, imaginary) / size, abs(turned) * length, abs(decayed) * length) < _SETTLED:
                refuse_outliers(residual, found.noise, abs(start))
                break
        return LinearFit(
            frequency=float(frequency),
            damping_rate=float(gamma),
            start=start,
            offset=float(offset),
            noise=found.noise,
            noise_gain=float(np.sqrt(found.covariance[2, 2])),
            residual=residual,
        )
