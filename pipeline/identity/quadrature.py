"""The identities as weights of uniform samples: no derivative is taken, no differential equation is integrated.

With lam = -gamma2 + i w and h^2 = w^2 + gamma2^2 the equation `z'' + 2 gamma2 z' + h^2 z = f` is one of its samples,

    z[k+1] - 2 Re(T) z[k] + |T|^2 z[k-1] = Im(I[k] - conj(T) I[k-1])/w,
    T = exp(lam step),   I[k] = int_0^step exp(lam (step - x)) f(t_k + x) dx,

exact but for the quadrature of I. Its weights are exact for a swing at the pendulum's own frequency that slowly
changes, on a cubic. A plain polynomial of degree seven errs by 2.4e-4 mGal at 10 Hz where this errs by 1e-9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Complexes, Floats

NODES = 8
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(16)  # on an interval: exact to rounding below Nyquist
_CUTOFF = 1e-14  # of the largest: what fast sampling leaves of the functions' differences below it is rounding


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
    """Weights (count,) of `int_0^step exp(lam (step - x)) f dx` over the central interval of `count` samples.

    They are fitted at `frequency`, rad s-1, near Im(lam).
    """
    turned = 0.5 * step * _GAUSS_WEIGHTS * np.exp(0.5 * eigenvalue * step * (1.0 - _GAUSS))
    return np.asarray(cardinal(0.5 * _GAUSS, frequency * step, count) @ turned)


def padded(series: Floats, frequency: float, step: float) -> Floats:
    """A series continued by three samples on either side by the same functions, for the intervals at its ends."""
    onward = cardinal(np.arange(3.0) + 0.5 * (NODES + 1), frequency * step)
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


def weights(frequency: float, gamma: float, ratio: float, damping_difference: float, step: float) -> Weights:
    """Weights for h = `frequency`, rad s-1, gamma2, n1/n2 and gamma1 - gamma2.

    By parts the first pendulum acts as `(1-r) theta1` and by f = Im(gain c), c its running integral with exp(lam t).
    """
    r = ratio**-2
    oscillation = np.sqrt(frequency**2 - gamma**2)
    eigenvalue = complex(-gamma, oscillation)
    turn = np.exp(eigenvalue * step)
    drag = 2.0 * (gamma * (1.0 - r) - r * damping_difference)
    gain = ((1.0 - r) * eigenvalue**2 + drag * eigenvalue) / oscillation

    near, wide = (taps(eigenvalue, frequency, step, count) for count in (2, NODES))
    near, wide = (np.append(0.0, own) - np.conj(turn) * np.append(own, 0.0) for own in (near, wide))
    swing = np.array([abs(turn) ** 2, -2.0 * turn.real, 1.0])
    return Weights(swing, wide.imag / oscillation, near.imag / oscillation, (gain * wide).imag, 1.0 - r)
