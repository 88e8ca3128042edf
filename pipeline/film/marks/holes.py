"""How sure a drive is where marks are missing for long."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from pipeline.film.marks.drive import Drive, run_drive
from pipeline.film.parts import Floats

HOLE = 3.0  # s without marks


def holes_honest(rows: Floats, sigma: Floats, found: Drive) -> Drive:
    """The same, with its 1 sigma in long holes as large as errors are where marks are hidden over as long a time.

    The model's own sigma in a hole rests on the form of its motion, not on marks.
    """
    seen = np.flatnonzero((np.isfinite(rows) & found.used).any(axis=0))
    length = int(np.diff(seen).max(initial=0))
    if length * found.step < HOLE or seen.size < 6 * length:
        return found
    hidden = np.zeros(rows.shape[1], dtype=bool)
    for begin in range(length, rows.shape[1] - length, 3 * length):
        hidden[begin : begin + length] = True
    left = found.used & ~hidden
    parameters = (found.step, found.roughness, found.shake, found.floor, found.lines)
    blind = run_drive(np.where(left, rows, np.nan), sigma, *parameters, left, True)
    holes = hidden & (found.row_sigma < 0.5 * blind.row_sigma)
    away = (blind.row - found.row)[holes] / blind.row_sigma[holes]
    if away.size < 3:
        return found
    scale = max(1.0, float(np.sqrt(np.mean(away**2))))
    inside = np.zeros(rows.shape[1], dtype=bool)
    for begin, stop in itertools.pairwise(seen.tolist()):
        inside[begin + 1 : stop] = (stop - begin) * found.step >= HOLE
    return replace(found, row_sigma=np.where(inside, scale * found.row_sigma, found.row_sigma))
