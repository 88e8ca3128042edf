"""The record: what an instrument would have written down of the motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import Contents, Entry, Group
from data_schemas.layouts import Kind, root_attributes
from data_schemas.scene import Scene
from data_schemas.scene_recording import Accelerometer
from data_schemas.variables import attributes
from synth.conditions import stated
from synth.march import Course
from synth.recording.apparatus import Apparatus, stamps
from synth.recording.clock import Clock
from synth.recording.defects import Defects


def observe(scene: Scene, clock: Clock, course: Course, apparatus: Apparatus, defects: Defects) -> Contents:
    """Record a motion, or a portion of it.

    Parameters
    ----------
    scene
        Its recording says how.
    clock
        Moments of the readings.
    course
        Angles and accelerations at those moments.
    apparatus, defects
        Of the whole recording; portions must come in order of time.

    Returns
    -------
    Contents
        A record as `data_schemas` lays it out.
    """
    combination = np.array(
        [[trace.combination.get(each.label, 0.0) for each in scene.pendulums] for trace in scene.traces]
    )
    readings, flags = defects.readings(apparatus.elongations(course, clock), clock.seconds)
    record: dict[str, Any] = {
        "combination": (("trace", "pendulum"), combination),
        "elongation": (("trace", "time"), readings),
    }
    states_noise = scene.recording.record_uncertainty
    if states_noise if states_noise is not None else scene.recording.noise > 0:
        record["elongation_uncertainty"] = (("trace",), np.full(len(scene.traces), scene.recording.noise))
    if defects.lose_any:
        record["elongation_qc"] = (("trace", "time"), flags)
    record |= apparatus.beside(course, clock)
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    traces = {"trace": label_array(each.name for each in scene.traces)}
    restoring = {"restoring": scene.restoring} if scene.recording.write_restoring else {}
    return {
        "": root(scene, clock, "record", {}),
        "record": described("record", record, traces | labels, reference(scene)),
        "instrument": described(
            "instrument", _instrument(scene) | stated(scene, clock.true_seconds), labels, restoring | _frame(scene)
        ),
    }


def _instrument(scene: Scene) -> dict[str, Any]:
    instrument: dict[str, Any] = {
        "period": (("pendulum",), np.array([each.period for each in scene.pendulums])),
        "reference_gravity": ((), scene.reference_gravity),
    }
    if scene.recording.write_damping:
        instrument["damping_rate"] = (
            ("pendulum",),
            np.array([each.damping_rate for each in scene.pendulums]),
        )
    return instrument


def reference(scene: Scene) -> dict[str, str]:
    """What elongations are measured from, where a case tilts."""
    return {} if scene.case is None else {"reference": scene.case.reference}


def _frame(scene: Scene) -> dict[str, str]:
    how = scene.recording.horizontal_acceleration
    return {"acceleration_frame": how.frame} if isinstance(how, Accelerometer) else {}


def root(scene: Scene, clock: Clock, kind: Kind, attrs: dict[str, Any]) -> Group:
    """Time and the attributes of the whole, for a record or a truth; `attrs` are further ones."""
    time = attributes("time") | {"units": f"seconds since {scene.start_time}"}
    return Group(
        {
            **root_attributes(kind, scene.record_id),
            "title": scene.title,
            "history": history(scene),
            "source": "model",
            **attrs,
        },
        {"time": Entry(("time",), stamps(scene, clock.seconds) if kind == "record" else clock.seconds, time)},
    )


def history(scene: Scene) -> str:
    """What files say of where they come from."""
    return f"simulated from the scene {scene.record_id!r} with seed {scene.seed}"


def described(
    group: str, variables: dict[str, Any], labels: dict[str, Any], attrs: Mapping[str, Any] = MappingProxyType({})
) -> Group:
    """Variables of a group, each with its unit and meaning, labels first."""
    named = {name: ((name,), data) for name, data in labels.items()} | variables
    return Group(
        dict(attrs),
        {name: Entry(dims, np.asarray(data), attributes(f"{group}/{name}")) for name, (dims, data) in named.items()},
    )


def label_array(names: Iterable[str]) -> NDArray[np.str_]:
    """Labels as text."""
    return np.array(list(names), dtype=np.str_)
