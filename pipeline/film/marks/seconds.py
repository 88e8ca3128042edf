"""The time of every row, from the paper's motion at the marks."""

from __future__ import annotations

import numpy as np

from pipeline.film.marks.drive import Drive
from pipeline.film.parts import Floats


def times_of(found: Drive, rows: int, lasting: float) -> tuple[Floats, Floats]:
    """Time since the first mark of the centre of each row, and 1 sigma, s; NaN beyond the marks.

    Between marks the motion is the polynomial of degree five that has row, speed and acceleration at both.

    The variance is the sum of three. At the marks, that of the drive's smoother, which knows the gaps' noise and how
    rough the paper ran, both as the film itself shows them; between two marks, what a motion as rough may do unseen
    while row and speed at both are held, `shake^2 (x (1 - x) h)^3 / 3 + roughness^2 (x (1 - x) h)^5 / 20` at the share
    x of the way h; and `lasting`, which no smoother tells from motion. It is that of a time read on any trace; the zero
    of time, common to all rows, is not in it.

    Parameters
    ----------
    found : Drive
    rows : int
        Of the film.
    lasting : float
        1 sigma, px, of errors that neighbouring marks share: of their gaps, the traces' offsets and the shear.
    """
    from scipy.interpolate import CubicSpline

    fine = 16
    x = np.arange(fine) / fine
    h = found.step
    r0, r1 = found.row[:-1, None], found.row[1:, None]
    v0, v1 = found.speed[:-1, None] * h, found.speed[1:, None] * h
    a0, a1 = found.acceleration[:-1, None] * h * h, found.acceleration[1:, None] * h * h
    c3 = 10 * (r1 - r0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * (r1 - r0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * (r1 - r0) - 3 * (v0 + v1) - 0.5 * (a0 - a1)
    curve = r0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
    at = np.concatenate([curve.ravel(), found.row[-1:]])
    when = np.arange(at.size) * (h / fine)
    centre = np.arange(rows) + 0.5
    inside = (centre >= at[0]) & (centre <= at[-1])
    seconds = np.full(rows, np.nan)
    forward = np.maximum.accumulate(at + 1e-9 * np.arange(at.size))
    seconds[inside] = CubicSpline(forward, when)(centre[inside])
    sigma = np.full(rows, np.nan)
    marks = np.arange(found.row.size)
    place = seconds[inside] / h
    variance = np.interp(place, marks, found.row_sigma**2 + lasting**2)
    unseen = (place % 1.0) * (1.0 - place % 1.0) * h
    variance += np.exp(2.0 * found.shake) * unseen**3 / 3.0 + np.exp(2.0 * found.roughness) * unseen**5 / 20.0
    sigma[inside] = np.sqrt(variance) / np.interp(place, marks, np.maximum(found.speed, 1e-9))
    return seconds, sigma
