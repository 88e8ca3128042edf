"""What acts on the pendulums as a vertical acceleration does, but is no part of the recorded z'': sums of harmonics.

With g the true gravity, E the Eotvos effect, b the tilt, W the rate of turn, l a pendulum's length,

    T = period + c (t - t_ref) + D rho/rho0 + drift      at reference gravity
    n^2 = (2 pi/T)^2 (g - E) cos b / g_ref - W^2

and accelerations of the support, as they act in the tilted plane, compare with (g - E) cos b - W^2 l. The turn's
`W^2 sin cos` is taken as `W^2 sin`: within 1e-3 mGal at one degree a second and arcs of 20 mrad. What changes within
the record acts as heave does,

    theta'' = -(1/l) [(g(t) + z'') sin theta + x'' cos theta]        linear law: -(1/l) [g(t) theta + x'']

so every propagator that knows heave knows it. Products of two such changes are left out, as those with heave are (below
3e-3 mGal at 100 mGal).

A pitch p(t) of the case, in the plane of swing, leaves the pendulums alone. A roll b(t) turns the plane about a
horizontal axis through the suspension: along the plane gravity is `(g + z'') cos b - y'' sin b`, and the pendulum's own
turning adds `l b'^2 cos theta`, taken as `l b'^2` of the mean length (3e-3 mGal at 30 mrad in 6 s). So a roll acts as

    (g + z'') (cos b - 1) - y'' sin b + l b'^2

which is evaluated at even times, finely, and continued between them. Both are positive as elongations are: a case that
follows the apparent vertical leans by -x''/g and -y''/g.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import LARGEST_CHANGE, Scene, felt_gravity, period
from data_schemas.scene_motion import GimbalTilt, HarmonicTilt, LinearCourse, SineCourse, Tilt
from synth.kernels.tide import tide
from synth.motion.harmonic_sum import HarmonicSum, harmonics
from synth.motion.tabulated import continued, tabulated
from synth.phase import Floats
from synth.propagators.times import EvenTimes

_TURN = 1e-2  # rad that the slowest sine of an even change turns over the record
_TIDAL_STEP, _BEYOND = 60.0, 64  # s; steps beyond the record on either side
_EVEN = ((1.0, 1.5), (2.0, -0.3), (3.0, 1.0 / 30.0))
"""Sines c_k sin(k x) that add up to x (1 + x^6/140 ...): 7e-15 of the change at the record's end, rounding 4e-14."""
_A_PERIOD = 16  # samples of the fastest harmonic of a tilt or an acceleration: of products of two, 8
_MARGIN = 256  # samples beyond the record on either side, where the continuation is rough


def stiffening(scene: Scene) -> HarmonicSum | None:
    """A temperature that swings within the record, as the vertical acceleration that would change n^2 alike, m/s^2.

    `n^2 = n0^2 (1 + k s)^-2` with k = c A/T of the mean pendulum, s the sine of the course, to second order in k: the
    third is 1e-11.
    """
    given = scene.conditions
    if not given.temperature_amplitude:
        return None
    shares = [each.temperature_coefficient / period(scene, each) for each in scene.pendulums]
    k = given.temperature_amplitude * float(np.mean(shares))
    gravity, turn, phase = felt_gravity(scene), 2.0 * math.pi / given.temperature_period, given.temperature_phase
    # -2 k sin(x) + 3 k^2 sin(x)^2
    phases = np.array([phase + 0.5 * math.pi, 0.0, 2.0 * phase])
    sizes = np.array([2.0 * k * gravity, 1.5 * k**2 * gravity, -1.5 * k**2 * gravity])
    return HarmonicSum(np.array([turn, 0.0, 2.0 * turn]), sizes * np.exp(1j * phases))


def gravity_change(scene: Scene, end: float) -> HarmonicSum | None:
    """What is added to the scene's gravity until the last sample, m/s^2; None where gravity is constant.

    `SceneError` if the table of a course cannot be read, does not cover the record, or changes gravity too much.
    """
    course = scene.gravity_course
    match course:
        case None:
            return None
        case LinearCourse():
            base = _TURN / max(end, 1.0)
            orders, sizes = np.array(_EVEN).T
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


def tilt(term: Tilt, acceleration: HarmonicSum, gravity: float, end: float) -> HarmonicSum:
    """Angle of the case until `end`, rad; a gimbal follows the acceleration of the support along its axis, m/s^2."""
    match term:
        case GimbalTilt():
            own, w = 2.0 * math.pi / term.period, acceleration.angular_frequency
            follows = own**2 / (own**2 - w**2 + 2j * term.damping * own * w)
            return replace(acceleration, acceleration=-follows * acceleration.acceleration / gravity)
        case HarmonicTilt():
            return harmonics(term)
    return tabulated(term, end)


def shifted(motion: HarmonicSum, seconds: float) -> HarmonicSum:
    """The same, as it is so much later."""
    turned = np.exp(1j * motion.angular_frequency * seconds)
    return replace(motion, acceleration=motion.acceleration * turned)


def lift_of_roll(
    scene: Scene, roll: HarmonicSum, transverse: HarmonicSum, vertical: HarmonicSum, end: float
) -> HarmonicSum:
    """What acts on pendulums in a rolling plane as a vertical acceleration does, m/s^2."""
    parts = (roll, transverse, vertical)
    fastest = max(float(np.max(each.angular_frequency, initial=0.1)) for each in parts)
    step = Fraction(2.0 * math.pi / (_A_PERIOD * fastest)).limit_denominator(10**6)
    late = float(step) * _MARGIN
    times = EvenTimes(step, math.ceil(end / step) + 2 * _MARGIN)

    def at(motion: HarmonicSum) -> Floats:
        return times.acceleration(shifted(motion, -late))

    angle, across, along = (at(each) for each in parts)
    rate = at(replace(roll, acceleration=1j * roll.angular_frequency * roll.acceleration))
    mean = float(np.mean([period(scene, each) for each in scene.pendulums]) / (2 * np.pi))
    length = scene.reference_gravity * mean**2
    felt = (felt_gravity(scene) + along) * (np.cos(angle) - 1.0) - across * np.sin(angle) + length * rate**2
    return continued(felt, float(step), late)
