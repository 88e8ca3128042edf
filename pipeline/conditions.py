"""Periods of the instrument under the conditions of a record: temperature, air, and what base stations say of them.

The two periods change by different amounts, and with them n1/n2, which every method holds: a temperature coefficient
that differs by 1e-7 s/K moves the ratio by 1e-6 in 10 K, some 2 mGal.

Each occupation of a base station gives the period that the instrument then had, brought to reference_gravity by the
base's own gravity. Between two occupations the period is taken on the straight line through both; where there is one on
one side only, it is held. What the line may be wrong by: the occupations' own uncertainties, and a drift that wandered
instead of going straight. A wandering drift pinned at both ends departs from the line by `|misclosure| sqrt(f (1 -
f))`, 1 sigma, at the part f of the time between them (a Brownian bridge whose size the misclosure tells): half of it
midway.
"""

from collections.abc import Mapping
from dataclasses import dataclass
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
MGAL, DAY = 1e-5, 86400.0  # m s-2, s
BASE = ("base_time", "base_gravity", "base_period")


def refuse_impossible(constants: Constants, period: Floats, longer: Floats) -> None:
    """`RecordError` for conditions that add (2,) to the periods (2,), s, what none at sea do: likely a wrong unit."""
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


def rate_uncertainty(time: Floats, sigma: Floats) -> float:
    """Relative 1 sigma of the rate of a clock whose times have a stated uncertainty.

    Two times share an error as large as the least uncertainty of all times between them: a constant uncertainty costs
    no rate, one that rises from an instant on is a step of the clock, a hump an error that passes. The rate is the
    slope of a straight line through all errors. `time` and `sigma` are (n,), s.

    Examples
    --------
    >>> time = np.arange(1000.0)
    >>> f"{rate_uncertainty(time, 0.5 * (time >= 500.0)):.2e}"  # 1.5 times the step over the length
    '7.50e-04'
    """
    lever = time - time.mean()
    total = np.concatenate([[0.0], np.cumsum(lever / (lever @ lever))])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(sigma)) + 1])
    variance, open_levels = 0.0, list[tuple[float, int]]()
    for start, level in zip([*edges.tolist(), time.size], [*np.square(sigma[edges]).tolist(), 0.0], strict=True):
        begin = start
        while open_levels and open_levels[-1][0] > level:
            height, begin = open_levels.pop()
            lower = max(level, open_levels[-1][0] if open_levels else 0.0)
            variance += (height - lower) * (total[start] - total[begin]) ** 2
        if not open_levels or open_levels[-1][0] < level:
            open_levels.append((level, begin))
    return float(np.sqrt(variance))


@dataclass(frozen=True)
class Tie:
    """Periods of the instrument at the time of the record."""

    period: Floats  # (2,) at reference gravity, s
    relative_uncertainty: Floats  # (2,) from the occupations' periods and from drift, 1 sigma; zero if none is stated
    gravity_uncertainty: float | None  # of the bases' gravity, m s-2
    misclosure: float  # after less before, of the second pendulum, as gravity, mGal; NaN with bases on one side only
    misclosure_uncertainty: float
    fraction: float  # where the record lies between the two, 0 to 1
    stated: bool  # whether the occupations state any uncertainty


def tie(constants: Constants, middle: float, reference_gravity: float) -> Tie | None:
    """Tie a record whose middle is `middle` seconds after its epoch; None where no base is stated."""
    if any(name not in constants for name in BASE):
        return None
    time, gravity, own = (np.asarray(constants[name]) for name in BASE)  # periods are (base, 2)
    period = own * np.sqrt(gravity / reference_gravity)[:, None]
    stated = "base_period_uncertainty" in constants
    spread = np.asarray(constants["base_period_uncertainty"]) / own if stated else np.zeros_like(own)
    order = np.argsort(time, kind="stable")
    earlier, later = order[time[order] <= middle], order[time[order] > middle]
    two_sided, fraction = bool(earlier.size and later.size), 0.0
    ends = [int((earlier if earlier.size else later[::-1])[-1]), int((later if later.size else earlier[::-1])[0])]
    if two_sided:
        fraction = float((middle - time[ends[0]]) / (time[ends[1]] - time[ends[0]]))
    weights = np.array([1.0 - fraction, fraction])
    at, uncertain = period[ends], spread[ends]
    drift = np.abs(at[1] - at[0]) / at[0] * np.sqrt(fraction * (1.0 - fraction))
    scale, heavy = 2.0 * reference_gravity / MGAL, None
    if "base_gravity_uncertainty" in constants:
        one, two = np.asarray(constants["base_gravity_uncertainty"])[ends] * weights
        # equal gravity means one station, whose error both occupations share
        heavy = float(one + two if gravity[ends[0]] == gravity[ends[1]] else np.hypot(one, two))
    return Tie(
        period=weights @ at,
        relative_uncertainty=np.hypot(np.sqrt((weights**2) @ uncertain**2), drift),
        gravity_uncertainty=heavy,
        misclosure=scale * float((at[1, 1] - at[0, 1]) / at[0, 1]) if two_sided else float("nan"),
        misclosure_uncertainty=scale * float(np.hypot(*uncertain[:, 1])) if two_sided else float("nan"),
        fraction=fraction,
        stated=stated or two_sided,
    )
