"""What the apparatus makes of the motion: tilt of the case, errors of traces, of accelerometers and of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from data_schemas.scene import Scene
from data_schemas.scene_recording import Accelerometer, TraceErrors
from synth.lift import shifted
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats
from synth.plan import Plan
from synth.propagate import Trajectory, propagate
from synth.propagators.times import UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator


class Apparatus:
    """The apparatus of one record, given its whole clock; chunk by chunk, in order of time."""

    def __init__(self, plan: Plan, clock: Clock) -> None:
        self._scene, self._plan = plan.scene, plan
        self._late = {
            delay: _angles_before(plan, clock, delay)
            for delay in dict.fromkeys(each.delay for each in plan.scene.recording.errors if each.delay)
        }
        self._noise = {name: generator(plan.scene.seed, f"noise of {name}") for name in ("case_tilt", *_AXES)}

    def elongations(self, trajectory: Trajectory, clock: Clock) -> Floats:
        """Traces as they would be read without noise, (traces, samples), rad; NaN where none has begun."""
        scene = self._scene
        rows = []
        for trace, weights in zip(scene.traces, combination(scene), strict=True):
            errors = _of(scene.recording.errors, trace.name)
            delay = sum(each.delay for each in errors)
            theta = self._late[delay][:, clock.begin : clock.begin + clock.count] if delay else trajectory.theta
            row = weights @ theta
            if scene.case is not None and scene.case.reference == "case" and self._plan.pitch is not None:
                row -= weights.sum() * _at(shifted(self._plan.pitch, -delay), clock)
            for each in errors:
                row = misread(each, row, clock.seconds, scene.duration)
            rows.append(row)
        return np.array(rows)

    def beside(self, trajectory: Trajectory, clock: Clock) -> dict[str, Any]:
        """Accelerations and tilt that the record carries, variables of its group `record`."""
        found: dict[str, Any] = {}
        for name, motion in zip(_AXES, (self._plan.motion, self._plan.vertical), strict=True):
            how = getattr(self._scene.recording, name)
            if isinstance(how, Accelerometer):
                found[name] = (("time",), self._accelerometer(name, how, motion, clock))
            elif how:
                found[name] = (("time",), getattr(trajectory, name))
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


def combination(scene: Scene) -> Floats:
    """Weight of each pendulum in each trace, (traces, pendulums)."""
    return np.array([[trace.combination.get(each.label, 0.0) for each in scene.pendulums] for trace in scene.traces])


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


def limits(scene: Scene) -> list[float]:
    """Largest elongation that each trace shows, rad."""
    shown = [_of(scene.recording.errors, trace.name) for trace in scene.traces]
    return [min((each.clip for each in errors if each.clip is not None), default=np.inf) for errors in shown]


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
    angles = [trajectory.theta for _, trajectory in propagate(moved, earlier)]
    return np.hstack([np.full((len(plan.frequencies), begins), np.nan), *angles])
