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
from data_schemas.scene_apparatus import Accelerometer
from data_schemas.variables import attributes
from synth.propagate import Trajectory
from synth.recording.apparatus import Apparatus, combination, stamps
from synth.recording.clock import Clock
from synth.recording.defects import Defects
from synth.recording.stated import stated


def observe(scene: Scene, clock: Clock, trajectory: Trajectory, apparatus: Apparatus, defects: Defects) -> Contents:
    """Record a trajectory at the moments of a clock, as `data_schemas` lays a record out.

    Apparatus and defects are those of the whole recording; its chunks must come in order of time.
    """
    samples, flags = defects.samples(apparatus.elongations(trajectory, clock), clock)
    record: dict[str, Any] = {
        "combination": (("trace", "pendulum"), combination(scene)),
        "elongation": (("trace", "time"), samples),
    }
    states_noise = scene.recording.record_uncertainty
    if states_noise if states_noise is not None else scene.recording.noise > 0:
        record["elongation_uncertainty"] = (("trace",), np.full(len(scene.traces), scene.recording.noise))
    if defects.lose_any:
        record["elongation_qc"] = (("trace", "time"), flags)
    record |= apparatus.beside(trajectory, clock)
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    traces = {"trace": label_array(each.name for each in scene.traces)}
    measured_from = {} if scene.case is None else {"reference": scene.case.reference}
    instrument: dict[str, Any] = {
        "period": (("pendulum",), np.array([each.period for each in scene.pendulums])),
        "reference_gravity": ((), scene.reference_gravity),
    }
    if scene.recording.write_damping:
        instrument["damping_rate"] = (("pendulum",), np.array([each.damping_rate for each in scene.pendulums]))
    how: dict[str, str] = {"restoring": scene.restoring} if scene.recording.write_restoring else {}
    accelerometer = scene.recording.horizontal_acceleration
    if isinstance(accelerometer, Accelerometer):
        how["acceleration_frame"] = accelerometer.frame
    return {
        "": root(scene, clock, "record", {}),
        "record": described("record", record, traces | labels, measured_from),
        "instrument": described("instrument", instrument | stated(scene, clock.true_seconds), labels, how),
    }


def root(scene: Scene, clock: Clock, kind: Kind, attrs: dict[str, Any]) -> Group:
    """Time and the attributes of the whole, for a record or a truth; `attrs` are further ones."""
    time = attributes("time") | {"units": f"seconds since {scene.start_time}"}
    seconds = stamps(scene, clock.seconds) if kind == "record" else clock.seconds
    said = {"title": scene.title, "history": history(scene), "source": "model"}
    return Group(root_attributes(kind, scene.record_id) | said | attrs, {"time": Entry(("time",), seconds, time)})


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
