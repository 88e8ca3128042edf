"""The emulsion of a film, measured on it."""

from __future__ import annotations

import numpy as np

from pipeline.film.emulsion.blank import darkness_table, measure_blank
from pipeline.film.emulsion.curve import ToneCurve
from pipeline.film.emulsion.film_emulsion import FilmEmulsion
from pipeline.film.parts import Scan
from pipeline.film.tracking.probing import probe

UNTOLD = ToneCurve(0.6, 0.2, 1.5)
"""Where nothing swings on the film, from which its curve could be told."""
LEAST_SIGMA = 2.5e-3
"""Of a pixel of blank film: without grain it is rounded to whole values, and no background is known better."""


def measure_emulsion(
    scan: Scan, *, spot: float | None = None, rows_per_swing: float | None = None, count: int | None = None
) -> FilmEmulsion:
    """Blank film, grain, characteristic curve and spot, from strips spread over the film.

    Parameters
    ----------
    scan : Scan
        The film, dark lines on light.
    spot : float, optional
        1 sigma of the spot, px, to start from.
    rows_per_swing, count : optional
        Rows in a full swing and number of traces, if known.
    """
    plain = plain_emulsion(scan)
    probed = probe(
        lambda first, stop: plain.darkness(scan.read(first, stop), first),
        scan.rows,
        float(np.sqrt(plain.grain[0])),
        spot,
        rows_per_swing,
        count,
    )
    if probed is None:
        return plain
    _, optics = probed
    return FilmEmulsion(scan.full_scale, plain.blank, optics.curve, optics.grain, optics.spot)


def plain_emulsion(scan: Scan) -> FilmEmulsion:
    """Blank film and its grain; the rest is untold."""
    blank = measure_blank(scan, darkness_table(scan.full_scale))
    sigma = max(blank.sigma, LEAST_SIGMA)
    return FilmEmulsion(scan.full_scale, blank, UNTOLD, np.array([sigma**2, 10.0 * sigma**2]))
