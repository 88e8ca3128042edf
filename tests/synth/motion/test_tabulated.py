from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

from data_schemas.errors import SceneError
from data_schemas.scene_motion import TabulatedMotion
from data_schemas.scene_pendulum import FreeStart, StateStart
from synth.motion.harmonic_sum import HarmonicSum
from synth.motion.tabulated import continued, tabulated
from synth.pendulums.linear import respond
from synth.propagators.times import EvenTimes

N = 2 * math.pi / 1.01
SWELL = 2 * math.pi / 10


def _at(motion: HarmonicSum, seconds: np.ndarray) -> np.ndarray:
    return np.real(np.exp(1j * np.outer(seconds, motion.angular_frequency)) @ motion.acceleration)


@pytest.mark.parametrize("count", [2, 3, 10, 65, 301, 1000])
def test_passes_through_every_reading(count: int) -> None:
    values = np.random.default_rng(1).normal(size=count)
    np.testing.assert_allclose(_at(continued(values, 0.5, 0.0), 0.5 * np.arange(count)), values, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [300, 301])
def test_begins_later(count: int) -> None:
    values = np.cos(SWELL * np.arange(count))
    early, late = continued(values, 1.0, 0.0), continued(values, 1.0, 20.25)
    seconds = np.linspace(0, 200, 77)
    np.testing.assert_allclose(_at(late, seconds), _at(early, seconds + 20.25), rtol=0, atol=1e-12)


def test_holds_nothing_beyond_half_the_rate_of_the_table() -> None:
    motion = continued(np.random.default_rng(1).normal(size=200), 0.5, 0.0)
    assert np.max(motion.angular_frequency) <= math.pi / 0.5 * (1 + 1e-12)


@pytest.mark.parametrize(("from_end", "error"), [(0.0, 2e-2), (3.0, 2e-3), (50.0, 1e-5), (200.0, 1e-6)])
def test_interpolation_error_of_10_s_swell_read_once_a_second(from_end: float, error: float) -> None:
    """The stated error, as a part of the amplitude; it comes from the ends of the table and falls inwards."""
    seconds = np.arange(from_end, 1000 - from_end, 0.1)
    for phase in (0.3, 1.5, 2.5):
        motion = continued(np.cos(SWELL * np.arange(1001) + phase), 1.0, 0.0)
        assert np.max(np.abs(_at(motion, seconds) - np.cos(SWELL * seconds + phase))) < error


def test_pendulum_answers_the_table_as_it_answers_the_swell() -> None:
    """A table that reads a harmonic against the closed form of that harmonic, 100 s from the table's ends."""
    table = continued(0.1 * np.cos(SWELL * np.arange(1001)), 1.0, 100.0)
    swell = HarmonicSum(np.array([SWELL]), np.array([0.1 * np.exp(1j * SWELL * 100)]))
    start = FreeStart(amplitude=0.01, phase=0.3)
    times = EvenTimes(Fraction(1, 4), 3200)
    found = times.elongation([respond(N, 1e-4, start, table, 9.81)])
    expected = times.elongation([respond(N, 1e-4, start, swell, 9.81)])
    # 5e-6 of the forced 10 mrad: the interpolation error at 100 s from an end
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-8)


def test_variation_of_constants_by_quadrature() -> None:
    """One interval from a state, by adaptive quadrature of the interpolated motion."""
    motion = continued(np.random.default_rng(8).normal(scale=0.05, size=120), 1.0, 30.0)
    damping_rate, angle, speed, gravity = 0.01, 0.02, -0.03, 9.81
    start = StateStart(angle=angle, angular_velocity=speed)
    response = respond(N, damping_rate, start, motion, gravity)
    theta = EvenTimes(Fraction(3, 2), 2).elongation([response])[0]
    omega, t = math.sqrt(N**2 - damping_rate**2), 1.5

    def pushed(s: float) -> float:
        kernel = math.exp(-damping_rate * (t - s)) * math.sin(omega * (t - s)) / omega
        return -(N**2) / gravity * float(_at(motion, np.array([s]))[0]) * kernel

    own = angle * math.cos(omega * t) + (speed + damping_rate * angle) / omega * math.sin(omega * t)
    expected = math.exp(-damping_rate * t) * own + quad(pushed, 0, t, epsabs=1e-15, epsrel=1e-13)[0]
    assert theta[1] == pytest.approx(expected, abs=1e-14)


def _written(folder: Path, text: str) -> str:
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def _rows(seconds: np.ndarray, values: np.ndarray, separator: str = ",") -> str:
    return "\n".join(f"{t!r}{separator}{v!r}" for t, v in zip(seconds.tolist(), values.tolist(), strict=True))


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("header", [True, False])
def test_columns_by_name_and_number(tmp_path: Path, header: bool, separator: str) -> None:
    seconds = np.arange(50.0)
    text = f"time_s{separator} along\n" * header + _rows(seconds, np.cos(seconds / 3), separator)
    columns = {"time": "time_s", "value": "along"} if header else {"time": 1, "value": 2}
    motion = tabulated(TabulatedMotion(file=_written(tmp_path, text), factor=0.01, **columns), 40.0)
    np.testing.assert_allclose(_at(motion, seconds), 0.01 * np.cos(seconds / 3), rtol=0, atol=1e-14)


def test_netcdf_table(tmp_path: Path) -> None:
    seconds = np.arange(50.0)
    path = tmp_path / "table.nc"
    xr.Dataset({"push": ("time", np.cos(seconds / 3))}, {"time": seconds}).to_netcdf(path, engine="h5netcdf")
    motion = tabulated(TabulatedMotion(file=str(path), time="time", value="push"), 40.0)
    np.testing.assert_allclose(_at(motion, seconds), np.cos(seconds / 3), rtol=0, atol=1e-12)


def test_uneven_readings_by_spline(tmp_path: Path) -> None:
    chance = np.random.default_rng(2)
    seconds = np.sort(np.concatenate([[0.0, 300.0], chance.uniform(0, 300, 900)]))
    term = TabulatedMotion(file=_written(tmp_path, _rows(seconds, np.cos(SWELL * seconds))), interpolation="spline")
    inside = np.linspace(50, 250, 500)
    # a gap of 2.5 s between readings is the worst of 900: (0.63 * 2.5/2)^6/720 = 3e-4
    np.testing.assert_allclose(_at(tabulated(term, 300.0), inside), np.cos(SWELL * inside), rtol=0, atol=1e-3)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_spline_of_a_few_readings(tmp_path: Path, count: int) -> None:
    seconds = np.arange(count) * 1.0
    text = _rows(seconds, 0.1 * seconds)
    motion = tabulated(TabulatedMotion(file=_written(tmp_path, text), interpolation="spline"), count - 1.0)
    np.testing.assert_allclose(_at(motion, seconds), 0.1 * seconds, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "parts", "said"),
    [
        ("0,1\n1,2\n2,3", {}, "shorten the scene's duration or set motion.begin"),
        ("0,1\n1,2\n2,3\n50,4", {}, "set motion.interpolation = 'spline'"),
        ("0,1\n1,2\n1,3\n50,4", {}, "do not increase"),
        ("0,1\n1,nan\n50,4", {}, "missing or infinite"),
        ("t,x\n", {}, "two readings at least"),
        ("0,1\n1,\n50,4", {}, "lacks a number"),
        ("0,1\n1\n50,4", {}, "lacks a number"),
        ("0,1", {}, "two readings at least"),
        ("", {}, "is empty"),
        ("0,1\n50,2", {"value": 3}, "has no column 3; it has 2"),
        ("0,1\n50,2", {"value": "push"}, "has no header"),
        ("t,x\n0,1\n50,2", {"value": "push"}, "has no column 'push'; it has t, x"),
        ("0,1\n60,2", {"begin": -1.0}, "set motion.begin"),
    ],
)
def test_table_that_cannot_be_used(tmp_path: Path, text: str, parts: dict[str, object], said: str) -> None:
    path = _written(tmp_path, text)
    term = TabulatedMotion.model_validate({"kind": "tabulated", "file": path} | parts)
    with pytest.raises(SceneError, match=said) as caught:
        tabulated(term, 40.0)
    assert path in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("interpolation", ["band-limited", "spline"])
def test_table_that_jumps(tmp_path: Path, interpolation: str) -> None:
    seconds = np.arange(301) / 5.0
    path = _written(tmp_path, _rows(seconds, 0.3 * np.sin(0.9 * seconds) + (seconds > 20.0)))
    term = TabulatedMotion.model_validate({"kind": "tabulated", "file": path, "interpolation": interpolation})
    with pytest.raises(SceneError, match=r"jumps by 1\.\d* m/s\^2 between 20 and 20\.2 s") as caught:
        tabulated(term, 40.0)
    assert path in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["absent.csv", "absent.nc", "hollow.nc"])
def test_table_that_is_not_there(tmp_path: Path, name: str) -> None:
    (tmp_path / "hollow.nc").write_bytes(b"not netCDF")
    with pytest.raises(SceneError, match=r"cannot be read|is not netCDF") as caught:
        tabulated(TabulatedMotion(file=str(tmp_path / name)), 1.0)
    assert "\n" not in str(caught.value)
