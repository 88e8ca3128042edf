"""The truth beside a record: what no estimator may read."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from data_schemas.scene import Scene
from synth.march import Course
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock
from synth.recording.observe import described, label_array, root


def reveal(scene: Scene, clock: Clock, plan: Plan, course: Course) -> xr.DataTree:
    """Lay out the truth of a simulated record.

    Returns
    -------
    DataTree
        As `data_schemas` lays it out; theta = free_amplitude * cos(free_phase) + forced to the last digit
        where the pendulums are linear.
    """
    both, one = ("pendulum", "time"), ("pendulum",)
    moves_up = plan.vertical.angular_frequency.size > 0
    interval = float(scene.recording.mark_interval) if scene.recording.marks else scene.recording.gap_interval
    marks = np.arange(0.0, scene.duration, interval) * float(clock.scale)
    variables = {
        "gravity": ((), scene.gravity),
        "frequency": (one, np.array([each.frequency for each in plan.responses])),
        "damping_rate": (one, np.array([each.damping_rate for each in plan.responses])),
        "theta": (both, course.theta),
        **_parts(clock, plan, course),
        "horizontal_acceleration": (("time",), course.horizontal_acceleration),
        **({"vertical_acceleration": (("time",), course.vertical_acceleration)} if moves_up else {}),
        "mark_time": (("mark",), marks),
    }
    whole = root(scene, clock, "truth").assign_attrs(
        {
            "scene": scene.model_dump_json(),
            "seed": scene.seed,
            "propagator": plan.propagator,
            "estimated_error": course.estimated_error,
        }
    )
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    return xr.DataTree.from_dict({"/": whole, "/truth": described("truth", variables, labels)})


def _parts(clock: Clock, plan: Plan, course: Course) -> dict[str, Any]:
    """Free harmonic and forced rest; for the sine law, which does not superpose, what linear pendulums would answer."""
    both = ("pendulum", "time")
    if course.free is None:
        return {"forced": (both, course.slow)}
    amplitude = np.abs(course.free)
    base = np.array([float(each.damped_frequency) for each in plan.responses])[:, None] * clock.true_seconds
    phase = unwrapped_beside(course.free, base)
    return {
        "free_amplitude": (both, amplitude),
        "free_phase": (both, phase),
        "forced": (both, course.theta - amplitude * np.cos(phase)),
    }


def unwrapped_beside(signal: Phasors, base: Floats) -> Floats:
    """Phase of a signal, unwrapped beside a phase that runs nearly as it does.

    The signal's own phase may turn by half a turn between readings; the difference from the base moves
    slowly.

    Parameters
    ----------
    signal : (pendulums, readings)
        Complex.
    base : (pendulums, readings)
        rad
    """
    beside = np.unwrap(np.remainder(np.angle(signal) - base, 2 * np.pi), axis=-1)
    # The whole turns are chosen so that the phase begins within half a turn of zero.
    beside -= 2 * np.pi * np.rint((beside[:, :1] + base[:, :1]) / (2 * np.pi))
    phase: Floats = base + beside
    return phase
