"""A single pendulum: finite arc, cycles, and the infinitesimal period with its own uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import simulate
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from data_schemas.errors import RefusedError
from pipeline import process, summaries
from pipeline.period.cycles import arc_factor, find_cycles
from pipeline.period.fit import fit_period

T0 = 1.029
REST = -0.0044


def test_arc_factor_against_the_elliptic_integral() -> None:
    amplitude = np.linspace(0.0, 3.1415, 400)
    assert arc_factor(amplitude) == pytest.approx(2 / np.pi * ellipk(np.sin(amplitude / 2) ** 2), rel=1e-9)


@pytest.mark.parametrize(("amplitude", "ratio"), [(3.1, 3.34849644557), (3.14159, 9.49775504494)])
def test_arc_factor_at_published_points(amplitude: float, ratio: float) -> None:
    assert float(arc_factor(amplitude)) == pytest.approx(ratio, rel=2e-11)


def test_arc_factor_at_small_arcs_is_the_series() -> None:
    a = np.array([0.0, 1e-3, 0.05])
    assert arc_factor(a) == pytest.approx(1 + a**2 / 16 + 11 * a**4 / 3072, abs=1e-9)


def decaying(amplitude: float = 1.5, duration: float = 240.0, gamma: float = 0.008) -> tuple[np.ndarray, np.ndarray]:
    """A free pendulum with viscous damping at clock steps of 10 and 11 ms, from scipy."""
    random = np.random.default_rng(2)
    time = np.cumsum(np.where(random.random(int(duration / 0.0102)) < 0.2, 0.011, 0.010))
    n = 2 * np.pi / T0
    found = solve_ivp(
        lambda t, y: [y[1], -2 * gamma * y[1] - n * n * np.sin(y[0])],
        (0.0, time[-1]),
        [amplitude, 0.0],
        "DOP853",
        time,
        rtol=1e-10,
        atol=1e-12,
    )
    return time, found.y[0]


@pytest.fixture(scope="module")
def swing() -> tuple[np.ndarray, np.ndarray]:
    return decaying()


def quantised(theta: np.ndarray, step: float = 5.24e-3) -> np.ndarray:
    return np.round((theta + REST) / step) * step


def test_infinitesimal_period_of_an_ideal_record(swing: tuple[np.ndarray, np.ndarray]) -> None:
    fit = fit_period(find_cycles(*swing))
    # damping of 0.008 /s lengthens the period by gamma^2/(2 n^2) = 9e-7, and the amplitude moves within a cycle
    assert fit["period"] == pytest.approx(T0, rel=1e-5)
    assert fit["rest_position"] == pytest.approx(0.0, abs=1e-4)
    assert np.abs(fit["cycle_period_infinitesimal"][1:] / T0 - 1.0).max() < 3e-4
    # the release is half a turning point: the first crossing borrows the amplitude of the next
    assert abs(fit["cycle_period_infinitesimal"][0] / T0 - 1.0) < 6e-4


def test_encoder_record_within_its_own_three_sigma(swing: tuple[np.ndarray, np.ndarray]) -> None:
    """Steps of 5.24 mrad, a clock of 10 or 11 ms, rest at -4.4 mrad: what the real pendulum's recorder does."""
    time, theta = swing
    fit = fit_period(find_cycles(time, quantised(theta)))
    assert abs(fit["period"] - T0) < 3.0 * fit["period_sigma"]
    assert fit["period_sigma"] < 2e-4
    assert fit["rest_position"] == pytest.approx(REST, abs=2.5e-3)
    assert fit["trend"] < 3e-3


@pytest.mark.parametrize("seed", range(4))
def test_noise_within_three_sigma(swing: tuple[np.ndarray, np.ndarray], seed: int) -> None:
    time, theta = swing
    noise = np.random.default_rng(seed).normal(0.0, 2e-3, theta.size)
    fit = fit_period(find_cycles(time, theta + noise + 0.02))
    assert abs(fit["period"] - T0) < 3.5 * fit["period_sigma"]
    assert fit["rest_position"] == pytest.approx(0.02, abs=1e-3)


def test_gaps_make_no_double_periods(swing: tuple[np.ndarray, np.ndarray]) -> None:
    time, theta = swing
    theta = theta.copy()
    for start, stop in ((30.0, 33.3), (80.0, 80.7), (150.0, 171.0)):
        theta[(time > start) & (time < stop)] = np.nan
    fit = fit_period(find_cycles(time, theta))
    assert fit["period"] == pytest.approx(T0, rel=5e-5)
    reduced = fit["cycle_period_infinitesimal"][np.isfinite(fit["cycle_period_infinitesimal"])]
    assert np.abs(reduced / T0 - 1.0).max() < 0.02


def test_a_wrong_scale_of_the_angle_is_found(swing: tuple[np.ndarray, np.ndarray]) -> None:
    time, theta = swing
    fit = fit_period(find_cycles(time, theta / 1.03))
    assert fit["scaled"]
    assert fit["amplitude_scale"] == pytest.approx(0.03, abs=2e-3)
    assert fit["period"] == pytest.approx(T0, rel=3e-5)


def test_linear_pendulums_need_no_arc() -> None:
    time = np.arange(4000) * 0.01
    fit = fit_period(find_cycles(time, 0.5 * np.cos(2 * np.pi * time / 1.1)), linear=True)
    assert fit["period"] == pytest.approx(1.1, rel=1e-6)
    assert not fit["scaled"]


@pytest.mark.parametrize(
    ("theta", "step", "named"),
    [
        (np.cos(np.arange(20) * 0.3), 0.05, "too few"),
        (np.cos(2 * np.pi * np.arange(300) * 0.01), 0.01, "swings"),
        (np.cos(2 * np.pi * np.arange(600) * 0.3), 0.3, "samples a swing"),
        (np.cos(2 * np.pi * np.arange(900) * 0.1), 0.1, "samples a swing"),
        (np.full(500, np.nan), 0.01, "too few"),
        (np.full(500, 0.3), 0.01, "swings"),
    ],
    ids=["twenty readings", "three swings", "three a swing", "ten a swing", "nothing", "at rest"],
)
def test_what_gives_no_period_is_refused(theta: np.ndarray, step: float, named: str) -> None:
    with pytest.raises(RefusedError, match=named):
        fit_period(find_cycles(np.arange(theta.size) * step, theta))


def single(**recording: object) -> xr.DataTree:
    return simulate(
        duration=60.0, motion=[], sampling_rate=50, traces=[{"name": "1", "combination": {"1": 1.0}}], **recording
    )[0]


def test_a_record_with_one_trace_gives_its_period_and_no_gravity() -> None:
    found = summaries(process(single()))[0]
    exact = 1.0097648 / 1.0001 * np.sqrt(9.81 / 9.8054321)
    assert found["gravity_m_s2"] is None
    assert found["period_s"] == pytest.approx(exact, rel=1e-7)
    assert "single-trace" in found["flags"]


def test_the_chronometer_of_a_single_trace() -> None:
    slow = summaries(process(single(chronometer_rate=8.64)))[0]["period_s"]
    assert slow == pytest.approx(summaries(process(single()))[0]["period_s"], rel=1e-7)


def test_trend_and_scale_are_flagged(swing: tuple[np.ndarray, np.ndarray]) -> None:
    time, theta = swing
    base = single()
    instrument = base["instrument"].to_dataset(inherit=False)
    for values, flag in ((theta, None), (theta / 1.03, "amplitude-scale"), (theta, "period-trend")):
        drift = 1.5e-5 * time if flag == "period-trend" else 0.0
        tree = xr.DataTree.from_dict(
            {
                "/": xr.Dataset(
                    coords={"time": ("time", time * (1.0 + drift), base.dataset["time"].attrs)}, attrs=base.attrs
                ),
                "/record": base["record"]
                .to_dataset(inherit=False)
                .drop_vars("elongation")
                .assign(elongation=(("trace", "time"), values[None], base["record"]["elongation"].attrs)),
                "/instrument": instrument,
            }
        )
        tree["instrument"].attrs.pop("restoring", None)
        flags = summaries(process(tree))[0]["flags"]
        assert (flags == ["single-trace"]) if flag is None else (flag in flags)


FRICTIONS = {
    "viscous": (0.01, 0.0, 0.0),
    "quadratic": (0.0, 0.02, 0.0),
    "knife-edge": (0.0, 0.0, 6e-4),
    "viscous, knife-edge": (0.005, 0.0, 4e-4),
}


def braked(gamma: float, quadratic: float, dry: float, duration: float = 120.0) -> tuple[np.ndarray, np.ndarray]:
    """A pendulum under three laws of friction, from scipy; dry friction turned over within 10 mrad/s."""
    n, time = 2 * np.pi / T0, np.arange(0.0, duration, 0.01)

    def slope(_: float, y: np.ndarray) -> list[float]:
        brake = 2 * gamma * y[1] + quadratic * abs(y[1]) * y[1] + dry * n * n * np.tanh(y[1] / 0.01)
        return [y[1], -brake - n * n * np.sin(y[0])]

    found = solve_ivp(slope, (0.0, duration), [0.6, 0.0], "RK45", time, rtol=1e-8, atol=1e-10, max_step=0.02)
    return time, found.y[0]


@pytest.mark.parametrize("laws", FRICTIONS)
def test_law_of_friction_is_told_by_the_turning_points(laws: str) -> None:
    time, theta = braked(*FRICTIONS[laws])
    random = np.random.default_rng(1)
    fit = fit_period(find_cycles(time, theta + random.normal(0.0, 1e-3, theta.size)))
    assert fit["friction"] == laws
    found = fit["damping_rate"], fit["quadratic_damping"], fit["knife_edge"]
    assert np.allclose(found, FRICTIONS[laws], rtol=0.1, atol=0.0)
    assert abs(fit["period"] - T0) < 3.5 * fit["period_sigma"]


def test_dry_friction_and_a_drifting_rest_do_not_bias_thirds() -> None:
    """Each half swing of a knife edge lies about a middle of its own: the rest is passed late, the more the less."""
    time, theta = braked(0.0, 0.01, 4e-4, 150.0)
    shown = theta + 0.003 + 0.004 * time / time[-1] + np.random.default_rng(3).normal(0.0, 5e-4, theta.size)
    parts = [fit_period(find_cycles(time[part], shown[part])) for part in np.array_split(np.arange(time.size), 3)]
    period, sigma = (np.array([each[name] for each in parts]) for name in ("period", "period_sigma"))
    assert np.sum(((period - T0) / sigma) ** 2) < 11.3  # of three degrees of freedom, 99 %
    assert sigma.max() < 2e-4
    whole = fit_period(find_cycles(time, shown))
    assert abs(whole["rest_drift"] - 0.004) < 3.5 * whole["rest_drift_sigma"]


def test_length_gives_gravity_of_a_single_pendulum() -> None:
    base = single()
    exact = summaries(process(base))[0]
    stored = base["instrument"].to_dataset(inherit=False)
    length = 9.8 * (exact["period_s"] / (2 * np.pi)) ** 2
    for name, value in (("length", length), ("length_uncertainty", 1e-6)):
        stored[name] = ("pendulum", np.full(stored.sizes["pendulum"], value), {"units": "m"})
    stored = stored.isel(pendulum=[0])
    tree = base.copy(deep=True)
    tree["record"] = tree["record"].to_dataset(inherit=False).isel(pendulum=[0])
    tree["instrument"] = stored
    found = summaries(process(tree))[0]
    assert found["gravity_m_s2"] == pytest.approx(9.8, rel=1e-9)
    own = 2.0 * 9.8e5 * exact["period_sigma_s"] / exact["period_s"]
    assert found["gravity_sigma_mgal"] == pytest.approx(np.hypot(9.8e5 * 1e-6 / length, own), rel=1e-6)
