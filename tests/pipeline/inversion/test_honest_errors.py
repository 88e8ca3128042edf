"""What the stated uncertainty of `shooting` holds besides noise: numerics, gaps, the heave it tells, marks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heavy_pair import observe
from test_shooting import error, thinned

from data_schemas.errors import RefusedError
from pipeline.gaps import bridge
from pipeline.inversion import heave
from pipeline.inversion.prepare import invert
from pipeline.observation import Observation
from pipeline.prepared import prepare

N2, STEP = 6.2, 0.04


@pytest.mark.parametrize("every", [1, 2, 3])
def test_numerical_error_is_stated(every: int) -> None:
    """Noise-free, heave recorded, 25 to 8 Hz: the error grows a ten-thousandfold, and sigma with it."""
    seen = observe(300.0, 0.04, heave=True)
    found = seen if every == 1 else thinned(seen, slice(None, None, every), 0.04 * every)
    off, sigma, _ = error(found)
    assert abs(off) < 4.0 * sigma
    assert sigma < (2e-3, 2e-2, 0.4)[every - 1]


def test_window_lets_through_what_is_said_of_a_line() -> None:
    """Mean of zeta under the Hann window over random phases and lines, against `window_leak`."""
    random = np.random.default_rng(2)
    count, step = 7500, 0.04
    time = np.arange(count) * step
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    means, told = [], []
    for _ in range(200):
        rate, phase = random.uniform(0.4, 1.2), random.uniform(0.0, 2.0 * np.pi)
        zeta = 0.02 * np.cos(rate * time + phase)
        means.append(float(window @ zeta / window.sum()))
        told.append(heave.window_leak(zeta))
    # 200 values know a root mean square to 5 %; that the bound is met on average only, costs some more
    assert np.sqrt(np.mean(np.square(told))) / np.sqrt(np.mean(np.square(means))) == pytest.approx(1.0, abs=0.4)


def test_phase_goes_on_across_a_gap() -> None:
    count = 6000
    low = heave.band(count, STEP, N2)
    time = np.arange(count) * STEP
    lack = 1e-2 * np.sin(0.6 * time) + 5e-3 * np.cos(1.1 * time)
    model, seen = np.cos(N2 * time), np.cos(N2 * time + lack)
    whole = heave.lacking_speed(model, seen - model, N2, STEP, low)
    broken = seen - model
    lost = (time % 30.0) < 0.6
    broken[lost] = np.nan
    found = heave.lacking_speed(model, broken, N2, STEP, low)
    inside = slice(500, -500)
    # a hundredth of the phase speed; without going on it is as large as the speed itself
    assert np.abs(found - whole)[inside].max() < 0.03 * np.abs(whole)[inside].max()


def test_a_long_gap_costs_and_a_short_one_does_not() -> None:
    count = 20_000
    time = np.arange(count) * STEP
    zeta = 0.02 * np.cos(0.6 * time) + 0.005 * np.sin(0.93 * time)
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    noise = np.random.default_rng(5).normal(0.0, 1e-6, count)

    def cost(seconds: float) -> float:
        residual = noise.copy()
        residual[8000 : 8000 + round(seconds / STEP)] = np.nan
        model = 0.01 * np.cos(N2 * time)
        return heave.gap_error(model, residual, zeta, window / window.sum(), N2, STEP, heave.band(count, STEP, N2))

    assert cost(0.0) == cost(0.6) == 0.0
    assert 0.0 < 10.0 * cost(3.0) < cost(20.0)
    # no room to try it: a bound that the heave sets, a third of its rms times the gap's share of the window
    hidden = cost(400.0) / (N2 * np.std(zeta) / 6.0)
    assert hidden == pytest.approx(400.0 / STEP * window[8000 + round(200.0 / STEP)] / window.sum(), rel=0.3)


@pytest.mark.compiled
def test_gaps_of_both_traces_in_heave_that_nobody_recorded() -> None:
    """Lost seconds of the difference alone once cost eight tenths of a milligal."""
    seen = observe(900.0, 0.04, heave=True, recorded=False)
    lost = ((seen.time % 60.0) < 0.6) & (seen.time > 1.0)
    theta, difference = seen.theta.copy(), seen.difference.copy()
    theta[lost], difference[lost] = np.nan, np.nan
    off, sigma, _ = error(replace(seen, theta=theta, difference=difference))
    assert abs(off) < 4.0 * sigma
    assert abs(off) < 0.1


@pytest.mark.compiled
def test_gaps_of_the_first_pendulum_in_heave_have_no_bias() -> None:
    """6 records with lost seconds beside the same without: apart by noise of the bridges, not all one way."""
    seen = observe(600.0, 0.04, heave=True)
    lost = ((seen.time % 60.0) < 0.6) & (seen.time > 1.0)
    apart = []
    for seed in range(6):
        random = np.random.default_rng([seed, 11])
        theta, difference = (series + random.normal(0.0, 1e-4, series.size) for series in (seen.theta, seen.difference))
        whole = error(replace(seen, theta=theta, difference=difference))[0]
        broken = theta.copy()
        broken[lost] = np.nan
        apart.append(error(replace(seen, theta=broken, difference=difference))[0] - whole)
    assert abs(np.mean(apart)) < max(3.0 * np.std(apart) / np.sqrt(6), 0.01)
    assert np.std(apart) < 0.2


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_bridge_knows_its_error_in_modulated_motion(noise: float) -> None:
    """The true rms error of bridges of 0.2 and 0.6 s, over the predicted one: neither far above nor far below."""
    seen = observe(300.0, 0.04, heave=True)
    theta = seen.theta + np.random.default_rng(3).normal(0.0, 1.0, seen.theta.size) * noise
    broken = theta.copy()
    starts = np.arange(400, 7000, 300)
    for k, start in enumerate(starts):
        broken[start : start + (5, 15)[k % 2]] = np.nan
    filled, spans = bridge(broken, 0.04, N2, noise)
    true = np.sqrt(
        np.mean([np.mean((filled - seen.theta)[s : s + n] ** 2) for s, (n, _) in zip(starts, spans, strict=True)])
    )
    told = np.sqrt(np.mean([e**2 for _, e in spans]))
    assert 0.3 < true / told < 2.0


def marks(seen: Observation, noise: float) -> Observation:
    """Half-second marks of a record of 0.1 s, its noise stated."""
    found = thinned(seen, slice(None, None, 5), 0.5)
    random = np.random.default_rng(5)
    theta, difference = (s + random.normal(0.0, noise, s.size) for s in (found.theta, found.difference))
    return replace(found, theta=theta, difference=difference, sigma_theta=noise, sigma_difference=noise)


@pytest.mark.compiled
@pytest.mark.parametrize("recorded", [True, False])
def test_marks_in_heave_say_how_little_they_know(recorded: bool) -> None:
    """Read twice a swing, a heave that nobody recorded hides a hundred milligals, and a recorded one some of them."""
    off, sigma, _ = error(marks(observe(900.0, 0.1, heave=True, recorded=recorded), 1e-4))
    assert abs(off) < 3.0 * sigma
    if not recorded:
        assert abs(off) > 30.0


def test_what_is_no_heave_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where more of it is found than a ship can do; here the limit is brought down to a ship."""
    seen = observe(300.0, 0.04, heave=True, recorded=False)
    assert invert(prepare(seen)).heave is not None
    monkeypatch.setattr(heave, "MOST_HEAVE", 0.005)
    with pytest.raises(RefusedError, match="neither arcs nor heave"):
        invert(prepare(seen))


@pytest.mark.compiled
def test_95_per_cent_of_200_short_records() -> None:
    """Binomial: 190 +- 3.1 of 200; three sigmas are 4.6 %."""
    hits, ratios = [], []
    for recorded in (True, False):
        seen = observe(600.0, 0.1, heave=recorded, recorded=recorded)
        for seed in range(100):
            random = np.random.default_rng([seed, 13, recorded])
            theta, difference = (s + random.normal(0.0, 1e-4, s.size) for s in (seen.theta, seen.difference))
            off, sigma, _ = error(replace(seen, theta=theta, difference=difference))
            hits.append(abs(off) < 1.96 * sigma)
            ratios.append(off / sigma)
    assert abs(np.mean(hits) - 0.95) < 0.047
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(ratios)) < 3.0 / np.sqrt(200)


@pytest.mark.campaign
def test_95_per_cent_of_2000_records() -> None:
    """The issue's bar, 93.5 to 96.5 %, over swell, larger period difference, heave recorded and not."""
    from pipeline.benchmarks.bars_inversion import kinds
    from pipeline.benchmarks.trials import campaign

    hits = []
    for name, scene in kinds().items():
        found = campaign(scene, ("shooting",), 500, first_seed=40_000)["shooting"]
        hits.append(found.covered())
        print(f"{name}: coverage {hits[-1]:.4f}, rms {found.rmse:.4f}, mean sigma {found.sigmas.mean():.4f} mGal")
    assert 0.935 <= np.mean(hits) <= 0.965
