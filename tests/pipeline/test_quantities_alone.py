"""Parts of the quantities on their own: spectrum, flags, raw pendulums, the model of the harmonics."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline import quantities
from pipeline.harmonics.envelope import sliding_envelope
from pipeline.quantities import AMBIGUOUS, GAP, INTERPOLATED, best_of, model_of_harmonics, spectrum

STEP, FREQUENCY = 0.1, 6.2
TIME = np.arange(1200) * STEP


def sampled(step: float = STEP) -> tuple[Any, np.ndarray, np.ndarray]:
    """A stand-in for what is prepared of two pure swings on slow lines; both angles; both derivatives."""
    time = np.arange(round(120.0 / step)) * step
    swings = [a * np.exp(1j * (n * time + p)) for a, n, p in ((0.02, 6.21, 0.3), (0.01, 6.2, 1.9))]
    angle = np.array([swings[0].real + 0.002 + 1e-5 * time, swings[1].real + 0.001])
    slope = np.array([(6.21j * swings[0]).real + 1e-5, (6.2j * swings[1]).real])
    envelope = sliding_envelope(time, step, angle[0], angle[0] - angle[1], FREQUENCY)
    seen = SimpleNamespace(step=step, theta=angle[0], difference=angle[0] - angle[1])
    at = np.rint(envelope.time / step).astype(int)
    return SimpleNamespace(sliding=envelope, observation=seen, nominal=FREQUENCY), angle[:, at], slope[:, at]


@pytest.mark.parametrize("sparse", [0.0, 0.8], ids=["harmonics", "samples"])
def test_raw_pendulums_have_value_and_slope_of_the_samples(monkeypatch, sparse: float) -> None:
    """(4), whether the derivative is taken of the samples or of the separated harmonics."""
    monkeypatch.setattr(quantities, "SPARSE", sparse)
    prepared, angle, slope = sampled()
    own = np.array([6.21, 6.2])
    raw = quantities._raw(prepared, own)
    np.testing.assert_allclose(raw.real, angle, atol=1e-7)
    np.testing.assert_allclose(-raw.imag * own[:, None], slope, atol=1e-5)  # a polynomial through nine samples


def test_few_samples_a_swing_take_the_harmonics() -> None:
    prepared, angle, _ = sampled(0.4)
    raw = quantities._raw(prepared, np.array([6.21, 6.2]))
    np.testing.assert_allclose(raw.real, angle, atol=1e-4)


def test_harmonics_and_slow_part_are_the_series() -> None:
    prepared, _, _ = sampled()
    envelope = prepared.sliding
    model = model_of_harmonics(prepared, TIME)
    inside = (envelope.time[0] <= TIME) & (envelope.time[-1] >= TIME)
    assert np.array_equal(np.isfinite(model), inside)
    # straight lines between instants a second apart of what turns by 0.01 rad in it
    np.testing.assert_allclose(model[inside], prepared.observation.difference[inside], atol=1e-6)


@pytest.mark.parametrize("count", [700, 1024, 5000])
def test_the_spectrum_is_welchs(count: int) -> None:
    from scipy.signal import welch

    residual = np.random.default_rng(4).normal(0.3, 1.0, count)
    values, axis = spectrum(5.0 + STEP * np.arange(count), residual)
    frequency, power = welch(
        residual - residual.mean(), 1.0 / STEP, nperseg=min(1024, count), detrend=False, scaling="density"
    )
    np.testing.assert_allclose(axis["frequency"], frequency, rtol=1e-12)
    inner = slice(1, -1)  # the two ends have no mirror image, which Welch's counts once
    np.testing.assert_allclose(values["residual_spectrum"][inner], power[inner], rtol=1e-9)


def test_samples_that_are_missing_leave_the_spectrum_as_it_is() -> None:
    draw = np.random.default_rng(5)
    time, residual = STEP * np.arange(60_000), draw.normal(2.0, 1.0, 60_000)
    residual[draw.random(residual.size) < 0.2] = np.nan
    kept = draw.random(residual.size) < 0.8
    kept[0] = kept[-1] = True
    power = spectrum(time[kept], residual[kept])[0]["residual_spectrum"]
    # 116 segments, 500 frequencies: the mean is good to a per cent
    assert np.mean(power[2:-1]) == pytest.approx(2.0 * STEP, rel=0.03)
    assert power[0] < power[2:].max()
    assert spectrum(time, np.full(time.size, np.nan))[0]["residual_spectrum"].max() == 0.0


def test_flags_of_phases_by_their_reasons() -> None:
    time = np.arange(6.0)
    amplitude = np.ones((3, 6))
    amplitude[0, 1], amplitude[1, 2], amplitude[1, 3], amplitude[2] = np.nan, 0.0999, 0.1001, 5.0
    readings = np.array([-0.5, 0.5, 2.0, 3.0, 3.9])
    found = quantities._quality(amplitude, time, readings)
    assert found.dtype == np.uint16
    far = [0, 0, 0, 0, 0, INTERPOLATED]
    assert found.tolist() == [[0, GAP, *far[2:]], [0, 0, AMBIGUOUS, *far[3:]], far]
    for one, flagged in ((np.array([2.0]), [True, False, False, False, True, True]), (np.array([]), [False] * 6)):
        assert ((quantities._quality(amplitude, time, one)[2] & INTERPOLATED) > 0).tolist() == flagged
    assert quantities._quality(amplitude, time, np.array([0.0, 2.0, 4.5]))[2].tolist() == [0] * 6
    assert quantities._quality(amplitude, time, np.array([2.0, 9.0]))[2].tolist() == [4, 0, 0, 0, 4, 4]


def test_the_most_exact_method_that_gave_a_value_is_best() -> None:
    def given(*names: str) -> list[Any]:
        return [SimpleNamespace(method=name.strip("!"), estimate=None if "!" in name else 1) for name in names]

    for names, best in (
        (("uncorrected", "projection", "complex"), "projection"),
        (("mine", "uncorrected"), "uncorrected"),
        (("joint!", "general", "panteleev"), "panteleev"),
        (("mine",), "mine"),
    ):
        found = best_of(given(*names))
        assert found is not None
        assert found.method == best
    assert best_of(given("joint!")) is None
