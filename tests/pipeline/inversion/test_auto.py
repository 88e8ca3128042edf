"""`auto` on real pendulums: what it takes, why, and that it is as right as what it takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_pair import Pair, swell
from heavy_pair import G, observe
from made_records import row
from test_shooting import thinned

import synth
from data_schemas.scene import Scene
from pipeline.choice import NEGLIGIBLE, choose
from pipeline.flags import LINEAR_FITS
from pipeline.observation import Observation
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by


def noisy(seen: Observation, noise: float, seed: int = 1) -> Observation:
    random = np.random.default_rng(seed)
    theta, difference = (s + random.normal(0.0, noise, s.size) for s in (seen.theta, seen.difference))
    return replace(seen, theta=theta, difference=difference)


@pytest.mark.parametrize("restoring", ["sine", None])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_real_pendulums_in_a_seaway_are_left_to_shooting(restoring: str | None, noise: float) -> None:
    prepared = prepare(noisy(observe(300.0, 0.1, heave=True, restoring=restoring), noise))
    auto, shooting = (reduce_by(name, prepared, 0.0) for name in ("auto", "shooting"))
    assert auto.method == "shooting"
    assert ("restoring = sine" if restoring else "real pendulums leave the smaller residual") in auto.reason
    assert auto.gravity is not None
    assert shooting.gravity is not None
    assert auto.gravity.gravity == shooting.gravity.gravity
    assert abs(auto.gravity.gravity - G) * 1e5 < 4.0 * auto.gravity.sigma


@pytest.mark.compiled
@pytest.mark.parametrize("restoring", ["sine", None])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_heave_that_nobody_recorded_is_seen(restoring: str | None, noise: float) -> None:
    prepared = prepare(noisy(observe(900.0, 0.1, heave=True, recorded=False, restoring=restoring), noise))
    auto = reduce_by("auto", prepared, 0.0)
    assert auto.method == "shooting"
    assert ("restoring = sine" if restoring else "heave that is not recorded") in auto.reason
    assert auto.gravity is not None
    assert abs(auto.gravity.gravity - G) * 1e5 < max(4.0 * auto.gravity.sigma, 0.05)


@pytest.mark.compiled
@pytest.mark.parametrize(("size", "period"), [(0.02, 20.0), (0.1, 9.0)])
def test_heave_that_hides_the_arcs_is_told_before_the_law(size: float, period: float) -> None:
    """Without heave in them both identities leave the same residual, now the one, now the other a little less."""
    swings = zip(("1", "2"), (1.0, 1.0001), (0.0, 2.0), strict=True)
    scene = {
        "record_id": "heave",
        "seed": 3,
        "duration": 600.0,
        "gravity": 9.81,
        "reference_gravity": 9.81,
        "restoring": "sine",
        "pendulums": [
            {"label": label, "period": long, "start": {"kind": "free", "amplitude": 0.02, "phase": phase}}
            for label, long, phase in swings
        ],
        "motion": [
            {"kind": "harmonics", "amplitude": [size], "period": [period], "phase": [0.5], "axis": "vertical"},
        ],
        "recording": {"sampling_rate": 10.0, "noise": 1e-5, "write_restoring": False},
    }
    found = row(synth.simulate(Scene.model_validate(scene))[0], "auto")
    assert found["method"] == "shooting"
    assert "leave the smaller residual" in found["choice_reason"]
    assert "heave that is not recorded" in found["choice_reason"]
    assert abs(found["gravity_m_s2"] - 9.81) * 1e5 < 4.0 * found["gravity_sigma_mgal"] < 0.2


def linear(noise: float, size: float = 0.03, **changes: object) -> Observation:
    pair = Pair.apart(1e-4, damping=(2e-4, 1.6e-4), forcing=swell(8, size))
    time = np.arange(3000) * 0.1
    return noisy(pair.observe(time, step=0.1, **({"restoring": None} | changes)), noise)


@pytest.mark.parametrize("noise", [0.0, 2e-5, 1e-4])
def test_linear_pendulums_keep_the_projection(noise: float) -> None:
    """Nothing stated, and a residual of white noise: no heave is looked for in it."""
    prepared = prepare(linear(noise))
    auto, projection = (reduce_by(name, prepared, 0.0) for name in ("auto", "projection"))
    assert auto.method == "projection"
    assert auto.gravity is not None
    assert projection.gravity is not None
    assert auto.gravity.gravity == projection.gravity.gravity
    assert "log likelihood ratio" in auto.reason


@pytest.mark.parametrize("restoring", ["sine", None])
def test_real_pendulums_read_five_times_a_swing(restoring: str | None) -> None:
    seen = thinned(observe(300.0, 0.1, heave=False, restoring=restoring), slice(None, None, 2), 0.2)
    auto = reduce_by("auto", prepare(seen), 0.0)
    assert auto.method == "shooting"
    assert auto.gravity is not None
    assert abs(auto.gravity.gravity - G) * 1e5 < 4.0 * auto.gravity.sigma


def test_linear_pendulums_with_few_readings_a_swing() -> None:
    seen = linear(0.0)
    rows = slice(None, None, 2)
    assert choose(prepare(thinned(seen, rows, 0.2))).method == "projection"


@pytest.mark.parametrize("step", [0.1, 0.2])
def test_what_negligible_arcs_might_be_worth_is_in_doubt(step: float) -> None:
    time = np.arange(round(300.0 / step)) * step
    prepared = prepare(Pair.apart(1e-4, free=(1e-4 + 0j, 2e-5j)).observe(time, step=step, restoring=None))
    chosen = choose(prepared)
    assert chosen.method == "projection"
    assert "linear identity is adequate" in chosen.reason
    doubt = 2e5 * prepared.observation.reference_gravity * chosen.doubt / prepared.nominal  # mGal
    assert 0.0 < doubt < NEGLIGIBLE
    auto, alone = (reduce_by(name, prepared, 0.0).gravity for name in ("auto", "projection"))
    assert auto is not None
    assert alone is not None
    assert auto.sigma == pytest.approx(np.hypot(alone.sigma, doubt), rel=1e-3)


def test_shooting_by_name_says_that_linear_pendulums_fit_better() -> None:
    """Heave told from the phase makes them look real, hundreds of milligals off, and the residual says nothing."""
    mistaken = reduce_by("shooting", prepare(linear(2e-5)), 0.0)
    assert mistaken.gravity is not None
    assert abs(mistaken.gravity.gravity - G) * 1e5 > 20.0
    assert LINEAR_FITS in mistaken.flags
    assert LINEAR_FITS not in reduce_by("shooting", prepare(linear(2e-5, restoring="sine")), 0.0).flags
    sparse = linear(2e-5)
    every = slice(None, None, 4)
    marks = replace(sparse, step=0.4, **{k: getattr(sparse, k)[every] for k in ("time", "theta", "difference")})
    assert LINEAR_FITS in reduce_by("shooting", prepare(marks), 0.0).flags


@pytest.mark.compiled
def test_shooting_by_name_on_real_pendulums_is_not_doubted() -> None:
    real = prepare(noisy(observe(900.0, 0.1, heave=True, recorded=False, restoring=None), 2e-5))
    assert LINEAR_FITS not in reduce_by("shooting", real, 0.0).flags
