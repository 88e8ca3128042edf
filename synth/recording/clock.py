"""When readings are taken, and what the chronometer says of it."""

from __future__ import annotations

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
_MOST = 1 << 19  # values a variable and portion: 4 MiB
_FEWEST, _LARGEST = 1 << 13, 1 << 16  # readings a portion; the largest is a chunk of a file
_UNEVEN = 2  # how many times fewer they are at uneven moments, which take the values of 28 polynomials each


@dataclass(frozen=True)
class Clock:
    """Moments of the readings, or of a portion of them."""

    times: EvenTimes | UnevenTimes  # The propagator's moments, in true time
    kept: Integers | slice
    """(readings,) which of the propagator's moments are recorded: readings that are absent are left out afterwards."""
    scale: Fraction  # True time over the chronometer's
    begin: int = 0  # Readings before the first of these

    @property
    def count(self) -> int:
        """Number of readings."""
        return self.times.count if isinstance(self.kept, slice) else self.kept.size

    @cached_property
    def seconds(self) -> Floats:
        """Time of the readings by the chronometer, (readings,), as recorded; strictly increasing, s."""
        if isinstance(self.times, UnevenTimes):
            return self.times.seconds
        step = self.times.step / self.scale
        index = np.arange(self.times.first, self.times.first + self.times.count)
        seconds: Floats = (index * step.numerator / step.denominator)[self.kept]
        return seconds

    @property
    def true_seconds(self) -> Floats:
        """True time of the readings, s."""
        return self.seconds * float(self.scale)

    @property
    def true_end(self) -> float:
        """True time of the last reading, s."""
        last = self.times.count - 1 if isinstance(self.kept, slice) else int(self.kept[-1])
        return float(Clock(self.times.stretch(last, last + 1), slice(None), self.scale).true_seconds[0])

    def portions(self, rows: int) -> Iterator[Clock]:
        """The same moments in portions of bounded size, in order of time; a portion may record nothing.

        There are `rows` values to a moment. A scene always falls into the same portions: hence the same bits.
        """
        size = min(max(1 << (_MOST // rows).bit_length() - 1, _FEWEST), _LARGEST)
        if isinstance(self.times, UnevenTimes):
            size //= _UNEVEN
        for begin in range(0, self.times.count, size):
            end, first, kept = min(begin + size, self.times.count), begin, self.kept
            if not isinstance(kept, slice):
                first, last = np.searchsorted(kept, [begin, end]).tolist()
                kept = kept[first:last] - begin
            yield Clock(self.times.stretch(begin, end), kept, self.scale, first)


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

    Even readings without a gap are only counted, not listed; others take a few numbers a reading.

    `SceneError` if no reading is left.
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
