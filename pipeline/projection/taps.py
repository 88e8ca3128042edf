"""Quadrature weights of `int_0^h exp(lam (h - x)) f(x) dx` from eight uniform samples.

The weights are exact for {1, z, z^2, z^3, cos, sin, z cos, z sin} at the pendulum's own frequency: a free
oscillation that slowly changes, on a cubic. A plain degree-7 polynomial errs by 2.4e-4 mGal at 10 Hz where this
errs by 1e-9. The four oscillating functions are replaced by combinations of the same span that begin with z^4,
z^5, z^6 and z^7, so that the system stays well conditioned when the sampling is fast.
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
_SERIES_BELOW = 2.0  # radians at the stencil's end, below which series replace differences of large numbers
_SERIES_TERMS = 12


@functools.cache
def _gauss_legendre() -> tuple[Floats, Floats]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def fitted_basis(z: Floats, angle: float) -> Floats:
    """The eight functions at positions `z` (steps from the centre); `angle` = frequency times step, rad.

    Returns an array (8, len(z)).
    """
    z = np.asarray(z, dtype=np.float64)
    a = angle
    if abs(a) * CENTRE < _SERIES_BELOW:
        tail = [_tail(z, a, start) for start in (4, 5)] + [_tail_of_product(z, a, start) for start in (6, 7)]
    else:
        cos, sin = np.cos(a * z), np.sin(a * z)
        tail = [cos, sin, z * sin, z * cos]
    return np.stack([np.ones_like(z), z, z**2, z**3, *tail])


def _tail(z: Floats, a: float, start: int) -> Floats:
    """cos (start 4) or sin (start 5) without its terms below z^start, scaled to begin with z^start."""
    ratios = [-1.0 / ((start + 2 * k - 1) * (start + 2 * k)) for k in range(1, _SERIES_TERMS)]
    return _horner((a * z) ** 2, ratios) * z**start


def _tail_of_product(z: Floats, a: float, start: int) -> Floats:
    """z sin (start 6) or z cos (start 7), less the part along cos or sin that begins with z^(start-2)."""
    # terms of  a z sin(a z) + 4 cos(a z)  or  a z cos(a z) - 5 sin(a z), scaled by the leading coefficient:
    # (-1)^k (k + 1) start! / (start + 2 k)!
    ratios = [-(k + 1) / (k * (start + 2 * k - 1) * (start + 2 * k)) for k in range(1, _SERIES_TERMS)]
    return _horner((a * z) ** 2, ratios) * z**start


def _horner(x: Floats, ratios: list[float]) -> Floats:
    """`1 + r1 x (1 + r2 x (1 + ...))`: a series given by the ratios of its coefficients."""
    total = np.ones_like(x)
    for ratio in reversed(ratios):
        total = 1.0 + ratio * x * total
    return total


def _cardinal(points: Floats, angle: float) -> Floats:
    """What each of the eight nodes contributes at positions in steps from the centre, (len(points), 8)."""
    nodes = np.arange(NODES) - CENTRE
    basis = fitted_basis(np.concatenate([nodes, points]), angle)
    return np.linalg.solve(basis[:, :NODES], basis[:, NODES:]).T.copy()


@functools.lru_cache(maxsize=64)
def stencil(frequency: float, step: float) -> Floats:
    """Cardinal functions of the basis at the quadrature nodes of the central interval, (16, 8)."""
    return _cardinal(_gauss_legendre()[0] - 0.5, frequency * step)


@functools.lru_cache(maxsize=64)
def continuation(frequency: float, step: float) -> Floats:
    """Weights (8, 3) of the last eight samples of a series in its next three, by the same eight functions."""
    return _cardinal(CENTRE + np.arange(1.0, 4.0), frequency * step).T


def padded(series: Floats, part: slice, frequency: float, step: float) -> Floats:
    """Some samples with `BEFORE` and `AFTER` of their neighbours; beyond a series' ends it is continued.

    The last of those behind the end belongs to no interval and is zero.
    """
    low, high = part.start - BEFORE, part.stop + AFTER
    pieces = [series[max(low, 0) : high]]
    onward = continuation(frequency, step)
    if low < 0:
        pieces.insert(0, (series[NODES - 1 :: -1] @ onward)[::-1])
    if high > series.size:
        pieces.append(np.append(series[-NODES:] @ onward, 0.0)[: high - series.size])
    return np.concatenate(pieces)


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
