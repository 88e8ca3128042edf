"""What cannot be meant: units and labels that are not what the record says, each told in one line with its remedy."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats

LARGEST = 1.0  # rad, of the usual reading
MOST_SWINGS = 20.0  # between readings
GRAVITIES = (0.1, 100.0)  # m s-2
MOST_HEAVE = 0.5  # of gravity, standard deviation
WINDOW, FEWEST, WINDOWS = 3.0, 12, 400  # swings; readings; of them at most
SINGULAR = 1e-6  # of the determinant of three orthogonal functions
SWAYS, HALF = 3.0, 0.5  # of the doubt of its mean; of what a trace should share of another's slow motion


def refuse_wrong_units(time: Floats, series: Floats, heave: Floats | None, frequency: float, gravity: float) -> None:
    """Refuse elongations, times or accelerations in other units than theirs.

    Parameters
    ----------
    time : (n,) array
    series : (t, n) array
    heave : (n,) array, optional
        m s-2.
    frequency, gravity : float
        rad s-1; m s-2, at which it holds.
    """
    if not GRAVITIES[0] < gravity < GRAVITIES[1]:
        raise RefusedError(f"instrument/reference_gravity: {gravity:g} m s-2 is no planet's; give m s-2")
    swings = float(np.median(np.diff(time))) * frequency / (2.0 * np.pi) if time.size > 1 else 0.0
    if swings > MOST_SWINGS:
        raise RefusedError(f"time: {swings:.3g} swings lie between readings; give times and periods in s")
    usual = float(np.nanmedian(np.abs(series)))
    if usual > LARGEST:
        raise RefusedError(f"record/elongation: half of the readings exceed {usual:.3g} rad; give elongations in rad")
    if heave is not None and (scatter := float(np.nanstd(heave))) > MOST_HEAVE * gravity:
        raise RefusedError(
            f"record/vertical_acceleration: {scatter:.3g} m s-2 of standard deviation are no ship's; give m s-2"
        )


def refuse_exchanged_traces(
    time: Floats, series: Floats, combination: Floats, frequency: float, names: tuple[str, ...]
) -> None:
    """Refuse where a difference sways as a pendulum does, or a pendulum does not sway as another.

    The ship's slow motion moves pendulums alike.
    """
    levels = combination.sum(axis=1)
    first = int(np.argmax(np.abs(levels)))
    if not levels[first]:
        return
    slow, doubt = _slow(time, series, frequency)
    for j, level in enumerate(levels):
        both = np.isfinite(slow[j]) & np.isfinite(slow[first])
        one, other = np.diff(slow[first, both]), np.diff(slow[j, both])  # a step of a zero is in one of them
        if one.size < FEWEST or not np.std(one) > SWAYS * np.median(doubt[first, both]):
            continue
        share = float(one @ other / (one @ one))
        if abs(share - level / levels[first]) > HALF:
            raise RefusedError(
                f"record/combination: trace '{names[j]}' has {share:+.2f} of the slow motion of '{names[first]}', "
                f"its combination says {level / levels[first]:+.2f}; say which pendulums each trace records"
            )


def _slow(time: Floats, series: Floats, frequency: float) -> Floats:
    """Mean of each trace beside the swing in windows of some swings, and its 1 sigma, (2, t, w); NaN: too few."""
    bounds = np.searchsorted(time, np.arange(time[0], time[-1], WINDOW * 2.0 * np.pi / frequency)[: WINDOWS + 1])
    begins = bounds[:-1][np.diff(bounds) > 0]
    if not begins.size:
        return np.zeros((2, series.shape[0], 0))
    some = slice(0, bounds[-1])
    there = np.isfinite(series[:, some])
    turn = frequency * time[some]
    basis = np.stack([np.ones(turn.size), np.cos(turn), np.sin(turn)])
    values = np.where(there, series[:, some], 0.0)
    count, square = (np.add.reduceat(each, begins, axis=1) for each in (there.astype(np.float64), values**2))
    normal = np.add.reduceat(there[:, None, None] * basis[:, None] * basis, begins, axis=3)
    normal = normal.transpose(0, 3, 1, 2)
    right = np.add.reduceat(values[:, None] * basis, begins, axis=2).transpose(0, 2, 1)
    enough = (count >= FEWEST) & (np.linalg.det(normal) > SINGULAR * count**3)
    fit = np.linalg.solve(np.where(enough[..., None, None], normal, np.eye(3)), right[..., None])[..., 0]
    left = np.maximum(square - np.sum(fit * right, axis=2), 0.0)
    return np.where(enough, [fit[..., 0], np.sqrt(left) / np.maximum(count, 1.0)], np.nan)
