"""The first pendulum between half-second marks.

Read twice a swing, a pendulum of 1.01 s lies at 0.99 of the Nyquist frequency: neighbouring readings tell nothing of
the motion between them, and no short interpolation works. The reading is split by a filter into the slow part, which is
well sampled and interpolated by a windowed sinc, and the harmonic `Re[Z(t) exp(i n t)]`, whose envelope is a cubic
spline found by least squares over hundreds of seconds. A weak preference for a smooth envelope settles the
confusion with its image above the Nyquist frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Complexes, Floats, readings
from pipeline.gaps import missing_stretches
from pipeline.harmonics.envelope import fill
from pipeline.outliers import THRESHOLD, local_maxima
from pipeline.projection.missing_marks import guessed

FILTER_REACH = 24  # marks on each side, of the filter that splits slow part and harmonic
CUT = 0.62  # of the Nyquist frequency, between swell and pendulum
KAISER_SHAPE = 9.0
SINC_REACH = 16
KNOT_SECONDS = 10.0
SEGMENT_SECONDS, OVERLAP_SECONDS = 1200.0, 150.0
ROUNDS = 2  # of splitting; missing readings and the ends need a first envelope
ROUNDS_OF_GAPS = 5  # where readings are missing: their covariance needs a first guess of them
ROUNDS_OF_WILD = 8
LEAST_WILD = 1e-4  # of the largest elongation: below it lies what the envelope errs by
STIFFNESS = 1.0  # weight of the smoothness against the readings for an envelope turning at 0.1 rad/s


def upsample(
    theta: Floats, step: float, frequency: float, factor: int, long: float = np.inf
) -> tuple[Floats, float, float]:
    """Elongation on a grid `factor` times finer, and what missing readings add to its errors.

    Parameters
    ----------
    theta : (n,) array
        Readings, rad, NaN = missing.
    step : float
        s; fewer than four readings a swing.
    frequency : float
        Circular frequency of the free swing, rad s-1.
    long : float
        Readings that a long gap lacks at least.

    Returns
    -------
    ((n - 1) factor + 1,) array
    float
        1 sigma of the sum of the errors of missing readings, turned back by the swing, rad.
    float
        The same without long gaps.
    """
    fine = np.arange((theta.size - 1) * factor + 1) * (step / factor)
    parts = _split(theta, step, frequency, long)
    # what is faster than the slow part is no stranger to the swing where readings are missing
    left, there = 1.4826 * np.nanmedian(np.abs(parts.left)), readings(theta)
    gaps = [stop - start for start, stop in missing_stretches(theta)]
    every, short = (
        float(np.hypot(spread, left * np.sqrt(absent * theta.size / there)))
        for spread, absent in zip(parts.spreads, (sum(gaps), sum(gap for gap in gaps if gap < long)), strict=True)
    )
    swing = _evaluate(parts.envelope, parts.knots, fine, frequency)
    return swing + interpolated(parts.slow, factor), every, short


def reject_at_marks(theta: Floats, step: float, frequency: float) -> tuple[Floats, int]:
    """Replace wild readings by NaN: those that neither the swing nor what is slower leads to, the wildest around first.

    Parameters
    ----------
    theta, step, frequency
        See `upsample`.

    Returns
    -------
    (n,) array, int
        The series (itself when nothing was found), and how many readings were rejected.
    """
    cleaned, parts = theta, _split(theta, step, frequency)
    for _ in range(ROUNDS_OF_WILD):
        error = np.abs(parts.left)
        limit = max(THRESHOLD * 1.4826 * float(np.nanmedian(error)), LEAST_WILD * float(np.nanmax(np.abs(theta))))
        wild = np.flatnonzero(error > limit)
        if not wild.size:
            break
        cleaned = cleaned.copy()
        cleaned[wild[local_maxima(error[wild], wild, FILTER_REACH)]] = np.nan
        parts = _split(cleaned, step, frequency)
    if cleaned is theta:
        return theta, 0
    # where all around is misfitted, at ends and in quick beats, no single one is to blame
    rejected = np.flatnonzero(np.isnan(cleaned) & np.isfinite(theta))
    model = _evaluate(parts.envelope, parts.knots, rejected * step, frequency) + parts.slow[rejected]
    around = np.clip(rejected[:, None] + np.arange(-FILTER_REACH, FILTER_REACH + 1), 0, theta.size - 1)
    left = np.nan_to_num(np.abs(parts.left), nan=float(np.nanmedian(np.abs(parts.left))))
    usual = 1.4826 * np.median(left[around], axis=1) / (1.0 - CUT)
    again = rejected[np.abs(theta[rejected] - model) <= THRESHOLD * usual]
    cleaned[again] = theta[again]
    return (cleaned, rejected.size - again.size) if again.size < rejected.size else (theta, 0)


class _Parts(NamedTuple):
    """Envelope of the swing and its knots; slow motion and what both leave of the readings, rad; see `guessed`."""

    envelope: Complexes
    knots: Floats
    slow: Floats
    left: Floats
    spreads: tuple[float, float]


def _split(theta: Floats, step: float, frequency: float, long: float = np.inf) -> _Parts:
    time = np.arange(theta.size) * step
    present = np.isfinite(theta)
    slow: Floats = np.zeros(theta.size)
    guess = slow
    for number in range(ROUNDS if present.all() else ROUNDS_OF_GAPS):
        envelope, knots = _envelope(time, np.where(present, theta - slow, np.nan), frequency)
        rest = np.where(present, theta - _evaluate(envelope, knots, time, frequency), np.nan)
        before = fill(rest.astype(np.complex128)).real if number == 0 else np.where(present, rest, guess)
        guess, *spreads = guessed(rest, before, frequency * step, long)
        slow = _low_pass(guess)
    return _Parts(envelope, knots, slow, rest - slow, (spreads[0], spreads[1]))


def _low_pass(values: Floats) -> Floats:
    taps = np.arange(-FILTER_REACH, FILTER_REACH + 1)
    window = np.i0(KAISER_SHAPE * np.sqrt(1.0 - (taps / FILTER_REACH) ** 2)) / np.i0(KAISER_SHAPE)
    weights = CUT * np.sinc(CUT * taps) * window
    return np.convolve(_mirrored(values, FILTER_REACH), weights / weights.sum(), mode="valid")


def interpolated(values: Floats, factor: int, reach: int = SINC_REACH, shape: float = KAISER_SHAPE) -> Floats:
    """A series that holds little near its Nyquist frequency, on a finer grid, by a sinc in a Kaiser window.

    Parameters
    ----------
    values : (n,) array
    factor : int
        Steps of the finer grid in one of the series.
    reach : int
        Readings on each side that a point is told from; at the ends the series is continued by point reflection.
    shape : float
        Of the window.

    Returns
    -------
    ((n - 1) factor + 1,) array
    """
    padded = _mirrored(values, reach)
    fine = np.empty((values.size - 1) * factor + 1)
    fine[::factor] = values
    for part in range(1, factor):
        offset = np.arange(-reach + 1, reach + 1) - part / factor
        window = np.i0(shape * np.sqrt(1.0 - (offset / reach) ** 2)) / np.i0(shape)
        weights = np.sinc(offset) * window
        full = np.convolve(padded, (weights / weights.sum())[::-1], mode="valid")
        fine[part::factor] = full[1 : values.size]
    return fine


def _mirrored(values: Floats, reach: int) -> Floats:
    """Continued at both ends by point reflection, which keeps value and slope."""
    reach_in = min(reach, values.size - 1)
    left = 2.0 * values[0] - values[reach_in:0:-1]
    right = 2.0 * values[-1] - values[-2 : -reach_in - 2 : -1]
    return np.concatenate([left, values, right])


def _envelope(time: Floats, swing: Floats, frequency: float) -> tuple[Complexes, Floats]:
    """Spline coefficients of Z, segment by segment, and the knots they belong to."""
    knots = np.arange(-1.0, time[-1] / KNOT_SECONDS + 3.0) * KNOT_SECONDS
    coefficients = np.zeros(knots.size, dtype=np.complex128)
    start = 0.0
    while True:
        stop = start + SEGMENT_SECONDS
        if stop + OVERLAP_SECONDS > time[-1]:
            stop = time[-1] + KNOT_SECONDS
        low = np.searchsorted(time, start - OVERLAP_SECONDS)
        high = np.searchsorted(time, stop + OVERLAP_SECONDS, side="right")
        chosen = low + np.flatnonzero(np.isfinite(swing[low:high]))
        inside = np.flatnonzero((knots > start - OVERLAP_SECONDS - 2 * KNOT_SECONDS) & (knots < stop + OVERLAP_SECONDS))
        solved = _segment(time[chosen], swing[chosen], knots[inside], frequency)
        keep = (knots[inside] >= start - 2 * KNOT_SECONDS) & (knots[inside] <= stop + 2 * KNOT_SECONDS)
        coefficients[inside[keep]] = solved[keep]
        if stop >= time[-1]:
            return coefficients, knots
        start = stop


def _segment(time: Floats, swing: Floats, knots: Floats, frequency: float) -> Complexes:
    """Coefficients at the knots; each reading knows eight unknowns, so that the normal equations are a narrow band."""
    from scipy.linalg import solveh_banded

    first, splines = _splines(time, knots)
    carrier = np.exp(1j * frequency * time)
    # real and imaginary part of each knot's coefficient beside each other
    rows = np.stack([splines * carrier.real, -splines * carrier.imag], axis=1).reshape(-1, time.size)
    size = 2 * knots.size
    band, right = np.zeros((len(rows), size)), np.zeros(size)
    for one, row in enumerate(rows):
        right += np.bincount(2 * first + one, row * swing, size)[:size]
        for apart, other in enumerate(rows[one:]):
            band[apart] += np.bincount(2 * first + one, row * other, size)[:size]
    bend = np.diff(np.eye(knots.size), 2, axis=0)
    rate = time.size / max(knots.size, 1)
    penalty = STIFFNESS * rate / (0.1 * KNOT_SECONDS) ** 4 * (bend.T @ bend) + 1e-9 * rate * np.eye(knots.size)
    for apart in range(3):
        band[2 * apart, : size - 2 * apart] += np.repeat(np.diag(penalty, apart), 2)
    solution = solveh_banded(band, right, lower=True)
    return np.asarray(solution[::2] + 1j * solution[1::2])


def _splines(time: Floats, knots: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The first of the four knots whose splines reach a time, and their values, (4, n)."""
    first = np.clip(np.floor((time - knots[0]) / KNOT_SECONDS).astype(np.int64) - 1, 0, None)
    places = (time - (knots[0] + first * KNOT_SECONDS)) / KNOT_SECONDS
    return first, np.stack([_cubic(places - offset) for offset in range(4)])


def _evaluate(coefficients: Complexes, knots: Floats, time: Floats, frequency: float) -> Floats:
    first = np.clip(np.floor((time - knots[0]) / KNOT_SECONDS).astype(np.int64) - 1, 0, knots.size - 4)
    envelope = np.zeros(time.size, dtype=np.complex128)
    for offset in range(4):
        envelope += coefficients[first + offset] * _cubic((time - knots[first + offset]) / KNOT_SECONDS)
    return np.asarray((envelope * np.exp(1j * frequency * time)).real)


def _cubic(x: Floats) -> Floats:
    """Cubic B-spline of unit knots, centred on zero."""
    size = np.abs(x)
    near = 2.0 / 3.0 - size**2 + 0.5 * size**3
    far = np.clip(2.0 - size, 0.0, None) ** 3 / 6.0
    return np.where(size < 1.0, near, far)
