"""A recorded acceleration, continued between its readings as a finite sum of harmonics.

Band-limited interpolation at even steps: the table is continued beyond both ends by its point reflection, which fades
into the mean, so that the whole closes on itself; its discrete Fourier transform is a sum of harmonics that passes
through every reading and holds nothing beyond half the table's rate. That sum *is* the motion. It is summed by
Fourier transform, to 1e-15 (`propagators.blocks`). Uneven readings are first continued by a spline of degree 5.

Interpolation error against the motion that was read, 10 s swell once a second, as a part of its amplitude:
1.5e-2 between the last two readings, 1e-3 three readings from the end, 7e-6 fifty readings from it, and
falling. It is an error of the table, not of the simulation: the truth holds the interpolated motion.
"""

import contextlib
import csv
import io
import math
import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np

from data_schemas.errors import FileError, SceneError
from data_schemas.scene_motion import Table
from data_schemas.text_files import text_of
from synth.motion.harmonic_sum import Comb, HarmonicSum
from synth.phase import Floats, rational_turns

LONG = 256
"""Harmonics from which a table is summed by Fourier transform: there it takes as long as harmonic by harmonic."""

_EVENNESS = 1e-6  # of a step, by which readings may be off and still count as even
_REFINEMENT = 4  # even steps a typical uneven step


def tabulated(term: Table, duration: float) -> HarmonicSum:
    """Read a table for the true time, s, of the record; `SceneError`: too short, jumps, or uneven and band-limited."""
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
    """Finite sum of harmonics through even readings a step apart, s; the first is read a delay before t = 0, s."""
    count = values.size
    margin = min(count - 1, max(64, count // 8))
    mean = float(np.mean(values))
    x = (np.arange(margin) + 1.0) / (margin + 1.0)
    fade = (1 - np.tanh((1 / (1 - x) - 1 / x) / 2)) / 2  # from 1 to 0, with all derivatives vanishing at both ends
    left = 2 * values[0] - values[margin:0:-1]
    right = 2 * values[-1] - values[-2 : -margin - 2 : -1]
    closed = np.concatenate([values, mean + (right - mean) * fade, mean + (left - mean) * fade[::-1]])
    spectrum = np.fft.rfft(closed) / closed.size
    spectrum[1 : (closed.size + 1) // 2] *= 2  # both signs of frequency; zero and the last of an even count have one
    period = closed.size * Fraction(step)
    comb = Comb(0, spectrum.size, period)
    late = rational_turns(Fraction(delay) / period).phasors(np.arange(spectrum.size))[0]
    return HarmonicSum(comb.frequencies()[0], spectrum * late, (comb,) if spectrum.size > LONG else ())


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
    """Place of the reading before the first jump, or None; times increase, s."""
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
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(size, _NEIGHBOURS), 2 * _NEIGHBOURS + 1)
    others = np.abs(np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)) >= nearest
    return np.asarray(size > _ALONE * np.max(windows, axis=1, where=others, initial=0.0))


@np.errstate(all="ignore")
def read_table(term: Table) -> tuple[Floats, Floats]:
    """Two columns of a CSV file or variables of a netCDF file: times in s, and values times the factor.

    `SceneError`: no such file or column, a value that is no number, or times that do not increase.
    """
    path = Path(term.file)
    try:
        columns = _netcdf(path, term) if path.suffix == ".nc" else _csv(path, term)
    except (OSError, ValueError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise SceneError(f"{path}: cannot be read ({why}); mend {term.section}.file") from None
    seconds, values = columns[0], columns[1] * term.factor
    if seconds.shape != values.shape or seconds.ndim != 1 or seconds.size < 2:
        raise SceneError(f"{path}: time and value must be two columns of equal length with two readings at least")
    if not (np.all(np.isfinite(seconds)) and np.all(np.isfinite(values))):
        raise SceneError(f"{path}: has values missing or infinite; a motion must be known at all times, fill them in")
    if np.any(seconds[1:] <= seconds[:-1]):
        raise SceneError(f"{path}: the times of column {term.time!r} do not increase; sort them")
    return seconds, values


def _csv(path: Path, term: Table) -> tuple[Floats, Floats]:
    text = text_of(path, f"mend {term.section}.file", SceneError).lstrip()
    if not text:
        raise SceneError(f"{path}: is empty; give a table with a time and a value column")
    separator = ";" if ";" in text.partition("\n")[0] else ","
    names, has_header = [cell.strip() for cell in next(csv.reader(io.StringIO(text), delimiter=separator))], True
    with contextlib.suppress(ValueError):
        has_header = not [float(cell) for cell in names]
    places = [_place(path, names if has_header else [], len(names), column) for column in (term.time, term.value)]
    try:
        with warnings.catch_warnings(action="ignore"):  # no row at all
            seconds, values = np.loadtxt(
                io.StringIO(text), delimiter=separator, skiprows=int(has_header), usecols=places, unpack=True, ndmin=2,
                comments=None, quotechar='"',
            )  # fmt: skip
    except ValueError:
        what = f"column {term.time!r} or {term.value!r}"
        raise SceneError(f"{path}: a row lacks a number in {what}; mend it") from None
    return seconds, values


def _place(path: Path, names: list[str], width: int, column: int | str) -> int:
    if isinstance(column, int):
        if column > width:
            raise SceneError(f"{path}: has no column {column}; it has {width}")
        return column - 1
    if column not in names:
        known = f"it has {', '.join(names)}" if names else "it has no header, give the column's number"
        raise SceneError(f"{path}: has no column {column!r}; {known}")
    return names.index(column)


def _netcdf(path: Path, term: Table) -> tuple[Floats, Floats]:
    from data_schemas.reading import load

    try:
        variables = load(path)[""].variables
    except FileError as fault:
        raise SceneError(str(fault)) from None
    names = list(variables)
    found = [names[_place(path, names, len(names), column)] for column in (term.time, term.value)]
    seconds, values = (np.asarray(variables[name].values, dtype=np.float64) for name in found)
    return seconds, values
