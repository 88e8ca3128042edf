"""What heat, air, tilt, turn and way of the ship do to pendulums, and what the record states of them.

With g the true gravity, E the Eotvos effect, b the tilt, W the rate of turn, l a pendulum's length,

    T = period + c (t - t_ref) + D rho/rho0 + drift      at reference gravity
    n^2 = (2 pi/T)^2 (g - E) cos b / g_ref - W^2

and accelerations of the support, as they act in the tilted plane, compare with (g - E) cos b - W^2 l. The turn's
`W^2 sin cos` is taken as `W^2 sin`: within 1e-3 mGal at one degree a second and arcs of 20 mrad.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from data_schemas.scene_conditions import felt_gravity, period
from data_schemas.scene_motion import HarmonicMotion
from synth.motion.harmonic_sum import HarmonicSum, harmonics
from synth.phase import Floats
from synth.seeds import generator


def stiffening(scene: Scene) -> HarmonicSum | None:
    """A temperature that swings within the record, as the vertical acceleration that would change n^2 alike.

    `n^2 = n0^2 (1 + k s)^-2` with k = c A/T of the mean pendulum, s the sine of the course, to second order in k: the
    third is 1e-11.
    """
    given = scene.conditions
    if not given.temperature_amplitude:
        return None
    k = given.temperature_amplitude * float(
        np.mean([each.temperature_coefficient / period(scene, each) for each in scene.pendulums])
    )
    gravity, turn, phase = felt_gravity(scene), 2.0 * math.pi / given.temperature_period, given.temperature_phase
    # -2 k sin(x) + 3 k^2 sin(x)^2
    return harmonics(
        HarmonicMotion(
            amplitude=(2.0 * k * gravity, 1.5 * k**2 * gravity, -1.5 * k**2 * gravity),
            angular_frequency=(turn, 0.0, 2.0 * turn),
            phase=(phase + 0.5 * math.pi, 0.0, 2.0 * phase),
        )
    )


def stated(scene: Scene, true_seconds: Floats) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Variables of /instrument that state the conditions, each off by a draw of its stated uncertainty."""
    given = scene.conditions
    found: dict[str, tuple[tuple[str, ...], Any]] = {}

    def state(name: str, value: float, sigma: float) -> float:
        off = sigma * float(generator(scene.seed, f"stated {name}").normal()) if sigma else 0.0
        found[name] = ((), value + off)
        if sigma:
            found[f"{name}_uncertainty"] = ((), sigma)
        return off

    def per_pendulum(name: str) -> None:
        found[name] = (("pendulum",), np.array([getattr(each, name) for each in scene.pendulums]))

    if given.temperature is not None:
        off = state("temperature", given.temperature, given.temperature_uncertainty)
        found["temperature_reference"] = ((), given.temperature_reference)
        per_pendulum("temperature_coefficient")
        if given.temperature_amplitude:
            turned = 2.0 * math.pi / given.temperature_period * true_seconds + given.temperature_phase
            course = given.temperature + off + given.temperature_amplitude * np.sin(turned)
            found["temperature"] = (("time",), course)
    if given.air_density is not None:
        state("air_density", given.air_density, given.air_density_uncertainty)
        found["air_density_reference"] = ((), given.air_density_reference)
        per_pendulum("density_coefficient")
    if given.tilt is not None:
        _tilt(given.tilt, given.tilt_uncertainty, state, found)
    for name in ("yaw_rate", "speed", "course"):
        if getattr(given, name) is not None:
            state(name, getattr(given, name), getattr(given, f"{name}_uncertainty"))
    for name in ("latitude", "longitude", "height"):
        if getattr(given, name) is not None:
            state(name, getattr(given, name), 0.0)
    if scene.recording.chronometer_rate or given.chronometer_rate_uncertainty:
        state("chronometer_rate", scene.recording.chronometer_rate, given.chronometer_rate_uncertainty)
    return found | _bases(scene)


def _tilt(tilt: float, sigma: float, state: Callable[[str, float, float], float], found: dict[str, Any]) -> None:
    """A tilt is read as an angle and stated as its square."""
    off = state("tilt_mean_square", 0.0, sigma)
    read = tilt + off
    found["tilt_mean_square"] = ((), read**2)
    if sigma:
        found["tilt_mean_square_uncertainty"] = ((), math.hypot(2.0 * read * sigma, math.sqrt(2.0) * sigma**2))


def _bases(scene: Scene) -> dict[str, tuple[tuple[str, ...], Any]]:
    given = scene.conditions
    if not given.bases:
        return {}
    shape = (len(given.bases), len(scene.pendulums))
    periods = np.array(
        [
            [
                (each.period + each.drift * base.time / 86400.0) * math.sqrt(scene.reference_gravity / base.gravity)
                for each in scene.pendulums
            ]
            for base in given.bases
        ]
    )
    sigma = given.base_period_uncertainty
    if sigma:
        periods = periods + generator(scene.seed, "base periods").normal(scale=sigma, size=shape)
    found: dict[str, tuple[tuple[str, ...], Any]] = {
        "base": (("base",), np.array([base.label for base in given.bases], dtype=np.str_)),
        "base_time": (("base",), np.array([base.time for base in given.bases])),
        "base_gravity": (("base",), np.array([base.gravity for base in given.bases])),
        "base_period": (("base", "pendulum"), periods),
    }
    if sigma:
        found["base_period_uncertainty"] = (("base", "pendulum"), np.full(shape, sigma))
    return found
