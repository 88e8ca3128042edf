"""Every method on small simulated records: right ones at their zeros, wrong ones wrong as the formulas say."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import GRAVITY, PERIOD, RESONANT, SWELL, changed, error, row, simulate
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.interpolate import CubicSpline

from pipeline import METHODS, process, summaries

EXACT = {"projection": 1e-5, "complex": 4e-3, "panteleev": 4e-3}  # mGal at 240 s: the windows pass -95 dB of swell
SCALE = 2.0 / 1e-5  # mGal per relative error of the frequency and m s-2


def truth_phases(truth: xr.DataTree) -> dict[str, np.ndarray]:
    """Free harmonics as analytic signals, slow motions as splines."""
    data = truth["truth"].dataset
    time = truth.dataset["time"].values
    z = data["free_amplitude"].values * np.exp(1j * data["free_phase"].values)
    return {"time": time, "z1": z[0], "z2": z[1], "psi": data["forced"].values, "n": data["frequency"].values}


def weighted_slope(time: np.ndarray, values: np.ndarray, amplitude: np.ndarray) -> float:
    """Slope by numpy's polynomial fit with the weights a."""
    return float(np.polyfit(time - time.mean(), values, 1, w=amplitude)[0])


@pytest.mark.parametrize("method", EXACT)
@pytest.mark.parametrize("eps", [1e-5, 1e-4])
def test_right_methods_at_their_zeros(method: str, eps: float) -> None:
    record, _ = simulate(eps=eps, motion=[SWELL, RESONANT | {"amplitude": 4e-4 if eps < 5e-5 else 4e-5}])
    assert abs(error(record, method)) < EXACT[method]
    assert abs(error(record, "uncorrected")) > 1.0


@pytest.mark.parametrize("damping", [(2e-4, 2e-4), (4e-4, 1e-4)])
@pytest.mark.parametrize("method", ["projection", "complex", "panteleev"])
def test_stated_damping_is_used(method: str, damping: tuple[float, float]) -> None:
    record, _ = simulate(eps=1e-4, damping=damping)
    # exact but for terms of gamma^2/n^2 in the phase speed
    assert abs(error(record, method)) < (1e-5 if method == "projection" else 5e-3)


def test_a_common_damping_that_is_not_stated_is_found() -> None:
    record, _ = simulate(eps=1e-4, damping=(3e-4, 3e-4), write_damping=False)
    found = row(record, "projection")
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < 1e-5
    assert found["flags"] == ["short-record", "damping-difference-assumed"]


def test_uncorrected_errs_by_the_integral_of_27() -> None:
    record, truth = simulate(eps=1e-4)
    known = truth_phases(truth)
    z = known["z1"] - known["z2"]
    n1, n2 = known["n"]
    speed = n2 + (n1 - n2) * np.abs(known["z1"] / z) * np.cos(np.angle(known["z1"] / z))
    inside = (known["time"] >= 8.0) & (known["time"] <= 232.0)
    time = known["time"][inside]
    phase = cumulative_simpson(speed[inside], x=time, initial=0.0)
    predicted = SCALE * GRAVITY * (weighted_slope(time, phase, np.abs(z[inside])) / n2 - 1.0)
    assert error(record, "uncorrected") == pytest.approx(predicted, rel=1e-4)
    assert abs(predicted) > 10.0


@pytest.mark.parametrize("eps", [1e-4, -2e-4])
def test_vening_meinesz_errs_by_the_leak_of_14_at_its_minute_marks(eps: float) -> None:
    record, truth = simulate(eps=eps, duration=400.0)
    known = truth_phases(truth)
    result = process(record, method="vening-meinesz")
    time = result.dataset["time"].values
    marks = time[:: round(60.0 / (time[1] - time[0]))]
    n1, n2 = known["n"]

    def at(values: np.ndarray, instants: np.ndarray) -> np.ndarray:
        return CubicSpline(known["time"], values)(instants)

    turn = np.exp(-1j * n2 * known["time"])
    difference = (known["z1"] - known["z2"]) * turn
    first = known["z1"] * turn
    z = (at(difference.real, marks) + 1j * at(difference.imag, marks)) * np.exp(1j * n2 * marks)
    free = (at(first.real, marks) + 1j * at(first.imag, marks)) * np.exp(1j * n2 * marks)
    a, phi = np.abs(z), np.angle(z)
    slow = CubicSpline(known["time"], known["psi"][0])
    inner = np.abs(free) * np.cos(np.angle(free) - phi) + slow(marks) * np.cos(phi) - slow(marks, 1) / n1 * np.sin(phi)
    correction = np.interp(time, marks, (n1 - n2) * inner / a)  # (14)
    envelope = at(difference.real, time) + 1j * at(difference.imag, time)
    phase = np.unwrap(np.angle(envelope)) - cumulative_simpson(correction, x=time, initial=0.0)
    predicted = SCALE * GRAVITY * weighted_slope(time, phase, np.abs(envelope)) / n2
    assert abs(predicted) > 10.0
    assert error(record, "vening-meinesz") == pytest.approx(predicted, rel=0.01)


def test_general_without_arcs_is_panteleev() -> None:
    record, _ = simulate(eps=1e-4, motion=[SWELL, RESONANT | {"amplitude": 4e-5}])
    one, two = row(record, "general"), row(record, "panteleev")
    assert one["gravity_m_s2"] == pytest.approx(two["gravity_m_s2"], abs=1e-10)
    assert one["corrections_mgal"]["finite_arc"] == 0.0


def test_arc_term_of_general_is_the_sheets_integral() -> None:
    """`d phi' = -(n/2) Re{[|S|^2 Z/4 + S^2 conj(Z)/8 + |Z|^2 Z/32]/Z}`, S the mean motion: derived by another way."""
    record, truth = simulate(eps=1e-4, write_restoring=False)
    known = truth_phases(truth)
    z = known["z1"] - known["z2"]
    mean = known["z1"] - z / 2
    bracket = np.abs(mean) ** 2 * z / 4 + mean**2 * np.conj(z) / 8 + np.abs(z) ** 2 * z / 32
    n2 = known["n"][1]
    inside = (known["time"] >= 8.0) & (known["time"] <= 232.0)
    time = known["time"][inside]
    change = cumulative_simpson((-0.5 * n2 * (bracket / z).real)[inside], x=time, initial=0.0)
    predicted = -SCALE * GRAVITY * weighted_slope(time, change, np.abs(z[inside])) / n2
    assert predicted > 1.0
    assert row(record, "general")["corrections_mgal"]["finite_arc"] == pytest.approx(predicted, rel=2e-4)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_general_sees_that_linear_pendulums_do_not_feel_the_acceleration(noise: float) -> None:
    """The arcs' term stays, as agreed; the acceleration's, of hundreds of milligals, the residual denies."""
    record, _ = simulate(eps=1e-4, write_restoring=False)
    record["instrument"].attrs.pop("restoring", None)
    if noise:
        shown = record["record/elongation"].values
        record = changed(
            record, "record", "elongation", shown + np.random.default_rng(2).normal(0.0, noise, shown.shape)
        )
    arc = row(record, "general")["corrections_mgal"]["finite_arc"]
    assert error(record, "general") == pytest.approx(arc, abs=0.02 + 3e3 * noise)
    record["instrument"].attrs["restoring"] = "sine"
    assert abs(error(record, "general")) > 100.0


def nonlinear_record(amplitudes: tuple[float, float], eps: float = 1e-4, restoring: str | None = None) -> xr.DataTree:
    """Two real (sine) pendulums on a still support, integrated by DOP853."""
    record, _ = simulate(eps=eps, motion=[], gravity=9.81)
    time = record.dataset["time"].values
    n = 2 * np.pi / (PERIOD / np.array([1.0 + eps, 1.0]))
    theta = [
        solve_ivp(
            lambda t, y, k=k: [y[1], -(n[k] ** 2) * np.sin(y[0])],
            (0.0, time[-1] + 1.0),
            [amplitudes[k] * np.cos(phase), -amplitudes[k] * n[k] * np.sin(phase)],
            "DOP853",
            time,
            rtol=1e-12,
            atol=1e-14,
        ).y[0]
        for k, phase in enumerate((0.4, 2.2))
    ]
    tree = changed(record, "record", "elongation", np.stack([theta[0], theta[0] - theta[1]]))
    del tree["instrument"].attrs["restoring"]
    if restoring:
        tree["instrument"].attrs["restoring"] = restoring
    return tree


@pytest.mark.parametrize("amplitudes", [(0.012, 0.006), (0.02, 0.02), (0.03, 0.02)])
def test_general_reduces_the_arcs_of_real_pendulums(amplitudes: tuple[float, float]) -> None:
    record = nonlinear_record(amplitudes)
    wrong, right = error(record, "panteleev", 9.81), error(record, "general", 9.81)
    largest = SCALE * 9.81 * max(amplitudes) ** 2 / 16
    assert abs(wrong) > 0.1 * largest
    # left: the fourth power of the arc (11/3072) and the third harmonic in the windows
    assert abs(right) < 1e-3 * largest


@pytest.mark.compiled
def test_auto_is_joint() -> None:
    """On real pendulums whose arcs are worth some mGal; noise-free, so the bound is the numerical one."""
    found = row(nonlinear_record((0.02, 0.02), restoring="sine"), "auto")
    assert (found["requested_method"], found["method"]) == ("auto", "joint")
    off = abs(found["gravity_m_s2"] - 9.81) * 1e5
    assert off < 4.0 * found["gravity_sigma_mgal"] + 1e-3
    assert found["gravity_sigma_mgal"] < 0.01


@pytest.mark.compiled
def test_auto_on_linear_pendulums_whose_law_is_not_stated() -> None:
    record, _ = simulate(eps=1e-4, free=((0.02, 0.4), (0.02, 2.2)), write_restoring=False)
    found = row(record, "auto")
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < 4.0 * found["gravity_sigma_mgal"] + 1e-3
    assert found["gravity_sigma_mgal"] < 0.01


ZERO = ((0.01, 0.0), (0.01, 0.7))


@pytest.fixture(scope="module")
def through_zero() -> xr.DataTree:
    return simulate(eps=1e-3, free=ZERO, motion=[SWELL])[0]


@pytest.mark.parametrize("method", ["uncorrected", "vening-meinesz", "panteleev", "general"])
def test_phase_methods_refuse_a_beat_through_zero(method: str, through_zero: xr.DataTree) -> None:
    found = row(through_zero, method)
    assert found["status"] == "refused"
    assert "complex" in found["error"]
    assert "projection" in found["error"]
    assert np.isnan(found["gravity_m_s2"])


@pytest.mark.parametrize(("method", "limit"), [("complex", 0.01), ("projection", 1e-4)])
def test_exact_forms_pass_through_zero_and_say_so(method: str, limit: float, through_zero: xr.DataTree) -> None:
    found = row(through_zero, method)
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < limit
    assert "beats-through-zero" in found["flags"]


def test_several_methods_share_one_result_in_the_order_asked() -> None:
    record, _ = simulate()
    asked = ["projection", "auto", "uncorrected", "joint"]
    rows = summaries(process(record, method=asked))
    assert [r["requested_method"] for r in rows] == asked
    assert [r["method"] for r in rows] == ["projection", "joint", "uncorrected", "joint"]
    assert rows[1]["gravity_m_s2"] == rows[3]["gravity_m_s2"]
    assert rows[0]["gravity_m_s2"] == row(record, "projection")["gravity_m_s2"]


def test_the_record_is_not_modified() -> None:
    record, _ = simulate(duration=120.0, noise=1e-5)
    before = record.copy(deep=True)
    process(record, method=[name for name in METHODS if name != "joint"])
    assert record.identical(before)


@pytest.mark.parametrize("method", ["panteleev", "complex", "projection"])
def test_results_do_not_depend_on_when_the_record_begins(method: str) -> None:
    """Time stamps of a later day: phases are counted from the record's own start."""
    record, _ = simulate()
    nodes = {f"/{name}": node.to_dataset(inherit=False) for name, node in record.children.items()}
    time = record.dataset["time"]
    root = xr.Dataset(coords={"time": ("time", time.values + 1000.0, time.attrs)}, attrs=record.attrs)
    nodes = {name: node.drop_vars("time", errors="ignore") for name, node in nodes.items()}
    later = xr.DataTree.from_dict({"/": root, **nodes})
    assert row(later, method)["gravity_m_s2"] == pytest.approx(row(record, method)["gravity_m_s2"], abs=1e-11)
