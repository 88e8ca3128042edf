"""One example of every system, with all terms it may have, and states to try it at."""

from __future__ import annotations

from typing import Any

import numpy as np
from pantaleone_board import pantaleone

from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums, Linear, Sine
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import KnifeEdge, Quadratic, VanDerPolDrive, Viscous
from synth.systems.terms import Harmonics, harmonics, together
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes

FREQUENCY = np.array([6.2, 6.3, 5.9])
LENGTH = np.array([0.25, 0.24, 0.3])
MASS = np.array([0.3, 0.2, 0.25])
VISCOUS = Viscous(np.array([0.1, 0.02, 0.0]))
QUADRATIC = Quadratic(np.array([0.03, 0.2, 0.01]))
KNIFE = KnifeEdge(np.array([0.02, 0.01, 0.05]), np.array([0.3, 0.2, 0.4]))
DRIVE = VanDerPolDrive(np.array([0.06, 0.2, 0.1]), np.array([0.055, 0.2, 0.1]))
SIDEWAYS = harmonics([1.2, 0.4], [0.7, 5.1], [0.3, 1.0])
UPWARDS = harmonics([2.0], [1.1], [0.2])

EVERYTHING = together(VISCOUS, QUADRATIC, KNIFE, DRIVE)
SYSTEMS: dict[str, Any] = {
    "pendulums": DrivenPendulums(FREQUENCY, 9.81),
    "pendulums, all terms": DrivenPendulums(FREQUENCY, 9.81, Sine(), SIDEWAYS, UPWARDS, EVERYTHING),
    "pendulums, sideways": DrivenPendulums(FREQUENCY, 9.81, Sine(), SIDEWAYS, None, VISCOUS),
    "pendulums, upwards": DrivenPendulums(FREQUENCY, 9.81, Sine(), None, UPWARDS, None),
    "linear pendulums": DrivenPendulums(FREQUENCY, 9.81, Linear(), SIDEWAYS, UPWARDS, VISCOUS),
    "linear, sideways": DrivenPendulums(FREQUENCY, 9.81, Linear(), SIDEWAYS),
    "linear, upwards": DrivenPendulums(FREQUENCY, 9.81, Linear(), None, UPWARDS),
    "linear, still": DrivenPendulums(FREQUENCY, 9.81, Linear()),
    "beam": ElasticBeam(2.0, MASS, LENGTH, 150.0, 0.0, 9.81),
    "driven beam": ElasticBeam(2.0, MASS, LENGTH, 150.0, 0.25, 9.81, together(DRIVE, QUADRATIC)),
    "reduced beam": ReducedBeam(0.02, 0.1, 0.02, np.array([-0.01, 0.02, 0.0])),
    "frame": FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.0, 9.81),
    "driven frame": FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.7, 9.81, together(DRIVE, KNIFE)),
    "beam at sea": ElasticBeam(2.0, MASS, LENGTH, 150.0, 0.25, 9.81, VISCOUS, SIDEWAYS, UPWARDS),
    "beam, upwards": ElasticBeam(2.0, MASS, LENGTH, 150.0, 0.25, 9.81, None, None, UPWARDS),
    "frame at sea": FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.7, 9.81, VISCOUS, SIDEWAYS, UPWARDS),
    "frame, sideways": FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.7, 9.81, None, SIDEWAYS),
    "metronomes": Metronomes(FREQUENCY, 0.05),
    "driven metronomes": Metronomes(FREQUENCY, 0.05, together(DRIVE, QUADRATIC), 9.81, UPWARDS),
    "metronomes of Pantaleone": pantaleone([0.01, -0.01, 0.0], 0.01, 0.39, 0.05),
}


def state_for(system: Any, seed: int = 3) -> Floats:
    """A random state of ordinary size."""
    size = system.first_angle + 2 * 3
    return np.random.default_rng(seed).normal(size=size) * 0.4


def opposite(motion: Harmonics) -> Harmonics:
    """The same motion the other way."""
    table = motion.table.copy()
    table[0] = -table[0]
    return Harmonics(table)


def mirrored(system: Any, state: Floats) -> tuple[Any, Floats]:
    """The mirror image of a system and a state: angles change sign, and what moves sideways with them."""
    image = -state
    if isinstance(system, ElasticBeam | ReducedBeam):
        image[:2] = state[:2]  # up and down
    if getattr(system, "horizontal", None) is not None:
        system = system._replace(horizontal=opposite(system.horizontal))
    return system, image


def plain(natural_frequency: float) -> DrivenPendulums:
    """One free pendulum on a fixed support."""
    return DrivenPendulums(np.array([natural_frequency]))
