"""The truth beside a record: what no estimator may read."""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.contents import Contents
from data_schemas.scene_conditions import frequency
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.propagate import Trajectory
from synth.recording.clock import Clock
from synth.recording.observe import described, label_array, root


def reveal(clock: Clock, plan: Plan, trajectory: Trajectory, unwrapped: Unwrapping) -> Contents:
    """Lay out the truth of a record, or of a chunk of it, as `data_schemas` does; chunks must come in order of time.

    theta = free_amplitude * cos(free_phase) + forced to the last digit where the pendulums are linear.
    """
    scene, both, one, time = plan.scene, ("pendulum", "time"), ("pendulum",), ("time",)
    interval = float(scene.recording.mark_interval) if scene.recording.marks else scene.recording.gap_interval
    at_mean = scene.model_copy(update={"gravity": scene.gravity + plan.mean_change})
    kicked = np.array([each.kick_intensity for each in scene.pendulums])
    variables: dict[str, Any] = {
        "gravity": ((), at_mean.gravity),
        "frequency": (one, np.array([frequency(at_mean, each) for each in scene.pendulums])),
        "damping_rate": (one, np.array([each.damping_rate for each in scene.pendulums])),
        "theta": (both, trajectory.theta),
        "horizontal_acceleration": (time, trajectory.horizontal_acceleration),
        "mark_time": (("mark",), np.arange(0.0, scene.duration, interval) * float(clock.scale)),
    }
    if trajectory.gravity_change is not None:
        variables["gravity_course"] = (time, scene.gravity + trajectory.gravity_change)
    if kicked.any():
        variables["kick_intensity"] = (one, kicked)
    if trajectory.free is not None:
        amplitude = np.abs(trajectory.free)
        base = np.array([float(each.damped_frequency) for each in plan.responses])[:, None] * clock.true_seconds
        phase = unwrapped(trajectory.free, base)
        variables["free_amplitude"], variables["free_phase"] = (both, amplitude), (both, phase)
        variables["forced"] = (both, trajectory.theta - amplitude * np.cos(phase))
    elif trajectory.slow is not None:  # motions do not superpose: what linear pendulums would answer
        variables["forced"] = (both, trajectory.slow)
    if plan.vertical.angular_frequency.size:
        variables["vertical_acceleration"] = (time, trajectory.vertical_acceleration)
    if trajectory.support_displacement is not None:
        variables["support_displacement"] = (time, trajectory.support_displacement)
    if plan.pitch is not None:
        variables["case_pitch"] = (time, clock.times.acceleration(plan.pitch)[clock.kept])
    if plan.kicks is not None and plan.kicks.jumps:
        moments = [float((each.number + 1) * plan.kicks.step) for each in plan.kicks.jumps]
        variables["event_time"] = (("event",), np.array(moments))
    attrs = {
        "scene": scene.model_dump_json(),
        "seed": scene.seed,
        "propagator": trajectory.propagator,
        "estimated_error": trajectory.estimated_error,
    }
    attrs |= {"tolerance": plan.tolerance} if plan.tolerance is not None else {}
    attrs |= {"caution": plan.caution} if plan.caution is not None else {}
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    return {"": root(scene, clock, "truth", attrs), "truth": described("truth", variables, labels)}


_TURN = 2 * np.pi


class Unwrapping:
    """Unwraps chunk after chunk, in order of time, as if the signal had come whole.

    The signal's own phase may turn by half a turn between samples; the difference from the base moves slowly. The
    turns of that difference are counted in whole numbers, which do not depend on the chunks.

    Examples
    --------
    >>> base = np.arange(0.0, 20.0, 2.5)[None]
    >>> unwrapped = Unwrapping()
    >>> halves = [unwrapped(np.exp(0.9j * base[:, half]), base[:, half]) for half in (slice(4), slice(4, None))]
    >>> bool(np.allclose(np.hstack(halves), 0.9 * base))
    True
    """

    def __init__(self) -> None:
        self._last: Floats | None = None
        self._turns: Floats | None = None

    def __call__(self, signal: Phasors, base: Floats) -> Floats:
        """Phase of the next chunk of a signal, (pendulums, samples) rad; so is the base."""
        beside = np.remainder(np.angle(signal) - base, _TURN)
        if not beside.size:
            return beside
        if self._last is None or self._turns is None:
            self._last = beside[:, :1]
            # The whole turns are chosen so that the phase begins within half a turn of zero.
            self._turns = -np.rint((beside[:, :1] + base[:, :1]) / _TURN)
        turns = self._turns - np.cumsum(np.rint(np.diff(beside, prepend=self._last) / _TURN), axis=-1)
        self._last, self._turns = beside[:, -1:].copy(), turns[:, -1:].copy()
        turns *= _TURN
        beside += turns
        beside += base
        return beside
