"""Missing readings of a slow random motion: the best linear guess from those around, and how wrong it is.

Between half-second marks a swell moves too far for a straight line. Its own covariance, told from the series, makes
the guess of least expected square and says what that square is (Wiener 1949; in any dimension Kriging).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.gaps import missing_stretches

REACH = 24  # marks on each side that tell of a missing one
MOST_LAGS = 512  # beyond which nothing is known of a motion's likeness to itself
AT_ONCE = 256  # missing readings that are guessed together
SYSTEMS = 32  # of equal size, of one missing reading each, that are solved together


def guessed(series: Floats, before: Floats, angle: float, long: float = np.inf) -> tuple[Floats, float, float]:
    """The series with its gaps filled, and how large the errors may be together.

    Parameters
    ----------
    series : (n,) array
        rad, NaN = missing.
    before : (n,) array
        An earlier guess, without gaps, that tells the covariance.
    angle : float
        Of the swing from reading to reading, rad.
    long : float
        Readings that a long gap lacks at least.

    Returns
    -------
    (n,) array
    float
        1 sigma of the sum of all errors turned back by the swing, rad; white errors of the readings give their 1 sigma
        times the root of the number of readings.
    float
        The same without long gaps.
    """
    filled, total, short = series.copy(), 0.0, 0.0
    mean = float(before.mean())
    power = np.abs(np.fft.rfft(before - mean, 2 * before.size)) ** 2
    covariance = np.zeros(before.size)
    lags = min(MOST_LAGS, before.size)
    covariance[:lags] = np.fft.irfft(power)[:lags] / before.size
    parts = [
        (at, min(at + AT_ONCE, stop), stop - start < long)
        for start, stop in missing_stretches(series)
        for at in range(start, stop, AT_ONCE)
    ]
    alike: dict[tuple[int, int, bool], list[tuple[NDArray[np.intp], NDArray[np.intp]]]] = {}
    for start, stop, is_short in parts:
        around = np.arange(max(0, start - REACH), min(series.size, stop + REACH))
        known, missing = around[np.isfinite(series[around])], np.arange(start, stop)
        alike.setdefault((known.size, missing.size, is_short), []).append((known, missing))
    for (_, absent, is_short), group in alike.items():  # many small systems of one size at once
        together = max(SYSTEMS // absent, 1)
        for begin in range(0, len(group), together):
            known, missing = (np.stack(rows) for rows in zip(*group[begin : begin + together], strict=True))
            each = covariance[np.abs(known[:, :, None] - known[:, None])]
            each += 1e-12 * covariance[0] * np.eye(known.shape[1])
            across = covariance[np.abs(known[:, :, None] - missing[:, None])]
            weights = np.linalg.solve(each, across)
            filled[missing] = mean + np.einsum("gk,gkm->gm", series[known] - mean, weights)
            error = covariance[np.abs(missing[:, :, None] - missing[:, None])] - across.swapaxes(1, 2) @ weights
            turned = np.exp(1j * angle * missing)
            powers = np.einsum("gi,gij,gj->g", turned.conj(), error, turned).real
            square = float(np.sum(np.maximum(powers, 0.0)))
            total += square
            short += is_short * square
    return filled, float(np.sqrt(total)), float(np.sqrt(short))
