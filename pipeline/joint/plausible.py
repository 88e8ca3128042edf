"""What cannot be meant: units and labels that are not what the record says, each told in one line with its remedy."""

from __future__ import annotations

import itertools

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats

LARGEST = 1.0  # rad, of the usual reading
MOST_SWINGS = 20.0  # between readings
GRAVITIES = (0.1, 100.0)  # m s-2
MOST_HEAVE = 0.5  # of gravity, standard deviation
WINDOW, FEWEST, WINDOWS = 3.0, 12, 400  # swings; readings; of them at most
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


def _slow(time: Floats, series: Floats, frequency: float) -> tuple[Floats, Floats]:
    """Mean of each trace beside the swing in windows of some swings, (t, w), and its 1 sigma; NaN: too few."""
    edges = np.arange(time[0], time[-1], WINDOW * 2.0 * np.pi / frequency)[: WINDOWS + 1]
    bounds = np.searchsorted(time, edges)
    mean, doubt = np.full((2, series.shape[0], max(edges.size - 1, 0)), np.nan)
    for w, (begin, end) in enumerate(itertools.pairwise(bounds)):
        turn = frequency * (time[begin:end] - time[begin])
        basis = np.stack([np.ones(turn.size), np.cos(turn), np.sin(turn)], axis=1)
        for j, own in enumerate(series[:, begin:end]):
            there = np.isfinite(own)
            if there.sum() < FEWEST:
                continue
            found, left, rank, _ = np.linalg.lstsq(basis[there], own[there], rcond=None)
            if rank == 3 and left.size:
                mean[j, w], doubt[j, w] = found[0], np.sqrt(left[0] / there.sum() ** 2)
    return mean, doubt
