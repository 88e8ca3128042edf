"""The fastest rate: known eigenvalues, and each thing that makes a scene stiff."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from system_examples import SYSTEMS, plain, state_for

from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.resistance import KnifeEdge, VanDerPol, VanDerPolDrive, Viscous
from synth.systems.starts import fastest_rate
from synth.systems.yielding import ElasticBeam, FlexibleFrame, stiffness_of_ratio


def test_a_plain_pendulum_is_as_fast_as_it_swings() -> None:
    assert fastest_rate(plain(6.0), [0.1, 0.0]) == pytest.approx(6.0, rel=1e-12)
    assert fastest_rate(plain(6.0), [0.0, 0.0]) == pytest.approx(6.0, rel=1e-12)


def test_overdamped_is_as_fast_as_its_fast_root() -> None:
    slow = DrivenPendulums(np.array([6.0]), terms=Viscous(np.array([1e4])))
    assert fastest_rate(slow, [0.1, 0.0]) == pytest.approx(1e4 + math.sqrt(1e8 - 36), rel=1e-8)  # arcs


def test_knife_edge_counts_where_it_turns_over() -> None:
    sharp = DrivenPendulums(np.array([6.0]), terms=KnifeEdge(np.array([0.5]), np.array([1e-5])))
    assert fastest_rate(sharp, [0.1, 3.0]) == pytest.approx(0.5 / 1e-5, rel=1e-3)  # seen at rest, not at the start


def test_escapement_counts_at_twice_its_angle() -> None:
    driven = DrivenPendulums(np.array([6.0]), terms=VanDerPolDrive(np.array([1e4]), np.array([0.05])))
    assert fastest_rate(driven, [0.01, 0.0]) == pytest.approx(3e4, rel=1e-3)
    assert fastest_rate(VanDerPol(1000.0), [2.0, 0.0]) == pytest.approx(3000.0, rel=1e-6)


@pytest.mark.parametrize("ratio", [3.0, 1e2, 1e6])
def test_beam_counts_by_its_own_frequency(ratio: float) -> None:
    beam = ElasticBeam(50.0, np.full(2, 0.25), np.full(2, 0.25), 1.0, 0.0, 9.81)
    stiff = beam._replace(stiffness=stiffness_of_ratio(ratio, beam))
    swing = math.sqrt(9.81 / 0.25)
    assert fastest_rate(stiff, [0.0, 0.0, 0.1, 0.0, 0.1, 0.0]) == pytest.approx(ratio * swing, rel=1e-3)


def test_light_supports_are_fast_where_the_bobs_do_not_load_them() -> None:
    light = FlexibleFrame(1e-3, np.ones(1), np.ones(1), 150.0, 0.0, 9.81)
    assert fastest_rate(light, [0.0, 0.0, 0.5, 0.0]) > 0.9 * math.sqrt(150.0 / 1e-3)
    beam = ElasticBeam(1e-3, np.ones(1), np.ones(1), 150.0, 0.0, 9.81)
    assert fastest_rate(beam, [0.0, 0.0, 2.0, 0.0]) > 0.9 * math.sqrt(150.0 / 1e-3)  # passes the horizontal


@pytest.mark.parametrize("system", SYSTEMS.values(), ids=list(SYSTEMS))
def test_every_system_has_one(system: Any) -> None:
    assert 0.5 < fastest_rate(system, state_for(system)) < 60.0
