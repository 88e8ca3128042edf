"""The emulsion of a film, measured on it."""

from __future__ import annotations

import numpy as np

from pipeline.film.emulsion.blank import darkness_table, measure_blank
from pipeline.film.emulsion.film_emulsion import FilmEmulsion, ToneCurve
from pipeline.film.parts import Scan
from pipeline.film.tracking.probing import probe

UNTOLD = ToneCurve(0.6, 0.2, 1.5)
"""Where nothing swings on the film, from which its curve could be told."""
LEAST_SIGMA = 2.5e-3
"""Of a pixel of blank film: without grain it is rounded to whole values, and no background is known better."""


def measure_emulsion(scan: Scan) -> FilmEmulsion:
    """Blank film, grain, characteristic curve and spot, from strips spread over the film, dark lines on light."""
    plain = plain_emulsion(scan)
    sigma = float(np.sqrt(plain.grain[0]))
    probed = probe(lambda first, stop: plain.darkness(scan.read(first, stop), first), scan.rows, sigma)
    if probed is None:
        return plain
    _, optics = probed
    return FilmEmulsion(scan.full_scale, plain.blank, optics.curve, optics.grain, optics.spot)


def plain_emulsion(scan: Scan) -> FilmEmulsion:
    """Blank film and its grain; the rest is untold."""
    blank = measure_blank(scan, darkness_table(scan.full_scale))
    sigma = max(blank.sigma, LEAST_SIGMA)
    return FilmEmulsion(scan.full_scale, blank, UNTOLD, np.array([sigma**2, 10.0 * sigma**2]))
