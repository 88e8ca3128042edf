r"""Random kicks of each pendulum: white noise of the angular velocity, as impulses at an even step.

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

from data_schemas.scene import Scene
from synth.phase import Floats
from synth.propagators.even import EvenTimes
from synth.propagators.uneven import UnevenTimes
from synth.seeds import generator

_A_PERIOD = 16  # impulses of the fastest pendulum
_BLOCK = 4096  # impulses of one generator


@dataclass(frozen=True)
class Kicks:
    """Impulses of all pendulums; impulse `number`, from 0, comes at (number + 1) * step.

    Attributes
    ----------
    step : Fraction
        h in s, true time; a multiple or a whole part of the sampling step.
    sizes : (pendulums,) float64
        k sqrt(h), rad: standard deviation of the change of theta'/n.
    seed : int
    labels : tuple of str
        Of the pendulums.
    """

    step: Fraction
    sizes: Floats
    seed: int
    labels: tuple[str, ...]

    def some(self, first: int, count: int) -> Floats:
        """Changes of theta'/n by `count` impulses from the `first`, (pendulums, count) rad."""
        blocks = range(first // _BLOCK, -(-(first + count) // _BLOCK))
        skip = first - blocks.start * _BLOCK
        rows = [
            size * np.concatenate([_block(self.seed, label, each) for each in blocks])[skip : skip + count]
            if size
            else np.zeros(count)
            for size, label in zip(self.sizes.tolist(), self.labels, strict=True)
        ]
        return np.array(rows)


@functools.lru_cache(maxsize=64)
def _block(seed: int, label: str, number: int) -> Floats:
    return generator(seed, f"kicks {label} {number}").normal(size=_BLOCK)


def kicks(scene: Scene, fastest: float, times: EvenTimes | UnevenTimes) -> Kicks | None:
    """Impulses of a scene; None where no pendulum has any.

    Parameters
    ----------
    scene
    fastest
        Largest n, rad/s.
    times
        Of the samples; none before t = 0.
    """
    intensity = np.array([each.kick_intensity for each in scene.pendulums])
    if not intensity.any():
        return None
    step = _step(times, 2.0 * math.pi / (_A_PERIOD * fastest))
    return Kicks(step, intensity * math.sqrt(step), scene.seed, tuple(each.label for each in scene.pendulums))


def _step(times: EvenTimes | UnevenTimes, longest: float) -> Fraction:
    """Of impulses, at most `longest`: so that samples and impulses fall into the same pattern again and again."""
    if isinstance(times, UnevenTimes):
        return Fraction(math.ldexp(1.0, math.frexp(longest / float(times.scale))[1] - 1)) * times.scale
    if times.step > longest:
        return times.step / math.ceil(times.step / Fraction(longest))
    return times.step * math.floor(longest / times.step)
