"""The Eotvos effect: a ship that goes east turns with the Earth a little faster, and weighs less."""

from __future__ import annotations

import math

from pipeline.ledger.entry import MGAL, Case, Change, uncertainty_told

NAME = "eotvos"
FORMULA = (
    "2 w v sin(course) cos(lat) + v^2 (cos(course)^2/M + sin(course)^2/N); "
    "with v in knots 7.503 v cos(lat) sin(course) + 0.00415 v^2 mGal"
)
SOURCE = "Eotvos 1919, Ann. Phys. 364, 743; Harlan 1968, J. Geophys. Res. 73, 4675"
NEEDS = ("latitude", "speed", "course")
USES: tuple[str, ...] = ()

TURN = 7.292115e-5  # rad s-1, GRS80 (Moritz 1980), as the two below
AXIS = 6378137.0  # m
SQUARE_ECCENTRICITY = 0.00669438002290


def change(case: Case, gravity: float) -> Change:
    """Add what the ship's way takes off."""
    given = [case.scalar(name) for name in NEEDS]
    parts: dict[str, float | None] = {}
    for k, name in enumerate(NEEDS):
        own = case.uncertainty(name)
        above, below = (eotvos(*(x + sign * (own or 0.0) * (i == k) for i, x in enumerate(given))) for sign in (1, -1))
        parts[name] = None if own is None else 0.5 * (above - below) / MGAL
    sigma = case.sigma(**parts)
    latitude, speed, course = given
    told = f"{speed:.3f} m/s on {course:.1f} deg at {latitude:+.3f} deg"
    return Change(gravity + eotvos(*given), sigma, told + uncertainty_told(sigma))


def eotvos(latitude: float, speed: float, course: float) -> float:
    """Correction for the ship's way, to be added to gravity, m s-2.

    Parameters
    ----------
    latitude, course : float
        Degrees; course over ground from north by east.
    speed : float
        m s-1 over ground, steady, at the sea's surface.

    Examples
    --------
    Four knots east at the equator:

    >>> round(eotvos(0.0, 4 * 1852 / 3600, 90.0) * 1e5, 1)
    30.1
    """
    phi, alpha = math.radians(latitude), math.radians(course)
    bulge = 1.0 - SQUARE_ECCENTRICITY * math.sin(phi) ** 2
    across = AXIS / math.sqrt(bulge)  # N, of the prime vertical
    along = across * (1.0 - SQUARE_ECCENTRICITY) / bulge  # M, of the meridian
    east, north = speed * math.sin(alpha), speed * math.cos(alpha)
    return 2.0 * TURN * east * math.cos(phi) + north**2 / along + east**2 / across
