"""The benchmarks' own scenes of real (sine) pendulums in a seaway, one function a kind."""

from __future__ import annotations

from typing import Any

from data_schemas.scene import Scene
from pipeline.benchmarks.scenes import Motion, swell, two_pendulums

SWAY = 0.03  # rad, largest slow elongation
HEAVE_AMPLITUDES = (0.22, 0.15, 0.08)  # m s-2
HEAVE_PERIODS = (8.7, 6.1, 11.9)  # s
HEAVE_PHASES = (0.3, 1.9, 4.4)  # rad


def heave(size: float = 1.0) -> dict[str, Any]:
    """Vertical acceleration of three harmonics, 0.2 m/s2 rms at size 1."""
    return {
        "kind": "harmonics",
        "axis": "vertical",
        "amplitude": [size * each for each in HEAVE_AMPLITUDES],
        "period": list(HEAVE_PERIODS),
        "phase": list(HEAVE_PHASES),
    }


def real(relative_difference: float = 1e-4, **changes: Any) -> Scene:
    """Real pendulums swayed by swell; damped, the record states their damping and their law."""
    motion: Motion = [swell(SWAY)]
    given: dict[str, Any] = {
        "motion": motion,
        "damping_rates": (2e-5, 3e-5),
        "amplitudes": (0.012, 0.010),
        "restoring": "sine",
    }
    return two_pendulums("real", relative_difference, **(given | changes))


def real_heave(relative_difference: float = 1e-4, **changes: Any) -> Scene:
    """As `real`, in heavier swell and in heave, which the record holds."""
    motion: Motion = [swell(2.0 * SWAY), heave()]
    given: dict[str, Any] = {"motion": motion, "vertical_acceleration": True}
    return real(relative_difference, **(given | changes))
