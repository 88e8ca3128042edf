"""A cheap envelope from adjoining blocks: the start of the exact fits, and the weights of their error budget.

Each block is fitted by {cos, sin, 1, t}. All complete blocks are one small matrix product.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from data_schemas.scratch import portions, release
from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, window_length
from synth.kernels.compiled import summing_kernel

BLOCK_SECONDS = 4.0
LEAST_COVERAGE = 0.5


def block_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Envelope of both series at block centres.

    Parameters
    ----------
    time, first, difference : (n,) arrays
        s, rad, rad; NaN = missing.
    step : float
        Sampling step, s.
    frequency : float
        Carrier, rad s-1.
    """
    rows = max(4, round(window_length(frequency, step, BLOCK_SECONDS, float(time[-1]) + step) / step))
    centres, coefficients, counts = _fits((first, difference), step, rows, frequency)
    length = rows * step
    carrier = np.cos(frequency * centres) - 1j * np.sin(frequency * centres)
    amplitude = (coefficients[:, 0] - 1j * coefficients[:, 1]) * carrier
    coverage = counts / rows
    amplitude[coverage < LEAST_COVERAGE] = np.nan
    speed = _gradient(amplitude, length)
    return Envelope(
        time=centres,
        carrier=frequency,
        first=amplitude[0],
        difference=amplitude[1],
        first_speed=speed[0],
        difference_speed=speed[1],
        slow=coefficients[:, 2],
        slow_speed=coefficients[:, 3] / (0.5 * length),
        coverage=np.minimum(coverage[1], 1.0),
        samples=counts.mean(axis=1),
        noise_gain=2.0 / rows,
    )


def _basis(tau: Floats, half: float, frequency: float) -> Floats:
    return np.stack([np.cos(frequency * tau), np.sin(frequency * tau), np.ones_like(tau), tau / half], axis=-1)


@functools.lru_cache(maxsize=64)
def _complete_block(rows: int, step: float, frequency: float) -> tuple[Floats, Floats]:
    """Basis of a block without gaps, and what turns its samples into coefficients."""
    basis = _basis((np.arange(rows) - 0.5 * (rows - 1)) * step, 0.5 * rows * step, frequency)
    return basis, np.linalg.pinv(basis).copy()


def _fits(series: Sequence[Floats], step: float, rows: int, frequency: float) -> tuple[Floats, Floats, Floats]:
    count = series[0].size // rows
    basis, inverse = _complete_block(rows, step, frequency)
    coefficients = np.empty((2, 4, count))
    counts = np.full((2, count), float(rows))
    for which, values in enumerate(series):
        for some in portions(count * rows, values, unit=rows):
            fit_blocks(values[some], inverse, coefficients[which], some.start // rows)
        for block in np.flatnonzero(np.isnan(coefficients[which, 0])):
            part = values[block * rows : (block + 1) * rows]
            coefficients[which, :, block], counts[which, block] = _fit(basis, part)
        release(values)
    return (np.arange(count) + 0.5) * rows * step - 0.5 * step, coefficients, counts


@summing_kernel
def fit_blocks(values: Floats, inverse: Floats, out: Floats, first: int) -> None:
    """`out[i, first + b] = sum_m inverse[i, m] values[b rows + m]`, inverse (4, rows), out (4, blocks)."""
    rows = inverse.shape[1]
    i0, i1, i2, i3 = inverse[0], inverse[1], inverse[2], inverse[3]
    for block in range(values.size // rows):
        part = values[block * rows : (block + 1) * rows]
        s0 = s1 = s2 = s3 = 0.0
        for m in range(rows):
            value = part[m]
            s0 += i0[m] * value
            s1 += i1[m] * value
            s2 += i2[m] * value
            s3 += i3[m] * value
        to = first + block
        out[0, to], out[1, to], out[2, to], out[3, to] = s0, s1, s2, s3


def _fit(basis: Floats, values: Floats) -> tuple[Floats, int]:
    present = np.isfinite(values)
    count = int(present.sum())
    if count < 8:
        return np.full(4, np.nan), count
    return np.linalg.lstsq(basis[present], values[present], rcond=None)[0], count


def _gradient(values: Complexes, hop: float) -> Complexes:
    """Central differences along the rows, one-sided at the ends."""
    slope = np.zeros_like(values)
    if values.shape[1] > 1:
        slope[:, 1:-1] = (values[:, 2:] - values[:, :-2]) * (0.5 / hop)
        slope[:, 0] = (values[:, 1] - values[:, 0]) / hop
        slope[:, -1] = (values[:, -1] - values[:, -2]) / hop
    return slope
