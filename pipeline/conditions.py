"""Periods of the instrument under the conditions of a record: what temperature and air add to the stated ones.

The two periods change by different amounts, and with them n1/n2, which every method holds: a temperature coefficient
that differs by 1e-7 s/K moves the ratio by 1e-6 in 10 K, some 2 mGal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from data_schemas.errors import RecordError
from pipeline.arrays import Floats

Constants = Mapping[str, Any]
"""What /instrument states beside period and gravity, by name: a number, or one for each of the two pendulums."""

TEMPERATURE = ("temperature", "temperature_reference", "temperature_coefficient")
AIR = ("air_density", "air_density_reference", "density_coefficient")


MOST_CHANGE = 0.02  # of a period, by temperature, air and drift together
MOST_TURN = 0.1  # of the swing's frequency
MOST_TILT = 0.1  # rad2: 18 degrees


def refuse_impossible(constants: Constants, period: Floats, longer: Floats) -> None:
    """Refuse conditions that no pendulum at sea has: most likely a wrong unit.

    Parameters
    ----------
    period, longer : (2,) arrays
        Stated periods, and what the conditions add to them, s.

    Raises
    ------
    RecordError
        With the variable and the remedy.
    """
    change = float(np.abs(longer / period).max())
    if change > MOST_CHANGE:
        raise RecordError(
            f"instrument: temperature, air density and base periods change a period by {100.0 * change:.3g} %; "
            "check the units of temperature_coefficient (s K-1), density_coefficient (s) and base_period (s)"
        )
    turn = abs(float(constants.get("yaw_rate", 0.0)))
    if turn * float(period.max()) > MOST_TURN * 2.0 * np.pi:
        raise RecordError(f"instrument/yaw_rate: {turn:g} rad s-1 is no ship's; check its unit")
    tilt = float(constants.get("tilt_mean_square", 0.0))
    if tilt > MOST_TILT:
        raise RecordError(f"instrument/tilt_mean_square: {tilt:g} rad2 is no tilt a pendulum stands; check its unit")


def by_temperature(constants: Constants) -> Floats:
    """What the record's mean temperature adds to the two periods, s, (2,); zero where it is not stated."""
    if any(name not in constants for name in TEMPERATURE):
        return np.zeros(np.shape(constants["period"]))
    warm = float(constants["temperature"]) - float(constants["temperature_reference"])
    return np.asarray(constants["temperature_coefficient"]) * warm


def by_air(constants: Constants) -> Floats:
    """What the air adds to the two periods in vacuum, s, (2,); zero where it is not stated."""
    if any(name not in constants for name in AIR):
        return np.zeros(np.shape(constants["period"]))
    relative = float(constants["air_density"]) / float(constants["air_density_reference"])
    return np.asarray(constants["density_coefficient"]) * relative
