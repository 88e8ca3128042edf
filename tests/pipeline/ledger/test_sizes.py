"""Sizes that are published or follow from a formula by hand, each correction alone; and their signs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from ledger_records import BASES, PERIOD, entry, row, scene, with_stated

import synth

TEMPERATURE = {"temperature": 289.15, "temperature_reference": 288.15}
AIR = {"air_density": 1.2, "air_density_reference": 1.2}
EAST = {"latitude": 0.0, "speed": 4 * 1852 / 3600, "course": 90.0}
CASES: dict[str, tuple[str, dict[str, Any], float, float]] = {
    # entry, what the record states, mGal to be ADDED, tolerance (half of the last digit that is published)
    "one second a day lost": ("chronometer", {"chronometer_rate": 1.0}, -22.7, 0.05),
    "brass, a kelvin": ("temperature", TEMPERATURE | {"temperature_coefficient": [93e-7] * 2}, 18.0, 0.5),
    # expansion 1e-6 /K: c = 1e-6 T/2, dg = g 1e-6
    "invar, a kelvin": ("temperature", TEMPERATURE | {"temperature_coefficient": [PERIOD * 5e-7] * 2}, 0.98, 0.005),
    "air, buoyancy alone": ("air_density", AIR | {"density_coefficient": [770e-7] * 2}, 149.0, 0.6),
    "ten minutes of arc": ("tilt", {"tilt_mean_square": np.radians(1 / 6) ** 2}, 4.15, 0.005),
    "a degree a second": ("yaw", {"yaw_rate": np.radians(1.0)}, 7.7, 0.05),
    "four knots east at the equator": ("eotvos", EAST, 30.1, 0.05),
    "four knots west": ("eotvos", EAST | {"course": 270.0}, -29.94, 0.01),
    "0.1 m/s2 across the plane": (
        "transverse_acceleration",
        {"transverse_acceleration_mean_square": 0.005},
        -25.49,
        0.02,
    ),
    "a plane that follows 0.1 m/s2 in ten seconds": (
        "rocking",
        {"rocking_rate_mean_square": 0.5 * (0.1 * 2 * np.pi / 10.0 / 9.81) ** 2},
        -0.52,
        0.01,
    ),
    "tide of the scene's first day": ("tide", {"latitude": 45.0, "longitude": 10.0}, 0.00832, 5e-5),
    "an after-base a micro-second up": (
        "base_tie",
        # the record lies a third of the way from before to after: 1e-6 s / 3
        BASES | {"base_period": [[PERIOD / 1.0001, PERIOD], [PERIOD / 1.0001 + 1e-6, PERIOD + 1e-6]]},
        2 * 9.8054e5 * 1e-6 / 3 / PERIOD,
        1e-3,
    ),
}


@pytest.fixture(scope="module")
def plain() -> xr.DataTree:
    return synth.simulate(scene(duration=120.0, motion=[]))[0]


@pytest.mark.parametrize("case", CASES)
def test_size_and_sign(plain: xr.DataTree, case: str) -> None:
    name, stated, size, tolerance = CASES[case]
    found, before = row(with_stated(plain, stated), "complex"), row(plain, "complex")
    assert entry(found, name)["value_mgal"] == pytest.approx(size, abs=tolerance)
    # gravity moves by the entry; 770e-7 s more on both periods move n1/n2 by 8e-9, which costs 0.012 mGal
    moved = (found["gravity_m_s2"] - before["gravity_m_s2"]) * 1e5
    assert moved == pytest.approx(entry(found, name)["value_mgal"], abs=0.02)


def test_coefficients_that_differ_move_the_ratio_that_methods_hold(plain: xr.DataTree) -> None:
    """A coefficient that is 1e-7 s/K larger for pendulum 1 makes T1 longer by 1e-6 in 10 K, as if it were stated so."""
    warm = {"temperature": 298.15, "temperature_reference": 288.15}
    even = row(with_stated(plain, warm | {"temperature_coefficient": [93e-7, 93e-7]}))
    uneven = row(with_stated(plain, warm | {"temperature_coefficient": [94e-7, 93e-7]}))
    period = plain["instrument"]["period"].values * np.array(
        [1.0 + 1e-6 / plain["instrument"]["period"].values[0], 1.0]
    )
    restated = row(with_stated(plain, warm | {"temperature_coefficient": [93e-7, 93e-7], "period": period}))
    change = (uneven["gravity_m_s2"] - even["gravity_m_s2"]) * 1e5
    assert abs(change) > 0.5
    assert change == pytest.approx((restated["gravity_m_s2"] - even["gravity_m_s2"]) * 1e5, rel=1e-3)
