"""Collocation and Radau piece by piece: the motion that one march gives, whatever the chunks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from synth.integrators import collocation, radau
from synth.systems.resistance import VanDerPol
from synth.systems.yielding import ElasticBeam, FlexibleFrame

FRAME = FlexibleFrame(2.0, np.full(2, 0.2), np.array([0.25, 0.24]), 150.0, 0.0, 9.81)
BEAM = ElasticBeam(50.0, np.full(2, 0.25), np.array([0.249, 0.2484]), 8000.0, 0.25, 9.81)
SWING = [0.0, 0.0, 0.1, 0.0, -0.07, 0.3]
WAYS: dict[str, tuple[Any, Any, list[float], float]] = {
    "collocation, frame": (collocation, FRAME, SWING, 1e-9),
    "collocation, beam": (collocation, BEAM, SWING, 1e-11),
    "radau": (radau, VanDerPol(100.0), [2.0, 0.0], 1e-9),
}


@pytest.mark.compiled  # thousands of instants are marched beforehand
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cuts", [[], [1, 2, 30], [0, 60]])
def test_streamed_as_in_one_piece(way: str, cuts: list[int]) -> None:
    integrator, system, start, tolerance = WAYS[way]
    times = np.linspace(0.0, 6.0, 61)
    known = integrator.integrate(system, start, times, tolerance=1e-13)
    chunks = [chunk for chunk in np.split(times, cuts) if chunk.size]
    found = integrator.stream(system, start, chunks, (0.0, 6.0), tolerance=tolerance)
    states = np.concatenate(list(found))
    assert states.shape == known.states.shape
    error = np.max(np.abs(states - known.states) / np.abs(known.states).max(axis=0))
    assert error <= 10.0 * found.estimated_error + 1e-13
    assert found.estimated_error <= tolerance


@pytest.mark.compiled
def test_a_stream_may_begin_after_the_start() -> None:
    late = np.linspace(2.0, 4.0, 9)
    pieces = collocation.stream(FRAME, SWING, np.split(late, 3), (0.0, 4.0), tolerance=1e-12)
    known = collocation.integrate(FRAME, SWING, np.concatenate([[0.0], late]), tolerance=1e-12).states[1:]
    np.testing.assert_allclose(np.concatenate(list(pieces)), known, rtol=0, atol=1e-11)
