"""Whether a trace shows motion much faster than the swing, for which the lattice must be dense."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats

WINDOW = 25.0  # s
FAST, FAST_PEAK, FAST_LINE = 1.8, 6.0, 0.3  # of the swing; deviations of a mean power; of the third harmonic
LEAST_GAP = 0.2  # s: shorter ones are interpolated without harm
QUIETEST = 1e-6  # rad: motion below it is none


def is_calm(time: Floats, series: Floats, swing: float, arc: float) -> bool:
    """Whether readings, (n,), NaN where missing, show no motion much faster than a swing of that arc, rad."""
    from scipy.interpolate import CubicSpline
    from scipy.signal.windows import blackmanharris

    there = np.isfinite(series)
    if there.sum() < 64:
        return True
    at, value = time[there], series[there]
    step = max(float(np.median(np.diff(at))), 1e-3)
    rows = int(WINDOW / step)
    turns = 2.0 * np.pi * np.fft.rfftfreq(rows, step) / swing
    fast = turns > FAST
    if not fast.any():
        return True
    filled, taper, found = CubicSpline(at, value), blackmanharris(rows), []
    own = np.arange(rows) * step
    design, inverse = _of_the_swing(own, swing, taper)
    for begin in np.arange(at[0], at[-1] - WINDOW, WINDOW):
        low, high = np.searchsorted(at, (begin, begin + WINDOW))
        if high - low > 2 and np.diff(at[low:high]).max() < LEAST_GAP:
            series = filled(begin + own)
            found.append(np.abs(np.fft.rfft(taper * (series - design @ (inverse @ series)))[fast]) ** 2)
    if not found:
        return False
    power = np.mean(found, axis=0) / float(taper @ taper)
    allowed = (1.0 + FAST_PEAK / np.sqrt(len(found))) * max(float(np.median(power)), QUIETEST**2)
    # the swing's own third harmonic, whose amplitude the ship changes
    third = float(taper.sum()) ** 2 / float(taper @ taper) * (arc**3 / 192.0) ** 2
    return bool(np.all(power < allowed + third * (np.abs(turns[fast] - 3.0) < FAST_LINE)))


def _of_the_swing(own: Floats, swing: float, taper: Floats) -> tuple[Floats, Floats]:
    """A line, the swing with an amplitude that changes evenly, its third harmonic; and what fits them under a taper."""
    since = own - own.mean()
    columns = [np.ones(own.size), since]
    for multiple in (1.0, 3.0):
        turn = np.cos(multiple * swing * since), np.sin(multiple * swing * since)
        columns += [*turn, since * turn[0], since * turn[1]] if multiple == 1.0 else turn
    design = np.stack(columns, axis=1)
    left = taper[:, None] * design
    return design, np.linalg.pinv(design.T @ left, hermitian=True) @ left.T
