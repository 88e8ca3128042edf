"""What the apparatus makes of the motion: tilt of the case, errors of traces, of accelerometers and of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from data_schemas.scene_recording import Accelerometer, TraceErrors
from synth.case import shifted
from synth.march import Course, march
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats
from synth.plan import Plan
from synth.propagators.times import UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator


class Apparatus:
    """The apparatus of one record, portion by portion, in order of time.

    Parameters
    ----------
    scene, plan
    clock
        Of the whole record.
    """

    def __init__(self, scene: Scene, plan: Plan, clock: Clock) -> None:
        self._scene, self._plan = scene, plan
        self._done = 0
        self._late = {
            delay: _angles_before(plan, clock, delay)
            for delay in dict.fromkeys(each.delay for each in scene.recording.errors if each.delay)
        }
        self._noise = {name: generator(scene.seed, f"noise of {name}") for name in ("case_tilt", *_AXES)}

    def elongations(self, course: Course, clock: Clock) -> Floats:
        """Traces as they would be read without noise, (traces, readings), rad; NaN where none has begun."""
        scene = self._scene
        begin, self._done = self._done, self._done + clock.count
        errors = {trace.name: _of(scene.recording.errors, trace.name) for trace in scene.traces}
        rows = []
        for trace in scene.traces:
            delay = sum(each.delay for each in errors[trace.name])
            theta = self._late[delay][:, begin : self._done] if delay else course.theta
            weights = np.array([trace.combination.get(each.label, 0.0) for each in scene.pendulums])
            row = weights @ theta
            if scene.case is not None and scene.case.reference == "case" and self._plan.pitch is not None:
                row -= weights.sum() * _at(shifted(self._plan.pitch, -delay), clock)
            for each in errors[trace.name]:
                row = misread(each, row, clock.seconds, scene.duration)
            rows.append(row)
        return np.array(rows)

    def beside(self, course: Course, clock: Clock) -> dict[str, Any]:
        """Accelerations and tilt that the record carries, variables of its group `record`."""
        found: dict[str, Any] = {}
        for name, motion in zip(_AXES, (self._plan.motion, self._plan.vertical), strict=True):
            how = getattr(self._scene.recording, name)
            if isinstance(how, Accelerometer):
                found[name] = (("time",), self._accelerometer(name, how, motion, clock))
            elif how:
                found[name] = (("time",), getattr(course, name))
        case, pitch = self._scene.case, self._plan.pitch
        if case is not None and case.write_tilt and pitch is not None:
            noise = self._noise["case_tilt"].normal(size=clock.count)
            found["case_tilt"] = (("time",), _at(pitch, clock) + case.tilt_noise * noise)
        return found

    def _accelerometer(self, name: str, how: Accelerometer, motion: HarmonicSum, clock: Clock) -> Floats:
        value = _at(shifted(motion, -how.delay), clock)
        if name == _AXES[0] and how.frame == "case" and self._plan.pitch is not None:
            tilted = _at(shifted(self._plan.pitch, -how.delay), clock)
            along = self._plan.gravity + _at(shifted(self._plan.vertical, -how.delay), clock)
            value = value * np.cos(tilted) + along * np.sin(tilted)
        value = (1.0 + how.scale) * value + how.bias + how.noise * self._noise[name].normal(size=clock.count)
        for begin, end in how.missing:
            value[(clock.seconds >= begin) & (clock.seconds < end)] = np.nan
        return value


_AXES = ("horizontal_acceleration", "vertical_acceleration")


def stamps(scene: Scene, seconds: Floats) -> Floats:
    """Times as the record has them, (readings,), s."""
    recording = scene.recording
    stamped = seconds
    for step in recording.clock_steps:
        stamped = stamped + step.size * (seconds >= step.time)
    if recording.wow is not None:
        turn = 2.0 * np.pi / recording.wow.period
        stamped = stamped + recording.wow.amplitude * np.sin(turn * seconds + recording.wow.phase)
    return stamped


def limits(scene: Scene) -> Floats:
    """Largest elongation that each trace shows, (traces,), rad."""
    return np.array(
        [
            min(
                (each.clip for each in _of(scene.recording.errors, trace.name) if each.clip is not None), default=np.inf
            )
            for trace in scene.traces
        ]
    )


def misread(errors: TraceErrors, angle: Floats, seconds: Floats, duration: float) -> Floats:
    """What a trace shows of an angle, (readings,), rad; see `TraceErrors`."""
    shown = np.tan(errors.lever * angle) / errors.lever if errors.lever else angle
    shown = (1.0 + errors.scale) * (shown + errors.cubic * angle**3) + errors.zero
    shown = shown + errors.drift * (seconds / duration - 0.5)
    for step in errors.steps:
        shown = shown + step.size * (seconds >= step.time)
    return np.asarray(shown)


def _of(errors: Iterable[TraceErrors], trace: str) -> list[TraceErrors]:
    return [each for each in errors if each.trace in (None, trace)]


def _at(motion: HarmonicSum, clock: Clock) -> Floats:
    return clock.times.acceleration(motion)[clock.kept]


def _angles_before(plan: Plan, clock: Clock, delay: float) -> Floats:
    """Angles of all readings at a time earlier by a delay, (pendulums, readings); NaN before the start."""
    seconds = np.concatenate([part.seconds for part in clock.portions(1)]) - delay / float(clock.scale)
    begins = int(np.searchsorted(seconds, 0.0))
    earlier = Clock(UnevenTimes(seconds[begins:], clock.scale), slice(None), clock.scale)
    moved = replace(plan, times=earlier.times, planes=tuple(replace(each, times=earlier.times) for each in plan.planes))
    found = [course.theta for _, course in march(moved, earlier)]
    return np.hstack([np.full((len(plan.frequencies), begins), np.nan), *found])
