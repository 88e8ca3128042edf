"""The shutter's gaps on a piece of film: told from a trace's brightness row by row, and fitted to the pixels.

The spot blurs a gap, but not what is missing: the lack of light summed over the rows is the gap's length, and its
centre of gravity the gap's middle. Beside a gap a row holds part of a line, whose cut is not that of a whole one, so
that this is a first guess only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import FilmEmulsion
from pipeline.film.marks.gap_kernels import ROW, ROW_SIGMA, WIDTH, Known, fit_gaps
from pipeline.film.marks.pieces import grain

LEAST_LACK = 0.12
SIGNIFICANT = 6.0  # sigma of the light missing in all
LATERAL, LENGTH_PRIOR = 0.1, 0.25  # px, 1 sigma of the course across the line; of the length
MOST_SIGMA = 0.5  # rows, of a fit that is believed


def lamp_course(light: Floats, period: float) -> Floats:
    """Brightness of the line in the open: the running upper half of half a swing, where anything is seen."""
    from scipy import ndimage

    width = 2 * max(4, round(0.25 * period)) + 1
    course = ndimage.percentile_filter(np.nan_to_num(light, nan=0.0), 60.0, size=width, mode="nearest")
    return np.asarray(np.maximum(course, 0.02), dtype=np.float64)


def find_gaps(light: Floats, lamp: Floats, first: int) -> Floats:
    """First and last row of a trace's gaps (n, 2) from its brightness from row `first` on; NaN where not followed."""
    lack = np.clip(1.0 - light / lamp, -0.5, 1.0)
    known = np.isfinite(lack)
    lack = np.where(known, lack, 0.0)
    sigma = 1.4826 * float(np.median(np.abs(lack[known] - np.median(lack[known])))) if known.sum() > 8 else 0.1
    smooth = np.convolve(lack, np.ones(3) / 3.0, mode="same")
    inside = smooth > max(LEAST_LACK, 2.0 * sigma)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    gaps = []
    for begin, stop in zip(edges[::2], edges[1::2], strict=True):
        a, b = max(0, begin - 1), min(lack.size, stop + 1)
        amount = float(lack[a:b].sum())
        if amount > max(0.2, SIGNIFICANT * sigma * np.sqrt(b - a)):
            middle = first + float(np.sum(lack[a:b] * (np.arange(a, b) + 0.5))) / amount
            gaps.append((middle - 0.5 * amount, middle + 0.5 * amount))
    return np.array(gaps).reshape(-1, 2)


def fitted_gaps(
    darkness: NDArray[np.float32],
    first: int,
    place: Floats,
    slope: Floats,
    gaps: list[Floats],
    emulsion: FilmEmulsion,
    period: float,
) -> list[Floats]:
    """Gaps of all traces fitted to the film; those that cannot be fitted stay as they are.

    Parameters
    ----------
    darkness : (rows, columns) array
        Of the rows from `first` on, above blank film.
    place, slope : (traces, rows) arrays
        The courses; NaN where they are not known.
    gaps : list of (n, 2) arrays
        First and last rows.
    period : float
        Rows in a swing.
    """
    table, exposure = np.concatenate(gaps) - first, emulsion.lit(darkness)
    trace = np.repeat(np.arange(len(gaps)), [len(each) for each in gaps])
    known = Known(emulsion.spot, *grain(emulsion), LATERAL, LENGTH_PRIOR, 0.5 * period)
    result = fit_gaps(exposure, 0, place, slope, trace, table.mean(axis=1), table[:, 1] - table[:, 0], known)
    good = result[:, ROW_SIGMA] < MOST_SIGMA
    table[good] = result[good, ROW, None] + result[good, WIDTH, None] * np.array([-0.5, 0.5])
    return [first + table[trace == k] for k in range(len(gaps))]
