"""When samples are taken, and what the chronometer says of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth.phase import Floats, Integers
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.seeds import generator

_DAY = 86_400
CHUNK = 1 << 16  # samples that are evaluated at once, as many as in a chunk of a file
_UNEVEN = 2  # how many times fewer they are at uneven moments, which take the values of 28 polynomials each


@dataclass(frozen=True)
class Clock:
    """Moments of the samples, or of a chunk of them."""

    times: EvenTimes | UnevenTimes  # The propagator's moments, in true time
    kept: Integers | slice
    """(samples,) which of the propagator's moments are recorded: absent samples are left out afterwards."""
    scale: Fraction  # True time over the chronometer's
    begin: int = 0  # Samples before the first of these

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.times.count if isinstance(self.kept, slice) else self.kept.size

    @cached_property
    def seconds(self) -> Floats:
        """Time of the samples by the chronometer, (samples,), as recorded; strictly increasing, s."""
        if isinstance(self.times, UnevenTimes):
            return self.times.seconds
        step = self.times.step / self.scale
        index = np.arange(self.times.first, self.times.first + self.times.count)
        seconds: Floats = (index * step.numerator / step.denominator)[self.kept]
        return seconds

    @property
    def true_seconds(self) -> Floats:
        """True time of the samples, s."""
        return self.seconds * float(self.scale)

    @property
    def true_end(self) -> float:
        """True time of the last sample, s."""
        last = self.times.count - 1 if isinstance(self.kept, slice) else int(self.kept[-1])
        return float(Clock(self.times.stretch(last, last + 1), slice(None), self.scale).true_seconds[0])

    def chunks(self) -> Iterator["Clock"]:
        """The same moments in chunks, always the same ones of a scene; a chunk may record nothing."""
        size = CHUNK // _UNEVEN if isinstance(self.times, UnevenTimes) else CHUNK
        for begin in range(0, self.times.count, size):
            end, first, kept = min(begin + size, self.times.count), begin, self.kept
            if not isinstance(kept, slice):
                first, last = np.searchsorted(kept, [begin, end]).tolist()
                kept = kept[first:last] - begin
            yield Clock(self.times.stretch(begin, end), kept, self.scale, first)


def true_time_scale(rate: float) -> Fraction:
    """True time over that of a chronometer which loses `rate` seconds a day."""
    return 1 + Fraction(str(rate)) / _DAY


def set_clock(scene: Scene) -> Clock:
    """Moments of a scene's samples by the chronometer, less those dropped; `SceneError` if no sample is left.

    Even samples without a gap are only counted, not listed; others take a few numbers each.
    """
    recording = scene.recording
    scale = true_time_scale(recording.chronometer_rate)
    count = scene.count
    dropped = round(recording.drop_fraction * count)
    if dropped >= count:
        raise SceneError("recording.drop_fraction: no reading is left; lower it or lengthen the duration")
    kept: Integers | slice = slice(None)
    if dropped:
        kept = np.sort(generator(scene.seed, "drop").permutation(count)[dropped:])
    clock = Clock(EvenTimes(recording.step * scale, count), kept, scale)
    if not recording.jitter:
        return clock
    taken = generator(scene.seed, "jitter").normal(scale=recording.jitter, size=count)[kept]
    # Readings may overtake each other: what counts is when they were taken, so they are put in order.
    # A reading before the start is taken as long after it.
    return Clock(UnevenTimes(np.unique(np.abs(taken + clock.seconds)), scale), slice(None), scale)
