"""By how many swings a day one clock outruns another: from instant to instant, and over the record."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.gravity import DAY

_BLOCKS = 16
_TURN = 2.0 * np.pi


def instantaneous(time: Floats, psi: Floats) -> Floats:
    """Rate difference at each instant, swings a day; NaN beside what is missing.

    Examples
    --------
    >>> t = np.arange(5.0)
    >>> instantaneous(t, 2.0 * np.pi * t / 86400.0).round(9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0]
    """
    return np.asarray(np.gradient(psi, time) * (DAY / _TURN))


def mean(time: Floats, psi: Floats) -> tuple[float, float]:
    """Mean rate difference over the record and one sigma, swings a day.

    Least squares through means of blocks, whose scatter gives the sigma: so it holds for noise of any colour shorter
    than a block, and for the steps of slips.
    """
    present = np.isfinite(psi)
    parts = np.array_split(np.flatnonzero(present), _BLOCKS)
    middles = np.array([time[each].mean() for each in parts])
    means = np.array([psi[each].mean() for each in parts])
    x = middles - middles.mean()
    slope = float(x @ means / (x @ x))
    left = means - means.mean() - slope * x
    sigma = float(np.sqrt(left @ left / (_BLOCKS - 2) / (x @ x)))
    return slope * DAY / _TURN, sigma * DAY / _TURN
