"""The record: what an instrument would have written down of the motion."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from data_schemas.layouts import CONVENTIONS, LAYOUTS, VERSION, Kind
from data_schemas.scene import Scene
from data_schemas.variables import attributes
from synth.march import Course
from synth.recording.clock import Clock
from synth.recording.defects import disturbed, losses


def observe(scene: Scene, clock: Clock, course: Course) -> xr.DataTree:
    """Record a motion.

    Parameters
    ----------
    scene
        Its recording says how.
    clock
        Moments of the readings.
    course
        Angles and accelerations at those moments.

    Returns
    -------
    DataTree
        A record as `data_schemas` lays it out.
    """
    combination = np.array(
        [[trace.combination.get(each.label, 0.0) for each in scene.pendulums] for trace in scene.traces]
    )
    readings = disturbed(combination @ course.theta, scene)
    flags = losses(clock.seconds, scene)
    readings[flags != 0] = np.nan
    record: dict[str, Any] = {
        "combination": (("trace", "pendulum"), combination),
        "elongation": (("trace", "time"), readings),
    }
    states_noise = scene.recording.record_uncertainty
    if states_noise if states_noise is not None else scene.recording.noise > 0:
        record["elongation_uncertainty"] = (("trace",), np.full(len(scene.traces), scene.recording.noise))
    if np.any(flags):
        record["elongation_qc"] = (("trace", "time"), flags)
    if scene.recording.horizontal_acceleration:
        record["horizontal_acceleration"] = (("time",), course.horizontal_acceleration)
    if scene.recording.vertical_acceleration:
        record["vertical_acceleration"] = (("time",), course.vertical_acceleration)
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    traces = {"trace": label_array(each.name for each in scene.traces)}
    return xr.DataTree.from_dict(
        {
            "/": root(scene, clock, "record"),
            "/record": described("record", record, traces | labels),
            "/instrument": described("instrument", _instrument(scene), labels).assign_attrs(
                {"restoring": scene.restoring} if scene.recording.write_restoring else {}
            ),
        }
    )


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
    if scene.recording.chronometer_rate:
        instrument["chronometer_rate"] = ((), scene.recording.chronometer_rate)
    return instrument


def root(scene: Scene, clock: Clock, kind: Kind) -> xr.Dataset:
    """Time and the attributes of the whole, for a record or a truth."""
    time = attributes("time") | {"units": f"seconds since {scene.start_time}"}
    return xr.Dataset(
        coords={"time": ("time", clock.seconds, time)},
        attrs={
            "Conventions": CONVENTIONS,
            "schema": LAYOUTS[kind].schema,
            "schema_version": VERSION,
            "record_id": scene.record_id,
            "title": scene.title,
            "history": f"simulated from the scene {scene.record_id!r} with seed {scene.seed}",
            "source": "model",
        },
    )


def described(group: str, variables: dict[str, Any], labels: dict[str, Any]) -> xr.Dataset:
    """Dataset of a group, every variable with its unit and meaning."""
    return xr.Dataset(
        {name: (dims, data, attributes(f"{group}/{name}")) for name, (dims, data) in variables.items()},
        coords={name: (name, data, attributes(f"{group}/{name}")) for name, data in labels.items()},
    )


def label_array(names: Iterable[str]) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Labels as text of any length."""
    return np.array(list(names), dtype=object)
