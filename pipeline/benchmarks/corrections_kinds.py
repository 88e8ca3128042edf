"""Kinds of record of the suite `corrections`, and what the methods must show on each.

On noise-free linear pendulums it is known which method is right and by how much, to the order of magnitude, the others
are wrong. The sizes of wrong methods depend on phases and swell, so they are judged by their root mean square over
several swells. On real pendulums a value is judged by its own sigma and flags.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from data_schemas.scene import Scene
from pipeline.benchmarks.scenes import Motion, resonant, swell, two_pendulums

SWELLS = (24, 25, 26, 27, 28, 29)
"""Seeds of the swell; the records that are shown have the first."""
FULL_LENGTH, QUICK_LENGTH = 1800.0, 600.0
"""s, of records of real pendulums."""
_EXACT = {"projection": 1e-3, "complex": 1e-2}
_INTEGRATED = _EXACT | {"panteleev": 1e-2, "general": 1e-2}
_PHASE_METHODS = ("uncorrected", "vening-meinesz", "panteleev", "general")


@dataclass(frozen=True)
class Kind:
    """One kind of record.

    Attributes
    ----------
    scene : callable
        The seed of the swell gives the scene.
    right : dict
        Largest error, mGal, of the methods that are right here.
    wrong : dict
        Least root mean square error over the swells, mGal, of the methods that are wrong: a fifth of what is found.
    refused : tuple of str
        Methods that may decline: a phase means nothing where the amplitude vanishes.
    real : bool
        Real pendulums, where a value of the methods made for them must hold within its sigma or carry a flag.
    """

    name: str
    scene: Callable[[int], Scene]
    right: Mapping[str, float] = field(default_factory=dict)
    wrong: Mapping[str, float] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    real: bool = False


def kinds(*, quick: bool) -> list[Kind]:
    """All kinds: linear pendulums, then real ones, whose records are shorter when quick."""
    length = QUICK_LENGTH if quick else FULL_LENGTH
    return [
        *LINEAR,
        *(
            Kind(name, partial(real_scene, **({"length": length} | changes)), real=True)
            for name, changes in REAL.items()
        ),
    ]


def _linear(name: str, difference: float, *more: dict[str, Any], **changes: Any) -> Callable[[int], Scene]:
    return lambda seed: two_pendulums(name, difference, motion=[swell(seed=seed), *more], **changes)


LINEAR = (
    Kind(
        "linear, eps 1e-5, near-resonant",
        _linear("eps-1e-5-resonant", 1e-5, resonant()),
        _INTEGRATED,
        {"uncorrected": 0.9, "vening-meinesz": 0.6},
    ),
    Kind("linear, eps 1e-4", _linear("eps-1e-4", 1e-4), _INTEGRATED, {"uncorrected": 2.8, "vening-meinesz": 8.0}),
    Kind(
        "linear, eps 1e-3",
        _linear("eps-1e-3", 1e-3),
        _EXACT | {"panteleev": 0.1},
        {"uncorrected": 13.0, "vening-meinesz": 260.0},
    ),
    Kind(
        "linear, eps 1e-4, 50/40 mrad",
        _linear("eps-1e-4-heavy", 1e-4, amplitudes=(0.05, 0.04)),
        _INTEGRATED,
        {"uncorrected": 26.0, "vening-meinesz": 10.0},
    ),
    Kind(
        "linear, eps 1e-3, beats through zero",
        _linear("eps-1e-3-zero", 1e-3, amplitudes=(0.01, 0.01)),
        _EXACT,
        refused=_PHASE_METHODS,
    ),
)
"""Noise-free linear pendulums in swell; eps is the relative difference of the periods."""

REAL: Mapping[str, dict[str, Any]] = {
    "nominal": {},
    "no swell": {"slow": 0.0},
    "eps 1e-6": {"difference": 1e-6},
    "eps 1e-3": {"difference": 1e-3},
    "psi/a 10": {"slow": 0.1},
    "Theta1/a 10": {"first_arc": 0.1},
    "arcs of 50 mrad": {"arc": 0.05, "first_arc": 0.05},
    "vibration of 1e-4 g": {"strength": 1e-4},
    "sea of 4 m": {"sea": (4.0, 0.0)},
    "sea of 3 m, 30 m deep": {"sea": (3.0, 30.0)},
    "damping not stated": {"damping_difference": 1e-4, "write_damping": False},
    "noise of 1e-4 rad": {"noise": 1e-4},
    "noise of 1e-5 rad, 8 Hz": {"noise": 1e-5, "sampling_rate": 8},
    "300 s long": {"length": 300.0},
}
"""Departures from a nominal record of real pendulums: 25 Hz, noise-free, heave recorded."""


def real_scene(
    seed: int,
    *,
    length: float,
    difference: float = 1e-4,
    arc: float = 0.01,
    first_arc: float = 0.01,
    slow: float = 0.03,
    strength: float = 1e-5,
    sea: tuple[float, float] | None = None,
    damping_difference: float = 2e-5,
    **recording: Any,
) -> Scene:
    """Real pendulums in swell, heave that is recorded, and a little vibration near the pendulums' period.

    Parameters
    ----------
    arc, first_arc, slow : float
        Of the difference, of the first pendulum, and largest slow elongation, rad. The second pendulum's harmonic is
        the first's less the difference's, so that both arcs are what is asked.
    strength : float
        Of the vibration, share of gravity.
    sea : (2,) tuple, optional
        Significant height and depth of the vessel, m, in place of swell and heave.
    """
    first = cmath.rect(first_arc, 0.4)
    second = first - cmath.rect(arc, 2.2)  # no beat passes through zero
    motion: Motion = [swell(slow, seed=seed)] if slow else []
    motion.append({"kind": "harmonics", "amplitude": [0.05], "period": [9.0], "axis": "vertical"})
    if sea is not None:
        height, depth = sea
        # waves of a few seconds do not move a hull, and pairs of them would meet the swing
        waves = {
            "kind": "sea", "significant_height": height, "peak_period": 6.0 + height, "depth": depth, "cutoff": 2.5,
            "components": 48, "seed": 7,
        }  # fmt: skip
        motion = [waves, waves | {"axis": "vertical"}]
    return two_pendulums(
        "real",
        difference,
        motion=[*motion, resonant(strength)],
        amplitudes=(abs(first), abs(second)),
        phases=(cmath.phase(first), cmath.phase(second)),
        damping_rates=(1e-4 + damping_difference, 1e-4),
        duration=length,
        restoring="sine",
        seed=1958,
        vertical_acceleration=True,
        **recording,
    )
