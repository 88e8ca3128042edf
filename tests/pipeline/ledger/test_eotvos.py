"""The Eotvos correction against shipgrav (Harlan 1968), against motion in an inertial frame, and as published."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from data_schemas.scene import lightening
from pipeline.ledger.earth import eotvos

KNOT = 1852.0 / 3600.0
WAYS = [(0.0, 4.0, 90.0), (0.0, 12.0, 270.0), (43.7, 9.0, 63.0), (-61.0, 15.0, 190.0), (78.0, 6.0, 300.0)]


@pytest.mark.parametrize(("latitude", "knots", "course"), WAYS)
def test_as_published(latitude: float, knots: float, course: float) -> None:
    """7.503 v cos(lat) sin(course) + 0.00415 v^2, v in knots: rounded to half a unit of the last digits."""
    published = 7.503 * knots * math.cos(math.radians(latitude)) * math.sin(math.radians(course)) + 0.00415 * knots**2
    rounding = 0.0005 * knots + 0.00003 * knots**2  # the Earth's radius varies by 0.5 %
    assert eotvos(latitude, knots * KNOT, course) * 1e5 == pytest.approx(published, abs=rounding)


@pytest.mark.parametrize(("latitude", "knots", "course"), WAYS)
def test_against_shipgrav(latitude: float, knots: float, course: float) -> None:
    """Its full formula on positions along the course, WGS84; first order in flattening: 1e-4 of what v^2 gives."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # escapes in strings of its own dependencies
        shipgrav = pytest.importorskip("shipgrav.grav")
    speed, step = knots * KNOT, 1.0
    phi, alpha = math.radians(latitude), math.radians(course)
    bulge = 1.0 - 0.00669437999014 * math.sin(phi) ** 2
    across, along = 6378137.0 / math.sqrt(bulge), 6378137.0 * (1.0 - 0.00669437999014) / bulge**1.5
    time = np.arange(-3, 4) * step
    north = phi + speed * math.cos(alpha) * time / along
    east = speed * math.sin(alpha) * time / (across * math.cos(phi))
    full = shipgrav.eotvos_full(np.degrees(east), np.degrees(north), np.zeros(7), step)
    # its center_diff of positions in degrees keeps 1e-9 m/s2; flattening to first order only
    assert eotvos(latitude, speed, course) * 1e5 == pytest.approx(float(full[3]), abs=0.02 + 1e-3 * abs(float(full[3])))


@pytest.mark.parametrize(("latitude", "knots", "course"), WAYS)
def test_against_motion_in_an_inertial_frame(latitude: float, knots: float, course: float) -> None:
    """Acceleration of the ship along the ellipsoid's normal, less that of a point at rest, by differences."""
    mpmath = pytest.importorskip("mpmath")
    speed = knots * KNOT
    with mpmath.workdps(40):
        axis, square = mpmath.mpf("6378137"), mpmath.mpf("0.00669438002290")
        turn, phi0, alpha = mpmath.mpf("7.292115e-5"), mpmath.radians(latitude), mpmath.radians(course)

        def place(t: float, moving: bool) -> list:
            bulge = 1 - square * mpmath.sin(phi0) ** 2
            phi = phi0 + moving * speed * mpmath.cos(alpha) * t / (axis * (1 - square) / bulge**1.5)
            way = moving * speed * mpmath.sin(alpha) * t / (axis / mpmath.sqrt(bulge) * mpmath.cos(phi0))
            across = axis / mpmath.sqrt(1 - square * mpmath.sin(phi) ** 2)
            angle = turn * t + way
            ring = across * mpmath.cos(phi)
            return [ring * mpmath.cos(angle), ring * mpmath.sin(angle), across * (1 - square) * mpmath.sin(phi)]

        def upward(moving: bool) -> float:
            step = mpmath.mpf("0.01")
            before, now, after = (place(k * step, moving) for k in (-1, 0, 1))
            bent = [(b - 2 * n + a) / step**2 for b, n, a in zip(before, now, after, strict=True)]
            normal = [mpmath.cos(phi0), 0, mpmath.sin(phi0)]
            return sum(x * n for x, n in zip(bent, normal, strict=True))

        lost = float(upward(False) - upward(True))
    assert eotvos(latitude, speed, course) == pytest.approx(lost, abs=1e-11)


@pytest.mark.parametrize(("latitude", "knots", "course"), [*WAYS, (90.0, 5.0, 45.0), (-90.0, 5.0, 200.0)])
def test_the_simulator_takes_off_what_the_ledger_adds(latitude: float, knots: float, course: float) -> None:
    """Two formulas, of the simulator and of the ledger: 1e-11 m/s2 of rounding in the squares of the ground's speed."""
    assert lightening(latitude, knots * KNOT, course) == pytest.approx(
        eotvos(latitude, knots * KNOT, course), abs=1e-11
    )
