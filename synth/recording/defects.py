"""What becomes of perfect readings: noise, false readings, rounding, and what is lost."""

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
    """What befalls one trace: its noise as it comes, and which readings are false or missing, increasing."""

    noise: np.random.Generator | None
    false: Integers
    errors: Floats
    missing: Integers


class Defects:
    """The defects of one recording, applied to its readings portion by portion, in order of time.

    Chance is drawn for the whole record, trace by trace, so that it does not depend on the portions.

    Parameters
    ----------
    scene
        Its recording says how much of each.
    clock
        Of the whole record.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene = scene
        self._done = 0
        self._limits = limits(scene).tolist()
        self._traces = [_chance(scene, trace.name, clock.count) for trace in scene.traces]
        self.lose_any = self._lose_any(clock)
        """Whether any reading is lost; what has no loss has no flags."""

    def _lose_any(self, clock: Clock) -> bool:
        recording = self._scene.recording
        if any(each.delay > 0.0 for each in recording.errors):
            return True
        if not (recording.mark_gap or recording.missing):
            return recording.missing_samples > 0
        return recording.missing_samples > 0 or any(
            bool(_lost_by_time(part.seconds, self._scene).any()) for part in clock.portions(1)
        )

    def readings(self, perfect: Floats, seconds: Floats) -> tuple[Floats, Flags]:
        """The next readings, with noise and false ones, rounded, NaN where lost.

        Parameters
        ----------
        perfect : (traces, readings)
            rad; changed in place and returned.
        seconds : (readings,)
            By the chronometer.

        Returns
        -------
        readings : (traces, readings) float64
            rad
        flags : (traces, readings) uint16
            Flags of `record/elongation_qc`; zero where the reading stands.
        """
        recording = self._scene.recording
        begin, self._done = self._done, self._done + seconds.size
        flags = np.empty(perfect.shape, dtype=np.uint16)
        flags[:] = _lost_by_time(seconds, self._scene)
        flags[np.isnan(perfect)] |= ELONGATION_FLAGS["gap"]
        for chance, row, lost, limit in zip(self._traces, perfect, flags, self._limits, strict=True):
            if chance.noise is not None:
                row += chance.noise.normal(scale=recording.noise, size=row.size)
            here = slice(*np.searchsorted(chance.false, [begin, self._done]).tolist())
            row[chance.false[here] - begin] += chance.errors[here]
            here = slice(*np.searchsorted(chance.missing, [begin, self._done]).tolist())
            lost[chance.missing[here] - begin] |= ELONGATION_FLAGS["gap"]
            np.clip(row, -limit, limit, out=row)
        if recording.quantisation:
            np.rint(perfect / recording.quantisation, out=perfect)
            perfect *= recording.quantisation
        perfect[flags != 0] = np.nan
        return perfect, flags


def _chance(scene: Scene, trace: str, count: int) -> _Chance:
    recording = scene.recording
    false, errors, missing = np.empty(0, dtype=np.int64), np.empty(0), np.empty(0, dtype=np.int64)
    if recording.outliers:
        chance = generator(scene.seed, f"outliers {trace}")
        where = chance.permutation(count)[: recording.outliers]
        signs = chance.choice([-1.0, 1.0], size=where.size)
        order = np.argsort(where)
        false, errors = where[order], recording.outlier_amplitude * signs[order]
    if recording.missing_samples:
        missing = np.sort(generator(scene.seed, f"missing {trace}").permutation(count)[: recording.missing_samples])
    return _Chance(generator(scene.seed, f"noise {trace}") if recording.noise else None, false, errors, missing)


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
