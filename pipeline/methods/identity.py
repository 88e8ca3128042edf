"""The exact identities of clean uniform records: the difference pendulum driven by the recorded first pendulum.

    d'' + 2 gamma2 d' + n2^2 F(d) = (1-r) theta1'' + 2 (gamma2 - r gamma1) theta1',   r = (n2/n1)^2

The unknown acceleration of the support is eliminated between the two equations of motion (formula sheet, section 1.1),
nothing is neglected, and the slow motion need not be separated. Linear pendulums have F = d, real ones

    F = (1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d),   w = (theta1'' + 2 gamma1 theta1')/n1^2

Least squares on it: Newton's method, one banded triangular system a round; sums where it is linear. The right-hand side
`N(d) = h^2 d - n2^2 F(d)` is expanded about an angle of the difference: at first the MEASURED one, later the model's.
Expanded about the measured one the start is good to 1e-3 even in heavy motion, where iterating about a linear model
diverges.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.narrowband import scaled_inverse
from pipeline.observation import Observation

NODES = 8
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(16)  # on an interval: exact to rounding below Nyquist
_CUTOFF = 1e-14  # of the largest: what fast sampling leaves of the functions' differences below it is rounding
ITERATIONS = 12
SETTLED = 1e-5  # rad at the record's end: what is left after such a step is a thousandth of it at most
OUTLIER = 7.0  # sigmas
FLOOR = 1e-4  # of the amplitude: what departs less may be the quadrature at the ends


def basis(z: Floats, angle: float, count: int = NODES) -> Floats:
    """The first of eight functions at positions `z` (steps), (count, len(z)); `angle` is that of a step, rad."""
    x, cos, sin = z / (0.5 * NODES), np.cos(angle * z), np.sin(angle * z)
    return np.stack([cos, sin, np.ones_like(x), x, x * cos, x * sin, x**2, x**3][:count])


def cardinal(points: Floats, angle: float, count: int = NODES) -> Floats:
    """What each of `count` nodes about zero contributes at positions in steps, (count, len(points)).

    With fast sampling the functions are nearly dependent: of all weights that are right for them the smallest are
    taken.
    """
    nodes = np.arange(count) - 0.5 * (count - 1)
    return np.linalg.lstsq(basis(nodes, angle, count), basis(points, angle, count), rcond=_CUTOFF)[0]


def taps(eigenvalue: complex, frequency: float, step: float, count: int = NODES) -> Complexes:
    """Weights (count,) of `int_0^step exp(lam (step - x)) f dx` amid `count` samples, fitted at `frequency`."""
    turned = 0.5 * step * _GAUSS_WEIGHTS * np.exp(0.5 * eigenvalue * step * (1.0 - _GAUSS))
    return np.asarray(cardinal(0.5 * _GAUSS, frequency * step, count) @ turned)


@lru_cache(maxsize=16)
def _onward(angle: float) -> Floats:
    """Weights (8, 3) of the last eight samples in the three that follow."""
    return cardinal(np.arange(3.0) + 0.5 * (NODES + 1), angle)


def padded(series: Floats, frequency: float, step: float) -> Floats:
    """A series continued by three samples on either side by the same functions, for the intervals at its ends."""
    onward = _onward(frequency * step)
    return np.concatenate([(series[NODES - 1 :: -1] @ onward)[::-1], series, series[-NODES:] @ onward])


class Weights(NamedTuple):
    """Both sides of an identity at a sample, from it and its neighbours.

    `swing` (3,) is of z, `source` (9,) of the right-hand side f, `near` (3,) the same from three samples alone;
    `driven` (9,) and `direct` are those of the first pendulum: z = d - direct theta1 has no derivative on the right.
    """

    swing: Floats
    source: Floats
    near: Floats
    driven: Floats
    direct: float

    def system(self, stiffness: Floats | float) -> Floats:
        """Lower band matrix (3, n) of the identity whose right-hand side changes with the angle by `stiffness`."""
        return np.asarray(self.swing[::-1] - self.near[::-1] * np.asarray(stiffness)[..., None]).T


@dataclass(frozen=True)
class Fit:
    """Least squares for the start, n2, gamma2 and the zero line."""

    frequency: float  # n2 at infinitesimal arc, rad s-1
    damping_rate: float  # gamma2, s-1
    noise: float  # 1-sigma residual, rad
    model: Floats  # (n,) of the difference, rad
    residual: Floats  # (n,) rad
    influence: Floats  # (n,) d n2 / d (sample of the difference), s-1
    stiffness: Floats | float  # (n,) dN/dd, s-2
    weights: Weights

    @property
    def adjoint(self) -> Floats:
        """d n2 by what is added to the model's right-hand side at a sample, (n,)."""
        from scipy.linalg.lapack import dtbtrs

        return np.asarray(dtbtrs(self.weights.system(self.stiffness), self.influence, uplo="L", trans="T")[0])


@dataclass(frozen=True)
class Identity:
    """A record as the identity of linear pendulums sees it; all samples are there."""

    observation: Observation
    held: float  # h, rad s-1: near n2, or in wide arcs near the frequency that the difference shows
    inside: slice  # samples that are fitted

    def expand(self, angle: Floats, frequency: float) -> tuple[Floats, Floats | float, Floats]:
        """N(d), s-2 rad, and its derivatives by d (a number where it is the same at all samples) and by n2."""
        softer = self.held**2 - frequency**2
        return softer * angle, softer, -2.0 * frequency * angle

    def source(self, by: Weights, series: Floats) -> Floats:
        """What a right-hand side adds at each sample but the first two, (n - 2,)."""
        return np.correlate(padded(series, self.held, self.observation.step), by.source, "valid")

    def defect(self, by: Weights, angle: Floats, right: Floats) -> Floats:
        """What is missing to the identity at an angle of the difference with its N, (n - 2,)."""
        theta = self.observation.theta[self.inside]
        driven = np.correlate(padded(theta, self.held, self.observation.step), by.driven, "valid")
        return self.source(by, right) + driven - np.correlate(angle - by.direct * theta, by.swing, "valid")

    def weights(self, gamma: float) -> Weights:
        """Weights at a trial gamma2, s-1.

        By parts the first pendulum acts as `(1-r) theta1` and by f = Im(gain c), c its running integral with
        exp(lam t).
        """
        seen, step = self.observation, self.observation.step
        r = seen.frequency_ratio**-2
        oscillation = np.sqrt(self.held**2 - gamma**2)
        eigenvalue = complex(-gamma, oscillation)
        turn = np.exp(eigenvalue * step)
        drag = 2.0 * (gamma * (1.0 - r) - r * seen.damping_difference)
        gain = ((1.0 - r) * eigenvalue**2 + drag * eigenvalue) / oscillation
        near, wide = (taps(eigenvalue, self.held, step, count) for count in (2, NODES))
        near, wide = (np.append(0.0, own) - np.conj(turn) * np.append(own, 0.0) for own in (near, wide))
        swing = np.array([abs(turn) ** 2, -2.0 * turn.real, 1.0])
        return Weights(swing, wide.imag / oscillation, near.imag / oscillation, (gain * wide).imag, 1.0 - r)

    def fit(self, gamma: float, *, fit_damping: bool) -> Fit:
        """Iterate until n2 and gamma2, held or from `gamma` on, stand still; `RefusedError`: no swing, outliers."""
        about = difference = self.observation.difference[self.inside]
        count, step = about.size, self.observation.step
        # n2 with which the nonlinear pull does the work that the held frequency does
        work = float(self.expand(about, self.held)[0] @ about) / float(about @ about)
        frequency = float(self.held / np.sqrt(1.0 - work / self.held**2))
        columns = np.ones((5 if fit_damping else 4, count))  # free swings, by n2, zero line, by gamma2
        for _ in range(ITERATIONS):
            by = self.weights(gamma)
            right, stiffness, by_frequency = self.expand(about, frequency)
            sources = self.defect(by, about, right), self.source(by, by_frequency)
            columns[0], columns[1], missing, columns[2] = responses(by, stiffness, *sources)
            if fit_damping:
                columns[4] = step * (0.5 * (count - 1) - np.arange(count)) * about
            about = about + missing
            change, inverse = least_squares(columns, difference - about)
            zero_line, change[3] = float(change[3]), 0.0
            about += change @ columns
            frequency, gamma = frequency + float(change[2]), gamma + float(change[4:].sum())
            if not np.isfinite(frequency) or abs(gamma) > 0.1 * frequency:
                raise RefusedError(
                    "difference: no swing near the nominal period; check instrument/period and the traces"
                )
            if np.abs(change[2:]).max() * step * count < SETTLED:
                break
        residual = difference - about - zero_line
        noise = float(np.linalg.norm(residual) / np.sqrt(max(count - change.size, 1)))
        if np.abs(residual).max() > max(OUTLIER * noise, FLOOR * float(np.sqrt(2.0) * about.std())):
            raise RefusedError("record/elongation: the difference has outliers; use --method joint")
        return Fit(frequency, gamma, noise, about, residual, inverse[2] @ columns, stiffness, by)


def responses(by: Weights, stiffness: Floats | float, *sources: Floats) -> tuple[Floats, ...]:
    """Two free swings of an identity, and its responses to sources (n - 2,) from its third sample on; (n,) each."""
    count = sources[0].size + 2
    if isinstance(stiffness, float):  # a complex exponential and running sums: scipy.linalg takes .1 s to import
        before, middle, own = by.swing - by.near * stiffness
        turn = complex(-middle, np.sqrt(4.0 * own * before - middle**2)) / (2.0 * own)
        size = int(np.ceil(np.sqrt(count)))
        swing, whole = turn ** np.arange(size), turn**size
        free = np.outer(whole ** np.arange(size), swing).ravel()[:count]
        rows, laid = [free.real, free.imag], np.zeros(size * size)
        for source in sources:
            laid[2:count] = source
            sums = np.cumsum(laid.reshape(size, size) * swing**-1, axis=1)
            lasts = sums[:-1, -1].tolist()
            carried = itertools.accumulate(lasts, lambda state, last: whole * (state + last), initial=0j)
            sums += np.array(list(carried))[:, None]
            rows.append((sums * (turn / (own * turn.imag) * swing)).imag.ravel()[:count])
        return tuple(rows)
    from scipy.linalg.lapack import dtbtrs

    columns = np.zeros((count, 2 + len(sources)), order="F")
    columns[:2, :2] = (1.0, 0.0), (0.5 * by.swing[1], 1.0)  # a cosine and a sine
    columns[2:, 2:] = np.stack(sources, axis=1)
    return tuple(dtbtrs(by.system(stiffness), columns, uplo="L", overwrite_b=True)[0].T)


def least_squares(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Coefficients of columns (k, n), their covariance (k, k) per variance; `RefusedError`: too few, no numbers."""
    gram = np.stack([columns @ column for column in columns])
    if not np.all(np.isfinite(gram)) or values.size < 2 * len(gram):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    inverse = scaled_inverse(gram)
    return inverse @ (columns @ values), inverse
