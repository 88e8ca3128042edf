"""The time of every row, from the paper's motion at the marks."""

from __future__ import annotations

import numpy as np

from pipeline.film.marks.drive import Drive
from pipeline.film.parts import Floats

SHARED = 0.3  # of the marks' floor: neighbouring marks lie at the same phase of the swing and err alike


def times_of(found: Drive, rows: int) -> tuple[Floats, Floats]:
    """Time since the first mark of the centre of each row, and 1 sigma, s; NaN beyond the marks.

    Between marks the motion is the polynomial of degree five that has row, speed and acceleration at both.
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
    marks = np.arange(found.row.size) * h
    sigma = np.full(rows, np.nan)
    sigma[inside] = np.interp(
        seconds[inside], marks, np.hypot(found.row_sigma, SHARED * found.floor) / np.maximum(found.speed, 1e-9)
    )
    return seconds, sigma
