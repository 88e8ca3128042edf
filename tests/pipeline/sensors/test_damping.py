"""The difference of damping where none is stated: told from the record, else held by what is likely and in sigma."""

from __future__ import annotations

from dataclasses import replace

import heavy_pair
import numpy as np
import pytest
from exact_pair import G, Pair, swell

from pipeline.flags import DAMPING_ASSUMED
from pipeline.observation import Observation
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by
from pipeline.sensors.damping import LIKELY, with_damping_told
from pipeline.sensors.examination import Examination, examine
from pipeline.sensors.state import State, made_by_noise

pytestmark = pytest.mark.compiled  # many fits of both identities
TIME = np.arange(18000) * 0.1


def linear(damping: tuple[float, float], eps: float = 1e-3, noise: float = 2e-5) -> Observation:
    pair = Pair.apart(eps, damping=damping, forcing=swell(8, 0.03))
    random = np.random.default_rng(4)
    series = (pair.elongation(0, TIME), pair.difference(TIME))
    theta, difference = (each + noise * random.normal(size=TIME.size) for each in series)
    return pair.observe(TIME, step=0.1, theta=theta, difference=difference, damping_rate=None)


def left(found: Examination, method: str) -> tuple[float, float]:
    """Error and sigma, mGal."""
    value = reduce_by(method, found.prepared, 0.0, found).gravity
    assert value is not None
    return (value.gravity - G) * 1e5, value.sigma


def test_linear_pendulums_tell_it() -> None:
    seen = linear((1.5e-4, 1e-4))
    found = examine(seen)
    assert found.flags == (DAMPING_ASSUMED,)
    assert found.prepared.observation.damping_difference == pytest.approx(5e-5, rel=0.05)
    off, sigma = left(found, "projection")
    assert abs(off) < 4.0 * sigma < 1.0
    assumed, small = left(Examination(prepare(seen)), "projection")
    assert abs(assumed) > 4.0 * small


@pytest.mark.parametrize("noise", [0.0, 2e-6])
def test_real_pendulums_tell_it(noise: float) -> None:
    random = np.random.default_rng(1)
    seen = heavy_pair.observe(600.0, 0.1, heave=False, damping_rate=None)
    theta, difference = (each + noise * random.normal(size=each.size) for each in (seen.theta, seen.difference))
    found = examine(replace(seen, theta=theta, difference=difference))
    assert found.prepared.observation.damping_difference == pytest.approx(4e-5, rel=0.1)
    value = reduce_by("shooting", found.prepared, 0.0, found).gravity
    assert value is not None
    assert abs(value.gravity - heavy_pair.G) * 1e5 < max(4.0 * value.sigma, 0.03)


def test_where_it_is_not_told_it_is_likely_nought_and_doubted() -> None:
    """A relative difference of the periods of 1e-6: half an hour is a hundredth of a beat."""
    found = examine(linear((1.1e-4, 1e-4), eps=1e-6, noise=1e-4))
    assert abs(found.prepared.observation.damping_difference) < 0.5e-5
    assert found.doubt > 0.0
    off, sigma = left(found, "projection")
    assert abs(off) < 4.0 * sigma


def test_stated_or_no_damping_is_left_alone() -> None:
    still = State.of(prepare(linear((0.0, 0.0), noise=1e-7)))
    assert with_damping_told(still) == (still, 0.0)
    stated = State.of(prepare(replace(linear((1.5e-4, 1e-4)), damping_rate=np.array([1.5e-4, 1e-4]))))
    assert with_damping_told(stated) == (stated, 0.0)


def test_of_a_record_that_is_not_understood_nothing_is_told() -> None:
    """Heave that nobody recorded: the doubt is all that is likely."""
    given = State.of(prepare(heavy_pair.observe(300.0, 0.1, heave=True, recorded=False, damping_rate=None)), True)
    told, doubt = with_damping_told(given)
    assert told is given
    assert doubt > LIKELY * 1e-5


def test_what_noise_makes_of_real_pendulums() -> None:
    random = np.random.default_rng(2)
    seen = heavy_pair.observe(300.0, 0.1, heave=False)
    theta, difference = (each + 1e-5 * random.normal(size=each.size) for each in (seen.theta, seen.difference))
    noisy = State.of(prepare(replace(seen, theta=theta, difference=difference)))

    late = replace(seen, theta=heavy_pair.observe(300.0, 0.05, heave=False).theta[1::2])
    assert made_by_noise(noisy)
    assert not made_by_noise(State.of(replace(prepare(late), noise_theta=1e-5)))
    assert not made_by_noise(replace(noisy, real=False))
    assert not made_by_noise(replace(noisy, prepared=replace(noisy.prepared, noise_theta=float("nan"))))
