"""Ensembles by collocation: every member is what it is alone."""

from __future__ import annotations

import numpy as np
import pytest
from collocation_cases import LENGTHS

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.collocation import integrate, integrate_ensemble
from synth.systems.resistance import Quadratic, VanDerPolDrive
from synth.systems.yielding import ElasticBeam, Metronomes

DRIVE = VanDerPolDrive(np.full(2, 0.06), 0.0138 / LENGTHS)
BEAMS = [ElasticBeam(50.0, np.full(2, 0.25), LENGTHS, stiffness, 0.25, 9.81, DRIVE) for stiffness in (8e3, 7e3, 9e3)]
STARTS = np.array([[0.001, 0, 0.1, 0, -0.07, 0.3], [0.0, 0, 0.05, 0, 0.1, 0.0], [0.0, 0, 0.0, 0.1, 0.1, 0.0]])
TIMES = np.array([0.0, 0.4, 1.3, 2.0])


def test_members_are_what_they_are_alone() -> None:
    together = integrate_ensemble(BEAMS, STARTS, TIMES, workers=2)
    assert together.shape == (3, 4, 6)
    for states, system, start in zip(together, BEAMS, STARTS, strict=True):
        alone = integrate(system, start, TIMES, tolerance=1e-12).states
        assert np.max(np.abs(states - alone) / np.abs(alone).max(axis=0)) < 1e-9


def test_threads_change_nothing() -> None:
    one = integrate_ensemble(BEAMS, STARTS, TIMES, workers=1)
    np.testing.assert_array_equal(integrate_ensemble(BEAMS, STARTS, TIMES), one)


def test_faults_are_named() -> None:
    with pytest.raises(UsageError, match="one finite start a member"):
        integrate_ensemble(BEAMS, STARTS[:2], TIMES)
    with pytest.raises(UsageError, match="one row a member"):
        integrate_ensemble(BEAMS, STARTS[0], TIMES)
    with pytest.raises(RefusedError, match="Quadratic"):
        integrate_ensemble([each._replace(terms=Quadratic(np.full(2, 0.1))) for each in BEAMS], STARTS, TIMES)
    with pytest.raises(RefusedError, match="weigh nothing"):
        integrate_ensemble([Metronomes(np.full(2, 6.0), 0.6)], [[0.1, 0.0, 0.1, 0.0]], [0.0, 1.0])
