"""The suite `uncertainty`: its random scenes, its sums over records, and that it goes on where it stopped."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from data_schemas.scene import Scene
from pipeline.benchmarks import random_scenes, uncertainty


def test_scenes_are_the_same_each_time_and_of_every_kind() -> None:
    drawn = [random_scenes.scene(number) for number in range(60)]
    assert drawn == [random_scenes.scene(number) for number in range(60)]
    kinds = [set(random_scenes.kinds(each)) for each in drawn]
    assert set.union(*kinds) == {
        *("linear pendulums", "real pendulums, no heave"),
        *("real pendulums, heave recorded", "real pendulums, heave not recorded"),
        *("half-second marks", "5 Hz", "10 Hz", "20 to 50 Hz", "uneven times", "gaps at the minutes"),
        *("wild readings", "rounded readings", "damping not stated", "law not stated", "no noise", "noise 1e-4 rad"),
    }
    laws = ("linear pendulums", "real pendulums, no heave")
    laws += ("real pendulums, heave recorded", "real pendulums, heave not recorded")
    assert all(len(each.intersection(laws)) == 1 for each in kinds)


def test_an_error_too_small_to_matter_is_right_whatever_sigma_says() -> None:
    assert uncertainty.ratio(-0.9e-3, 1e-9) == 0.0
    assert uncertainty.ratio(-0.3, 0.1) == pytest.approx(-3.0)


def record(number: int, size: float, flags: str = "", refused: str = "") -> dict[str, Any]:
    return {"number": number, "kinds": "x", "error_over_sigma": size, "flags": flags, "refused": refused}


def test_records_of_a_kind_are_summed() -> None:
    records = [record(0, 1.0), record(1, -5.0), record(2, 9.0, "a b"), record(3, math.nan, refused="too short")]
    assert uncertainty.summed("x", [*records, record(4, -2.0)]) == {
        "kind": "x", "records": 5, "refused": 1, "flagged": 1, "within_2_sigma": pytest.approx(2.0 / 3.0),
        "far_and_silent": 1, "worst_silent": 5.0, "its_number": 1,
    }  # fmt: skip


@pytest.mark.parametrize("records", [[record(3, math.nan, refused="too short")], [record(2, 9.0, "a b")]])
def test_where_no_record_is_without_a_flag_there_is_no_worst(records: list[dict[str, Any]]) -> None:
    found = uncertainty.summed("x", records)
    assert found["its_number"] is None
    assert math.isnan(found["within_2_sigma"])
    assert math.isnan(found["worst_silent"])


def short(number: int) -> Scene:
    """Linear pendulums read at 10 Hz for 130 s, and a record too short for anything."""
    free = [
        {"label": label, "period": period, "start": {"kind": "free", "amplitude": 0.02, "phase": phase}}
        for label, period, phase in (("1", 1.0, 0.0), ("2", 1.0001, 2.0))
    ]
    return Scene.model_validate(
        {
            "record_id": f"short-{number}",
            "duration": (130.0, 2.0)[number],
            "gravity": 9.81,
            "reference_gravity": 9.81,
            "restoring": "linear",
            "pendulums": free,
            "recording": {"sampling_rate": 10.0},
        }
    )


def test_a_run_resumes_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uncertainty, "QUICK", 2)
    monkeypatch.setattr(random_scenes, "scene", short)
    rows = list(uncertainty.run(quick=True, folder=tmp_path))
    told = json.loads((tmp_path / "uncertainty.json").read_text())
    read, refused = told["records"]
    assert abs(read["error_mgal"]) < uncertainty.EXACT
    assert read["method"] == "projection"
    assert refused["refused"]
    assert refused["error_mgal"] is None
    every = rows[0]
    assert (every["kind"], every["records"], every["refused"]) == ("all", 2, 1)
    assert [row["kind"] for row in rows if "kind" in row] == ["all", "linear pendulums", "10 Hz", "no noise"]
    assert (tmp_path / "uncertainty.csv").read_text().count("\n") == 3

    def never(number: int) -> dict[str, Any]:
        raise AssertionError(number)

    monkeypatch.setattr(uncertainty, "_made", never)
    assert repr(list(uncertainty.run(quick=True, folder=tmp_path))) == repr(rows)
