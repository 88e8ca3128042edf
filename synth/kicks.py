r"""Random kicks of each pendulum: white noise of the angular velocity, as impulses at an even step.

What is done to a pendulum by hand comes at the nearest of these impulses too: a knock, a restart, a release.

    d theta' = n k dW    becomes    theta' += n k sqrt(h) xi_j  at t = h, 2 h ...,    xi_j normal

At 16 and more impulses a period the walk of amplitude and phase is that of white noise that begins half a step late:
its variances are short by h/(2 t) of themselves, and between two impulses the angle lacks less than `0.2 k sqrt(h)`,
5e-9 rad at k = 1e-7. The step depends on the sampling and the fastest pendulum alone, an impulse on the seed, the
pendulum's label and its number: any propagator, in any chunks, gives the same motion.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from data_schemas.scene import Scene, frequency
from data_schemas.scene_pendulum import Clamp, Knock, Release, Restart
from synth.phase import Floats
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.seeds import generator

_A_PERIOD = 16  # impulses of the fastest pendulum
_BLOCK = 4096  # impulses of one generator


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

    def changes(self, first: int, count: int) -> Floats:
        """By `count` impulses from the `first`: what stays of the state, what is added to theta and to theta'/n.

        Returns
        -------
        (3, pendulums, count) float64
            1, rad, rad
        """
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
    """Impulses of a scene whose largest n is `fastest`, rad/s; None where no pendulum has any.

    The times are those of the samples; none lies before t = 0.
    """
    intensity = np.array([each.kick_intensity for each in scene.pendulums])
    if not intensity.any() and not scene.events:
        return None
    step = _step(times, 2.0 * math.pi / (_A_PERIOD * fastest))
    labels = tuple(each.label for each in scene.pendulums)
    jumps = []
    for each in scene.events:
        place, angle, rate = labels.index(each.pendulum), 0.0, 0.0
        match each:
            case Knock():
                rate = each.change
            case Restart():
                angle, rate = each.angle, each.angular_velocity / frequency(scene, scene.pendulums[place])
            case Release() | Clamp():
                angle = each.angle
        nearest = max(round(Fraction(each.time) / step) - 1, 0)
        jumps.append(Jump(nearest, place, angle, rate, isinstance(each, Knock)))
    return Kicks(step, intensity * math.sqrt(step), scene.seed, labels, tuple(jumps))


def held(scene: Scene, kicks: Kicks | None) -> list[tuple[int, float, float, float]]:
    """Pendulums that are held: which, from when to when, s, and at which angle, rad."""
    spans = []
    for event, jump in zip(scene.events, kicks.jumps if kicks is not None else (), strict=True):
        if isinstance(event, Release | Clamp) and kicks is not None:
            at = float((jump.number + 1) * kicks.step)
            begin, end = (-math.inf, at) if isinstance(event, Release) else (at, math.inf)
            spans.append((jump.pendulum, begin, end, jump.angle))
    return spans


def _step(times: EvenTimes | UnevenTimes, longest: float) -> Fraction:
    """Of impulses, at most `longest`: so that samples and impulses fall into the same pattern again and again."""
    if isinstance(times, UnevenTimes):
        return Fraction(math.ldexp(1.0, math.frexp(longest / float(times.scale))[1] - 1)) * times.scale
    if times.step > longest:
        return times.step / math.ceil(times.step / Fraction(longest))
    return times.step * math.floor(longest / times.step)
