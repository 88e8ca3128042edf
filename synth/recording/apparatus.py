"""What the apparatus makes of the motion: tilt, errors of traces, accelerometers and time; defects of the recording."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene import Scene
from data_schemas.scene_recording import Accelerometer, TraceErrors
from data_schemas.variables import ELONGATION_FLAGS
from synth.disturbances import shifted
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats, Integers
from synth.plan import Plan, SampledMotion, propagate
from synth.propagators.times import UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator

Flags = NDArray[np.uint16]
_AXES = ("horizontal_acceleration", "vertical_acceleration")
_GAP, _MARK = ELONGATION_FLAGS["gap"], ELONGATION_FLAGS["time_mark"]


class Apparatus:
    """The apparatus of one record, chunk by chunk in order; chance is drawn for the whole record, trace by trace."""

    def __init__(self, plan: Plan, clock: Clock) -> None:
        scene, recording = plan.scene, plan.scene.recording
        self._scene, self._plan = scene, plan
        delays = {sum(each.delay for each in self._errors(trace.name)) for trace in scene.traces} - {0.0}
        self._late = {delay: _angles_before(plan, clock, delay) for delay in delays}
        self._noise = {name: generator(scene.seed, f"noise of {name}") for name in ("case_tilt", *_AXES)}
        self._chance = [_chance(scene, trace.name, clock.count) for trace in scene.traces]
        self.loses_samples = recording.missing_samples > 0 or any(delay > 0.0 for delay in self._late)
        """Whether any sample is lost; what has no loss has no flags."""
        if not self.loses_samples and (recording.mark_gap or recording.missing):
            self.loses_samples = any(_lost_by_time(part.seconds, scene).any() for part in clock.chunks())

    def samples(self, sampled: SampledMotion, clock: Clock) -> tuple[Floats, Flags]:
        """The traces of a chunk, (traces, samples) rad, NaN where lost; and the flags of `record/elongation_qc`."""
        recording = self._scene.recording
        rows = np.array(list(self._elongations(sampled, clock)))
        flags = np.empty(rows.shape, dtype=np.uint16)
        flags[:] = _lost_by_time(clock.seconds, self._scene)
        flags[np.isnan(rows)] |= _GAP
        ends = [clock.begin, clock.begin + clock.count]
        for trace, chance, row, lost in zip(self._scene.traces, self._chance, rows, flags, strict=True):
            noise, outliers, errors, missing = chance
            if recording.noise:
                row += noise.normal(scale=recording.noise, size=row.size)
            here = slice(*np.searchsorted(outliers, ends))
            row[outliers[here] - clock.begin] += errors[here]
            here = slice(*np.searchsorted(missing, ends))
            lost[missing[here] - clock.begin] |= _GAP
            limits = [each.clip for each in self._errors(trace.name) if each.clip is not None]
            if limits:
                np.clip(row, -min(limits), min(limits), out=row)
        if recording.quantisation:
            rows = np.rint(rows / recording.quantisation) * recording.quantisation
        rows[flags != 0] = np.nan
        return rows, flags

    def _elongations(self, sampled: SampledMotion, clock: Clock) -> Iterator[Floats]:
        """Traces as they would be read without noise; NaN where none has begun."""
        scene, pitch = self._scene, self._plan.pitch
        for trace, weights in zip(scene.traces, combination(scene), strict=True):
            errors = self._errors(trace.name)
            delay = sum(each.delay for each in errors)
            theta = self._late[delay][:, clock.begin : clock.begin + clock.count] if delay else sampled.theta
            row = weights @ theta
            if scene.case is not None and scene.case.reference == "case" and pitch is not None:
                row -= weights.sum() * _at(shifted(pitch, -delay), clock)
            for each in errors:
                row = _misread(each, row, clock.seconds, scene.duration)
            yield row

    def _errors(self, trace: str) -> list[TraceErrors]:
        return [each for each in self._scene.recording.errors if each.trace in (None, trace)]

    def beside(self, sampled: SampledMotion, clock: Clock) -> dict[str, Any]:
        """Accelerations and tilt that the record carries, variables of its group `record`."""
        carried: dict[str, Any] = {}
        for name, motion in zip(_AXES, (self._plan.motion, self._plan.vertical), strict=True):
            how = getattr(self._scene.recording, name)
            if isinstance(how, Accelerometer):
                carried[name] = (("time",), self._accelerometer(name, how, motion, clock))
            elif how:
                carried[name] = (("time",), getattr(sampled, name))
        case, pitch = self._scene.case, self._plan.pitch
        if case is not None and case.write_tilt and pitch is not None:
            noise = self._noise["case_tilt"].normal(size=clock.count)
            carried["case_tilt"] = (("time",), _at(pitch, clock) + case.tilt_noise * noise)
        return carried

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


def _chance(scene: Scene, trace: str, count: int) -> tuple[np.random.Generator, Integers, Floats, Integers]:
    """What befalls one trace: its noise as it comes; its outliers, increasing, and their sizes; what is missing."""
    recording = scene.recording

    def some(chance: np.random.Generator, number: int) -> Integers:
        return chance.permutation(count)[:number] if number else np.empty(0, dtype=np.int64)

    noise, signs, losses = (generator(scene.seed, f"{name} {trace}") for name in ("noise", "outliers", "missing"))
    where = some(signs, recording.outliers)
    errors = recording.outlier_amplitude * signs.choice([-1.0, 1.0], size=where.size)
    order = np.argsort(where)
    return noise, where[order], errors[order], np.sort(some(losses, recording.missing_samples))


def combination(scene: Scene) -> Floats:
    """Weight of each pendulum in each trace, (traces, pendulums)."""
    return np.array([[trace.combination.get(each.label, 0.0) for each in scene.pendulums] for trace in scene.traces])


def stamps(scene: Scene, seconds: Floats) -> Floats:
    """Times as the record has them, (samples,), s."""
    recording = scene.recording
    stamped = seconds
    for step in recording.clock_steps:
        stamped = stamped + step.size * (seconds >= step.time)
    if recording.wow is not None:
        turn = 2.0 * np.pi / recording.wow.period
        stamped = stamped + recording.wow.amplitude * np.sin(turn * seconds + recording.wow.phase)
    return stamped


def _misread(errors: TraceErrors, angle: Floats, seconds: Floats, duration: float) -> Floats:
    """What a trace shows of an angle, (samples,), rad; see `TraceErrors`."""
    shown = np.tan(errors.lever * angle) / errors.lever if errors.lever else angle
    shown = (1.0 + errors.scale) * (shown + errors.cubic * angle**3) + errors.zero
    shown = shown + errors.drift * (seconds / duration - 0.5)
    for step in errors.steps:
        shown = shown + step.size * (seconds >= step.time)
    return np.asarray(shown)


def _lost_by_time(seconds: Floats, scene: Scene) -> Flags:
    """Flags (samples,) of what is lost in all traces at once: time marks and whole stretches."""
    recording = scene.recording
    flags = np.zeros(seconds.size, dtype=np.uint16)
    if recording.mark_gap:
        flags[seconds % recording.gap_interval < recording.mark_gap] |= _GAP | _MARK
    for stretch in recording.missing:
        flags[(seconds >= stretch.start) & (seconds < stretch.stop)] |= _GAP
    return flags


def _at(motion: HarmonicSum, clock: Clock) -> Floats:
    return clock.times.acceleration(motion)[clock.kept]


def _angles_before(plan: Plan, clock: Clock, delay: float) -> Floats:
    """Angles of all samples at a time earlier by a delay, (pendulums, samples); NaN before the start."""
    seconds = np.concatenate([part.seconds for part in clock.chunks()]) - delay / float(clock.scale)
    begins = int(np.searchsorted(seconds, 0.0))
    earlier = Clock(UnevenTimes(seconds[begins:], clock.scale), slice(None), clock.scale)
    moved = replace(plan, times=earlier.times, planes=tuple(replace(each, times=earlier.times) for each in plan.planes))
    angles = [sampled.theta for _, sampled in propagate(moved, earlier)]
    return np.hstack([np.full((len(plan.frequencies), begins), np.nan), *angles])
