"""The table of what terms cost: its scenes, and what it counts as paid too early."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.benchmarks import cost_of_terms
from pipeline.benchmarks.cost_of_terms import ADDED, not_yet, run, scenes
from synth.needs import needs


def test_each_scene_has_a_term_more() -> None:
    grown = scenes(10.0)
    assert list(grown) == list(ADDED)
    seen: set[str] = set()
    for name, scene in grown.items():
        asked = set(needs(scene)) | {term.axis for term in scene.motion}
        assert asked != seen, name
        seen = asked
    last = grown["+ beam"]
    assert [each.escapement.kind for each in last.pendulums if each.escapement] == ["van-der-pol", "impulse"]


def test_modules_come_with_their_terms() -> None:
    assert "numba" in not_yet("+ horizontal motion")
    assert "numba" not in not_yet("+ sine")
    assert "synth.systems.elastic_beam" in not_yet("+ impulse")
    assert "synth.integrators.radau" in not_yet("+ beam")


def test_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A child that loads a general integrator for a linear scene fails that row; compiling is what the cache saves."""
    firsts = iter([3.0, 1.0] * len(ADDED))

    def probe(scene: Any, cache: str, repeats: int) -> dict[str, Any]:
        return {
            "first_s": next(firsts),
            "warm_s": 0.25,
            "modules": ["numpy", "synth.integrators.explicit"],
            "variables": 8,
            "propagator": "some",
            "estimated_error": 1e-15,
        }

    monkeypatch.setattr(cost_of_terms, "_probe", probe)
    rows = list(run(quick=True, folder=None))
    assert [row["pass"] for row in rows] == [False] * 4 + [True] * 5
    assert rows[0]["too_early"] == "synth.integrators.explicit"
    assert (rows[0]["compile_s"], rows[0]["start_ms"], rows[0]["ours"]) == (2.0, 750.0, 1)
