"""What the record states of heat, air, tilt, turn and way of the ship, and of base stations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from synth.phase import Floats
from synth.seeds import generator

Variables = dict[str, tuple[tuple[str, ...], Any]]

_SCALARS = ("temperature", "air_density", "yaw_rate", "speed", "course", "latitude", "longitude", "height")


def stated(scene: Scene, true_seconds: Floats) -> Variables:
    """Variables of /instrument that state the conditions, each off by a draw of its stated uncertainty."""
    given = scene.conditions
    variables: Variables = {}

    def error(name: str, sigma: float) -> float:
        return sigma * float(generator(scene.seed, f"stated {name}").normal()) if sigma else 0.0

    def per_pendulum(name: str) -> None:
        variables[name] = (("pendulum",), np.array([getattr(each, name) for each in scene.pendulums]))

    values = {name: (getattr(given, name), getattr(given, f"{name}_uncertainty", 0.0)) for name in _SCALARS}
    if scene.recording.chronometer_rate or given.chronometer_rate_uncertainty:
        values["chronometer_rate"] = (scene.recording.chronometer_rate, given.chronometer_rate_uncertainty)
    for name, (value, sigma) in values.items():
        if value is not None:
            variables[name] = ((), value + error(name, sigma))
            if sigma:
                variables[f"{name}_uncertainty"] = ((), sigma)
    if given.temperature is not None:
        variables["temperature_reference"] = ((), given.temperature_reference)
        per_pendulum("temperature_coefficient")
        if given.temperature_amplitude:
            turned = 2.0 * math.pi / given.temperature_period * true_seconds + given.temperature_phase
            course = variables["temperature"][1] + given.temperature_amplitude * np.sin(turned)
            variables["temperature"] = (("time",), course)
    if given.air_density is not None:
        variables["air_density_reference"] = ((), given.air_density_reference)
        per_pendulum("density_coefficient")
    if given.tilt is not None:  # read as an angle and stated as its square
        sigma = given.tilt_uncertainty
        read = given.tilt + error("tilt_mean_square", sigma)
        variables["tilt_mean_square"] = ((), read**2)
        if sigma:
            of_square = math.hypot(2.0 * read * sigma, math.sqrt(2.0) * sigma**2)
            variables["tilt_mean_square_uncertainty"] = ((), of_square)
    return variables | _bases(scene)


def _bases(scene: Scene) -> Variables:
    given = scene.conditions
    if not given.bases:
        return {}
    own, drift = np.array([(each.period, each.drift) for each in scene.pendulums]).T
    shares = [(base.time, math.sqrt(scene.reference_gravity / base.gravity)) for base in given.bases]
    periods = np.array([(own + drift * time / 86400.0) * share for time, share in shares])
    variables: Variables = {
        "base": (("base",), np.array([base.label for base in given.bases], dtype=np.str_)),
        "base_time": (("base",), np.array([base.time for base in given.bases])),
        "base_gravity": (("base",), np.array([base.gravity for base in given.bases])),
    }
    sigma = given.base_period_uncertainty
    if sigma:
        periods += generator(scene.seed, "base periods").normal(scale=sigma, size=periods.shape)
        variables["base_period_uncertainty"] = (("base", "pendulum"), np.full(periods.shape, sigma))
    return variables | {"base_period": (("base", "pendulum"), periods)}
