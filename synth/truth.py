"""The truth beside a record: what no estimator may read."""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.contents import Contents
from data_schemas.scene import Scene
from data_schemas.scene_conditions import frequency
from synth.march import Course
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock
from synth.recording.observe import described, label_array, root


def reveal(scene: Scene, clock: Clock, plan: Plan, course: Course, unwrapped: Unwrapping) -> Contents:
    """Lay out the truth of a simulated record, or of a portion of it; portions must come in order of time.

    Returns
    -------
    Contents
        As `data_schemas` lays it out; theta = free_amplitude * cos(free_phase) + forced to the last digit
        where the pendulums are linear.
    """
    both, one = ("pendulum", "time"), ("pendulum",)
    moves_up = plan.vertical.angular_frequency.size > 0
    interval = float(scene.recording.mark_interval) if scene.recording.marks else scene.recording.gap_interval
    yielded = course.support_displacement
    changed = course.gravity_change
    at_mean = scene.model_copy(update={"gravity": scene.gravity + plan.mean_change})
    kicked = np.array([each.kick_intensity for each in scene.pendulums])
    marks = np.arange(0.0, scene.duration, interval) * float(clock.scale)
    pitch = None if plan.pitch is None else clock.times.acceleration(plan.pitch)[clock.kept]
    events = [] if plan.kicks is None else [float((each.number + 1) * plan.kicks.step) for each in plan.kicks.jumps]
    variables = {
        "gravity": ((), at_mean.gravity),
        **({"gravity_course": (("time",), scene.gravity + changed)} if changed is not None else {}),
        "frequency": (one, np.array([frequency(at_mean, each) for each in scene.pendulums])),
        "damping_rate": (one, np.array(plan.damping_rates)),
        **({"kick_intensity": (one, kicked)} if kicked.any() else {}),
        "theta": (both, course.theta),
        **_parts(clock, plan, course, unwrapped),
        "horizontal_acceleration": (("time",), course.horizontal_acceleration),
        **({"vertical_acceleration": (("time",), course.vertical_acceleration)} if moves_up else {}),
        **({"support_displacement": (("time",), yielded)} if yielded is not None else {}),
        **({"case_pitch": (("time",), pitch)} if pitch is not None else {}),
        **({"event_time": (("event",), np.array(events))} if events else {}),
        "mark_time": (("mark",), marks),
    }
    whole = root(
        scene,
        clock,
        "truth",
        {
            "scene": scene.model_dump_json(),
            "seed": scene.seed,
            "propagator": course.propagator,
            "estimated_error": course.estimated_error,
            **({"tolerance": plan.tolerance} if plan.tolerance is not None else {}),
            **({"caution": plan.caution} if plan.caution is not None else {}),
        },
    )
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    return {"": whole, "truth": described("truth", variables, labels)}


def _parts(clock: Clock, plan: Plan, course: Course, unwrapped: Unwrapping) -> dict[str, Any]:
    """Free harmonic and forced rest; where motions do not superpose, what linear pendulums would answer, if known."""
    both = ("pendulum", "time")
    if course.free is None:
        return {"forced": (both, course.slow)} if course.slow is not None else {}
    amplitude = np.abs(course.free)
    base = np.array([float(each.damped_frequency) for each in plan.responses])[:, None] * clock.true_seconds
    phase = unwrapped(course.free, base)
    return {
        "free_amplitude": (both, amplitude),
        "free_phase": (both, phase),
        "forced": (both, course.theta - amplitude * np.cos(phase)),
    }


_TURN = 2 * np.pi


class Unwrapping:
    """Unwraps portion after portion, in order of time, as if the signal had come whole.

    The signal's own phase may turn by half a turn between readings; the difference from the base moves slowly. The
    turns of that difference are counted in whole numbers, which do not depend on the portions.

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
        """Phase of the next portion, (pendulums, readings), rad.

        Parameters
        ----------
        signal : (pendulums, readings) complex128
        base : (pendulums, readings) float64
            rad
        """
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
