"""Records of two clocks whose phase difference is written down beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from data_schemas.variables import VARIABLES, attributes

NAMED = {"in phase": 0.0, "antiphase": np.pi, "quadrature": 0.5 * np.pi}
STATES = ("in phase", "antiphase", "quadrature", "other angle", "drifting", "intermittent")


def record_of(time: np.ndarray, elongation: np.ndarray, **more: np.ndarray) -> xr.DataTree:
    """A valid record; `more` are variables of /record by name."""
    count = len(elongation)
    labels = np.array([str(k + 1) for k in range(count)], dtype=object)
    values: dict[str, Any] = {
        "record/trace": labels, "record/pendulum": labels, "record/combination": np.eye(count),
        "record/elongation": elongation, "instrument/pendulum": labels, "instrument/period": np.full(count, 1.0),
        "instrument/reference_gravity": 9.81, **{f"record/{name}": value for name, value in more.items()},
    }  # fmt: skip
    groups = {
        group: xr.Dataset(
            {
                key.partition("/")[2]: (VARIABLES[key].dims, value, attributes(key))
                for key, value in values.items()
                if key.startswith(group)
            }
        )
        for group in ("record", "instrument")
    }
    head = {"schema": "isochrony-record", "schema_version": "1", "record_id": "clocks"}
    root = xr.Dataset(coords={"time": ("time", time, attributes("time"))}, attrs=head)
    return xr.DataTree.from_dict({"/": root, **{f"/{name}": group for name, group in groups.items()}})


def swings(time: np.ndarray, psi: np.ndarray, chance: np.random.Generator, noise: float) -> np.ndarray:
    """(2, n) elongations whose phases differ by psi, with a third harmonic and a slow change of amplitude."""
    turn = 2.0 * np.pi / chance.uniform(0.9, 1.3) * time + chance.uniform(0.0, 6.0)
    size = 0.1 * (1.0 + 0.1 * np.exp(-time / 60.0))
    rows = []
    for phase, scale in ((turn + psi, 1.0), (turn, chance.uniform(0.6, 1.2))):
        pure = np.cos(phase) + 0.005 * np.cos(3.0 * phase)
        rows.append(scale * size * pure + noise * chance.standard_normal(time.size) + 2e-3 * chance.uniform(-1, 1))
    return np.stack(rows)


def made(state: str, seed: int) -> tuple[xr.DataTree, float]:
    """A record in a known state, and its locked angle (NaN if there is none)."""
    chance = np.random.default_rng([seed, STATES.index(state)])
    duration, rate = chance.uniform(300.0, 900.0), chance.uniform(8.0, 20.0)
    time = np.arange(0.0, duration, 1.0 / rate)
    psi, angle = difference(state, time, chance)
    rows = swings(time, psi, chance, 10.0 ** chance.uniform(-6.0, -3.0))
    kind = seed % 4
    if kind == 1:  # a gap of several swings in one of them
        begin = int(chance.uniform(0.1, 0.8) * time.size)
        rows[0, begin : begin + int(8.0 * rate)] = np.nan
    if kind == 2:  # uneven: every tenth reading lost
        kept = chance.uniform(size=time.size) > 0.1
        time, rows = time[kept], rows[:, kept]
    if kind == 3:  # the record's time begins anywhere
        time = time + 1234.5
    return record_of(time, rows), angle


def difference(state: str, time: np.ndarray, chance: np.random.Generator) -> tuple[np.ndarray, float]:
    """psi(t), and where it is locked."""
    duration, sign = float(time[-1]), float(chance.choice([-1.0, 1.0]))
    if state == "drifting":
        if chance.uniform() < 0.5:
            return sign * (chance.uniform(0.6, 60.0) * time / duration) + chance.uniform(0.0, 6.0), np.nan
        return adler(time, chance.uniform(2.5, 6.0), chance.integers(4, 12), sign) + chance.uniform(0.0, 6.0), np.nan
    if state == "intermittent":
        place = chance.uniform(-3.0, 3.0)
        if chance.uniform() < 0.5:
            return adler(time, chance.uniform(1.01, 1.1), chance.integers(3, 8), sign) + place, np.nan
        slips = np.sort((np.arange(4) + chance.uniform(0.2, 0.8, 4)) * duration / 4.0)
        steps = [1.0 / (1.0 + np.exp(-(time - when) / (0.01 * duration))) for when in slips]
        return place + sign * 2.0 * np.pi * np.sum(steps, axis=0), np.nan
    if state == "other angle":
        angle = sign * float(chance.choice([chance.uniform(0.4, 1.2), chance.uniform(1.95, 2.75)]))
    else:
        angle = sign * NAMED[state] + chance.uniform(-0.15, 0.15)
    turns = 2.0 * np.pi * chance.integers(-2, 3)
    settling = chance.uniform(-2.0, 2.0) * np.exp(-time / (duration * chance.uniform(0.02, 0.1)))
    return angle + turns + settling, angle


def adler(time: np.ndarray, ratio: float, slips: int, sign: float) -> np.ndarray:
    """Solution of psi' = c (ratio - sin psi) with so many whole turns over the record, unwrapped."""
    root = np.sqrt(ratio * ratio - 1.0)
    turn = np.pi * (slips + 0.5) * time / time[-1]
    half = np.arctan((1.0 + root * np.tan(turn)) / ratio)
    return sign * 2.0 * (half + np.pi * np.round((turn - half) / np.pi))
