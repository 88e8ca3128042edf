"""What becomes of perfect readings: noise, false readings, rounding, and what is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene import Scene
from data_schemas.variables_record import ELONGATION_FLAGS
from synth.phase import Floats
from synth.seeds import generator

Flags = NDArray[np.uint16]


def disturbed(readings: Floats, scene: Scene) -> Floats:
    """Add noise and false readings, then round.

    Parameters
    ----------
    readings : (traces, readings)
        rad; changed in place and returned.
    scene
        Its recording says how much of each.
    """
    recording = scene.recording
    for trace, row in zip(scene.traces, readings, strict=True):
        if recording.noise:
            row += generator(scene.seed, f"noise {trace.name}").normal(scale=recording.noise, size=row.size)
        if recording.outliers:
            chance = generator(scene.seed, f"outliers {trace.name}")
            where = chance.permutation(row.size)[: recording.outliers]
            row[where] += recording.outlier_amplitude * chance.choice([-1.0, 1.0], size=where.size)
    if recording.quantisation:
        np.rint(readings / recording.quantisation, out=readings)
        readings *= recording.quantisation
    return readings


def losses(seconds: Floats, scene: Scene) -> Flags:
    """Which readings are lost, and why.

    Parameters
    ----------
    seconds : (readings,)
        By the chronometer.

    Returns
    -------
    (traces, readings) uint16
        Flags of `record/elongation_qc`; zero where the reading stands.
    """
    recording = scene.recording
    flags = np.zeros((len(scene.traces), seconds.size), dtype=np.uint16)
    if recording.mark_gap:
        since_mark = seconds % recording.gap_interval
        flags[:, since_mark < recording.mark_gap] |= ELONGATION_FLAGS["gap"] | ELONGATION_FLAGS["time_mark"]
    for stretch in recording.missing:
        flags[:, (seconds >= stretch.start) & (seconds < stretch.stop)] |= ELONGATION_FLAGS["gap"]
    for trace, row in zip(scene.traces, flags, strict=True):
        chance = generator(scene.seed, f"missing {trace.name}")
        row[chance.permutation(seconds.size)[: recording.missing_samples]] |= ELONGATION_FLAGS["gap"]
    return flags
