"""The Eotvos effect: a ship that goes east turns with the Earth a little faster, and weighs less."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.ledger.entry import MGAL, Case, Change, correction

if TYPE_CHECKING:
    from pipeline.conditions import Constants

NEEDS = ("latitude", "speed", "course")
TURN = 7.292115e-5  # rad s-1, GRS80 (Moritz 1980), as the two below
AXIS = 6378137.0  # m
SQUARE_ECCENTRICITY = 0.00669438002290


@correction(
    "eotvos",
    "2 w v sin(course) cos(lat) + v^2 (cos(course)^2/M + sin(course)^2/N); "
    "with v in knots 7.503 v cos(lat) sin(course) + 0.00415 v^2 mGal",
    "Eotvos 1919, Ann. Phys. 364, 743; Harlan 1968, J. Geophys. Res. 73, 4675",
    NEEDS,
)
def way(case: Case, gravity: float) -> Change:
    """Add what the ship's way takes off; of a way that changes within the record its mean."""
    given = navigation(case.prepared.observation.constants)
    parts: list[float | None] = []
    for k, name in enumerate(NEEDS):
        own = case.uncertainty(name)
        above, below = (eotvos(*(x + sign * (own or 0.0) * (i == k) for i, x in enumerate(given))) for sign in (1, -1))
        parts.append(None if own is None else case.mean_over_record(0.5 * (above - below)) / MGAL)
    latitude, speed, course = (_span(x) for x in given)
    words = f"{speed} m/s on {course} deg at {latitude} deg"
    return Change(gravity + case.mean_over_record(eotvos(*given)), case.sigma(*parts), words)


def navigation(constants: Constants) -> list[Any]:
    """Latitude, speed and course: a number each, or an array at the record's times."""
    return [constants.get(f"{name}_course", constants[name]) for name in NEEDS]


def _span(values: Floats | float) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:.3f}" if low == high else f"{low:.3f} to {high:.3f}"


def eotvos(latitude: Floats | float, speed: Floats | float, course: Floats | float) -> Any:
    """Correction for the ship's way, to be added to gravity, m s-2, broadcast over numbers or arrays.

    Latitude in degrees; speed over ground, m s-1, steady, at the sea's surface; course in degrees from north by east.

    Examples
    --------
    >>> round(eotvos(0.0, 4 * 1852 / 3600, 90.0) * 1e5, 1)  # four knots east at the equator
    30.1
    """
    phi, alpha = np.radians(latitude), np.radians(course)
    bulge = 1.0 - SQUARE_ECCENTRICITY * np.sin(phi) ** 2
    across = AXIS / np.sqrt(bulge)  # N, of the prime vertical
    along = across * (1.0 - SQUARE_ECCENTRICITY) / bulge  # M, of the meridian
    east, north = speed * np.sin(alpha), speed * np.cos(alpha)
    return 2.0 * TURN * east * np.cos(phi) + north**2 / along + east**2 / across
