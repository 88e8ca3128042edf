"""The grids of the suite `corrections`: what their records are, how they are judged, kept, tabled and drawn."""

from __future__ import annotations

import cmath
import csv
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data_schemas.errors import RecordError
from pipeline.benchmarks import (
    corrections,
    corrections_cases,
    corrections_grid,
    corrections_ledger,
    corrections_maps,
    corrections_sweeps,
    corrections_waterfall,
    scenes,
)
from pipeline.benchmarks.corrections_points import FACTORS, MAP, Place, Point, places, scene
from pipeline.benchmarks.kept import Kept
from pipeline.methods import PAIR_METHODS

TINY = Point(length=30.0, sampling="10 Hz", arc=0.02, first_arc=0.06)


@pytest.mark.parametrize("point", [Point(), TINY, Point(arc=0.05, first_arc=0.025)])
def test_arcs_are_what_the_point_says(point: Point) -> None:
    first, second = (cmath.rect(each.start.amplitude, each.start.phase) for each in scene(point).pendulums)
    assert abs(first) == pytest.approx(point.first_arc, rel=1e-14)
    assert abs(first - second) == pytest.approx(point.arc, rel=1e-13)  # the difference of two doubles


@pytest.mark.parametrize("quick", [True, False])
def test_every_place_is_a_scene_and_every_factor_moves_its_record(quick: bool) -> None:
    all_places = list(places(quick=quick))
    for factor in FACTORS:
        made = [scene(place.point).model_dump_json() for place in all_places if place.factor == factor.name]
        assert len(set(made)) == len(factor.chosen(quick=quick)), factor.name
        assert len(made) >= 3
        assert set(factor.quick) <= set(factor.values)
    across, up = (factor.chosen(quick=quick) for factor in FACTORS[:2])
    mapped = [place.point for place in all_places if place.factor == MAP]
    assert {(point.difference, round(point.slow / point.arc, 9)) for point in mapped} == {
        (difference, slow) for difference in across for slow in up
    }


def test_the_issue_s_ranges_are_covered() -> None:
    found = {factor.name: [value for value in factor.values if not isinstance(value, str)] for factor in FACTORS}
    ends = {name: (min(values), max(values)) for name, values in found.items() if values}
    assert ends["period difference"] == (1e-7, 1e-3)
    assert ends["psi/a"] == (0.0, 10.0)
    assert ends["Theta1/a"] == (0.5, 10.0)
    assert ends["arc a"] == (1.0, 50.0)
    assert FACTORS[-1].values == ("25 Hz", "10 Hz", "8 Hz")


def test_a_calm_sea_is_no_motion_and_a_sea_moves_both_axes() -> None:
    assert [term.kind for term in scene(Point(height=0.0, strength=0.0)).motion] == []
    assert [term.axis for term in scene(Point(height=3.0, strength=0.0)).motion] == ["horizontal", "vertical"]
    assert [term.kind for term in scene(Point(slow=0.0)).motion] == ["harmonics", "near-resonant"]


def row(method: str, error: float = 0.0, sigma: float = 0.1, **changes: Any) -> dict[str, Any]:
    place = {"factor": "noise", "value": 0.0, "unit": "rad", **asdict(Point())}
    found = {"method": method, "used": method, "error_mgal": error, "sigma_mgal": sigma, "ms": 3.0}
    return {**place, **found, "flags": "", "refused": "", **changes}


def declined(method: str, **changes: Any) -> dict[str, Any]:
    nan = math.nan
    return row(method, nan, nan, ms=nan, refused="too short; record longer", **changes)


@pytest.mark.parametrize(
    ("found", "wrong"),
    [
        (row("shooting", 0.4), False),
        (row("shooting", 0.6), True),
        (row("shooting", -0.6), True),
        (row("shooting", 0.6, flags="arc"), False),
        (row("shooting", 4e-3, 0.0), False),
        (row("shooting", 6e-3, 0.0), True),
        (row("general", 0.09, 0.0), False),
        (row("shooting", math.nan), True),
        (declined("shooting"), False),
    ],
)
def test_wrong_without_a_word(found: dict[str, Any], wrong: bool) -> None:
    assert corrections.silently_wrong(found) == wrong


def test_only_methods_for_real_pendulums_are_judged() -> None:
    wrong = [row(name, 100.0) for name in PAIR_METHODS]
    judged = corrections.judged(wrong)
    assert judged["silently_wrong"] == "general shooting"
    assert judged["pass"] is False
    assert corrections.judged([row(name, 0.01) for name in PAIR_METHODS])["pass"] is True


def test_refusals_are_rows_and_the_summary_counts_them() -> None:
    points = [row("general", -2.0, ms=5.0), row("general", 1.0, ms=9.0, flags="x"), declined("general")]
    assert corrections.refusals(points) == [
        {"factor": "noise", "value": 0.0, "method": "general", "refused": "too short; record longer"}
    ]
    found = {each["method"]: each for each in corrections.summary(points)}
    assert found["general"] == {
        "method": "general", "median_ms": 7.0, "median_error_mgal": 1.5, "worst_error_mgal": 2.0, "flagged": 1,
        "declined": 1, "records": 3,
    }  # fmt: skip
    assert math.isnan(found["shooting"]["median_ms"])


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Records that were reduced, by their noise; the warm-up is not among them."""
    seen: list[float] = []

    def reduce(made: Any, repeats: int) -> list[dict[str, Any]]:
        if made.duration != corrections_grid._WARM:
            if made.recording.noise == 3e-3:
                raise KeyboardInterrupt
            seen.append(made.recording.noise)
        return [
            {
                key: value
                for key, value in each.items()
                if key not in asdict(Point()) | {"factor": 0, "value": 0, "unit": 0}
            }
            for each in (declined("general"), *(row(name, 1e-3) for name in PAIR_METHODS if name != "general"))
        ]

    monkeypatch.setattr(corrections_grid, "reduce", reduce)
    return seen


def noisy(*noises: float) -> list[Place]:
    return [Place("noise", noise, "rad", Point(noise=noise, length=30.0)) for noise in noises]


def test_an_interrupted_run_goes_on_where_it_stopped(counted: list[float], tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        list(corrections_grid.measured(noisy(1e-3, 2e-3, 3e-3), Kept(tmp_path), quick=True))
    assert counted == [1e-3, 2e-3]
    rows = list(corrections_grid.measured(noisy(1e-3, 2e-3, 4e-3), Kept(tmp_path), quick=True))
    assert counted == [1e-3, 2e-3, 4e-3]
    assert [each[0]["value"] for each in rows] == [1e-3, 2e-3, 4e-3]
    list(corrections_grid.measured(noisy(1e-3), Kept(tmp_path), quick=False))  # more rounds: other times
    assert counted == [1e-3, 2e-3, 4e-3, 1e-3]


def test_a_record_that_stands_in_two_sweeps_is_computed_once(counted: list[float]) -> None:
    list(corrections_grid.measured(noisy(1e-3, 1e-3), Kept(None), quick=True))
    assert counted == [1e-3]


def test_a_record_that_is_declined_as_a_whole_is_declined_by_each(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> Any:
        raise RecordError("no difference")

    for name in ("simulate", "prepare"):
        with monkeypatch.context() as patch:
            patch.setattr(corrections_grid, name, refuse)
            rows = corrections_grid.reduce(scenes.linear(duration=10.0, sampling_rate=5), 1)
        assert [(each["method"], each["refused"]) for each in rows] == [
            (name, "no difference") for name in PAIR_METHODS
        ]


def test_methods_that_decline_are_rows_beside_those_that_do_not() -> None:
    beats = scenes.beats_through_zero(duration=600.0, sampling_rate=10, motion=[], phases=(0.0, 0.3))
    rows = {each["method"]: each for each in corrections_grid.reduce(beats, 2)}
    assert tuple(rows) == PAIR_METHODS
    assert "a phase means nothing" in rows["panteleev"]["refused"]
    assert rows["projection"]["refused"] == ""
    assert abs(rows["projection"]["error_mgal"]) < 0.01  # exact; its quadrature leaves less
    assert rows["projection"]["ms"] > 0.0


@pytest.fixture
def small(counted: list[float], monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Two places a factor and a map, no table of residuals, a ledger by hand."""
    chosen = [place for place in places(quick=True) if place.point.noise != 3e-3]
    monkeypatch.setattr(corrections, "places", lambda *, quick: chosen)
    monkeypatch.setattr(corrections_cases, "run", lambda *, quick, folder: iter([{"case": "x", "pass": True}]))
    ledger = corrections_ledger.waterfall(made_ledger(), 9.81)
    monkeypatch.setattr(corrections_ledger, "measured", lambda length: ledger)
    return ledger


def test_the_suite_yields_its_tables_and_writes_them(small: list[dict[str, Any]], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    rows = list(corrections.run(quick=True, folder=tmp_path))
    judged = [each for each in rows if "silently_wrong" in each]
    assert all(each["pass"] for each in judged)
    assert sum("refused" in each for each in rows) == len(judged)  # `general` declines each
    assert sum("median_ms" in each for each in rows) == len(PAIR_METHODS)
    assert [each for each in rows if "entry" in each] == small
    with (tmp_path / "corrections.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == len(judged) * len(PAIR_METHODS)
    assert {each["refused"] for each in table if each["method"] == "general"} == {"too short; record longer"}
    content = json.loads((tmp_path / "corrections.json").read_text())
    assert list(content) == ["quick", "cases", "points", "methods", "ledger"]
    assert content["points"][0]["error_mgal"] is None
    pictures = sorted(path.name for path in tmp_path.glob("*.png"))
    assert pictures == [f"corrections-{name}.png" for name in ("cost", "maps", "sweeps", "waterfall")]
    assert (tmp_path / "corrections-ledger.csv").read_text().startswith("method,entry,")


@pytest.mark.usefixtures("small")
def test_without_a_folder_the_suite_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert list(corrections.run(quick=True, folder=None))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("small")
def test_without_matplotlib_the_tables_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    list(corrections.run(quick=True, folder=tmp_path))
    assert not list(tmp_path.glob("*.png"))
    assert (tmp_path / "corrections.json").exists()


def made_ledger() -> Any:
    import xarray

    # 1 mGal too much before anything; two entries of which one is not applied, as another program's ledger might be
    value = np.array([[2.0, np.nan, -3.5], [np.nan, np.nan, np.nan]])
    table = xarray.Dataset(
        {
            "gravity": ("method", [9.81 + (1.0 + 2.0 - 3.5) * 1e-5, np.nan]),
            "gravity_sigma": ("method", [0.25, np.nan]),
            "value": (("method", "entry"), value),
            "sigma": (("method", "entry"), np.full((2, 3), 0.1)),
            "applied": (("method", "entry"), np.array([[1, 0, 1], [0, 0, 0]], dtype="u1")),
            "reason": (("method", "entry"), np.full((2, 3), "why", dtype=object)),
        },
        coords={"method": ["shooting", "panteleev"], "entry": ["non_isochronism", "tilt", "chronometer"]},
    )
    return xarray.DataTree.from_dict({"/gravity": table})


def test_the_waterfall_takes_whatever_entries_a_result_holds() -> None:
    rows = corrections_ledger.waterfall(made_ledger(), 9.81)
    assert [each["entry"] for each in rows] == ["uncorrected", "non_isochronism", "tilt", "chronometer"]
    # gravity near 10 m/s2 resolves 2e-10 mGal
    np.testing.assert_allclose([each["residual_mgal"] for each in rows], [1.0, 3.0, 3.0, -0.5], atol=1e-9)
    assert [each["applied"] for each in rows] == [True, True, False, True]
    assert rows[-1]["total_sigma_mgal"] == 0.25
    assert {each["method"] for each in rows} == {"shooting"}  # the other one refused


def test_circumstances_act_as_the_physics_says() -> None:
    calm = {"tilt_mean_square": 0.0, "yaw_rate": 0.0, "speed": 0.0}

    def change(**acts: float) -> float:
        return corrections_ledger.Circumstances(**(calm | acts)).gravity_change(9.81, 2.0 * math.pi / 1.01) / 1e-5

    ten_minutes = (10.0 * math.pi / 10800.0) ** 2
    # published sizes, to their last digit: 4.15, 7.7 and 30.1 mGal, to be ADDED to what is observed
    assert change(tilt_mean_square=ten_minutes) == pytest.approx(-4.15, abs=0.005)
    assert change(yaw_rate=math.radians(1.0)) == pytest.approx(-7.7, abs=0.05)
    assert change(speed=4.0 * 1852.0 / 3600.0, course=90.0, latitude=0.0) == pytest.approx(-30.1, abs=0.05)
    kelvin = corrections_ledger.Circumstances(temperature=294.15, air_density=0.0)
    assert 2e5 * 9.81 * kelvin.period_change() / 1.01 == pytest.approx(18.0, abs=0.1)  # brass, mGal/K
    air = corrections_ledger.Circumstances(temperature=293.15, air_density=1.2)
    assert 2e5 * 9.81 * air.period_change() / 1.01 == pytest.approx(149.0, abs=1.0)  # buoyancy of all the air


def test_a_troubled_record_states_what_acts_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from data_schemas import check

    monkeypatch.setattr(corrections_ledger, "scene", lambda point: scenes.linear(duration=20.0, sampling_rate=5))
    circumstances = corrections_ledger.Circumstances()
    record, gravity = corrections_ledger.troubled(20.0, circumstances)
    assert check(record, "record") == []
    assert gravity == scenes.GRAVITY
    held = record["instrument"].dataset
    assert float(held["temperature"]) == circumstances.temperature
    assert held["density_coefficient"].dims == ("pendulum",)
    assert float(held["chronometer_rate"]) == circumstances.chronometer_rate
    assert held["period"].values[1] == scenes.PERIOD  # of the calibration, not of the voyage


def test_a_map_is_hatched_where_a_method_declines() -> None:
    pytest.importorskip("matplotlib")
    from pipeline.plots.canvas import panel, sheet

    points = [
        row("general", 2e-3, factor=MAP, difference=1e-5, slow=0.0),
        row("general", -30.0, factor=MAP, difference=1e-5, slow=0.03),
        declined("general", factor=MAP, difference=1e-4, slow=0.0),
        row("general", 0.0, factor=MAP, difference=1e-4, slow=0.03),
    ]
    across, up, errors = corrections_maps.field(points)
    assert (across, up) == ([1e-5, 1e-4], [0.0, 3.0])
    np.testing.assert_array_equal(errors, [[2e-3, np.nan], [30.0, 0.0]])
    figure = sheet("", "", 4.0, 4.0)
    axes = panel(figure, figure.add_gridspec(1, 1)[0, 0], "", "", "")
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    corrections_maps._cells(axes, errors, LogNorm(1e-6, 1e3), colormaps["viridis"])
    (hatched,) = axes.patches
    assert hatched.get_hatch() == "///"
    assert hatched.get_xy() == (0.5, -0.5)
    assert sorted(text.get_text() for text in axes.texts) == ["0", "0.002", "30"]


def test_a_waterfall_is_drawn_without_rows_too(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    corrections_waterfall.draw([], tmp_path / "none.png")
    assert (tmp_path / "none.png").read_bytes().startswith(b"\x89PNG")


def test_sweeps_mark_refusals(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    points = [declined(name) if name == "panteleev" else row(name, 1e-3) for name in PAIR_METHODS]
    corrections_sweeps.draw(points, tmp_path / "sweeps.png")
    corrections_sweeps.draw_cost(points, tmp_path / "cost.png")
    for name in ("sweeps", "cost"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def nominal() -> dict[str, dict[str, Any]]:
    made = scene(Point(length=600.0))
    return {each["method"]: each for each in corrections_grid.reduce(made, 1)}


@pytest.mark.compiled
def test_the_nominal_record_is_solved_by_the_exact_inversion(nominal: dict[str, dict[str, Any]]) -> None:
    """The bars on real pendulums with recorded heave; the paper's formulas leave arcs and acceleration in."""
    assert abs(nominal["shooting"]["error_mgal"]) < 0.005
    assert abs(nominal["general"]["error_mgal"]) < 0.1
    assert all(abs(nominal[name]["error_mgal"]) > 3.0 for name in ("panteleev", "complex", "projection"))


@pytest.mark.compiled
def test_a_record_in_peace_is_reduced_to_its_gravity() -> None:
    """Circumstances of the calibration itself: every entry but those of the motion is nothing."""
    at_rest = corrections_ledger.Circumstances(
        chronometer_rate=0.0, temperature=293.15, air_density=1.2, tilt_mean_square=0.0, yaw_rate=0.0, speed=0.0
    )
    record, gravity = corrections_ledger.troubled(600.0, at_rest)
    from pipeline.processing import process

    rows = corrections_ledger.waterfall(process(record, method=["shooting"]), gravity)
    assert abs(rows[-1]["residual_mgal"]) < 5.0 * rows[-1]["total_sigma_mgal"]


@pytest.mark.compiled
def test_the_chronometer_s_step_of_the_waterfall() -> None:
    rows = {(each["method"], each["entry"]): each for each in corrections_ledger.measured(600.0, ["shooting"])}
    # losing 1.5 s a day: T_true = T (1 + r/86400), -2 g r/86400 to be added
    assert rows["shooting", "chronometer"]["value_mgal"] == pytest.approx(-2e5 * 9.8123 * 1.5 / 86400.0, rel=1e-3)


@pytest.mark.campaign
def test_no_record_of_the_grids_is_silently_wrong() -> None:
    rows = list(corrections.run(quick=True, folder=None))
    assert [each for each in rows if each.get("pass") is False] == []
