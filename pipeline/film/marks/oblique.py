"""Offsets between the traces and shear of the image, from all marks, and the errors of gaps that last.

The drive's model tells motion from errors by their being independent from mark to mark. Dirt, bends of the tracker's
curve and the obliqueness of strokes are not: marks half a swing apart meet the strokes at nearly the same phase. Traces
tell, since the paper moves all of them at once: what lasts in their differences is error.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.drive import Drive
from pipeline.film.marks.search import Gaps
from pipeline.film.parts import Floats, Tracks

ENOUGH = 24  # marks seen on several traces
LAGS = 4  # marks: two swings
ENOUGH_PAIRS = 40  # pairs of marks a lag
SHARED = 0.3  # of the marks' floor, where one trace shows the marks


def middles(gaps: Gaps, tracks: Tracks) -> Floats:
    """Mean column of the two ends of each gap, px: what an oblique image shifts the middle of its rows by."""
    out = gaps.column.copy()
    for trace, slope in enumerate(tracks.slope):
        mine = gaps.trace == trace
        row, width = gaps.row[mine], gaps.width[mine]
        centres = np.arange(slope.size) + 0.5
        after, before = (np.interp(row + side * width, centres, slope) for side in (0.5, -0.5))
        out[mine] += np.nan_to_num(0.125 * width * (after - before))
    return out


def refined(rows: Floats, sigma: Floats, columns: Floats, found: Drive) -> tuple[Floats, float, float]:
    """Offsets of the traces, the first one's 0, shear, and what their errors make of a row, 1 sigma, by least squares.

    Of marks that several traces show, the row is free, so that nothing of theirs is taken for the paper's motion. If
    there are too few of those, rows are held to the motion found: a trace now left and now right of its middle tells
    the shear.

    Parameters
    ----------
    rows, sigma, columns : (traces, marks) arrays
        Of the gaps, px; NaN = missing.
    found : Drive
        The paper's motion and the gaps that were believed.
    """
    traces = len(rows)
    used = found.used & np.isfinite(rows) & np.isfinite(columns)
    weight = np.where(used, 1.0 / (sigma**2 + found.floor**2), 0.0)
    terms = np.zeros((traces + 2, traces, rows.shape[1]))  # offsets, shear, what is left
    for trace in range(traces):
        terms[trace, trace] = 1.0
    terms[traces] = np.where(used, columns, 0.0)
    terms[traces + 1] = np.where(used, rows - found.row, 0.0)
    several = used.sum(axis=0) > 1
    if several.sum() >= ENOUGH:
        weight[:, ~several] = 0.0
    total = np.maximum(weight.sum(axis=0), 1e-300)
    mean = np.einsum("km,pkm->pm", weight, terms) / total
    terms[:, :, several] -= mean[:, None, several]
    normal = np.einsum("km,pkm,qkm->pq", weight, terms, terms)
    free = [*range(1, traces), traces] if traces > 1 else [0, 1]  # of one trace, what lies even is the paper's
    size = normal[np.ix_(free, free)] + 1e-9 * np.diag(np.diag(normal)[free]) + 1e-12 * np.eye(len(free))
    spread = np.linalg.inv(size)
    value = spread @ normal[free, traces + 1]
    offset = np.zeros(traces)
    if traces > 1:
        offset[1:] = value[:-1]
    return offset, float(value[-1]), _left_over(spread, free, weight, used, columns)


def _left_over(spread: Floats, free: list[int], weight: Floats, used: NDArray[np.bool_], columns: Floats) -> float:
    """1 sigma, px, of rows freed of offset and shear, over all gaps; what all gaps share is the time's zero."""
    which, _ = np.nonzero(used)
    if which.size == 0:
        return 0.0
    by = np.zeros((which.size, len(used) + 1))
    by[np.arange(which.size), which] = 1.0
    by[:, -1] = columns[used]
    total = max(float(weight[used].sum()), 1e-300)
    by -= weight[used] @ by / total
    return float(np.sqrt(np.mean(np.einsum("ni,ij,nj->n", by[:, free], spread, by[:, free]))))


def lasting(rows: Floats, found: Drive) -> float:
    """1 sigma of the lasting error of a mark's row, px.

    Parameters
    ----------
    rows : (traces, marks) array
        Measured, freed of offsets and shear; NaN = missing.
    found : Drive
    """
    left = np.where(found.used, rows - found.row, np.nan)
    products = []
    for one, other in itertools.combinations(left, 2):
        apart = one - other
        for lag in range(1, LAGS + 1):
            both = apart[lag:] * apart[:-lag]
            products.append(both[np.isfinite(both)])
    several = [each for each in products if each.size >= ENOUGH_PAIRS]
    if not several:
        return SHARED * found.floor
    together = np.concatenate(several)
    chance = float(np.std(together)) / np.sqrt(together.size)
    of_one = 0.5 * max(float(np.mean(together)) - chance, 0.0)  # variance of a trace; a difference has two
    return float(np.sqrt(of_one / len(rows)))
