"""Systems that can be collocated, each with everything it may have, and the references of the formula sheet."""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.terms import harmonics, together
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes

LENGTHS = np.array([0.249, 0.2484])
MASSES = np.array([0.3, 0.2, 0.25])
THREE = np.array([0.25, 0.24, 0.27])
TERMS = together(VanDerPolDrive(np.full(3, 0.06), np.full(3, 0.1)), Viscous(np.array([0.01, 0.0, 0.02])))
SIDEWAYS, UPWARDS = harmonics([0.3, 0.1], [0.7, 5.1], [0.3, 1.0]), harmonics([0.5], [1.1], [0.2])

# formula sheet, section 3.2: two independent integrators; printed digits end near 5e-13
REFERENCES: dict[str, tuple[Any, list[float], float, list[float]]] = {
    "A": (
        ReducedBeam(0.02, 0.02, 7.142857142857e-6, np.array([-0.01139, -0.01141])),
        [0, 0, 2, 0, 1, -1.5],
        1000.0,
        [9.5683187619e-5, 5.2287080973e-5, 0.693916614425, -1.857702623946, -1.820363617138, -0.814847412871],
    ),
    "B": (
        ElasticBeam(
            50.0, np.full(2, 0.25), LENGTHS, 8000.0, 0.25, 9.81, VanDerPolDrive(np.full(2, 0.06), 0.0138 / LENGTHS)
        ),
        [0.001, 0, 0.1, 0, -0.07, 0.3],
        10.0,
        [1.6354202583e-4, -0.0024138027753, 0.102128042586, -0.016925278855, -0.081577222789, 0.388456838204],
    ),
    "C1": (
        ElasticBeam(2.0, np.ones(2), np.array([1.0, 0.9]), 150.0, 0.0, 9.81),
        [0.05, 0, 1, 0, -0.5, 0],
        10.0,
        [-0.145528869838, -0.257144470808, -3.05900133082e-4, -0.831781109645, -0.459215748325, -2.504196294477],
    ),
}

SWING = [0.1, 0.0, -0.2, 0.3, 0.05, -0.4]
CASES: dict[str, tuple[Any, list[float]]] = {
    "beam": (ElasticBeam(20.0, MASSES, THREE, 3000.0, 0.25, 9.81, TERMS, SIDEWAYS, UPWARDS), [1e-3, 0.0, *SWING]),
    "beam, ashore": (ElasticBeam(20.0, MASSES, THREE, 3000.0, 0.0, 9.81), [1e-3, 0.0, *SWING]),
    "reduced": (
        ReducedBeam(0.02, 0.05, 1e-3, np.array([-0.01, 0.02, 0.0])),
        [0.0, 0.01, 1.0, 0.2, -1.5, 0.3, 0.1, 0.0],
    ),
    "frame": (FlexibleFrame(20.0, MASSES, THREE, 900.0, 0.7, 9.81, TERMS, SIDEWAYS, UPWARDS), [1e-3, 0.0, *SWING]),
    "frame, ashore": (FlexibleFrame(20.0, MASSES, THREE, 0.0, 0.0, 9.81), [1e-3, 0.0, *SWING]),
    "metronomes": (Metronomes(np.array([6.2, 6.3, 6.1]), 0.02, TERMS, 9.81, UPWARDS), SWING),
    "metronomes, ashore": (Metronomes(np.array([6.2, 6.3, 6.1]), 0.02), SWING),
}
