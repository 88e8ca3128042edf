"""Scenes of real pendulums: the sine law, heave, and what record and truth say of them."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import synth
from data_schemas import check
from data_schemas.errors import SceneError
from data_schemas.scene import Scene

GRAVITY = 9.8054321
SWELL = {"kind": "harmonics", "amplitude": [0.2, 0.1], "period": [9.0, 6.0], "phase": [0.3, 1.0]}
HEAVE = SWELL | {"axis": "vertical", "phase": [2.0, 0.1]}


def scene(**changes: Any) -> Scene:
    given: dict[str, Any] = {
        "record_id": "sine",
        "duration": 20.0,
        "gravity": GRAVITY,
        "restoring": "sine",
        "pendulums": [
            {"label": "1", "period": 1.0096, "damping_rate": 2e-4, "start": {"kind": "state", "angle": 0.02}},
            {"label": "2", "period": 1.0097, "damping_rate": 1e-4, "start": {"kind": "state", "angle": -0.01}},
        ],
        "motion": [SWELL, HEAVE],
        "recording": {"sampling_rate": 10},
    }
    return Scene.model_validate(given | changes)


def theta(truth: xr.DataTree) -> np.ndarray:
    return np.asarray(truth["truth"]["theta"].values)


def test_angles_obey_the_equation_of_motion() -> None:
    """Against DOP853 on theta'' + 2 gamma theta' = -n^2 [(1 + zeta) sin theta + u cos theta]."""
    _, truth = synth.simulate(scene())
    time = truth.dataset["time"].values

    def acceleration(term: dict[str, Any], t: float) -> float:
        rate = 2 * np.pi / np.array(term["period"])
        return float(np.sum(np.array(term["amplitude"]) * np.cos(rate * t + np.array(term["phase"]))))

    for row, (period, damping, angle) in enumerate(((1.0096, 2e-4, 0.02), (1.0097, 1e-4, -0.01))):
        square = (2 * np.pi / period) ** 2 * GRAVITY / 9.81

        def slope(t: float, y: np.ndarray, square: float = square, damping: float = damping) -> list[float]:
            u, zeta = acceleration(SWELL, t) / GRAVITY, acceleration(HEAVE, t) / GRAVITY
            return [y[1], -square * ((1 + zeta) * np.sin(y[0]) + u * np.cos(y[0])) - 2 * damping * y[1]]

        found = solve_ivp(slope, (0.0, time[-1]), [angle, 0.0], "DOP853", time, rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(theta(truth)[row], found.y[0], rtol=0, atol=1e-11)


def test_small_arcs_are_linear() -> None:
    """The sine departs from its angle by the cube: a millionth of 1e-3 rad."""
    small = SWELL | {"amplitude": [1e-4, 1e-4]}
    start = [
        {"label": label, "period": period, "start": {"kind": "free", "amplitude": 1e-5}}
        for label, period in (("1", 1.0096), ("2", 1.0097))
    ]
    linear, sine = (
        theta(synth.simulate(scene(restoring=law, motion=[small], pendulums=start))[1]) for law in ("linear", "sine")
    )
    np.testing.assert_allclose(sine, linear, rtol=0, atol=20 * np.abs(linear).max() ** 3)
    assert not np.array_equal(sine, linear)


def test_record_and_truth_keep_their_layouts() -> None:
    record, truth = synth.simulate(scene(recording={"sampling_rate": 10, "vertical_acceleration": True}))
    assert check(record, "record") == []
    assert check(truth, "truth") == []
    assert record["instrument"].attrs["restoring"] == "sine"
    heave = truth["truth"]["vertical_acceleration"].values
    np.testing.assert_array_equal(record["record"]["vertical_acceleration"].values, heave)
    assert np.std(heave) > 0.1
    assert "horizontal_acceleration" not in record["record"]
    assert truth.attrs["propagator"] == "Picard collocation"
    assert 0.0 < truth.attrs["estimated_error"] < 1e-12


def test_orbits_of_a_sea_are_round() -> None:
    """One seed for both axes: the vertical acceleration leads by a quarter, and both have one spectrum."""
    sea = {"kind": "sea", "significant_height": 2.0, "peak_period": 8.0, "seed": 5}
    _, truth = synth.simulate(scene(motion=[sea, sea | {"axis": "vertical"}], duration=400.0))
    across = truth["truth"]["horizontal_acceleration"].values
    up = truth["truth"]["vertical_acceleration"].values
    assert np.std(up) == pytest.approx(np.std(across), rel=0.05)
    assert abs(np.corrcoef(across, up)[0, 1]) < 0.05


def test_heave_needs_real_pendulums() -> None:
    with pytest.raises(ValueError, match="set restoring = 'sine'"):
        scene(restoring="linear")


@pytest.mark.compiled
def test_chaos_is_refused() -> None:
    shaken = SWELL | {"amplitude": [30.0, 20.0], "period": [1.3, 0.9]}
    with pytest.raises(SceneError, match="chaotic"):
        synth.simulate(scene(motion=[shaken, shaken | {"axis": "vertical"}], duration=200.0))


def test_linear_scenes_do_not_pay_for_the_sine_law() -> None:
    """A process of its own: no numba, no scipy for a linear scene."""
    words = (
        "import sys; sys.modules['dask'] = None;"  # xarray imports it, and with it scipy, wherever it is installed
        "import synth; from data_schemas.scene import load_scene;"
        "synth.simulate(load_scene(synth.scene_path('linear')));"
        "print([name for name in ('numba', 'scipy') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
