"""Films of the independent renderer agree with the truth beside them, and every kind can be made."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

pytest.importorskip("tifffile")  # of the extra `film`
pytest.importorskip("PIL")

import tifffile

from data_schemas.film_description import load_description

from . import make, pendulums, plain, score
from .kinds import KINDS, STRENGTHS, Case, case_of

CLEAN = Case(duration=(14.0, 14.0), grain=0.0, fog=0.0, spacing=44.0)
GROUPS = {entry.group: kind for kind, entry in reversed(KINDS.items())}


def film(**changes: Any) -> plain.Film:
    return plain.expose(replace(CLEAN, **changes), np.random.default_rng(1))


def exposure(scan: plain.Film) -> np.ndarray:
    """What the scan says of the light, by the curve that made it."""
    grey = np.concatenate(list(plain.blocks(scan)))
    density = -np.log10(np.maximum(grey, 1e-3) * 255.0 / scan.case.span) - 0.06
    return (-np.log1p(-np.clip(density, 0.0, 0.99 * scan.case.density) / scan.case.density)) ** (1.0 / scan.case.gamma)


@pytest.mark.parametrize(("kind", "strength"), list(itertools.product(KINDS, STRENGTHS)))
def test_kind_has_case_at_each_strength(kind: str, strength: str) -> None:
    case = case_of(kind, strength)
    assert KINDS[kind].group in GROUPS
    assert len(KINDS[kind].varied) == 0 or case != case_of(kind, STRENGTHS[STRENGTHS.index(strength) - 1])


@pytest.mark.parametrize("kind", list(GROUPS.values()))
def test_one_film_of_each_group_is_written(kind: str, tmp_path: Path) -> None:
    images = make.write(kind, "middle", 1, tmp_path, 10.0)
    label = make.label_of(kind, "middle", 1)
    truth = json.loads((tmp_path / f"{label}.truth.json").read_text())
    known = load_description(tmp_path / f"{label}.film.toml")
    assert [each.period for each in known.pendulums] == truth["periods"]
    assert truth["images"] == [path.name for path in images]
    assert len(truth["time_of_row"]) == truth["height"]
    assert np.all(np.diff(truth["time_of_row"]) >= 0.0)
    assert any(mark["kind"] != "missing" for mark in truth["marks"])


@pytest.mark.parametrize(
    "changes", [{}, {"skew": 0.5}, {"wander": 20.0}, {"dpi": 600}, {"tangent": True, "levers": (200.0,)}]
)
def test_centroid_of_clean_film_agrees_with_truth(changes: dict[str, Any]) -> None:
    scan = film(**changes)
    light, truth = exposure(scan), make.truth_of(scan)
    columns = np.arange(light.shape[1]) + 0.5
    marks = np.array([mark["row"] for mark in truth["marks"]])
    spread = (scan.case.spot * scan.geometry.ratio) ** 2 + 0.4**2  # of light along the film: spot and scanner, px^2
    for trace in truth["traces"]:
        place = np.array(trace["column_of_row"])
        expected = place + 0.5 * spread * np.gradient(np.gradient(place))  # the mean of a curve over a spot
        error = []
        for row in range(30, place.size - 30):
            near = np.abs(columns - place[row]) < 8.0 * math.sqrt(spread) * (1.0 + abs(trace["slope_of_row"][row]))
            if np.abs(marks - row).min() > 8.0 * math.sqrt(spread):
                error.append(float(light[row, near] @ columns[near] / light[row, near].sum()) - expected[row])
        assert len(error) > 200
        assert np.sqrt(np.mean(np.square(error))) < 0.3
        assert abs(np.mean(error)) < 0.05


def test_time_of_marks_agrees_with_gaps() -> None:
    scan = film(jitter=0.0)
    light, truth = exposure(scan), make.truth_of(scan)
    steep = 0
    for index, mark in itertools.product(range(2), truth["marks"][2:-2]):
        times = mark["time"] + np.arange(-0.05, 0.0501, 0.005)
        rows, columns = plain.path(scan, index, times)
        if np.abs(np.diff(columns)).min() > 2.0:  # of 5 ms; where a trace turns, light falls into its gap
            along = light[np.floor(rows).astype(int), np.floor(columns).astype(int)]
            dark = np.maximum(np.linspace(along[0], along[-1], along.size) - along, 0.0)
            assert float(dark @ times / dark.sum()) == pytest.approx(mark["time"], abs=0.003)
            steep += 1
    assert steep > 5


def test_stands_as_dark_bar_across_film() -> None:
    scan = film(still=1.0, fog=0.03)
    light, truth = exposure(scan), make.truth_of(scan)
    event = truth["events"][0]
    blank = light[:, :100].mean(1)
    assert abs(int(np.argmax(blank)) - np.searchsorted(truth["time_of_row"], event["time"])) <= 2
    assert blank.max() > 3.0 * np.median(blank)
    times = np.array(truth["time_of_row"])
    assert np.diff(times).max() > 0.9 * event["length"]


@pytest.mark.parametrize(("code", "gaps"), [("omitted", 0.0), ("long", 3.0), ("double", 2.0), ("none", 1.0)])
def test_minute_is_marked_as_its_code_says(code: str, gaps: float) -> None:
    scan = film(code=code, duration=(70.0, 70.0))
    minute = 60.0 - scan.offset
    near = [each for each in scan.marks if minute - 0.1 < each.time < minute + 0.3 and each.kind != "omitted"]
    assert sum(each.end - each.begin for each in near) / scan.case.gap == pytest.approx(gaps)


def test_swing_has_period_of_its_gravity() -> None:
    world = film(swell=0.0, damping=0.0, traces=("1",), amplitudes=(2.0,), duration=(40.0, 40.0)).world
    times = np.arange(0.0, 40.0, 0.01)
    angle = world.angles(times)[:, 0]
    up = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    crossings = times[up] - angle[up] * 0.01 / (angle[up + 1] - angle[up])
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    arc = np.abs(angle).max() ** 2 / 16.0
    expected = world.periods[0] * math.sqrt(pendulums.REFERENCE / world.gravity) * (1.0 + arc)
    assert period == pytest.approx(expected, rel=1e-7)


def test_wrong_end_is_turned_by_half(tmp_path: Path) -> None:
    case = replace(CLEAN, duration=(6.0, 6.0))
    right, wrong = (plain.expose(replace(case, reversed=end), np.random.default_rng(5)) for end in (False, True))
    images = [tifffile.imread(make.save(each, tmp_path, str(k))[0]) for k, each in enumerate((right, wrong))]
    np.testing.assert_array_equal(images[0], images[1][::-1, ::-1])


def test_long_film_is_written_in_strips_as_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = film(grain=0.05)
    whole = tifffile.imread(make.save(scan, tmp_path, "whole")[0])
    monkeypatch.setattr(make, "_LONG", 1.0)
    np.testing.assert_array_equal(tifffile.imread(make.save(scan, tmp_path, "strips")[0]), whole)


def test_table_counts_what_gives_gravity() -> None:
    common = {"kind": "typical", "owed": "sound", "film_flags": [], "digitise_s": 1.0}
    rows = [
        common | {"film": "a", "outcome": "gravity", "error_mgal": 1.0, "sigma_mgal": 0.2, "z": 5.0},
        common | {"film": "b", "outcome": "digitise refused", "error": "no"},
    ]
    text = score.table(rows)
    assert "2 films, 1 give gravity, 1 beyond 4 sigma, 0 beyond 5; of 2 sound ones 1 give none" in text


@pytest.mark.parametrize("jump", [0.0, 0.3, 2.5])
def test_record_that_is_late_from_its_middle_is_reported(tmp_path: Path, jump: float) -> None:
    scan = film(duration=(60.0, 60.0), swell=0.02)
    truth = make.truth_of(scan)
    times = np.arange(1.0, 55.0, 0.04)
    angles = scan.combinations @ scan.world.angles(times).T
    with h5py.File(tmp_path / "late.record.nc", "w") as file:
        file["time"] = times + scan.offset + np.where(times > 31.0, jump, 0.0)
        file["record/trace"] = list(scan.case.traces)
        file["record/elongation"] = angles
    found = score.compare(tmp_path / "late.record.nc", truth)
    assert found["time_error_s"] == pytest.approx(jump, abs=0.01)
    assert found["minute_error_s"] == pytest.approx(0.0, abs=0.002)
    assert found["sample_error_px"] < 0.05
    assert found["unflagged"] == 1.0
