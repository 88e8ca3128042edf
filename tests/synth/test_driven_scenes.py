"""Scenes of driven, resisted and coupled pendulums, against other equations and another integrator."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from synth_mechanics import solved

import synth
from data_schemas import check
from data_schemas.errors import RefusedError, SceneError
from data_schemas.scene import Scene
from synth.integrators import explicit
from synth.plan import plan
from synth.recording.clock import set_clock

GRAVITY = 9.8054321
SWELL = {"kind": "harmonics", "amplitude": [0.2, 0.1], "period": [9.0, 6.0], "phase": [0.3, 1.0]}
HEAVE = SWELL | {"axis": "vertical", "phase": [2.0, 0.1]}
STARTS = [(1.01, 0.12, 0.3), (0.99, -0.05, 0.1)]
VAN_DER_POL = {"kind": "van-der-pol", "rate": 0.8, "angle": 0.05}
BEAM = {"kind": "beam", "mass": 2.0, "stiffness": 800.0, "damping_rate": 0.3, "displacement": 0.002, "velocity": 0.01}


def scene(pendulum: dict[str, Any], **changes: Any) -> Scene:
    given: dict[str, Any] = {
        "record_id": "driven",
        "duration": 2.0,
        "gravity": GRAVITY,
        "restoring": "sine",
        "pendulums": [
            {
                "label": str(number + 1),
                "period": period,
                "start": {"kind": "state", "angle": angle, "angular_velocity": rate},
            }
            | pendulum
            for number, (period, angle, rate) in enumerate(STARTS)
        ],
        "recording": {"sampling_rate": 8},
    }
    return Scene.model_validate(given | changes)


def start(of: Scene) -> np.ndarray:
    state = [part for _, angle, rate in STARTS for part in (angle, rate)]
    return np.array([of.support.displacement, of.support.velocity, *state] if hasattr(of.support, "mass") else state)


def times(truth: xr.DataTree) -> np.ndarray:
    return np.asarray(truth.dataset["time"].values)


def theta(truth: xr.DataTree) -> np.ndarray:
    return np.asarray(truth["truth"]["theta"].values)


RESISTED = {"damping_rate": 0.01, "quadratic_damping": 0.3, "knife_edge": {"friction": 0.05, "rate": 0.2}}
SCENES = {
    "air and knife edges in a swell": scene(RESISTED, motion=[SWELL, HEAVE]),
    "clocks on a beam": scene({"mass": 0.3, "escapement": VAN_DER_POL}, support=BEAM),
    "a frame on a ship": scene(
        {"mass": 0.3, "damping_rate": 0.02},
        motion=[SWELL, HEAVE],
        support={"kind": "frame", "mass": 2.0, "stiffness": 900.0, "resistance": 3.0, "displacement": 0.003},
    ),
    "metronomes": scene({"escapement": VAN_DER_POL}, support={"kind": "board", "coupling": 0.1}),
}


@pytest.mark.parametrize("name", SCENES)
def test_angles_obey_newton(name: str) -> None:
    """Against DOP853, good to 1e-11 here, on Newton's law for every bob."""
    given = SCENES[name]
    _, truth = synth.simulate(given)
    states = solved(given, start(given), times(truth))
    first = states.shape[1] - 2 * len(STARTS)
    np.testing.assert_allclose(theta(truth), states[:, first::2].T, rtol=0, atol=2e-11)
    assert truth.attrs["propagator"] == ("beam collocation" if given.support.kind != "fixed" else "explicit, order 8")
    assert 0.0 < truth.attrs["estimated_error"] < 1e-10
    if first:
        moved = truth["truth"]["support_displacement"].values
        np.testing.assert_allclose(moved, states[:, 0], rtol=0, atol=2e-11 * np.abs(states[:, 0]).max())
        assert np.ptp(moved) > 1e-4


@pytest.mark.parametrize("name", SCENES)
def test_record_and_truth_keep_their_layouts(name: str) -> None:
    record, truth = synth.simulate(SCENES[name])
    assert check(record, "record") == []
    assert check(truth, "truth") == []
    yields = SCENES[name].support.kind != "fixed"
    assert ("support_displacement" in truth["truth"]) == yields
    assert "free_amplitude" not in truth["truth"]
    assert ("forced" in truth["truth"]) == (not yields)  # what a fixed support forces upon linear pendulums
    assert "tolerance" not in truth.attrs


def test_a_board_rolls_so_that_the_whole_stays_in_place() -> None:
    """b l sum of sines, the other way: the centre of mass of bobs of mass b (in the whole's) and board is at rest."""
    _, truth = synth.simulate(SCENES["metronomes"])
    length = np.mean(9.81 * (np.array([1.01, 0.99]) / (2 * np.pi)) ** 2)
    expected = -0.1 * length * np.sin(theta(truth)).sum(axis=0)
    np.testing.assert_allclose(truth["truth"]["support_displacement"].values, expected, rtol=1e-12)


def test_it_is_the_integrator_and_nothing_else() -> None:
    """The same bits as the integrator called by hand, which restarts nowhere and reads where it is told."""
    named = {"simulation": {"propagator": "explicit"}}
    given = Scene.model_validate(SCENES["clocks on a beam"].model_dump() | named)
    made = plan(given, set_clock(given)).assembly()
    _, truth = synth.simulate(given)
    by_hand = explicit.integrate(made.system, made.start, times(truth), tolerance=1e-13)
    np.testing.assert_array_equal(theta(truth), by_hand.states[:, 2::2].T)
    assert truth.attrs["estimated_error"] == by_hand.estimated_error


def test_readings_off_their_times_and_chronometers_that_lose() -> None:
    """True time is the chronometer's, stretched; the first reading comes after the start."""
    of = SCENES["clocks on a beam"].model_dump()
    kept = {"sampling_rate": 8, "jitter": 0.02, "drop_fraction": 0.3, "chronometer_rate": 800.0}
    given = Scene.model_validate(of | {"recording": kept})
    _, truth = synth.simulate(given)
    assert times(truth)[0] > 0.0
    states = solved(given, start(given), times(truth) * (1 + 800 / 86400))
    np.testing.assert_allclose(theta(truth), states[:, 2::2].T, rtol=0, atol=2e-11)


def test_dropped_readings_change_no_other() -> None:
    of = SCENES["clocks on a beam"].model_dump()
    whole, part = (
        synth.simulate(Scene.model_validate(of | {"recording": {"sampling_rate": 8, "drop_fraction": dropped}}))[1]
        for dropped in (0.0, 0.4)
    )
    kept = np.searchsorted(times(whole), times(part))
    assert 0 < kept.size < times(whole).size
    np.testing.assert_array_equal(theta(part), theta(whole)[:, kept])


def test_clocks_at_small_arcs_follow_the_reduced_beam() -> None:
    """System (2) is the limit of (1): halving the arcs leaves a quarter of their relative difference."""

    def difference(arc: float) -> float:
        clock = {"mass": 0.3, "escapement": {"kind": "van-der-pol", "rate": 0.05, "angle": arc}}
        starts = [{"kind": "state", "angle": share * arc} for share in (1.5, -0.8)]
        pendulums = [{"label": str(n), "period": 1.0, "start": starts[n]} | clock for n in (0, 1)]
        full, reduced = (
            theta(synth.simulate(scene({}, pendulums=pendulums, support=BEAM | words, restoring=law))[1])
            for words, law in (({"displacement": 0.0, "velocity": 0.0}, "sine"), (SMALL, "linear"))
        )
        return float(np.abs(full - reduced).max() / np.abs(full).max())

    SMALL = {"displacement": 0.0, "velocity": 0.0, "equations": "reduced"}
    large, small = difference(0.04), difference(0.02)
    assert small < 1e-3
    assert small == pytest.approx(large / 4, rel=0.1)


def test_reduced_beam_refuses_unlike_clocks() -> None:
    pendulums = [
        {
            "label": str(n),
            "period": 1.0,
            "mass": mass,
            "escapement": VAN_DER_POL,
            "start": {"kind": "free", "amplitude": 0.1},
        }
        for n, mass in enumerate((0.3, 0.4))
    ]
    with pytest.raises(SceneError, match="masses must be the same for all clocks; choose equations = 'full'"):
        synth.simulate(scene({}, pendulums=pendulums, support=BEAM | {"equations": "reduced"}, restoring="linear"))


@pytest.mark.campaign
def test_kicks_at_the_bottom() -> None:
    """A swing between kicks is a free one; each kick adds its energy: DOP853 from kick to kick."""
    kick = {"kind": "impulse", "angle": 0.01, "direction": "rising", "energy": 0.05}
    given = scene({"damping_rate": 0.02, "quadratic_damping": 0.01, "escapement": kick}, motion=[SWELL])
    _, truth = synth.simulate(given)
    for row, (period, angle, rate) in enumerate(STARTS):
        square = (2 * np.pi / period) ** 2 * GRAVITY / 9.81
        drive = np.array(SWELL["amplitude"]), 2 * np.pi / np.array(SWELL["period"]), np.array(SWELL["phase"])

        def slope(t: float, y: np.ndarray, square: float = square, drive: Any = drive) -> list[float]:
            u = float(np.sum(drive[0] * np.cos(drive[1] * t + drive[2]))) / GRAVITY
            pull = square * (np.sin(y[0]) + u * np.cos(y[0]))
            return [y[1], -pull - 0.04 * y[1] - 0.01 * abs(y[1]) * y[1]]

        def crossing(t: float, y: np.ndarray) -> float:
            return float(y[0]) - 0.01

        crossing.terminal, crossing.direction = True, 1.0  # type: ignore[attr-defined]  # as SciPy wants them
        here, state, kicks = 0.0, np.array([angle, rate]), 0
        while here < 2.0:
            readings = times(truth)
            wanted = readings[(readings >= here) & (readings <= 2.0)]
            found = solve_ivp(slope, (here, 2.0), state, "DOP853", wanted, events=crossing, rtol=1e-12, atol=1e-14)
            done = np.isin(readings, found.t)
            np.testing.assert_allclose(theta(truth)[row, done], found.y[0], rtol=0, atol=1e-10)
            if not found.t_events[0].size:
                break
            here, kicks = float(found.t_events[0][0]), kicks + 1
            state = found.y_events[0][0].copy()
            state[1] = np.sqrt(state[1] ** 2 + 2 * 0.05)
            state[0] = 0.01 + 1e-14  # on its far side, so that the same crossing is not found again
        assert kicks >= 1


def test_creeping_pendulum() -> None:
    """Overdamped and linear: two exponentials in closed form."""
    pendulum = {
        "label": "1",
        "period": 1.0,
        "damping_rate": 900.0,
        "start": {"kind": "state", "angle": 0.1, "angular_velocity": 20.0},
    }
    given = scene({}, pendulums=[pendulum], restoring="linear", duration=1.0)
    _, truth = synth.simulate(given)
    assert truth.attrs["propagator"].startswith("Radau IIA")
    n = 2 * np.pi * np.sqrt(GRAVITY / 9.81)
    split = np.sqrt(900.0**2 - n**2)
    slow, fast = -(n**2) / (900.0 + split), -900.0 - split
    quick = (20.0 - slow * 0.1) / (fast - slow)
    t = times(truth)
    expected = (0.1 - quick) * np.exp(slow * t) + quick * np.exp(fast * t)
    np.testing.assert_allclose(theta(truth)[0], expected, rtol=0, atol=1e-11)
    assert "forced" not in truth["truth"]


def test_free_starts_lie_on_the_forced_solution() -> None:
    """Angle and rate of the linear pendulum's free and forced motion together, whatever resists the swing."""
    parts = {"motion": [SWELL], "recording": {"sampling_rate": 1000}, "duration": 0.005}
    free = [{"label": "1", "period": 1.01, "start": {"kind": "free", "amplitude": 0.02, "phase": 0.7}}]
    linear = theta(synth.simulate(scene({}, pendulums=free, restoring="linear", **parts))[1])[0]
    resisted = [free[0] | {"quadratic_damping": 0.01}]
    driven = theta(synth.simulate(scene({}, pendulums=resisted, **parts))[1])[0]
    assert driven[0] == pytest.approx(linear[0], abs=1e-15)
    # the sine and the air change the second difference of the first readings, not the first
    assert driven[1] - driven[0] == pytest.approx(linear[1] - linear[0], abs=1e-9)


def test_a_tolerance_is_met_and_told() -> None:
    of = SCENES["clocks on a beam"].model_dump()
    exact = theta(synth.simulate(SCENES["clocks on a beam"])[1])
    for propagator in ("explicit", "radau", "beam-collocation"):
        asked = {"tolerance": 1e-7, "propagator": propagator}
        _, truth = synth.simulate(Scene.model_validate(of | {"simulation": asked}))
        error = np.max(np.abs(theta(truth) - exact)) / np.max(np.abs(exact))
        assert truth.attrs["tolerance"] == 1e-7
        assert truth.attrs["estimated_error"] <= 1e-7
        assert error <= 1e-7


def test_who_refuses_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Collocation that gives up half-way, and explicit steps that find the motion stiff."""
    from synth.propagators.picard import PicardPlan

    of = scene({}, duration=1.0)
    right = theta(synth.simulate(of)[1])

    def gives_up(self: PicardPlan) -> Any:
        raise RefusedError("too violent")

    monkeypatch.setattr(PicardPlan, "elongation", gives_up)
    _, truth = synth.simulate(of)
    assert truth.attrs["propagator"] == "explicit, order 8"
    np.testing.assert_allclose(theta(truth), right, rtol=0, atol=1e-12)
    insisted = of.model_dump() | {"simulation": {"propagator": "picard"}}
    with pytest.raises(RefusedError, match="too violent"):
        synth.simulate(Scene.model_validate(insisted))


@pytest.mark.compiled
def test_tolerance_allows_what_is_nearly_chaotic() -> None:
    """Released 93 microradians from the top: every passage magnifies rounding by some ten thousand."""
    pendulum = {"label": "1", "period": 1.0, "start": {"kind": "state", "angle": 3.1415}}
    of = {"pendulums": [pendulum], "duration": 30.0}
    with pytest.raises(SceneError, match=r"chaotic or nearly so.*give simulation\.tolerance if that will do"):
        synth.simulate(scene({}, **of))
    _, truth = synth.simulate(scene({}, simulation={"tolerance": 1e-2}, **of))
    assert 1e-6 < truth.attrs["estimated_error"] < 1e-2


LOADED = """
import sys
sys.modules["dask"] = None  # xarray imports it, and with it scipy, wherever it is installed
from data_schemas.scene import Scene, load_scene
import synth
given = sys.argv[1]
scene = Scene.model_validate_json(given) if given.startswith("{") else load_scene(synth.scene_path(given))
EXTRA
print(" ".join(name for name in sys.modules if name.split(".")[0] in ("synth", "numba", "scipy")))
"""


def loaded(given: str, work: str) -> set[str]:
    words = [sys.executable, "-c", LOADED.replace("EXTRA", work), given]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_a_scene_in_closed_form_imports_no_engine() -> None:
    names = loaded("linear", "synth.simulate(scene)")
    assert names.isdisjoint({"numba", "scipy", "synth.assembly", "synth.propagators.picard"})
    assert not any(name.startswith(("synth.systems", "synth.integrators")) for name in names)


@pytest.mark.compiled
def test_a_real_pendulum_imports_no_general_integrator() -> None:
    of = scene({}, duration=0.5)
    names = loaded(of.model_dump_json(), "synth.simulate(scene)")
    assert "synth.propagators.picard" in names
    assert not any(name.startswith(("synth.systems", "synth.integrators", "synth.assembly")) for name in names)


@pytest.mark.compiled
def test_what_a_driven_scene_leaves_out_is_not_imported() -> None:
    """Air and knife edges on a fixed support: no kicks, no other integrator.

    Modules of other systems may be there: the compiler's cache lists every type that the march was compiled for.
    """
    names = loaded(SCENES["air and knife edges in a swell"].model_dump_json(), "synth.simulate(scene)")
    assert "synth.integrators.explicit" in names
    absent = {
        "synth.integrators.radau", "synth.integrators.collocation", "synth.propagators.picard", "synth.explanation",
    }  # fmt: skip
    assert names.isdisjoint(absent)


def test_explaining_compiles_and_imports_no_integrator() -> None:
    names = loaded("clocks-on-beam", "from synth.explanation import explain; explain(scene)")
    assert not any(name.startswith("synth.integrators") for name in names)
