"""A recorded acceleration, continued between its readings as a finite sum of harmonics.

Band-limited interpolation of readings at even steps: the table is continued beyond both ends by its point
reflection, which fades into the mean, so that the whole closes on itself without a jump; its discrete Fourier
transform then is a sum of harmonics that passes through every reading and holds nothing beyond half the
table's rate. That sum *is* the motion: the pendulums answer it in closed form, and what the record sees is
exact. The many harmonics of a long table are summed by Fourier transform (see `propagators.periodic`), to 1e-15 too:
a day of readings once a second, 54001 harmonics, takes 0.1 microseconds a sum and moment.

Uneven readings are first continued by a spline of degree 5, whose values at fine even steps take the table's
place.

Interpolation error against the motion that was read, 10 s swell once a second, as a part of its amplitude:
1.5e-2 between the last two readings, 1e-3 three readings from the end, 7e-6 fifty readings from it, and
falling. It is an error of the table, not of the simulation: the truth holds the interpolated motion.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene_motion import Table
from synth.motion.harmonic_sum import Comb, HarmonicSum
from synth.motion.table_file import read_table
from synth.phase import Floats, rational_turns

LONG = 256
"""Harmonics from which a table is summed by Fourier transform: there it takes as long as harmonic by harmonic."""

_EVENNESS = 1e-6  # of a step, by which readings may be off and still count as even
_REFINEMENT = 4  # even steps a typical uneven step


def tabulated(term: Table, duration: float) -> HarmonicSum:
    """Read a table and continue it.

    `SceneError` if the table does not cover the record, jumps, or is uneven and should be band-limited.

    Parameters
    ----------
    term
        What the scene says.
    duration
        True time that the record needs, s.
    """
    seconds, values = read_table(term)
    begin = term.begin if term.begin is not None else float(seconds[0])
    if begin < seconds[0] or begin + duration > seconds[-1] + _EVENNESS:
        raise SceneError(
            f"{term.file}: covers {seconds[0]:g} to {seconds[-1]:g} s, the record needs {begin:g} to "
            f"{begin + duration:g} s; shorten the scene's duration or set {term.section}.begin"
        )
    jump = first_jump(seconds, values)
    if jump is not None:
        raise SceneError(
            f"{term.file}: jumps by {values[jump + 1] - values[jump]:.3g} m/s^2 between {seconds[jump]:g} and "
            f"{seconds[jump + 1]:g} s; a motion between readings must be smooth: read finer steps, or mend or cut it"
        )
    if term.interpolation == "spline":
        seconds, values = _resampled(seconds, values)
    step = float(seconds[-1] - seconds[0]) / (seconds.size - 1)
    if np.max(np.abs(seconds - (seconds[0] + step * np.arange(seconds.size)))) > _EVENNESS * step:
        raise SceneError(f"{term.file}: its steps are uneven; set {term.section}.interpolation = 'spline'")
    return continued(values, step, begin - float(seconds[0]))


def continued(values: Floats, step: float, delay: float) -> HarmonicSum:
    """Finite sum of harmonics through even readings.

    Parameters
    ----------
    values : (readings,)
        m/s^2
    step : float
        s
    delay : float
        Time from the first reading to t = 0, s.
    """
    count = values.size
    margin = min(count - 1, max(64, count // 8))
    mean = float(np.mean(values))
    fade = _fade(margin)
    left = 2 * values[0] - values[margin:0:-1]
    right = 2 * values[-1] - values[-2 : -margin - 2 : -1]
    closed = np.concatenate([values, mean + (right - mean) * fade, mean + (left - mean) * fade[::-1]])
    spectrum = np.fft.rfft(closed) / closed.size
    spectrum[1 : (closed.size + 1) // 2] *= 2  # both signs of frequency; zero and the last of an even count have one
    period = closed.size * Fraction(step)
    comb = Comb(0, spectrum.size, period)
    late = rational_turns(Fraction(delay) / period).phasors(np.arange(spectrum.size))[0]
    return HarmonicSum(comb.frequencies()[0], spectrum * late, (comb,) if spectrum.size > LONG else ())


def _fade(count: int) -> Floats:
    """From 1 to 0, with all derivatives vanishing at both ends."""
    x = (np.arange(count) + 1.0) / (count + 1.0)
    fade: Floats = (1 - np.tanh((1 / (1 - x) - 1 / x) / 2)) / 2
    return fade


def _resampled(seconds: Floats, values: Floats) -> tuple[Floats, Floats]:
    from scipy.interpolate import make_interp_spline

    count = 1 + _REFINEMENT * math.ceil((seconds[-1] - seconds[0]) / float(np.median(np.diff(seconds))))
    even = np.linspace(seconds[0], seconds[-1], count)
    degree = min(5, (seconds.size - 1) // 2 * 2 - 1) if seconds.size > 2 else 1
    return even, np.asarray(make_interp_spline(seconds, values, k=degree)(even))


_LARGE = 0.2  # of the range of the table
_ALONE = 8.0  # times all neighbours: white noise of 1e7 readings has no such place
_NEIGHBOURS = 15  # places to either side that it is compared with
_FEWEST = 12  # neighbours without which nothing is told
_GAP = 1.5  # typical steps: across a longer one, a wave too comes far


def first_jump(seconds: Floats, values: Floats) -> int | None:
    """Place of the reading before the first jump, or None.

    Parameters
    ----------
    seconds, values : (readings,)
        Times, increasing, and what was read.

    Examples
    --------
    >>> seconds = np.arange(100.0)
    >>> swell = np.cos(0.6 * seconds)
    >>> first_jump(seconds, swell) is None
    True
    >>> first_jump(seconds, swell + (seconds > 40.0))
    40
    """
    steps, rises = np.diff(seconds), np.diff(values)
    if rises.size <= _FEWEST + 1:
        return None
    bent = rises.copy()  # in line with the slopes before and after: nothing
    bent[1:-1] -= 0.5 * (rises[:-2] + rises[2:])
    bent[[0, -1]] = 0.0
    least = _LARGE * float(np.ptp(values))
    near = steps <= _GAP * float(np.median(steps))
    found = (_alone(rises, 2) | _alone(bent, 3)) & (np.abs(rises) > least) & near
    places = np.flatnonzero(found)
    return int(places[0]) if places.size else None


def _alone(differences: Floats, nearest: int) -> np.ndarray:
    """Where a difference is larger than all from `nearest` to _NEIGHBOURS places away."""
    size = np.abs(differences)
    padded = np.pad(size, _NEIGHBOURS)
    largest = np.zeros(size.size)
    for away in range(nearest, _NEIGHBOURS + 1):
        for begin in (_NEIGHBOURS - away, _NEIGHBOURS + away):
            np.maximum(largest, padded[begin : begin + size.size], out=largest)
    alone: np.ndarray = size > _ALONE * largest
    return alone
