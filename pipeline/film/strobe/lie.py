"""How a slow film lies in its scan: turned, or exposed through a slit that stood askew.

Swings of a slow film lie so close that rows are read as the slit wrote them: all at one time. Where the slit stands
askew to the rows, light of earlier and of later times comes together, and the mean place of a row's light swings with
overtones that a pendulum has not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import median_present
from pipeline.film.marks.pieces import exposed
from pipeline.film.scan.opening import OpenScan
from pipeline.film.strobe.dense import first_emulsion, spot_of
from pipeline.film.strobe.dense_kernels import first_shapes, values
from pipeline.film.strobe.dense_survey import faintest, light_of, survey

ASIDE = 2.0  # px by which bands may run aside over the film
STEEPEST, SHEARS = 0.035, 15  # tangent of the slit's slant, and how many are tried
AROUND = np.linspace(-0.0125, 0.0125, 11)  # the best of them, by a parabola
LEAST = 2.5e-3  # that matters
PIECES, SWINGS = 5, 12  # of the film, in which that is told, and swings in each
LESS = 0.8  # of what is left of the rows' mean places with a slit that stands askew the other way


class Lie(NamedTuple):
    """How a film lies; see `OpenScan.straightened`."""

    lean: float = 0.0  # columns by which bands run aside per row
    shear: float = 0.0  # rows by which the image lags per column


def lie_of(scan: OpenScan, count: int | None) -> Lie:
    """How a slow film with `count` traces, if known, lies; exactly 0 where nothing shows that it lies askew.

    `RefusedError`: no swinging band was found, or others than were expected.
    """
    emulsion = first_emulsion(scan)
    found, upright, lie = survey(scan, emulsion, count), scan, Lie()
    if abs(found.lean) * scan.rows > ASIDE:
        lie = Lie(found.lean, -found.lean)  # as of a film that was turned in the scanner
        upright = scan.straightened(*lie)
        found = survey(upright, emulsion, count)
    windows, period, spot, least = found.windows(upright.columns), found.period, spot_of(scan), faintest(emulsion)

    def overtones(shear: float) -> float:
        shown, away = scan.straightened(lie.lean, lie.shear + shear), []
        length = min(int(SWINGS * period), shown.rows)
        for first in np.unique(np.linspace(0, shown.rows - length, PIECES).astype(int)).tolist():
            piece = exposed(shown, emulsion, first, first + length)
            for window in windows:
                light, column = light_of(piece, *window, least)
                middle = np.arange(1.5 * period, light.size - 1.5 * period, period)
                shapes = first_shapes(light, column, 0, middle, period, spot)
                at = middle[:, None] + np.linspace(-0.5, 0.5, int(period))
                fitted = values(shapes[:, None], at - middle[:, None], period)[0]
                away.append(np.abs(np.interp(at, np.arange(light.size) + 0.5, column) - fitted).ravel())
        return median_present(np.concatenate(away))

    tried = np.linspace(-STEEPEST, STEEPEST, SHEARS)
    near = tried[int(np.nanargmin([overtones(float(shear)) for shear in tried]))] + AROUND
    bend, slope, _ = np.polyfit(near, [overtones(float(shear)) for shear in near], 2)
    askew = float(np.clip(-0.5 * slope / bend, near[0], near[-1])) if bend > 0.0 else 0.0
    if abs(askew) < LEAST or overtones(askew) > LESS * overtones(-askew):
        return lie
    return lie._replace(shear=lie.shear + askew)
