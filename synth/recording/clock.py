"""When readings are taken, and what the chronometer says of it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth.phase import Floats, Integers
from synth.propagators.even import EvenTimes
from synth.propagators.uneven import UnevenTimes
from synth.seeds import generator

_DAY = 86_400


@dataclass(frozen=True)
class Clock:
    """Moments of the readings.

    Attributes
    ----------
    seconds : (readings,) float64
        By the chronometer, as recorded; strictly increasing.
    kept : (readings,) int64 or slice
        Which of the propagator's moments these are: readings that are absent are left out afterwards.
    times : EvenTimes or UnevenTimes
        The propagator's moments, in true time.
    scale : Fraction
        True time over the chronometer's.
    """

    seconds: Floats
    kept: Integers | slice
    times: EvenTimes | UnevenTimes
    scale: Fraction

    @property
    def true_seconds(self) -> Floats:
        """True time of the readings, s."""
        return self.seconds * float(self.scale)


def true_time_scale(rate: float) -> Fraction:
    """True time over that of a chronometer which loses `rate` seconds a day.

    Examples
    --------
    >>> float(true_time_scale(86.4))
    1.001
    """
    return 1 + Fraction(str(rate)) / _DAY


def set_clock(scene: Scene) -> Clock:
    """Moments of a scene's readings: 0, step, 2 step ... by the chronometer, less those dropped.

    Raises
    ------
    SceneError
        If no reading is left.
    """
    recording = scene.recording
    scale = true_time_scale(recording.chronometer_rate)
    step, count = recording.step, scene.count
    dropped = round(recording.drop_fraction * count)
    if dropped >= count:
        raise SceneError("recording.drop_fraction: no reading is left; lower it or lengthen the duration")
    kept: Integers | slice = slice(None)
    if dropped:
        kept = np.sort(generator(scene.seed, "drop").permutation(count)[dropped:])
    seconds = (np.arange(count) * step.numerator / step.denominator)[kept]
    if not recording.jitter:
        return Clock(seconds, kept, EvenTimes(step * scale, count), scale)
    off = generator(scene.seed, "jitter").normal(scale=recording.jitter, size=count)[kept]
    # Readings may overtake each other: what counts is when they were taken, so they are put in order.
    # A reading before the start is taken as long after it.
    seconds = np.unique(np.abs(seconds + off))
    return Clock(seconds, slice(None), UnevenTimes(seconds, scale), scale)
