"""Ensembles by collocation: every member is what it is alone."""

from __future__ import annotations

import numpy as np
import pytest
from collocation_cases import LENGTHS

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.collocation import integrate, integrate_ensemble, members_of
from synth.systems.metronomes import Metronomes
from synth.systems.resistance import Quadratic, VanDerPolDrive
from synth.systems.yielding import ElasticBeam

DRIVE = VanDerPolDrive(np.full(2, 0.06), 0.0138 / LENGTHS)
BEAMS = ElasticBeam(50.0, np.full(2, 0.25), LENGTHS, np.array([8000.0, 7000.0, 9000.0]), 0.25, 9.81, DRIVE)  # type: ignore[arg-type]
STARTS = np.array([[0.001, 0, 0.1, 0, -0.07, 0.3], [0.0, 0, 0.05, 0, 0.1, 0.0], [0.0, 0, 0.0, 0.1, 0.1, 0.0]])
TIMES = np.array([0.0, 0.4, 1.3, 2.0])


def test_members_are_what_they_are_alone() -> None:
    together = integrate_ensemble(BEAMS, STARTS, TIMES, workers=2)
    assert together.shape == (3, 4, 6)
    for states, system, start in zip(together, members_of(BEAMS, 3), STARTS, strict=True):
        alone = integrate(system, start, TIMES, tolerance=1e-12).states
        assert np.max(np.abs(states - alone) / np.abs(alone).max(axis=0)) < 1e-9


def test_a_sequence_of_systems_and_threads_change_nothing() -> None:
    one = integrate_ensemble(members_of(BEAMS, 3), STARTS, TIMES, workers=1)
    np.testing.assert_array_equal(integrate_ensemble(BEAMS, STARTS, TIMES), one)


def test_parameters_are_taken_apart_by_their_axes() -> None:
    drive = DRIVE._replace(rate=np.array([[0.1, 0.2], [0.3, 0.4]]))
    apart = members_of(BEAMS._replace(stiffness=1.0, terms=drive), 2)
    assert [each.stiffness for each in apart] == [1.0, 1.0]
    assert [each.terms.rate.tolist() for each in apart] == [[0.1, 0.2], [0.3, 0.4]]
    assert all(each.terms.angle is DRIVE.angle for each in apart)


def test_faults_are_named() -> None:
    with pytest.raises(UsageError, match="members"):
        integrate_ensemble(BEAMS, STARTS[:2], TIMES)
    with pytest.raises(UsageError, match="one finite start a member"):
        integrate_ensemble(members_of(BEAMS, 3), STARTS[:2], TIMES)
    with pytest.raises(UsageError, match="one row a member"):
        integrate_ensemble(BEAMS, STARTS[0], TIMES)
    with pytest.raises(RefusedError, match="Quadratic"):
        integrate_ensemble(BEAMS._replace(terms=Quadratic(np.full(2, 0.1))), STARTS, TIMES)
    with pytest.raises(RefusedError, match="weigh nothing"):
        integrate_ensemble(Metronomes(np.full(2, 6.0), 0.6), [[0.1, 0.0, 0.1, 0.0]], [0.0, 1.0])
