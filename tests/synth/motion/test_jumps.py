"""Jumps are found in smooth, noisy and quantised tables; honest tables, however rough, have none."""

from __future__ import annotations

import numpy as np
import pytest

from synth.motion.tabulated import first_jump
from synth.phase import Floats

INDEX = np.arange(5000.0)


def _sea(step: float, seed: int = 3) -> Floats:
    """300 waves of 0.4 to 2.4 rad/s."""
    chance = np.random.default_rng(seed)
    rates, phases = chance.uniform(0.4, 2.4, 300), chance.uniform(0.0, 6.28, 300)
    sizes = np.exp(-(((rates - 0.7) / 0.3) ** 2)) + 0.05 / rates**2
    return np.asarray(sizes @ np.cos(np.outer(rates, step * INDEX) + phases[:, None]))


def _quantised(values: Floats, levels: int) -> Floats:
    size = np.ptp(values) / levels
    return np.asarray(np.round(values / size) * size)


@pytest.mark.parametrize("size", [1.0, 0.5, 0.3])
@pytest.mark.parametrize("step", [0.1, 0.2])
def test_jumps_are_found_where_they_are(step: float, size: float) -> None:
    """By shares of the table's range, in a sea read 5 and 10 times a second."""
    sea = _sea(step)
    assert first_jump(INDEX, sea) is None
    for sign in (1.0, -1.0):
        assert first_jump(INDEX, sea + sign * size * np.ptp(sea) * (INDEX > 777)) == 777


def test_a_large_jump_is_found_in_noise() -> None:
    noise = np.random.default_rng(5).normal(scale=0.02, size=INDEX.size)
    assert first_jump(INDEX, 0.3 * np.sin(0.18 * INDEX) + noise + (INDEX > 99)) == 99


def test_steps_from_rest_are_jumps() -> None:
    assert first_jump(INDEX, (INDEX > 100) * 1.0) == 100
    assert first_jump(INDEX, (INDEX // 50) % 2) == 49


@pytest.mark.parametrize("period", [2.5, 3.3, 10.0, 100.0, 1000.0])
def test_waves_do_not_jump(period: float) -> None:
    """Nor do they where they set in, or pass as a short packet."""
    assert first_jump(INDEX, np.cos(2 * np.pi * INDEX / period + 0.3)) is None
    if period >= 4.0:
        assert first_jump(INDEX, np.sin(2 * np.pi * (INDEX - 1000) / period) * (INDEX > 1000)) is None
        packet = np.exp(-0.5 * ((INDEX - 1000) / period) ** 2)
        assert first_jump(INDEX, packet * np.cos(2 * np.pi * INDEX / period)) is None


@pytest.mark.parametrize("width", [1.0, 1.5, 3.0, 10.0])
def test_blows_do_not_jump(width: float) -> None:
    for offset in (0.0, 0.3, 0.5):
        assert first_jump(INDEX, np.exp(-0.5 * ((INDEX - 1000 + offset) / width) ** 2)) is None


@pytest.mark.parametrize("levels", [5, 30, 1000])
@pytest.mark.parametrize("step", [0.1, 1.0])
def test_quantised_readings_do_not_jump(step: float, levels: int) -> None:
    assert first_jump(INDEX, _quantised(_sea(step), levels)) is None


def test_noise_does_not_jump() -> None:
    chance = np.random.default_rng(7)
    seconds = np.arange(200_000.0)
    for noise in (chance.normal(size=200_000), chance.uniform(size=200_000), chance.laplace(size=200_000)):
        assert first_jump(seconds, noise) is None
        assert first_jump(seconds, np.cumsum(noise - noise.mean())) is None


def test_a_gap_is_no_jump() -> None:
    kept = np.delete(INDEX, np.arange(500, 520))
    assert first_jump(kept, np.cos(0.1 * kept)) is None


def test_few_readings_and_a_constant_tell_nothing() -> None:
    assert first_jump(INDEX[:10], (INDEX[:10] > 4) * 1.0) is None
    assert first_jump(INDEX, np.full(INDEX.size, 2.0)) is None
