"""Scenes drawn at random over what a gravimeter at sea may meet: pendulums, sea, sampling, faults, what is stated."""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.scene import Scene


class _Chance:
    """One scene's draws."""

    def __init__(self, number: int) -> None:
        self._draw = np.random.default_rng([1959, number])

    def __call__(self, share: float) -> bool:
        return bool(self._draw.random() < share)

    def between(self, low: float, high: float) -> float:
        return float(self._draw.uniform(low, high))

    def power(self, low: float, high: float) -> float:
        """Even in the logarithm."""
        return float(10.0 ** self.between(low, high))

    def one(self, *values: Any) -> Any:
        return values[int(self._draw.integers(len(values)))]

    def whole(self, most: int) -> int:
        return int(self._draw.integers(1, most))


def scene(number: int) -> Scene:
    """The scene of that number, always the same."""
    chance = _Chance(number)
    real, amplitude = chance(0.6), chance.one(0.004, 0.01, 0.02, 0.05)
    motion, heaves = _motion(chance, real)
    recording = _recording(chance, amplitude, heaves)
    return Scene.model_validate(
        {
            "record_id": f"random-{number}",
            "seed": number,
            "duration": float(round(chance.between(600.0, 3600.0))),
            "gravity": chance.between(9.78, 9.83),
            "reference_gravity": 9.81,
            "restoring": "sine" if real else "linear",
            "pendulums": _pendulums(chance, amplitude),
            "motion": motion,
            "recording": recording,
        }
    )


def _pendulums(chance: _Chance, amplitude: float) -> list[dict[str, Any]]:
    """Two or three that are much alike; relative differences of the periods from 1e-6 to 2e-3."""
    period, rate = chance.between(0.9, 1.1), chance.one(0.0, 1.0, 1.0) * chance.power(-5.0, -3.5)
    return [
        {
            "label": str(place + 1),
            "period": period * (1.0 + (chance.one(-1, 1) * chance.power(-6.0, -2.7) if place else 0.0)),
            "damping_rate": rate * chance.between(0.8, 1.25),
            "start": {
                "kind": "free",
                "amplitude": amplitude * chance.between(0.3, 1.5),
                "phase": chance.between(0.0, 6.28),
            },
        }
        for place in range(chance.one(2, 2, 2, 3))
    ]


def _motion(chance: _Chance, real: bool) -> tuple[list[dict[str, Any]], bool]:
    """Swell at the surface or below, with heave or without, and vibration; whether there is heave."""
    motion: list[dict[str, Any]] = []
    heaves = False
    if chance(0.85):
        depth = chance.one(2.0, 10.0, 20.0, 30.0, 60.0)
        sea = {
            "kind": "sea",
            "spectrum": chance.one("jonswap", "pierson-moskowitz"),
            "significant_height": chance.between(0.3, 1.5) if depth == 2.0 else chance.between(0.5, 5.0),
            "peak_period": chance.between(6.0, 14.0),
            "depth": depth,
            "seed": chance.whole(1_000_000),
        }
        motion.append(sea)
        heaves = real and chance(0.5)
        if heaves:
            motion.append(sea | {"axis": "vertical"})
    if chance(0.5):
        beat, phase = chance.between(60.0, 600.0), chance.between(0.0, 6.28)
        amplitude = chance.power(-5.0, -3.2)
        motion.append({"kind": "near-resonant", "amplitude": amplitude, "beat_period": beat, "phase": phase})
    if chance(0.3):
        lines = {"amplitude": [chance.power(-4.0, -2.0)], "period": [chance.between(2.0, 30.0)], "phase": [0.0]}
        motion.append({"kind": "harmonics", **lines})
    return motion, heaves


def _recording(chance: _Chance, amplitude: float, heaves: bool) -> dict[str, Any]:
    """Even, uneven or at marks; noise, gaps, lost, wild and rounded readings; what the record says of the pendulums."""
    kept: dict[str, Any] = {"noise": chance.one(0.0, 1e-6, 1e-5, 1e-5, 1e-4)}
    marks, rate = chance(0.12), chance.one(5, 10, 10, 20, 25, 25, 50)
    kept |= {"marks": True} if marks else {"sampling_rate": rate}
    more: list[tuple[bool, dict[str, Any]]] = [
        (not marks and chance(0.15), {"jitter": chance.between(0.0, 0.1) / rate}),
        (chance(0.15), {"drop_fraction": chance.between(0.0, 0.05)}),
        (chance(0.3), {"mark_gap": chance.between(0.2, 2.0)}),
        (chance(0.3), {"missing_samples": chance.whole(60)}),
        (chance(0.3), {"outliers": chance.whole(40), "outlier_amplitude": amplitude * chance.between(0.05, 1.0)}),
        (chance(0.2), {"quantisation": chance.power(-6.0, -4.0)}),
        (heaves and chance(0.6), {"vertical_acceleration": True}),
        (chance(0.2), {"write_damping": False}),
        (chance(0.2), {"write_restoring": False}),
    ]
    for taken, words in more:
        kept |= words if taken else {}
    return kept


def kinds(drawn: Scene) -> list[str]:
    """What a scene is, in words; one scene is of several kinds."""
    told = drawn.recording
    real, heaves = drawn.restoring == "sine", any(getattr(each, "axis", "") == "vertical" for each in drawn.motion)
    words = {
        "linear pendulums": not real,
        "real pendulums, no heave": real and not heaves,
        "real pendulums, heave recorded": heaves and told.vertical_acceleration,
        "real pendulums, heave not recorded": heaves and not told.vertical_acceleration,
        "half-second marks": told.marks,
        "5 Hz": not told.marks and float(told.sampling_rate) == 5.0,
        "10 Hz": not told.marks and float(told.sampling_rate) == 10.0,
        "20 to 50 Hz": not told.marks and float(told.sampling_rate) >= 20.0,
        "uneven times": told.jitter > 0.0 or told.drop_fraction > 0.0,
        "gaps at the minutes": told.mark_gap > 0.0,
        "wild readings": told.outliers > 0,
        "rounded readings": told.quantisation > 0.0,
        "damping not stated": not told.write_damping,
        "law not stated": not told.write_restoring,
        "no noise": told.noise == 0.0 and told.quantisation == 0.0,
        "noise 1e-4 rad": told.noise == 1e-4,
    }
    return [name for name, is_so in words.items() if is_so]
