r"""The case of the apparatus: how it tilts, and what that does to the pendulums and to what is read.

A pitch p(t), in the plane of swing, leaves the pendulums alone. A roll b(t) turns the plane about a horizontal axis
through the suspension: along the plane gravity is `(g + z'') cos b - y'' sin b`, and the pendulum's own turning adds
`l b'^2 cos theta`, taken as `l b'^2` of the mean length (3e-3 mGal at 30 mrad in 6 s). So a roll acts as a vertical
acceleration

    (g + z'') (cos b - 1) - y'' sin b + l b'^2

which is evaluated at even times, finely, and continued between them. Both are positive as elongations are: a case that
follows the apparent vertical leans by -x''/g and -y''/g.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np

from data_schemas.scene import Scene
from data_schemas.scene_conditions import felt_gravity, period
from data_schemas.scene_motion import GimbalTilt, HarmonicTilt, Tilt
from synth.motion.harmonic_sum import HarmonicSum, harmonics
from synth.motion.tabulated import continued, tabulated
from synth.phase import Floats
from synth.propagators.times import EvenTimes

_A_PERIOD = 16  # samples of the fastest harmonic of a tilt or an acceleration: of products of two, 8
_MARGIN = 256  # samples beyond the record on either side, where the continuation is rough


def tilt(term: Tilt, acceleration: HarmonicSum, gravity: float, end: float) -> HarmonicSum:
    """Angle of the case, rad.

    Parameters
    ----------
    term
    acceleration
        Of the support along the axis, for a gimbal, m/s^2.
    gravity
        m/s^2
    end
        Until when a table must go, s.
    """
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
    length = (
        scene.reference_gravity * float(np.mean([period(scene, each) for each in scene.pendulums]) / (2 * np.pi)) ** 2
    )
    felt = (felt_gravity(scene) + along) * (np.cos(angle) - 1.0) - across * np.sin(angle) + length * rate**2
    return continued(felt, float(step), late)
