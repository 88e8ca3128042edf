"""Tide of a yielding Earth: what Moon and Sun take off gravity at a place.

Upward attraction of a body of mass M at distance d and zenith angle Z, less that on the Earth's centre, r from it:

    G M r/d^3 (3 cos^2 Z - 1) + (3/2) G M r^2/d^4 (5 cos^3 Z - 3 cos Z)

times 1.16 for what the Earth yields (Longman 1959). Places of Moon and Sun: the largest terms of Meeus, Astronomical
Algorithms (2nd ed. 1998), chapters 12, 25 and 47, without nutation. The permanent part is in it.
"""

import numpy as np

from synth.phase import Floats

YIELDING = 1.16
MOON, SUN = 4.902801e12, 1.32712440e20  # G M, m3 s-2
UNIT = 1.495978707e11  # m, astronomical unit
EQUATOR, FLATTENING = 6378137.0, 1.0 / 298.257223563  # m; WGS84
EPOCH = 946728000.0  # s of Unix time, 2000-01-01 12:00
DYNAMICAL = 67.0  # s, uniform time less UTC; 10 s of it are 1e-10 m s-2
OBLIQUITY = np.radians(23.4392911)
# multiples of D, M, M', F; longitude in 1e-6 degrees, distance in m (Meeus, table 47.A)
_LONGITUDE = np.array(
    [
        (0, 0, 1, 0, 6288774, -20905355), (2, 0, -1, 0, 1274027, -3699111), (2, 0, 0, 0, 658314, -2955968),
        (0, 0, 2, 0, 213618, -569925), (0, 1, 0, 0, -185116, 48888), (0, 0, 0, 2, -114332, -3149),
        (2, 0, -2, 0, 58793, 246158), (2, -1, -1, 0, 57066, -152138), (2, 0, 1, 0, 53322, -170733),
        (2, -1, 0, 0, 45758, -204586), (0, 1, -1, 0, -40923, -129620), (1, 0, 0, 0, -34720, 108743),
        (0, 1, 1, 0, -30383, 104755), (2, 0, 0, -2, 15327, 10321), (0, 0, 1, 2, -12528, 0),
        (0, 0, 1, -2, 10980, 79661), (4, 0, -1, 0, 10675, -34782), (0, 0, 3, 0, 10034, -23210),
        (4, 0, -2, 0, 8548, -21636), (2, 1, -1, 0, -7888, 24208), (2, 1, 0, 0, -6766, 30824),
        (1, 0, -1, 0, -5163, -8379),
    ]
)  # fmt: skip
# latitude in 1e-6 degrees (table 47.B)
_LATITUDE = np.array(
    [
        (0, 0, 0, 1, 5128122), (0, 0, 1, 1, 280602), (0, 0, 1, -1, 277693), (2, 0, 0, -1, 173237),
        (2, 0, -1, 1, 55413), (2, 0, -1, -1, 46271), (2, 0, 0, 1, 32573), (0, 0, 2, 1, 17198),
        (2, 0, 1, -1, 9266), (0, 0, 2, -1, 8822), (2, -1, 0, -1, 8216), (2, 0, -2, -1, 4324), (2, 0, 1, 1, 4200),
    ]
)  # fmt: skip


def tide(unix_time: Floats, latitude: float, longitude: float, height: float = 0.0) -> Floats:
    """What the tide takes off gravity, m s-2; to be added to what was measured.

    `unix_time` (n,) s since 1970-01-01 UTC; latitude and longitude in degrees, north and east positive; height m.
    """
    days = (np.asarray(unix_time) - EPOCH) / 86400.0
    centuries = (days + DYNAMICAL / 86400.0) / 36525.0
    slant = np.radians(latitude)
    bulge = EQUATOR / np.sqrt(1.0 - FLATTENING * (2.0 - FLATTENING) * np.sin(slant) ** 2)
    across, along = (bulge + height) * np.cos(slant), (bulge * (1.0 - FLATTENING) ** 2 + height) * np.sin(slant)
    radius, geocentric = np.hypot(across, along), np.arctan2(along, across)
    sidereal = np.radians(280.46061837 + 360.98564736629 * days + longitude)
    total = np.zeros_like(days)
    for mass, (ecliptic, beyond, distance) in ((MOON, _moon(centuries)), (SUN, _sun(centuries))):
        x, y, z = np.cos(beyond) * np.cos(ecliptic), np.cos(beyond) * np.sin(ecliptic), np.sin(beyond)
        y, z = y * np.cos(OBLIQUITY) - z * np.sin(OBLIQUITY), y * np.sin(OBLIQUITY) + z * np.cos(OBLIQUITY)
        upward = np.cos(geocentric) * (x * np.cos(sidereal) + y * np.sin(sidereal)) + np.sin(geocentric) * z
        ratio = radius / distance
        total += mass / distance**2 * ratio * (3.0 * upward**2 - 1.0)
        total += 1.5 * mass / distance**2 * ratio**2 * (5.0 * upward**3 - 3.0 * upward)
    return YIELDING * total


def _moon(t: Floats) -> tuple[Floats, Floats, Floats]:
    """Longitude and latitude in the ecliptic of date, rad, and distance, m; t in Julian centuries from 2000."""
    mean = 218.3164477 + 481267.88123421 * t
    arguments = np.radians(
        [
            297.8501921 + 445267.1114034 * t, 357.5291092 + 35999.0502909 * t,
            134.9633964 + 477198.8675055 * t + 0.0087414 * t**2, 93.2720950 + 483202.0175233 * t,
        ]
    )  # fmt: skip
    by_sine, by_cosine = np.sin(_LONGITUDE[:, :4] @ arguments), np.cos(_LONGITUDE[:, :4] @ arguments)
    longitude = mean + 1e-6 * (_LONGITUDE[:, 4] @ by_sine)
    latitude = 1e-6 * (_LATITUDE[:, 4] @ np.sin(_LATITUDE[:, :4] @ arguments))
    return np.radians(longitude), np.radians(latitude), 385000560.0 + _LONGITUDE[:, 5] @ by_cosine


def _sun(t: Floats) -> tuple[Floats, Floats, Floats]:
    """The same of the Sun."""
    anomaly, eccentricity = np.radians(357.52911 + 35999.05029 * t), 0.016708634 - 0.000042037 * t
    centre = (1.914602 - 0.004817 * t) * np.sin(anomaly) + 0.019993 * np.sin(2.0 * anomaly)
    centre = centre + 0.000289 * np.sin(3.0 * anomaly)
    longitude = np.radians(280.46646 + 36000.76983 * t + centre)
    true_anomaly = anomaly + np.radians(centre)
    distance = UNIT * 1.000001018 * (1.0 - eccentricity**2) / (1.0 + eccentricity * np.cos(true_anomaly))
    return longitude, np.zeros_like(longitude), distance
