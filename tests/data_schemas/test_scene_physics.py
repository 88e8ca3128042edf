"""Terms of real pendulums, supports that yield, and what must fit together."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from data_schemas.scene import Scene
from data_schemas.scene_fields import one_line

FREE = {"kind": "free", "amplitude": 0.01}
STATE = {"kind": "state", "angle": 0.1}
VAN_DER_POL = {"kind": "van-der-pol", "rate": 0.06, "angle": 0.05}
BEAM = {"kind": "beam", "mass": 50.0, "stiffness": 8000.0}
FRAME = {"kind": "frame", "mass": 5.0, "stiffness": 8000.0}
SWELL = {"kind": "harmonics", "amplitude": [0.1], "period": [9.0]}


def given(pendulum: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {
        "record_id": "one",
        "duration": 10,
        "gravity": 9.81,
        "restoring": "sine",
        "pendulums": [
            {"label": label, "period": period, "start": FREE} | pendulum for label, period in (("1", 1.0), ("2", 1.1))
        ],
    } | changes


def fault(pendulum: dict[str, Any], **changes: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        Scene.model_validate(given(pendulum, **changes))
    said = one_line(caught.value, Scene)
    assert "\n" not in said
    return said


GOOD = [
    ({}, {}),
    ({"quadratic_damping": 0.1, "knife_edge": {"friction": 0.01, "rate": 0.1}, "escapement": VAN_DER_POL}, {}),
    ({"escapement": {"kind": "impulse", "energy": 1e-3, "direction": "rising"}}, {"restoring": "linear"}),
    ({"damping_rate": 1e4, "start": STATE}, {"restoring": "linear"}),
    ({"start": {"kind": "state", "angle": -1000.0}}, {}),
    ({"mass": 0.25}, {"support": BEAM}),
    ({"mass": 0.25}, {"support": FRAME, "motion": [SWELL, SWELL | {"axis": "vertical"}]}),
    ({"mass": 0.25, "escapement": VAN_DER_POL}, {"support": BEAM | {"equations": "reduced"}, "restoring": "linear"}),
    ({}, {"support": {"kind": "board", "coupling": 0.49}, "motion": [{"kind": "still"}]}),
    ({}, {"simulation": {"tolerance": 1e-9, "propagator": "radau"}}),
]


@pytest.mark.parametrize(("pendulum", "changes"), GOOD)
def test_good_scenes_survive_json(pendulum: dict[str, Any], changes: dict[str, Any]) -> None:
    scene = Scene.model_validate(given(pendulum, **changes))
    assert Scene.model_validate_json(scene.model_dump_json()) == scene


def test_left_out_is_absent() -> None:
    scene = Scene.model_validate(given({}))
    first = scene.pendulums[0]
    assert (first.mass, first.knife_edge, first.escapement, first.quadratic_damping) == (None, None, None, 0.0)
    assert scene.support.kind == "fixed"
    assert scene.simulation.tolerance is None
    assert scene.simulation.propagator == "auto"


REDUCED = {"support": BEAM | {"equations": "reduced"}, "restoring": "linear"}
FAULTS = [
    ({}, {"support": BEAM}, "'1' moves the beam it hangs on; give its mass"),
    ({}, {"support": FRAME}, "'1' moves the frame it hangs on; give its mass"),
    ({"mass": 0.0}, {}, "pendulums[0].mass = 0.0: should be greater than 0"),
    ({"mass": 1.0}, {"support": BEAM, "restoring": "linear"}, "set restoring = 'sine'"),
    ({}, {"support": {"kind": "board", "coupling": 0.1}, "restoring": "linear"}, "set restoring = 'sine'"),
    ({}, {"support": {"kind": "board", "coupling": 0.5}}, "make it smaller than 0.5"),
    ({}, {"support": {"kind": "board", "coupling": 0.1}, "motion": [SWELL]}, "choose the kind 'frame'"),
    ({"mass": 1.0, "escapement": VAN_DER_POL}, REDUCED | {"restoring": "sine"}, "set restoring = 'linear'"),
    ({"mass": 1.0}, REDUCED, "give '1' one, or choose equations = 'full'"),
    ({"mass": 1.0, "escapement": VAN_DER_POL, "damping_rate": 0.1}, REDUCED, "take that of '1' away"),
    ({"mass": 1.0, "escapement": VAN_DER_POL}, REDUCED | {"motion": [SWELL]}, "no motion of the ship; remove it"),
    ({"escapement": VAN_DER_POL}, REDUCED, "give its mass"),
    ({"damping_rate": 7.0}, {}, "start it with kind = 'state'"),
    ({"damping_rate": 1e5, "start": STATE}, {}, "pendulums[0].damping_rate = 100000.0"),
    ({"start": {"kind": "state", "angle": 1001.0}}, {}, "pendulums[0].start.angle = 1001.0"),
    ({"escapement": {"kind": "anchor"}}, {}, "pendulums[0].escapement.kind = 'anchor' is none of"),
    ({"escapement": VAN_DER_POL | {"angel": 1}}, {}, "pendulums[0].escapement.angel = 1 is not a known key"),
    ({"escapement": VAN_DER_POL | {"angel": 1}}, {}, "did you mean 'angle'?"),
    ({"knife_edge": {"friction": 0.1}}, {}, "pendulums[0].knife_edge.rate is missing"),
    ({}, {"support": {"kind": "bean"}}, "did you mean 'beam'?"),
    ({}, {"simulation": {"propagator": "euler"}}, "simulation.propagator = 'euler'"),
    ({}, {"simulation": {"tolerance": 0.0}}, "simulation.tolerance = 0.0"),
]


@pytest.mark.parametrize(("pendulum", "changes", "said"), FAULTS)
def test_fault_is_said_in_one_line(pendulum: dict[str, Any], changes: dict[str, Any], said: str) -> None:
    assert said in fault(pendulum, **changes)
