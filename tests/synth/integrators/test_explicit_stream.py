"""Streams: the same bits however the times are cut, the error known beforehand."""

from __future__ import annotations

import numpy as np
import pytest
from kicked import crossings

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.events import escapement
from synth.integrators.explicit import integrate, stream
from synth.systems.driven_pendulums import DrivenPendulums, plain
from synth.systems.resistance import Viscous


@pytest.mark.parametrize("cuts", [[], [1, 2, 30], [40, 40]])
def test_cuts_change_no_bit(cuts: list[int]) -> None:
    times = np.linspace(0.0, 2.0, 41)
    whole = integrate(plain(6.0), [1.0, 0.0], times, tolerance=1e-6)
    pieces = stream(plain(6.0), [1.0, 0.0], np.split(times, cuts), (0.0, 2.0), tolerance=1e-6)
    assert pieces.estimated_error == whole.estimated_error
    np.testing.assert_array_equal(np.concatenate(list(pieces)), whole.states)


def test_kicks_are_streamed_too() -> None:
    system = DrivenPendulums(np.array([6.0]), terms=Viscous(np.array([0.05])))
    kick, times = escapement(system, 0, 0.01, 0.02, direction=0), np.linspace(0.0, 3.0, 61)
    whole = integrate(system, [0.1, 0.0], times, tolerance=1e-6, event=kick)
    pieces = stream(system, [0.1, 0.0], np.split(times, [7, 8, 50]), (0.0, 3.0), tolerance=1e-6, event=kick)
    np.testing.assert_array_equal(np.concatenate(list(pieces)), whole.states)


def test_a_touch_is_refused_before_anything_is_streamed() -> None:
    with pytest.raises(RefusedError, match="touches"):
        stream(plain(6.0), [0.1, 0.0], [], (0.0, 2.5), tolerance=1e-6, event=crossings(plain(6.0), 0.1, 1))


@pytest.mark.parametrize("chunks", [[[0.0, 2.1]], [[-0.1]], [[1.0, 0.5]], [[1.0], [0.5]]])
def test_times_beyond_the_span_or_out_of_order(chunks: list[list[float]]) -> None:
    pieces = stream(plain(6.0), [0.1, 0.0], [np.array(chunk) for chunk in chunks], (0.0, 2.0), tolerance=1e-4)
    with pytest.raises(UsageError, match="chunk"):
        list(pieces)
