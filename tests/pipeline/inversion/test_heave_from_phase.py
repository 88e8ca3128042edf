"""Heave that nobody recorded, where it is hard to tell: beats, short waves, gaps, amplitudes through zero."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import synth
from data_schemas.scene import Scene
from pipeline.inversion import heave
from pipeline.processing import process

GRAVITY = 9.8123


def told(
    periods: tuple[float, float], sizes: tuple[float, float], sea: dict[str, Any], **kept: Any
) -> tuple[float, float]:
    """Error and sigma, mGal, of half an hour at 10 Hz."""
    moved = {"kind": "sea", "spectrum": "jonswap", "seed": 7, **sea}
    drawn = Scene.model_validate(
        {
            "record_id": "heave-from-phase",
            "seed": 3,
            "duration": 1800.0,
            "gravity": GRAVITY,
            "reference_gravity": 9.81,
            "restoring": "sine",
            "pendulums": [
                {"label": label, "period": period, "start": {"kind": "free", "amplitude": size, "phase": phase}}
                for label, period, size, phase in zip("12", periods, sizes, (0.4, 2.9), strict=True)
            ],
            "motion": [moved, moved | {"axis": "vertical"}],
            "recording": {"sampling_rate": 10, "noise": 1e-6} | kept,
        }
    )
    record, _ = synth.simulate(drawn)
    found = process(record, method="shooting")["gravity"].dataset
    off = 1e5 * (float(found["gravity"].values[0]) - GRAVITY)
    return off, float(found["gravity_sigma"].values[0])


SWELL = {"significant_height": 3.5, "peak_period": 12.0, "depth": 20.0}
SHORT = {"significant_height": 0.35, "peak_period": 6.0, "depth": 2.0}


@pytest.mark.compiled
def test_a_beat_keeps_its_phase() -> None:
    """The first pendulum is a reading: what turns the difference does not turn it. Once 2.5 mGal off, ten sigmas."""
    off, sigma = told((1.0081, 1.0068), (0.0065, 0.0085), SWELL)
    assert abs(off) < 4.0 * sigma
    assert abs(off) < 0.05


@pytest.mark.compiled
def test_short_waves_are_followed() -> None:
    """A third of the heave lies beside what the residual's colour looks at; it was left alone: 22 mGal off."""
    off, sigma = told((1.0112, 1.0109), (0.0054, 0.0043), SHORT)
    assert abs(off) < 4.0 * sigma
    assert abs(off) < 0.2


@pytest.mark.compiled
def test_what_no_phase_tells_is_in_sigma() -> None:
    """Through zero amplitude: heave shows in the residual, and what it may do is said."""
    off, sigma = told((1.0, 0.9994), (0.02, 0.02), SWELL)
    assert 1.0 < abs(off) < 4.0 * sigma


@pytest.mark.compiled
@pytest.mark.parametrize("kept", [{"drop_fraction": 0.02}, {"mark_gap": 2.0}])
def test_gaps_cost_what_they_are_said_to(kept: dict[str, float]) -> None:
    """2 s each minute were said to cost 6 mGal; lone readings cost .6 where .1 was said."""
    off, sigma = told((1.0, 1.0001), (0.03, 0.02), SWELL, **kept)
    assert abs(off) < 4.0 * sigma
    assert sigma < 1.0


def test_what_the_rounds_do_not_follow_is_told_from_what_they_do() -> None:
    count, step, frequency, rounds = 30_000, 0.04, 6.2, 6
    low = heave.band(count, step, frequency)
    time = np.arange(count) * step
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    window /= window.sum()
    rate = 0.46 * frequency  # between pass and stop
    gain = float(np.interp(rate, np.fft.fftshift(low.angular), np.fft.fftshift(low.gain)))
    tall = 1.0 / (1.0 - 0.25 * 0.46**2)
    followed = 1.0 - (1.0 - gain * tall) ** rounds
    assert heave.LEAST_FOLLOWED < followed < 0.9
    found = 0.01 * followed * np.cos(rate * time) + 0.02 * np.cos(0.6 * time)
    lost = heave.power_lost(found, window, 0.0, 0.0, frequency, low, rounds)
    assert lost == pytest.approx(tall * 0.5e-4 * (1.0 - followed**2), rel=0.02)
    # noise alone tells of no heave
    noise, amplitude = 1e-5, 0.01
    model = amplitude * np.cos(frequency * time)
    made, taken = [], []
    for seed in range(12):
        read = np.random.default_rng(seed).normal(0.0, noise, count)
        zeta = 2.0 / frequency * heave.lacking_speed(model, read, frequency, step, low)
        made.append(heave.power_lost(zeta, window, amplitude**-2, noise, frequency, low, 1))
        taken.append(heave.power_lost(zeta, window, 0.0, 0.0, frequency, low, 1))
    assert abs(np.mean(made)) < 0.08 * np.mean(taken)
