"""Quadrature weights of `int_0^h exp(lam (h - x)) f(x) dx` from eight uniform samples.

The weights are exact for {1, z, z^2, z^3, cos, sin, z cos, z sin} at the pendulum's own frequency: a free
oscillation that slowly changes, on a cubic. A plain degree-7 polynomial errs by 2.4e-4 mGal at 10 Hz where this
errs by 1e-9.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats

NODES = 8
QUADRATURE = 16  # Gauss-Legendre nodes an interval: exact to rounding below Nyquist
CENTRE = 3.5  # of the stencil, in steps
BEFORE, AFTER = 3, 4  # samples that the stencil of an interval takes before its first one and behind it
_CUTOFF = 1e-14  # of the largest: what fast sampling leaves of the eight functions' differences below it is rounding


@functools.cache
def _gauss_legendre() -> tuple[Floats, Floats]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def fitted_basis(z: Floats, angle: float) -> Floats:
    """The eight functions at positions `z` (steps from the centre), (8, len(z)); `angle` is that of a step, rad."""
    x, cos, sin = z / CENTRE, np.cos(angle * z), np.sin(angle * z)
    return np.stack([np.ones_like(x), x, x**2, x**3, cos, sin, x * cos, x * sin])


def _cardinal(points: Floats, angle: float) -> Floats:
    """What each of the eight nodes contributes at positions in steps from the centre, (len(points), 8).

    With fast sampling the functions are nearly dependent: of all weights that are right for them the smallest are
    taken.
    """
    nodes = np.arange(NODES) - CENTRE
    weights = np.linalg.lstsq(fitted_basis(nodes, angle), fitted_basis(points, angle), rcond=_CUTOFF)[0]
    return np.asarray(weights.T.copy())


@functools.lru_cache(maxsize=64)
def stencil(frequency: float, step: float) -> Floats:
    """Cardinal functions of the basis at the quadrature nodes of the central interval, (16, 8)."""
    return _cardinal(_gauss_legendre()[0] - 0.5, frequency * step)


@functools.lru_cache(maxsize=64)
def continuation(frequency: float, step: float) -> Floats:
    """Weights (8, 3) of the last eight samples of a series in its next three, by the same eight functions."""
    return _cardinal(CENTRE + np.arange(1.0, 4.0), frequency * step).T


def padded(series: Floats, frequency: float, step: float) -> Floats:
    """A series continued by `BEFORE` and `AFTER` samples; the last of all belongs to no interval and is zero."""
    onward = continuation(frequency, step)
    return np.concatenate([(series[NODES - 1 :: -1] @ onward)[::-1], series, series[-NODES:] @ onward, [0.0]])


def taps(cardinal: Floats, eigenvalue: complex, step: float) -> NDArray[np.complex128]:
    """Weights of `int_0^h exp(lam (h - x)) f(x) dx` over the central interval of eight samples.

    Parameters
    ----------
    cardinal : (16, 8) array
        From `stencil`, fitted at a frequency near Im(lam).
    eigenvalue : complex
        lam = -gamma + i w, s-1.
    step : float
        Sampling step, s.

    Returns
    -------
    (8,) complex array
    """
    nodes, weights = _gauss_legendre()
    kernel = step * weights * np.exp(eigenvalue * step * (1.0 - nodes))
    return np.asarray(kernel @ cardinal)
