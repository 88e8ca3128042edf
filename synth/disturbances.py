"""What acts on the pendulums beside the recorded motion: changes of gravity and of the case, and kicks.

With g the true gravity, E the Eotvos effect, b the tilt, W the rate of turn, l a pendulum's length,

    T = period + c (t - t_ref) + D rho/rho0 + drift      at reference gravity
    n^2 = (2 pi/T)^2 (g - E) cos b / g_ref - W^2

and accelerations of the support compare with (g - E) cos b - W^2 l. The turn's `W^2 sin cos` is taken as `W^2 sin`:
within 1e-3 mGal at one degree a second and arcs of 20 mrad. What changes within the record acts as heave does, as a
sum of harmonics that is no part of the recorded z'', so that every propagator knows it:

    theta'' = -(1/l) [(g(t) + z'') sin theta + x'' cos theta]        linear law: -(1/l) [g(t) theta + x'']

Products of two such changes are left out, as those with heave are (below 3e-3 mGal at 100 mGal).

A pitch of the case, in the plane of swing, leaves the pendulums alone. A roll b(t) turns the plane: along it gravity is
`(g + z'') cos b - y'' sin b`, and the pendulum's own turning adds `l b'^2 cos theta`, taken as `l b'^2` of the mean
length (3e-3 mGal at 30 mrad in 6 s). So a roll acts as

    (g + z'') (cos b - 1) - y'' sin b + l b'^2

evaluated at fine even times. A case that follows the apparent vertical leans by -x''/g and -y''/g.

Random kicks are white noise of the angular velocity, as impulses at an even step; knocks, restarts and releases come
at the nearest of these impulses too.

    d theta' = n k dW    becomes    theta' += n k sqrt(h) xi_j  at t = h, 2 h ...,    xi_j normal

At 16 and more impulses a period the walk is that of white noise that begins half a step late: its variances are short
by h/(2 t) of themselves, and the angle lacks less than `0.2 k sqrt(h)`, 5e-9 rad at k = 1e-7. Step and impulses depend
on sampling, seed and label alone: any propagator, in any chunks, gives the same motion.
"""

import functools
import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import LARGEST_CHANGE, Scene, felt_gravity, frequency, period
from data_schemas.scene_motion import GimbalTilt, HarmonicTilt, LinearCourse, SineCourse, Tilt
from data_schemas.scene_pendulum import Clamp, Knock, Release, Restart
from synth.kernels.tide import tide
from synth.motion.harmonic_sum import HarmonicSum, add, harmonics
from synth.motion.tabulated import continued, tabulated
from synth.phase import Floats
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.seeds import generator

_TURN = 1e-2  # rad that the slowest sine of an even change turns over the record
_TIDAL_STEP, _BEYOND = 60.0, 64  # s; steps beyond the record on either side
_EVEN = ((1.0, 1.5), (2.0, -0.3), (3.0, 1.0 / 30.0))
"""Sines c_k sin(k x) that add up to x (1 + x^6/140 ...): 7e-15 of the change at the record's end, rounding 4e-14."""
_A_TURN = 16  # samples of the fastest harmonic of a tilt or an acceleration: of products of two, 8
_MARGIN = 256  # samples beyond the record on either side, where the continuation is rough
_A_PERIOD = 16  # impulses of the fastest pendulum
_BLOCK = 4096  # impulses of one generator


def lifted(
    scene: Scene, change: HarmonicSum | None, transverse: HarmonicSum, vertical: HarmonicSum, end: float
) -> HarmonicSum:
    """The vertical acceleration of the support with all that acts like it, m/s^2; `change` as `gravity_change` says."""
    case, upright = scene.case, math.cos(scene.conditions.tilt or 0.0)  # the share that a tilted plane of swing feels
    changes = [each for each in (change, tidal_change(scene, end)) if each is not None]
    lifts = [vertical, stiffening(scene)]
    lifts += [replace(each, acceleration=upright * each.acceleration) for each in changes]
    if case is not None and case.roll is not None:
        roll = tilt(case.roll, transverse, felt_gravity(scene), end)
        lifts.append(lift_of_roll(scene, roll, transverse, vertical, end))
    return add(each for each in lifts if each is not None)


def stiffening(scene: Scene) -> HarmonicSum | None:
    """A temperature that swings within the record, as the vertical acceleration of the same effect on n^2, m/s^2.

    `n^2 = n0^2 (1 + k s)^-2` with k = c A/T of the mean pendulum, s the sine of the course, to second order in k.
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
    """Mean from t = 0 to `end`, m/s^2."""
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
    step = Fraction(2.0 * math.pi / (_A_TURN * fastest)).limit_denominator(10**6)
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


@dataclass(frozen=True)
class Jump:
    """What is done to a pendulum at an impulse."""

    number: int
    pendulum: int
    angle: float
    rate: float  # rad, of theta and theta'/n: what they become; of a knock, what is added to them
    adds: bool  # Whether it is a knock


@dataclass(frozen=True)
class Kicks:
    """Impulses of all pendulums; impulse `number`, from 0, comes at (number + 1) * step."""

    step: Fraction  # h in s, true time; a multiple or a whole part of the sampling step
    sizes: Floats  # (pendulums,) k sqrt(h), rad: standard deviation of the change of theta'/n
    seed: int
    labels: tuple[str, ...]  # Of the pendulums
    jumps: tuple[Jump, ...] = ()
    held: tuple[tuple[int, float, float, float], ...] = ()  # Pendulum, from when to when, s, at which angle, rad

    def changes(self, first: int, count: int) -> Floats:
        """Of shape (3, pendulums, count): what stays of the state, what is added to theta and to theta'/n, rad."""
        blocks = range(first // _BLOCK, -(-(first + count) // _BLOCK))
        skip = first - blocks.start * _BLOCK
        result = np.zeros((3, self.sizes.size, count))
        result[0] = 1.0
        for row, size, label in zip(result[2], self.sizes.tolist(), self.labels, strict=True):
            if size:
                drawn = np.concatenate([_block(self.seed, label, each) for each in blocks])
                row[:] = size * drawn[skip : skip + count]
        for each in self.jumps:
            at = each.number - first
            if 0 <= at < count:
                kept = 1.0 if each.adds else 0.0
                result[:, each.pendulum, at] = kept, each.angle, kept * result[2, each.pendulum, at] + each.rate
        return result


@functools.lru_cache(maxsize=64)
def _block(seed: int, label: str, number: int) -> Floats:
    return generator(seed, f"kicks {label} {number}").normal(size=_BLOCK)


def kicks(scene: Scene, fastest: float, times: EvenTimes | UnevenTimes) -> Kicks | None:
    """Impulses of a scene at samples' times; `fastest` is its largest n, rad/s; None where no pendulum has any."""
    intensity = np.array([each.kick_intensity for each in scene.pendulums])
    if not intensity.any() and not scene.events:
        return None
    step = _step(times, 2.0 * math.pi / (_A_PERIOD * fastest))
    labels = tuple(each.label for each in scene.pendulums)
    jumps, held = [], []
    for each in scene.events:
        place, angle, rate = labels.index(each.pendulum), 0.0, 0.0
        nearest = max(round(Fraction(each.time) / step) - 1, 0)
        at = float((nearest + 1) * step)
        match each:
            case Knock():
                rate = each.change
            case Restart():
                angle, rate = each.angle, each.angular_velocity / frequency(scene, scene.pendulums[place])
            case Release() | Clamp():
                angle = each.angle
                held.append((place, *((-math.inf, at) if isinstance(each, Release) else (at, math.inf)), angle))
        jumps.append(Jump(nearest, place, angle, rate, isinstance(each, Knock)))
    return Kicks(step, intensity * math.sqrt(step), scene.seed, labels, tuple(jumps), tuple(held))


def _step(times: EvenTimes | UnevenTimes, longest: float) -> Fraction:
    """Of impulses, at most `longest`: so that samples and impulses fall into the same pattern again and again."""
    if isinstance(times, UnevenTimes):
        return Fraction(math.ldexp(1.0, math.frexp(longest / float(times.scale))[1] - 1)) * times.scale
    if times.step > longest:
        return times.step / math.ceil(times.step / Fraction(longest))
    return times.step * math.floor(longest / times.step)
