"""A scene of clocks alike that begin alike is told so, in the truth and by --explain; the shipped one is not."""

from __future__ import annotations

import pytest

import synth
from data_schemas.scene import Scene, load_scene
from synth.explanation import explain
from synth.systems.starts import CAUTION


def scene_of(**second: object) -> Scene:
    clocks = load_scene(synth.scene_path("clocks-on-beam")).model_dump()
    clocks["duration"] = 2.0
    clocks["pendulums"] = [{**clocks["pendulums"][0], "label": label} for label in ("1", "2")]
    clocks["pendulums"][1] |= second
    return Scene.model_validate(clocks)


def test_alike_and_begun_alike() -> None:
    assert explain(scene_of())["terms"]["caution"] == CAUTION


@pytest.mark.compiled
def test_the_truth_says_so() -> None:
    assert synth.simulate(scene_of())[1].attrs["caution"] == CAUTION
    assert "caution" not in synth.simulate(scene_of(period=1.001001))[1].attrs


@pytest.mark.parametrize(
    "second", [{"period": 1.001001}, {"start": {"kind": "state", "angle": 0.0999}}], ids=["unlike", "begun apart"]
)
def test_otherwise_nothing_is_said(second: dict[str, object]) -> None:
    assert "caution" not in explain(scene_of(**second))["terms"]
