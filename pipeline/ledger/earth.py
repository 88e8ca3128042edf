"""What the Earth does to gravity: the Eotvos effect of the ship's way, the tide, and normal gravity for anomalies.

A ship that goes east turns with the Earth a little faster, and weighs less.

Free-air anomaly at or above the sea: gravity less normal gravity at the pendulums' own height (closed form, no series).
Below the sea gravity is first brought to the surface through the water, which pulls up from above and no longer from
below: gradient of normal gravity less `4 pi G rho`. Simple Bouguer anomaly: the sea filled with rock, `2 pi G (rock -
water) depth`, a plate. Conventions of Hinze et al. 2005, Geophysics 70, J25: GRS80, 2670 and 1027 kg/m3; the air's own
pull (0.87 mGal) is not taken off.
"""

import math
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.conditions import MGAL, Constants
from pipeline.ledger.entry import Case, Change, correction
from synth.kernels.tide import tide

WAY = ("latitude", "speed", "course")
TURN = 7.292115e-5  # rad s-1, GRS80 (Moritz 1980), as the two below
AXIS = 6378137.0  # m
SQUARE_ECCENTRICITY = 0.00669438002290
PLACE = ("latitude", "longitude")
LOADING, LEAST, PLACES = 0.1, 1e-3, 64  # of the tide, by the sea's own load; mGal; moments of a record
GRAVITATION = 6.67430e-11  # m3 kg-1 s-2, CODATA 2018
ROCK, WATER = 2670.0, 1027.0  # kg m-3


@correction(
    "eotvos",
    "2 w v sin(course) cos(lat) + v^2 (cos(course)^2/M + sin(course)^2/N); "
    "with v in knots 7.503 v cos(lat) sin(course) + 0.00415 v^2 mGal",
    "Eotvos 1919, Ann. Phys. 364, 743; Harlan 1968, J. Geophys. Res. 73, 4675",
    WAY,
)
def way(case: Case, gravity: float) -> Change:
    """Add what the ship's way takes off; of a way that changes within the record its mean."""
    given = navigation(case.prepared.observation.constants)
    parts: list[float | None] = []
    for k, name in enumerate(WAY):
        own = case.uncertainty(name)
        above, below = (eotvos(*(x + sign * (own or 0.0) * (i == k) for i, x in enumerate(given))) for sign in (1, -1))
        parts.append(None if own is None else case.mean_over_record(0.5 * (above - below)) / MGAL)
    latitude, speed, course = (_span(x) for x in given)
    words = f"{speed} m/s on {course} deg at {latitude} deg"
    return Change(gravity + case.mean_over_record(eotvos(*given)), case.sigma(*parts), words)


def navigation(constants: Constants) -> list[Any]:
    """Latitude, speed and course: a number each, or an array at the record's times."""
    return [constants.get(f"{name}_course", constants[name]) for name in WAY]


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


@correction(
    "tide",
    "1.16 G M r/d^3 (3 cos^2 Z - 1) and the next order, of Moon and Sun",
    "Longman 1959, J. Geophys. Res. 64, 2351; places of Moon and Sun: Meeus 1998",
    PLACE,
    uses=("height",),
)
def moon_and_sun(case: Case, gravity: float) -> Change:
    """Add the mean of what it took off over the record."""
    seen = case.prepared.observation
    if "epoch" not in seen.constants:
        return Change(gravity, 0.0, "units of time name no date", applied=False)
    time: Floats = seen.start + float(seen.time[-1]) * np.linspace(0.0, 1.0, PLACES)
    lost = float(np.mean(tidal_loss(seen.constants, time)))
    sigma = LOADING * abs(lost) / MGAL + LEAST
    return Change(gravity + lost, sigma, "sigma: a tenth of it for the load of the sea's own tide")


def tidal_loss(constants: Constants, time: Floats) -> Floats:
    """What the tide takes off gravity at times of the record, m s-2."""
    latitude, longitude, height = (float(constants.get(name, 0.0)) for name in (*PLACE, "height"))
    return tide(np.asarray(float(constants["epoch"]) + time), latitude, longitude, height)


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Normal gravity of GRS80, m s-2, at a geodetic latitude, degrees, and a height above the ellipsoid, m, >= 0.

    Examples
    --------
    >>> round(normal_gravity(0.0), 10)
    9.7803267715
    """
    from boule import GRS80  # half a second, for records that state a latitude only

    return float(GRS80.normal_gravity((0.0, latitude, height), si_units=True))


def to_the_surface(gravity: Floats, latitude: float, depth: float) -> Floats:
    """Gravity, m s-2, of an instrument submerged to a depth, m, at the surface of the sea above it."""
    rise = normal_gravity(latitude) - normal_gravity(latitude, depth)
    return gravity - (rise - 4.0 * math.pi * GRAVITATION * WATER * depth)


def anomalies(constants: Constants, gravity: Floats) -> dict[str, Any]:
    """Variables of /gravity, from gravity (methods,), m s-2, for a record that states its latitude; none for others.

    Of the record's constants: latitude, height (0 where it states none), water_depth.
    """
    if "latitude" not in constants:
        return {}
    latitude, height = float(constants["latitude"]), float(constants.get("height", 0.0))
    normal = normal_gravity(latitude, max(height, 0.0))
    at = to_the_surface(gravity, latitude, -height) if height < 0.0 else gravity
    free_air = (at - normal) / MGAL
    found: dict[str, Any] = {"normal_gravity": normal, "free_air_anomaly": free_air}
    if "water_depth" in constants:
        plate = 2.0 * math.pi * GRAVITATION * (ROCK - WATER) * float(constants["water_depth"]) / MGAL
        found["bouguer_anomaly"] = free_air + plate
    return found
