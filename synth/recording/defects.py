"""What becomes of perfect samples: noise, outliers, rounding, and what is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene import Scene
from data_schemas.variables_record import ELONGATION_FLAGS
from synth.phase import Floats, Integers
from synth.recording.apparatus import limits
from synth.recording.clock import Clock
from synth.seeds import generator

Flags = NDArray[np.uint16]


@dataclass(frozen=True)
class _Chance:
    """What befalls one trace: its noise as it comes, and which samples are outliers or missing, increasing."""

    noise: np.random.Generator | None
    outliers: Integers
    errors: Floats
    missing: Integers


class Defects:
    """The defects of one recording, applied to its samples chunk by chunk, in order of time.

    Chance is drawn for the whole record, trace by trace, so that it does not depend on the chunks.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        recording = scene.recording
        self._scene = scene
        self._traces = [_chance(scene, trace.name, clock.count) for trace in scene.traces]
        self.lose_any = recording.missing_samples > 0 or any(each.delay > 0.0 for each in recording.errors)
        """Whether any sample is lost; what has no loss has no flags."""
        if not self.lose_any and (recording.mark_gap or recording.missing):
            self.lose_any = any(bool(_lost_by_time(part.seconds, scene).any()) for part in clock.portions(1))

    def samples(self, perfect: Floats, clock: Clock) -> tuple[Floats, Flags]:
        """The samples of a chunk, (traces, samples) rad, with noise and outliers, rounded, NaN where lost.

        The perfect ones are changed in place and returned, with the flags of `record/elongation_qc`; zero where a
        sample stands.
        """
        recording = self._scene.recording
        flags = np.empty(perfect.shape, dtype=np.uint16)
        flags[:] = _lost_by_time(clock.seconds, self._scene)
        flags[np.isnan(perfect)] |= ELONGATION_FLAGS["gap"]
        ends = [clock.begin, clock.begin + clock.count]
        for chance, row, lost, limit in zip(self._traces, perfect, flags, limits(self._scene), strict=True):
            if chance.noise is not None:
                row += chance.noise.normal(scale=recording.noise, size=row.size)
            here = slice(*np.searchsorted(chance.outliers, ends))
            row[chance.outliers[here] - clock.begin] += chance.errors[here]
            here = slice(*np.searchsorted(chance.missing, ends))
            lost[chance.missing[here] - clock.begin] |= ELONGATION_FLAGS["gap"]
            np.clip(row, -limit, limit, out=row)
        if recording.quantisation:
            np.rint(perfect / recording.quantisation, out=perfect)
            perfect *= recording.quantisation
        perfect[flags != 0] = np.nan
        return perfect, flags


def _chance(scene: Scene, trace: str, count: int) -> _Chance:
    recording = scene.recording
    noise, signs = (generator(scene.seed, f"{name} {trace}") for name in ("noise", "outliers"))
    where = _some(signs, recording.outliers, count)
    errors = recording.outlier_amplitude * signs.choice([-1.0, 1.0], size=where.size)
    order = np.argsort(where)
    missing = np.sort(_some(generator(scene.seed, f"missing {trace}"), recording.missing_samples, count))
    return _Chance(noise if recording.noise else None, where[order], errors[order], missing)


def _some(chance: np.random.Generator, number: int, count: int) -> Integers:
    """A number of samples of all."""
    return chance.permutation(count)[:number] if number else np.empty(0, dtype=np.int64)


def _lost_by_time(seconds: Floats, scene: Scene) -> Flags:
    """Flags (readings,) of what is lost in all traces at once: time marks and whole stretches."""
    recording = scene.recording
    flags = np.zeros(seconds.size, dtype=np.uint16)
    if recording.mark_gap:
        since_mark = seconds % recording.gap_interval
        flags[since_mark < recording.mark_gap] |= ELONGATION_FLAGS["gap"] | ELONGATION_FLAGS["time_mark"]
    for stretch in recording.missing:
        flags[(seconds >= stretch.start) & (seconds < stretch.stop)] |= ELONGATION_FLAGS["gap"]
    return flags
