"""Characteristic values of y'' + (a - 2 q cos 2z) y = 0 at the first resonance: exact, and as the paper has them.

Between a = b1(q) (of se1) and a = a1(q) (of ce1) lies the tongue in which the beam, at twice the clock's frequency,
drives the clock. The paper takes 1 -+ q.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.phase import Floats

_SERIES = (1.0, 1.0, -1.0 / 8.0, -1.0 / 64.0, -1.0 / 1536.0, 11.0 / 36864.0)
"""a1 in powers of q; b1(q) = a1(-q). Abramowitz and Stegun 20.2.25."""
_LARGEST = 5.0  # q: the series is of no use long before


class Edges(NamedTuple):
    """Both edges of the first resonance."""

    cosine: Floats
    """a of ce1, a_c^(1)."""
    sine: Floats
    """a of se1, a_s^(1)."""


def exact(q: ArrayLike) -> Edges:
    """Characteristic values by scipy.

    Parameters
    ----------
    q : array-like
        Strength of the parametric drive, of either sign.

    Examples
    --------
    >>> edges = exact(0.1)
    >>> round(float(edges.cosine), 10), round(float(edges.sine), 10)
    (1.098734313, 0.898765557)
    """
    from scipy.special import mathieu_a, mathieu_b

    size = np.abs(np.asarray(q, dtype=np.float64))
    upper, lower = np.asarray(mathieu_a(1, size)), np.asarray(mathieu_b(1, size))
    positive = np.asarray(q) >= 0.0  # a turn of z by a quarter exchanges them
    return Edges(np.where(positive, upper, lower), np.where(positive, lower, upper))


def series(q: ArrayLike, order: int = 1) -> Edges:
    """The paper's series, a_c = 1 + q - q^2/8 - ..., a_s = 1 - q - q^2/8 + ..., up to q^order.

    Examples
    --------
    >>> [float(each) for each in series(0.1)]
    [1.1, 0.9]
    """
    if not 0 <= order < len(_SERIES):
        raise UsageError(f"order = {order}: the series is known from 0 to {len(_SERIES) - 1}")
    powers = np.polynomial.Polynomial(_SERIES[: order + 1])
    strength = np.asarray(q, dtype=np.float64)
    return Edges(np.asarray(powers(strength)), np.asarray(powers(-strength)))


def matters_from(difference: float, order: int = 1) -> float:
    """Smallest q at which the series is wrong by a given amount in a.

    Compare the amount with what a is known to: `chi` for a phase offset, or delta^2/8, which the paper leaves out too.

    Parameters
    ----------
    difference : float
        Absolute error of either edge.
    order : int
        Of the series.

    Raises
    ------
    UsageError
        If the series is never so wrong up to q = 5, or the amount is not above 0.

    Examples
    --------
    With 1 -+ q an error of 1e-5 (one swing a day) is made from q = 0.0089 on: q^2/8 of it.

    >>> round(matters_from(1e-5), 5)
    0.00894
    """
    from scipy.optimize import brentq

    def excess(q: float) -> float:
        apart = [np.abs(true - near) for true, near in zip(exact(q), series(q, order), strict=True)]
        return float(max(apart)) - difference

    if not 0.0 < difference < excess(_LARGEST) + difference:
        raise UsageError(f"difference = {difference:g}: give an error of the series above 0 that it has below q = 5")
    return float(brentq(excess, 0.0, _LARGEST, xtol=1e-14))
