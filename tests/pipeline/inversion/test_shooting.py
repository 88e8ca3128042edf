"""`shooting` on real pendulums in a seaway, truth from scipy's DOP853."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from heavy_pair import G, observe
from scipy.interpolate import CubicSpline

from data_schemas.errors import RefusedError
from pipeline.inversion.prepare import Inverted, invert
from pipeline.methods import method
from pipeline.observation import Observation
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by


def error(seen: Observation) -> tuple[float, float, Inverted]:
    """Error and 1 sigma of gravity, mGal."""
    prepared = prepare(seen)
    found = invert(prepared)
    scale = 2e5 * G / found.frequency
    return (prepared.gravity_of(found.frequency) - G) * 1e5, found.sigma * scale, found


def thinned(seen: Observation, rows: Any, step: float | None) -> Observation:
    vertical = None if seen.vertical is None else seen.vertical[rows]
    return replace(
        seen,
        time=seen.time[rows],
        step=step,
        theta=seen.theta[rows],
        difference=seen.difference[rows],
        vertical=vertical,
    )


@pytest.mark.parametrize("heave", [False, True])
def test_exact_in_a_seaway(heave: bool) -> None:
    """The truth's own error, 1e-11 rad over 300 s, is 1e-4 mGal; linear projection errs by tens."""
    seen = observe(300.0, 0.04, heave=heave)
    off, _, found = error(seen)
    assert abs(off) < 2e-3
    assert found.noise < 1e-9
    prepared = prepare(seen)
    linear = method("projection")(prepared).frequency
    assert abs(prepared.gravity_of(linear) - G) > 10e-5


def test_lost_and_wild_readings() -> None:
    seen = observe(300.0, 0.04, heave=True)
    random = np.random.default_rng(3)
    difference, theta = seen.difference.copy(), seen.theta.copy()
    difference[(seen.time % 60.0) < 0.6] = np.nan
    difference[2000:2500] = np.nan
    difference[random.choice(difference.size, 20, replace=False)] += 0.004
    theta[1000:1010] = np.nan
    off, _, found = error(replace(seen, difference=difference, theta=theta))
    assert abs(off) < 0.2  # the bridge of 0.4 s in the first pendulum, in heave, which it does not know
    assert found.samples > 6500


def test_uneven_times() -> None:
    seen = observe(300.0, 0.04, heave=True)
    rows = np.sort(np.random.default_rng(4).choice(seen.time.size - 2, 6000, replace=False) + 1)
    rows[0], rows[-1] = 0, seen.time.size - 1
    off, _, _ = error(thinned(seen, rows, None))
    assert abs(off) < 0.02


def test_fewer_readings_a_swing() -> None:
    """Eight readings a swing: the quadrature's own limit, some 1e-2 mGal in heavy motion."""
    seen = observe(300.0, 0.04, heave=True)
    assert abs(error(thinned(seen, slice(None, None, 3), 0.12))[0]) < 0.1


def test_damping_is_fitted_where_none_is_stated() -> None:
    """The damping difference is then taken as zero, which costs milligals; the rate itself must come out."""
    off, _, found = error(observe(300.0, 0.04, heave=True, damping_rate=None))
    assert abs(off) < 30.0
    assert found.damping_rate == pytest.approx(1.6e-4, abs=1e-4)  # the difference of 4e-5, taken as zero, goes into it


def test_linear_records_are_left_to_the_projection() -> None:
    seen = observe(300.0, 0.04, heave=False, restoring="linear")
    prepared = prepare(seen)
    assert method("shooting")(prepared).frequency == method("projection")(prepared).frequency


def test_arcs_beyond_the_polynomials() -> None:
    """The kernels for any angle give what the polynomials give."""
    from pipeline.inversion import kernels

    random = np.random.default_rng(1)
    about, theta, curvature = random.uniform(-0.45, 0.45, (3, 400))
    pull = 1.0 + 0.1 * theta
    small, large = np.empty((2, 3, 400))
    kernels.expand_small(about, theta, curvature, pull, 6.2, 6.1, 1e-3, *small)
    kernels.expand_large(about, theta, curvature, pull, 6.2, 6.1, 1e-3, *large)
    assert np.abs(small - large).max() < 1e-13


def test_heave_that_nobody_recorded() -> None:
    seen = observe(900.0, 0.04, heave=True, recorded=False)
    off, _, found = error(seen)
    assert abs(off) < 0.05  # fifteen minutes; a record of thirty is right to 0.002
    assert found.heave == pytest.approx(np.sqrt(0.5 * (0.25**2 + 0.1**2)) / G, rel=0.02)
    heard = error(observe(900.0, 0.04, heave=True))[0]
    assert abs(heard) < 0.002


@pytest.mark.compiled
@pytest.mark.parametrize("recorded", [True, False])
def test_stated_error_in_noise(recorded: bool) -> None:
    """40 records: RMSE over mean sigma is known to 11 %, so within 35 % of one at three sigma."""
    seen = observe(900.0, 0.04, heave=True, recorded=recorded)
    offs, sigmas = [], []
    for seed in range(40):
        random = np.random.default_rng([seed, 7])
        noisy = [series + random.normal(0.0, 1e-4, series.size) for series in (seen.theta, seen.difference)]
        off, sigma, _ = error(replace(seen, theta=noisy[0], difference=noisy[1]))
        offs.append(off)
        sigmas.append(sigma)
    assert np.sqrt(np.mean(np.square(offs))) / np.mean(sigmas) == pytest.approx(1.0, abs=0.35)
    assert abs(np.mean(offs)) < 3.0 * np.mean(sigmas) / np.sqrt(40)


def test_what_it_reduces_is_not_flagged() -> None:
    reduced = {
        name: reduce_by(name, prepare(observe(300.0, 0.04, heave=True)), 0.0)
        for name in ("shooting", "general", "projection")
    }
    assert "acceleration-not-reduced" in reduced["projection"].flags
    assert all("acceleration-not-reduced" not in reduced[name].flags for name in ("shooting", "general"))


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("length", "heave", "recorded", "most"),
    [(300.0, False, False, 0.01), (300.0, True, True, 0.3), (900.0, True, False, 0.9)],
)
def test_five_readings_a_swing(length: float, heave: bool, recorded: bool, most: float) -> None:
    """Noise-free; left is what neighbours so far apart take for noise, and the third harmonic, which is folded over."""
    seen = thinned(observe(length, 0.04, heave=heave, recorded=recorded), slice(None, None, 5), 0.2)
    off, sigma, _ = error(seen)
    assert abs(off) < 4.0 * sigma
    assert abs(off) < most


def test_times_that_run_unevenly_look_like_heave_and_are_told_from_it() -> None:
    """A film's times 1 ms early and late every seven seconds: as heave they would cost g <t'^2>, 0.4 mGal."""
    seen = observe(300.0, 0.04, heave=False)
    late = 1e-3 * np.sin(0.9 * seen.time)
    moved = {name: CubicSpline(seen.time, getattr(seen, name))(seen.time + late) for name in ("theta", "difference")}
    uneven = 1e-3 * 0.9 / np.sqrt(2.0)
    taken_for_heave, alone, _ = error(replace(seen, **moved))
    assert taken_for_heave == pytest.approx(G * uneven**2 * 1e5, rel=0.1)
    # of what is stated half is taken to lie in the band of heave
    told, sigma, _ = error(replace(seen, **moved, time_rate_sigma=np.sqrt(2.0) * uneven))
    assert abs(told) < 0.1 * taken_for_heave
    assert sigma == pytest.approx(np.hypot(alone, 0.6 * taken_for_heave), rel=0.1)
    still, _, _ = error(replace(seen, time_rate_sigma=1e-3))
    assert abs(still) < 1e-3  # where nothing looks like heave nothing is taken off


def test_general_declines_where_the_slow_motion_is_known_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared = prepare(observe(120.0, 0.04, heave=False))
    monkeypatch.setattr(
        type(prepared.slow_motion), "phase", lambda self, gamma, frequency, time: np.full(time.size, np.nan)
    )
    with pytest.raises(RefusedError, match="correction: known at no instant"):
        method("general")(prepared)
