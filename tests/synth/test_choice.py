"""Which propagator a scene gets, and what is said when the one it names cannot."""

from __future__ import annotations

from typing import Any

import pytest

import synth
from data_schemas import load_scene
from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from data_schemas.scene_pendulum import RESISTANCES, Pendulum
from synth.choice import NAMES, choose, needs
from synth.explanation import explain
from synth.plan import plan
from synth.recording.clock import set_clock
from synth.systems.resistance import LAWS

STATE = {"kind": "state", "angle": 0.1}
VAN_DER_POL = {"kind": "van-der-pol", "rate": 0.06, "angle": 0.05}
BEAM = {"kind": "beam", "mass": 50.0, "stiffness": 8000.0}


def scene(pendulum: dict[str, Any], propagator: str = "auto", **changes: Any) -> Scene:
    given: dict[str, Any] = {
        "record_id": "chosen",
        "duration": 2.0,
        "gravity": 9.81,
        "restoring": "sine",
        "pendulums": [{"label": "1", "period": 1.0, "start": STATE} | pendulum],
        "simulation": {"propagator": propagator},
    }
    return Scene.model_validate(given | changes)


CHOSEN = [
    ({}, {"restoring": "linear"}, "closed-form"),
    ({"damping_rate": 3.0}, {"restoring": "linear"}, "closed-form"),
    ({"damping_rate": 4.0}, {"restoring": "linear"}, "explicit"),  # over half the frequency: it hardly swings
    ({}, {}, "picard"),
    ({}, {"recording": {"jitter": 0.01}}, "picard"),
    ({"quadratic_damping": 0.1}, {}, "explicit"),
    ({"knife_edge": {"friction": 0.1, "rate": 0.1}}, {}, "explicit"),
    ({"knife_edge": {"friction": 0.1, "rate": 1e-5}}, {}, "radau"),
    ({"escapement": VAN_DER_POL}, {}, "explicit"),
    ({"escapement": VAN_DER_POL | {"rate": 1e4}}, {}, "radau"),
    ({"escapement": {"kind": "impulse", "energy": 0.1}}, {}, "explicit"),
    ({"damping_rate": 1e4}, {}, "radau"),
    ({"kick_intensity": 1e-7}, {}, "picard"),
    ({"kick_intensity": 1e-7}, {"restoring": "linear"}, "picard"),
    ({"kick_intensity": 1e-7, "knife_edge": {"friction": 0.1, "rate": 0.1}}, {}, "explicit"),
    ({}, {"gravity_course": {"kind": "linear", "rate": 1e-6}}, "picard"),
    ({}, {"gravity_course": {"kind": "linear", "rate": 1e-6}, "restoring": "linear"}, "picard"),
    ({"damping_rate": 4.0}, {"gravity_course": {"kind": "linear", "rate": 1e-6}, "restoring": "linear"}, "explicit"),
    ({"mass": 0.25}, {"support": BEAM}, "beam-collocation"),
    ({"mass": 0.25}, {"support": BEAM | {"stiffness": 1e9}}, "radau"),
    ({"mass": 0.25, "quadratic_damping": 0.1}, {"support": BEAM}, "explicit"),
    ({"mass": 0.25, "escapement": {"kind": "impulse", "energy": 0.1}}, {"support": BEAM}, "explicit"),
    ({"escapement": VAN_DER_POL}, {"support": {"kind": "board", "coupling": 0.1}}, "beam-collocation"),
    (
        {"mass": 0.25, "escapement": VAN_DER_POL},
        {"support": BEAM | {"equations": "reduced"}, "restoring": "linear"},
        "beam-collocation",
    ),
]


@pytest.mark.parametrize(("pendulum", "changes", "propagator"), CHOSEN)
def test_choice(pendulum: dict[str, Any], changes: dict[str, Any], propagator: str) -> None:
    given = scene(pendulum, **changes)
    assert plan(given, set_clock(given)).choice.propagator == propagator
    told = explain(given)
    assert told["propagator"] == NAMES[propagator]  # type: ignore[index]  # a name from the table above
    assert 0 < told["expected_error"] <= 1e-11


REFUSED = [
    ("closed-form", {}, {}, "'closed-form' does not know the sine law; choose 'picard' or 'explicit' or 'radau'"),
    (
        "picard",
        {"quadratic_damping": 0.1},
        {},
        "does not know quadratic damping; choose 'explicit' or 'radau' or 'auto'",
    ),
    ("radau", {"kick_intensity": 1e-7}, {}, "'radau' does not know random kicks; choose 'picard' or 'explicit' or"),
    ("closed-form", {"kick_intensity": 1e-7}, {"restoring": "linear"}, "'closed-form' does not know random kicks;"),
    ("closed-form", {}, {"gravity_course": {"kind": "linear", "rate": 1e-6}}, "changing gravity"),
    ("radau", {"escapement": {"kind": "impulse", "energy": 0.1}}, {}, "choose 'explicit' or 'auto'"),
    ("beam-collocation", {}, {}, "does not know a fixed support; choose 'picard'"),
    ("picard", {"damping_rate": 9.0, "escapement": VAN_DER_POL}, {}, "overdamping and a van der Pol escapement;"),
]


@pytest.mark.parametrize(("name", "pendulum", "changes", "said"), REFUSED)
def test_a_name_that_cannot_says_who_can(
    name: str, pendulum: dict[str, Any], changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(SceneError) as caught:
        synth.simulate(scene(pendulum, name, **changes))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


class Oiled(Pendulum):
    """A pendulum whose friction somebody added to the schema and to nothing else."""

    friction: float = 0.0


def test_a_term_that_no_propagator_claims_is_an_error() -> None:
    for name in ("auto", "explicit"):
        given = scene({}, name)
        pendulum = Oiled(**given.pendulums[0].model_dump(), friction=0.1)
        with pytest.raises(SceneError, match="no propagator knows friction"):
            synth.simulate(given.model_copy(update={"pendulums": (pendulum,)}))


def test_every_resistance_has_its_law(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(LAWS) == {*RESISTANCES, "escapement"}
    monkeypatch.delitem(LAWS, "quadratic_damping")
    with pytest.raises(SceneError, match="no propagator knows quadratic damping"):
        synth.simulate(scene({"quadratic_damping": 0.1}))


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_taken_at_its_word(name: str) -> None:
    """Each propagator is the choice of a scene that names it and that it knows; nobody stands in for it."""
    on_beam = name == "beam-collocation"
    changes = {"support": BEAM} if on_beam else {"restoring": "linear"} if name == "closed-form" else {}
    asked = needs(scene({"mass": 1.0}, **changes))
    choice = choose(name, asked, lambda: pytest.fail("rates decide nothing"))  # type: ignore[arg-type]  # of NAMES
    assert (choice.propagator, choice.instead) == (name, ())


def test_a_tolerance_is_what_is_expected() -> None:
    driven = scene({"escapement": VAN_DER_POL}, simulation={"tolerance": 1e-7})
    assert explain(driven)["expected_error"] == 1e-7
    linear = scene({}, restoring="linear", simulation={"tolerance": 1e-7})
    assert explain(linear)["expected_error"] == 1e-15


@pytest.mark.parametrize("name", synth.scenes())
def test_shipped_scenes_explain_themselves(name: str) -> None:
    told = explain(load_scene(synth.scene_path(name)))
    assert told["terms"]["restoring"]
    assert set(told["terms"]).isdisjoint(told["left_out"])
    assert len(told["terms"]) + len(told["left_out"]) == 14


def test_words_of_an_explanation() -> None:
    pendulums = [
        {"label": "1", "period": 1.0, "mass": 0.2, "start": STATE, "escapement": VAN_DER_POL},
        {"label": "2", "period": 1.01, "mass": 0.2, "start": STATE, "knife_edge": {"friction": 0.1, "rate": 0.02}},
    ]
    swell = {"kind": "harmonics", "amplitude": [0.1], "period": [9.0], "axis": "vertical"}
    told = explain(scene({}, pendulums=pendulums, support=BEAM, motion=[swell], recording={"jitter": 0.01}))
    assert told["pendulums"] == "2, periods 1 and 1.01 s"
    assert told["readings"] == "50, one every 0.04 s, off by 0.01 s, for 2 s"
    assert told["terms"] == {
        "restoring": "the full sine",
        "knife edge": "2: friction 0.1 rad s-2, rate 0.02 rad s-1",
        "escapement": "1: van der Pol, 0.06 1/s up to 0.05 rad",
        "yielding support": "elastic beam, system (1), 50 kg on 8000 N/m",
        "vertical motion": "1 harmonic",
    }
    assert told["why"].startswith(
        "vertical motion, knife edge, a van der Pol escapement and an elastic beam: not stiff"
    )
    assert told["instead"] == ("Radau IIA, orders 9 and 13",)
