"""Gravity that changes over the record: its change as a sum of harmonics, and the mean.

A change of gravity acts as a vertical acceleration of the support does, but is no part of the recorded z'':

    theta'' = -(1/l) [(g(t) + z'') sin theta + x'' cos theta]        linear law: -(1/l) [g(t) theta + x'']

So every propagator that knows heave knows it. Products with a temperature that changes within the record are left out,
as those of heave are (below 3e-3 mGal at 100 mGal).
"""

from __future__ import annotations

import math

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from data_schemas.scene_conditions import LARGEST_CHANGE, LinearCourse, SineCourse
from synth.kernels.tide import tide
from synth.motion.harmonic_sum import HarmonicSum
from synth.motion.tabulated import continued, tabulated

_TURN = 1e-2  # rad that the slowest sine of an even change turns over the record
_TIDAL_STEP, _BEYOND = 60.0, 64  # s; steps beyond the record on either side
_EVEN = ((1.0, 1.5), (2.0, -0.3), (3.0, 1.0 / 30.0))
"""Sines c_k sin(k x) that add up to x (1 + x^6/140 ...): 7e-15 of the change at the record's end, rounding 4e-14."""


def gravity_change(scene: Scene, end: float) -> HarmonicSum | None:
    """What is added to the scene's gravity, m/s^2; None where gravity is constant.

    `SceneError` if the table of a course cannot be read, does not cover the record, or changes gravity too much.

    Parameters
    ----------
    scene
    end
        True time of the last sample, s.
    """
    course = scene.gravity_course
    match course:
        case None:
            return None
        case LinearCourse():
            base = _TURN / max(end, 1.0)
            orders, sizes = (np.array(column) for column in zip(*_EVEN, strict=True))
            return HarmonicSum(orders * base, -1j * course.rate / base * sizes)
        case SineCourse():
            swing = -1j * course.amplitude * np.exp(1j * course.phase)
            return HarmonicSum(np.array([2.0 * math.pi / course.period]), np.array([swing]))
    change = tabulated(course, end)
    largest = float(np.sqrt(np.sum(np.abs(change.acceleration) ** 2)))
    if largest > LARGEST_CHANGE * scene.gravity:
        raise SceneError(
            f"{course.file}: changes gravity by {largest:.3g} m/s^2, more than {LARGEST_CHANGE:g} of it; give the"
            " change alone, and gravity_course.factor if its unit is not m s-2"
        )
    return change


def tidal_change(scene: Scene, end: float) -> HarmonicSum | None:
    """What the tide adds to gravity, m/s^2; None where none acts."""
    given = scene.conditions
    if not given.tide or given.latitude is None or given.longitude is None:  # the scene sees to the place
        return None
    from datetime import datetime

    start = datetime.fromisoformat(scene.start_time).timestamp()
    times = _TIDAL_STEP * np.arange(-_BEYOND, math.ceil(end / _TIDAL_STEP) + _BEYOND + 1)
    lost = tide(np.asarray(start + times), given.latitude, given.longitude, given.height or 0.0)
    return continued(-lost, _TIDAL_STEP, _BEYOND * _TIDAL_STEP)


def mean_change(change: HarmonicSum, end: float) -> float:
    """Mean from t = 0 to `end`, m/s^2.

    Examples
    --------
    >>> round(mean_change(HarmonicSum(np.array([0.0, 2 * math.pi]), np.array([0.5, 1.0 + 0j])), 3.0), 15)
    0.5
    """
    half = 0.5 * change.angular_frequency * end
    return float(np.sum(change.acceleration * np.exp(1j * half) * np.sinc(half / math.pi)).real)
