"""The benchmarks' own scenes, two pendulums in a seaway, one function a kind; what methods make of their records."""

from typing import Any

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks.honesty import reduced
from pipeline.benchmarks.records import Made
from pipeline.observation import observe
from pipeline.prepared import Prepared, prepare
from synth import simulate

REFERENCE = 9.81  # m s-2, where the periods hold
GRAVITY = 9.8123456  # m s-2, what processing must find
PERIOD = 1.01  # s, of the second pendulum at REFERENCE
DURATION = 1800.0  # s
SWELL = 0.075  # rad, largest slow elongation
HARMONICS = 24
SWELL_PERIODS = (4.0, 20.0)  # s
SWAY = 0.03  # rad, largest slow elongation of the real pendulums


def swell(peak: float = SWELL, seed: int = 24, gravity: float = GRAVITY) -> dict[str, Any]:
    """Harmonics of random period and phase that a pendulum answers with slow elongations up to `peak` rad."""
    chance = np.random.default_rng(seed)
    period = chance.uniform(*SWELL_PERIODS, HARMONICS)
    phase = chance.uniform(0.0, 2.0 * np.pi, HARMONICS)
    rate = 2.0 * np.pi / period
    time = np.arange(0.0, DURATION, 0.25)
    unit = np.cos(rate[:, None] * time + phase[:, None]).sum(axis=0)
    elongation = peak / np.abs(unit).max()  # of each harmonic, rad
    # psi = -u / (1 - m^2/n^2): what acceleration makes this elongation
    own = 2.0 * np.pi / PERIOD * np.sqrt(gravity / REFERENCE)  # of the second pendulum, rad s-1
    acceleration = gravity * elongation * (1.0 - (rate / own) ** 2)
    values = {"amplitude": acceleration, "period": period, "phase": phase}
    return {"kind": "harmonics", **{name: value.tolist() for name, value in values.items()}}


def resonant() -> dict[str, Any]:
    """Vibration close to the first pendulum's own frequency."""
    return {"kind": "near-resonant", "amplitude": 4e-5 * GRAVITY, "detuning": 0.026, "phase": 1.0}


def two_pendulums(
    record_id: str, relative_difference: float, *, motion: list[dict[str, Any]] | None = None,
    amplitudes: tuple[float, float] = (0.006, 0.012), damping_rates: tuple[float, float] = (0.0, 0.0),
    gravity: float = GRAVITY, duration: float | None = None, restoring: str = "linear", seed: int = 0, **recording: Any,
) -> Scene:  # fmt: skip
    """Two pendulums on a moving support, swell by default, for half an hour. `relative_difference` is (n1 - n2)/n2,
    amplitudes of the free harmonics at the start, rad; `seed` of all chance; `recording` fields of the scene's."""
    pendulums = []
    for k, period in enumerate((PERIOD / (1.0 + relative_difference), PERIOD)):
        start = {"kind": "free", "amplitude": amplitudes[k], "phase": (0.4, 2.2)[k]}
        pendulums.append({"label": str(k + 1), "period": period, "damping_rate": damping_rates[k], "start": start})
    world = {"restoring": restoring, "gravity": gravity, "reference_gravity": REFERENCE, "pendulums": pendulums}
    world |= {"motion": [swell()] if motion is None else motion, "recording": recording}
    return Scene.model_validate({"record_id": record_id, "seed": seed, "duration": duration or DURATION, **world})


def linear(relative_difference: float = 1e-4, **changes: Any) -> Scene:
    """Swell and near-resonant vibration, damped pendulums, no noise."""
    given: dict[str, Any] = {"motion": [swell(), resonant()], "damping_rates": (1e-4, 1.2e-4)}
    return two_pendulums("linear", relative_difference, **(given | changes))


def real(relative_difference: float = 1e-4, **changes: Any) -> Scene:
    """Real pendulums swayed by swell; damped, the record states their damping and their law."""
    given: dict[str, Any] = {"motion": [swell(SWAY)], "damping_rates": (2e-5, 3e-5), "amplitudes": (0.012, 0.010)}
    return two_pendulums("real", relative_difference, **({"restoring": "sine"} | given | changes))


def real_heave(**changes: Any) -> Scene:
    """As `real`, in heavier swell and in heave of 0.2 m/s2 rms, which the record holds."""
    values = {"amplitude": [0.22, 0.15, 0.08], "period": [8.7, 6.1, 11.9], "phase": [0.3, 1.9, 4.4]}
    heave = {"kind": "harmonics", "axis": "vertical", **values}
    return real(motion=[swell(2.0 * SWAY), heave], vertical_acceleration=True, **changes)


def prepared(scene: Scene) -> Prepared:
    """A scene's record, simulated and made ready."""
    return prepare(observe(simulate(scene)[0]))


def errors(scene: Scene, *methods: str) -> dict[str, float]:
    """Error of gravity by each method on a scene's record, mGal; NaN where it refuses."""
    record = made(scene)
    return {name: reduced(record, name)["error_mgal"] for name in methods}


def made(scene: Scene) -> Made:
    """A scene's record as the suite `honesty` has its own; gravity does not change."""
    return Made(simulate(scene)[0], scene.gravity, scene.gravity * np.eye(6)[0])
