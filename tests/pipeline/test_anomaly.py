"""Normal gravity and anomalies against closed forms and against another program."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

from pipeline.ledger.earth import anomalies, normal_gravity, to_the_surface

LATITUDES = [-90.0, -35.2, 0.0, 45.0, 78.5]


@pytest.mark.parametrize("latitude", LATITUDES)
def test_normal_gravity_is_somigliana_s(latitude: float) -> None:
    """Moritz 1980, Geodetic Reference System 1980: equator 9.7803267715, k 0.001931851353."""
    square = math.sin(math.radians(latitude)) ** 2
    closed = 9.7803267715 * (1 + 0.001931851353 * square) / math.sqrt(1 - 0.00669438002290 * square)
    # published to ten digits
    assert normal_gravity(latitude) == pytest.approx(closed, abs=2e-9)


def test_normal_gravity_falls_by_the_free_air_gradient() -> None:
    """0.3086 mGal/m."""
    assert (normal_gravity(45.0) - normal_gravity(45.0, 1.0)) * 1e5 == pytest.approx(0.3086, abs=1e-4)


def grav() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own dependencies
        return pytest.importorskip("shipgrav.grav")


@pytest.mark.parametrize("latitude", LATITUDES)
def test_against_shipgrav(latitude: float) -> None:
    """It has WGS84, whose mass includes the air: 0.14 mGal."""
    assert normal_gravity(latitude) * 1e5 == pytest.approx(float(grav().wgs_grav(latitude)), abs=0.16)


def test_a_submarine_against_shipgrav() -> None:
    """Through 80 m of water: 0.2224 mGal/m; it takes water of 1030 kg/m3."""
    lost = 9.8e5 - to_the_surface(np.array([9.8]), 40.0, 80.0)[0] * 1e5
    assert lost == pytest.approx(-float(grav().free_air_second_order(40.0, 80.0, free_water=True)), abs=0.03)
    assert to_the_surface(np.array([9.8]), 40.0, 0.0)[0] == 9.8


def test_anomalies_follow_from_what_the_record_states() -> None:
    gravity = np.array([9.80, 9.81])
    assert anomalies({}, gravity) == {}
    only = anomalies({"latitude": 40.0}, gravity)
    assert set(only) == {"normal_gravity", "free_air_anomaly"}
    np.testing.assert_allclose(only["free_air_anomaly"], (gravity - normal_gravity(40.0)) * 1e5, rtol=1e-12)
    deep = anomalies({"latitude": 40.0, "water_depth": 4000.0, "height": -30.0}, gravity)
    # 2 pi G (2670 - 1027) = 0.0689 mGal/m
    plate = deep["bouguer_anomaly"] - deep["free_air_anomaly"]
    np.testing.assert_allclose(plate, 0.0689 * 4000.0, rtol=1e-3)
    # 30 m down gravity is larger by 6.67 mGal than at the surface
    np.testing.assert_allclose(only["free_air_anomaly"] - deep["free_air_anomaly"], 6.67, atol=0.01)
    high = anomalies({"latitude": 40.0, "height": 100.0}, gravity)
    np.testing.assert_allclose(high["free_air_anomaly"] - only["free_air_anomaly"], 30.86, atol=0.02)
