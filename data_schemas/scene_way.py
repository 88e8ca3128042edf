"""What the way of a ship takes off gravity, as the simulator has it: the turn about the Earth's axis is faster."""

from __future__ import annotations

import math

_TURN = 7.292115e-5  # rad/s, GRS80
_AXIS, _SQUARE_ECCENTRICITY = 6378137.0, 0.00669438002290  # m, GRS80


def lightening(latitude: float, speed: float, course: float) -> float:
    """Loss of gravity on a ship under way, m/s^2, upright centrifugal force of its motion less the Earth's own.

    Parameters
    ----------
    latitude, course
        Degrees; course from north by east.
    speed
        m/s over ground.

    Examples
    --------
    >>> round(lightening(0.0, 4 * 1852 / 3600, 90.0) * 1e5, 1)
    30.1
    """
    slant, way = math.radians(latitude), math.radians(course)
    bulge = math.sqrt(1.0 - (math.sqrt(_SQUARE_ECCENTRICITY) * math.sin(slant)) ** 2)
    east, north = speed * math.sin(way), speed * math.cos(way)
    ring = _AXIS * math.cos(slant) / bulge  # radius of the parallel
    ground = _TURN * ring
    if ring > 1.0:
        eastward = ((ground + east) ** 2 - ground**2) / ring * math.cos(slant)
    else:  # at a pole, where the parallel is a point
        eastward = east**2 * bulge / _AXIS
    return eastward + north**2 * bulge**3 / (_AXIS * (1.0 - _SQUARE_ECCENTRICITY))
