from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth.recording.clock import set_clock, true_time_scale

Maker = Callable[..., Scene]


def _seconds(scene: Scene) -> np.ndarray:
    return set_clock(scene).seconds


@pytest.mark.parametrize(("rate", "count"), [(25, 1000), (12.5, 500), ("25/3", 334), (20, 800)])
def test_even_times(make_scene: Maker, rate: object, count: int) -> None:
    """From 0, below the duration, each the double nearest to k/rate."""
    seconds = _seconds(make_scene(recording={"sampling_rate": rate}))
    exact = [float(k / Fraction(str(rate))) for k in range(count)]
    np.testing.assert_array_equal(seconds, exact)


def test_half_second_marks_only(make_scene: Maker) -> None:
    np.testing.assert_array_equal(_seconds(make_scene(recording={"marks": True})), np.arange(80) / 2)


def test_dropped_readings_are_absent(make_scene: Maker) -> None:
    whole = _seconds(make_scene())
    left = _seconds(make_scene(recording={"drop_fraction": 0.2}))
    assert left.size == 800
    assert np.all(np.isin(left, whole))
    assert np.max(np.diff(left)) < 0.5  # dropped at random, not in a stretch: 12 in a row has odds of 1e-5


def test_jitter(make_scene: Maker) -> None:
    scene = make_scene(duration=400.0, recording={"jitter": 0.01, "drop_fraction": 0.2})
    seconds = _seconds(scene)
    off = seconds - np.rint(seconds * 25) / 25
    assert np.all(np.diff(seconds) > 0)
    assert seconds[0] >= 0
    # readings more than half a step off count to the neighbour: 4.5 % of them
    assert np.std(off) == pytest.approx(0.01, rel=0.1)


def test_a_losing_chronometer_shows_less_than_the_truth(make_scene: Maker) -> None:
    clock = set_clock(make_scene(recording={"chronometer_rate": 86.4}))
    np.testing.assert_allclose(clock.true_seconds, 1.001 * clock.seconds, rtol=1e-15)
    assert true_time_scale(-86.4) == Fraction(999, 1000)


def test_nothing_left(make_scene: Maker) -> None:
    with pytest.raises(SceneError, match="drop_fraction"):
        set_clock(make_scene(duration=0.04, recording={"drop_fraction": 0.6}))
