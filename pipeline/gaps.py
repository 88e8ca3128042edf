"""Missing samples of a recorded pendulum that is an INPUT of the correction.

The exact identity integrates the first pendulum over the whole record, so a gap in it must be bridged, or cut out if it
is long (see `projection.cuts`); the difference, whose frequency is wanted, is never filled.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import by_portions, portions, release
from pipeline.arrays import Floats

CANDIDATES = (
    (11, 3.0, 6.0, 1.5),
    (9, 1.5, 1.0, 5.0),
    (11, 1.0, 2.0, 1.2),
    (5, 3.0, 6.0, 2.0),
    (1, 12.0, np.inf, 1.0),
)
"""Degree of the slow part, seconds of record on each side, and the longest gap, s: the first averages noise, the next
two follow swell and a swing that heave modulates, the last does not swing across a long gap. Then the times by which
errors exceed what leverage and misfit predict, root mean square, on simulated seas; across longer gaps a short fit errs
by ten times that, and its misfit does not show it."""
LONG_GAP = 6.0  # s; how far a bridge across it errs, only trials on the record itself tell
LONGEST_GAP = 300.0  # s; beyond it a method that must bridge has no sigma to offer
COARSE = 1.25  # gaps that differ by no more share their trials
FITS = 4096  # that are kept, some 20 kB each
GOOD = 2.0  # times the noise: a first fit that errs no more is taken without trying the others


def bridge(series: Floats, step: float, frequency: float, noise: float = 0.0) -> tuple[Floats, list[tuple[int, float]]]:
    """Bridge missing samples by a local fit of {polynomial, cos, sin, t cos, t sin}.

    Of several fits the one with the least predicted error is taken: its noise times its leverage in the gap, and
    what it misfits beyond the noise, which grows in the gap (see `_growth`).

    Parameters
    ----------
    series : (n,) array
        Uniform samples, rad, NaN = missing.
    step : float
        s.
    frequency : float
        Circular frequency of the free swing, rad s-1.
    noise : float
        White reading noise, 1 sigma, rad; infinite: the first fit will do.

    Returns
    -------
    (n,) array
        The series itself when nothing is missing. Stretches too poor to be bridged stay NaN.
    list of (int, float)
        For each bridge its length in samples and its predicted rms error, rad.
    """
    bridges: list[tuple[int, float]] = []
    gaps = missing_stretches(series)
    if not gaps:
        return series, bridges
    filled = by_portions(np.copy, series)
    for start, stop in gaps:
        best = np.inf
        for degree, seconds, beyond in candidates((stop - start) * step):
            reach = max(degree + 5, int(np.ceil(seconds / step)))
            around = np.arange(max(0, start - reach), min(series.size, stop + reach))
            known = around[~np.isnan(series[around[0] : around[-1] + 1])]
            parameters = degree + 5
            if known.size < parameters + 6:
                continue
            left, across, leverage = _fit((known - start).tobytes(), stop - start, around.size, step, frequency, degree)
            fit = left.T @ series[known]
            misfit = series[known] - left @ fit
            free = known.size - left.shape[1]
            variance = float(misfit @ misfit) / free
            chance = 1.0 + 2.0 * float(np.sqrt(2.0 / free))  # a variance from so few readings may be so much larger
            excess = max(variance - noise**2 * chance, 0.0)
            error = float(np.sqrt(variance * leverage + excess * (beyond * _growth(leverage)) ** 2))
            if error < best:
                best = error
                filled[start:stop] = across @ fit
            if error <= GOOD * noise:
                break
        if np.isfinite(best):
            bridges.append((stop - start, best))
        release(series, filled)
    return filled, bridges


def missing_stretches(series: Floats) -> list[tuple[int, int]]:
    """First missing sample and the next that is there, of every gap in order.

    Examples
    --------
    >>> missing_stretches(np.array([np.nan, 1.0, np.nan, np.nan]))
    [(0, 1), (2, 4)]
    """
    edges: list[int] = []
    within = False
    for part in portions(series.size, series):
        missing = np.isnan(series[part])
        if within or missing.any():
            edges += (part.start + np.flatnonzero(np.diff(missing, prepend=within))).tolist()
            within = bool(missing[-1])
    if within:
        edges.append(series.size)
    return list(zip(edges[::2], edges[1::2], strict=True))


def require_bridges(gaps: Iterable[tuple[int, int]], step: float) -> None:
    """Refuse gaps of the first pendulum, in samples of `step` s, too long for a method that must bridge them."""
    longest = step * max((stop - start for start, stop in gaps), default=0)
    if longest > LONGEST_GAP:
        raise RefusedError(
            f"record/elongation: the first pendulum has a gap of {longest:.0f} s, too long to bridge (at most "
            f"{LONGEST_GAP:.0f} s); use the method 'projection', or split the record there"
        )


def rounded_up(length: int) -> int:
    """Readings that a gap on trial lacks, for one of `length`: gaps of nearly one length share their trials."""
    return int(np.ceil(COARSE ** np.ceil(np.log(length) / np.log(COARSE))))


def candidates(gap: float) -> tuple[tuple[int, float, float], ...]:
    """Degree, seconds and excess of the fits that can be trusted across a gap of so many seconds."""
    return tuple((degree, side, beyond) for degree, side, longest, beyond in CANDIDATES if gap <= longest)


@functools.lru_cache(maxsize=FITS)
def _fit(
    places: bytes, length: int, span: int, step: float, frequency: float, degree: int
) -> tuple[Floats, Floats, float]:
    """Fit across a gap of `length` samples, from a span of so many: all but the readings themselves.

    A record's traces lack the same samples, and its examination bridges them again and again.

    Parameters
    ----------
    places : bytes
        Of the readings, int64, counted from the first missing sample.

    Returns
    -------
    (readings, k) array, (length, k) array, float
        Orthonormal functions at the readings and in the gap; mean variance in the gap per variance of white noise.
    """
    middle, scale = 0.5 * (length - 1) * step, 0.5 * span * step
    known = np.frombuffer(places, dtype=np.int64)
    left, size, right = np.linalg.svd(_basis(known * step - middle, scale, frequency, degree), full_matrices=False)
    used = size > 1e-12 * size[0]
    solve = right[used].T / size[used]
    across = _basis(np.arange(length) * step - middle, scale, frequency, degree) @ solve
    return left[:, used], across, float(np.mean(np.sum(across**2, axis=1)))


def _growth(leverage: float) -> float:
    """How much larger a misfit is in the gap than beside it: 2 to 24 times as measured on simulated swell and heave."""
    return 2.0 + 5.0 * float(np.sqrt(leverage))


def _basis(tau: Floats, scale: float, frequency: float, degree: int) -> Floats:
    x = tau / scale
    cos, sin = np.cos(frequency * tau), np.sin(frequency * tau)
    polynomials = np.polynomial.legendre.legvander(x, degree)
    return np.concatenate([polynomials, np.stack([cos, sin, x * cos, x * sin], axis=-1)], axis=1)
