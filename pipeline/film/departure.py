"""What the readings say of the course's error: a line and a swing of slowly changing size, over a few swings each.

Adjoining blocks, each by weighted least squares on 1, x, cos, sin, x cos and x sin of the swing's phase.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats

_SWINGS = 2.0  # a block: long enough to tell a swing from a line, short beside any change of the swing
_FEWEST = 24  # readings in a block: four a term
_RIDGE = 1e-9  # of the diagonal, for blocks of which only one end was read


def block_length(period: float, rate: float) -> int:
    """Samples in a block."""
    return max(2, round(_SWINGS * period * rate))


def describe(
    times: Floats, departure: Floats, weight: Floats, block: NDArray[np.int64], count: int, period: float, span: float
) -> Floats:
    """Coefficients of each block, (count, 6); zero where a block holds too few readings.

    Parameters
    ----------
    times, departure, weight : (readings,) arrays
        In order of `block`; times in s, departures in any unit, weights as inverse variances.
    block : (readings,) array
        Block of each reading, not decreasing, below `count`.
    period : float
        Of the swing, s.
    span : float
        Length of a block, s; block b covers b * span to (b + 1) * span.
    """
    coefficients = np.zeros((count, 6))
    edges = np.searchsorted(block, np.arange(count + 1))
    columns = terms(times, block, period, span)
    for number in range(count):
        part = slice(edges[number], edges[number + 1])
        if part.stop - part.start < _FEWEST:
            continue
        weighted = columns[part] * weight[part, None]
        matrix = weighted.T @ columns[part]
        matrix[np.diag_indices(6)] *= 1.0 + _RIDGE
        coefficients[number] = np.linalg.lstsq(matrix, weighted.T @ departure[part], rcond=1e-12)[0]
    return coefficients


def terms(times: Floats, block: NDArray[np.int64], period: float, span: float) -> Floats:
    """The six functions at some times of some blocks, (times, 6)."""
    x = 2.0 * (times / span - block) - 1.0
    phase = 2.0 * np.pi * times / period
    cosine, sine = np.cos(phase), np.sin(phase)
    return np.stack([np.ones_like(x), x, cosine, sine, x * cosine, x * sine], axis=-1)
