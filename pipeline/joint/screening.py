"""What readings show before any model: wrong units and labels (refused); copies, still traces, outliers, rounding."""

from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present
from pipeline.joint.lattice import WINDOW, folded

LARGEST = 1.0  # rad, of the usual reading
MOST_SWINGS = 20.0  # between readings
GRAVITIES = (0.1, 100.0)  # m s-2
MOST_HEAVE = 0.5  # of gravity, standard deviation
SWINGS, FEWEST, ROOMY, WINDOWS = 3.0, 12, 1.25, 400  # in a window; readings in it, also where sparse; windows at most
SINGULAR = 1e-6  # of the determinant of three orthogonal functions
FAR, MANY = 6.0, 10000  # of the median departure from the median; readings
OFTEN, FEW = 10.0, 5.0  # times as often as other values; readings a value from which rounding shows
COPIED = 30  # values in a row that two traces cannot share by chance
HELD = 6.0  # s: a window in which all traces stand still
STILL, SWINGLESS, LEAST = 0.01, 12.0, 10  # of the largest trace's variance; of white noise's power; readings
EXACT = 1e-14  # of a mean square, to which a variance is known
SWAYS, ALONE, HALF = 3.0, 10.0, 0.5  # of the doubt of its mean; of what a trace should share of another's slow motion
WILD = 5.0  # times the usual doubt
NOISIER, CALM = 20.0, 1e-6  # times than another no trace is, of which sparse readings take sway for doubt; rad


def refuse_wrong_units(time: Floats, series: Floats, heave: Floats | None, frequency: float, gravity: float) -> None:
    """Refuse times, (n,) s, elongations, (t, n) rad, or heave, (n,) m s-2, in other units than theirs; `frequency` of
    the swing, rad s-1, at this `gravity`, m s-2."""
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
    """Refuse where a difference sways slowly as a pendulum does, or a pendulum does not sway as another."""
    levels = combination.sum(axis=1)
    first = int(np.argmax(np.abs(levels)))
    if not levels[first]:
        return
    slow, doubt = _slow(time, series, frequency)
    for own, each in zip(slow, doubt, strict=True):  # a window with wild readings shows no motion
        own[each > WILD * median_present(each)] = np.nan
    for j, level in enumerate(levels):
        both = np.isfinite(slow[j]) & np.isfinite(slow[first])
        one, other = np.diff(slow[first, both]), np.diff(slow[j, both])  # a step of a zero is in one of them
        if one.size < FEWEST:
            continue
        usual, own = (float(np.median(np.abs(each - np.median(each)))) for each in (one, other))  # steps are rare
        sways = (own > ALONE * np.median(doubt[j, both]) and usual < HALF * own) or usual < own / NOISIER
        if not level and own > CALM and sways:
            raise RefusedError(
                f"record/combination: trace '{names[j]}', a difference, sways with the ship and '{names[first]}' does "
                "not; say which pendulums each trace records"
            )
        if not np.std(one) > SWAYS * np.median(doubt[first, both]):
            continue
        share = float(one @ other / (one @ one))
        if abs(share - level / levels[first]) > HALF:
            raise RefusedError(
                f"record/combination: trace '{names[j]}' has {share:+.2f} of the slow motion of '{names[first]}', "
                f"its combination says {level / levels[first]:+.2f}; say which pendulums each trace records"
            )


def _slow(time: Floats, series: Floats, frequency: float) -> Floats:
    """Mean of each trace beside the swing in windows of some swings, and its 1 sigma, (2, t, w); NaN: too few."""
    spacing = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    window = max(SWINGS * 2.0 * np.pi / frequency, ROOMY * FEWEST * spacing)
    bounds = np.searchsorted(time, np.arange(time[0], time[-1], window)[: WINDOWS + 1])
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


def _runs(flags: Any) -> list[tuple[int, int]]:
    """First place of each run of true values, and the one behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def without_copies(series: Floats) -> Floats:
    """Traces, (t, n), without what two hold alike for long, one a copy; RefusedError where they do so throughout."""
    out = series.copy()
    for i in range(len(series)):
        for j in range(i):
            for begin, end in _runs(series[i] == series[j]):
                if end - begin >= COPIED and np.ptp(series[i, begin:end]) > 0.0:
                    out[[i, j], begin:end] = np.nan
    if np.isfinite(series).any() and not np.isfinite(out).any():
        raise RefusedError("record/elongation: the traces hold the same values; give each pendulum, or the difference")
    return out


def moving(time: Floats, series: Floats, swing: float, names: tuple[str, ...]) -> tuple[Floats, tuple[str, ...]]:
    """Traces, (t, n), without what shows neither swing nor sway for two windows and more, shorter where all traces
    stand, as pendulums do that are held; and that in words."""
    out, words = series.copy(), []
    least = STILL * float(np.nanmax(np.nanvar(series[np.isfinite(series).any(axis=1)], axis=1)))
    for window, together in ((WINDOW, False), (HELD, True)):
        if folded(swing, float(np.median(np.diff(time)))) * window < 2.0 * np.pi:
            break  # samples so sparse show a swing that is nearly still
        bounds = np.searchsorted(time, np.arange(time[0], time[-1], window))
        stands = _stands(time, out, bounds, swing, least)
        for j, own in enumerate(series):
            for first, last in _runs(stands.all(axis=0) if together else stands[j]):
                if last - first < 2:
                    continue
                part = slice(bounds[first], bounds[last] if last < bounds.size else own.size)
                moves = np.abs(own - np.nanmean(own[part])) > FAR * np.nanstd(own[part])
                before, after = np.flatnonzero(moves[: part.start]), np.flatnonzero(moves[part.stop :])
                part = slice(before[-1] + 1 if before.size else 0, part.stop + after[0] if after.size else own.size)
                out[j, part] = np.nan
                words.append(f"trace '{names[j]}' stands still from {time[part][0]:.0f} to {time[part][-1]:.0f} s")
    return out, tuple(dict.fromkeys(words))


def _stands(time: Floats, series: Floats, bounds: np.ndarray, swing: float, least: float) -> np.ndarray:
    """Windows, (t, k), from `bounds`, that vary less than that and whose power at the swing chance explains."""
    there = np.isfinite(series)
    mean = np.where(there, series, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    away = np.where(there, series - mean[:, None], 0.0)

    def summed(each: np.ndarray) -> np.ndarray:
        return np.add.reduceat(each, bounds, axis=1)

    count, square = summed(there.astype(np.float64)), summed(away**2)
    mean = summed(away) / np.maximum(count, 1.0)
    variance = np.maximum(square / np.maximum(count, 1.0) - mean**2, EXACT * square)
    quiet = np.asarray((count >= LEAST) & (variance < least))
    if not quiet.any():
        return quiet
    turn = np.exp(-1j * swing * time)
    power = np.abs(summed(away * turn) - mean * summed(there * turn)) ** 2
    return np.asarray(quiet & (power <= np.minimum(SWINGLESS, 0.1 * count) * count * variance))


def far_off(trace: np.ndarray, value: Floats, traces: int) -> np.ndarray:
    """Readings that lie where no swing of the trace goes, neither all along nor at the time: it may die away."""
    out = np.zeros(value.size, dtype=bool)
    for j in range(traces):
        own = value[trace == j]
        if not own.size:
            continue
        off = np.abs(own - np.median(own))
        usual = [np.full(part.size, np.median(part)) for part in np.array_split(off, 1 + off.size // MANY)]
        out[trace == j] = (off > FAR * np.maximum(np.median(off), np.concatenate(usual))) | _clipped(own)
    return out


def _clipped(value: Floats) -> np.ndarray:
    """Readings at the end of a range, which hold the same value many times more often than any other."""
    values, count = np.unique(value, return_counts=True)
    if values.size < 8:
        return np.zeros(value.size, dtype=bool)
    often = OFTEN * max(int(count[1:-1].max()), 1)
    return np.isin(value, values[[0, -1]][count[[0, -1]] > often])


def quantum(value: Floats) -> float:
    """Step of readings that were rounded to few values; 0: not so few that it shows."""
    values, count = np.unique(value[np.isfinite(value)], return_counts=True)
    return float(np.median(np.diff(values))) if 3 <= values.size <= count.sum() / FEW else 0.0
