"""Normal gravity and anomalies, where the record states its latitude.

Free-air anomaly at or above the sea: gravity less normal gravity at the pendulums' own height (closed form, no series).
Below the sea gravity is first brought to the surface through the water, which pulls up from above and no longer from
below: gradient of normal gravity less `4 pi G rho`. Simple Bouguer anomaly: the sea filled with rock, `2 pi G (rock -
water) depth`, a plate. Conventions of Hinze et al. 2005, Geophysics 70, J25: GRS80, 2670 and 1027 kg/m3; the air's own
pull (0.87 mGal) is not taken off.
"""

from __future__ import annotations

import math
from typing import Any

from pipeline.arrays import Floats
from pipeline.conditions import MGAL, Constants

GRAVITATION = 6.67430e-11  # m3 kg-1 s-2, CODATA 2018
ROCK, WATER = 2670.0, 1027.0  # kg m-3


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
