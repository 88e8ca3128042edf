"""The project's own reading of a film, scored against its truth."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.variables_record import ELONGATION_FLAGS
from pipeline.benchmarks.film_scores import Truth, marks, order, places, ratio, timing
from pipeline.film.digitise import read
from pipeline.film.reading import Reading

_DOUBT = sum(ELONGATION_FLAGS[name] for name in ("lost", "ambiguous", "single_direction", "outlier"))
_NOT_READ = ELONGATION_FLAGS["lost"] | ELONGATION_FLAGS["ambiguous"]


@dataclass(frozen=True)
class OwnReading:
    """A reading, its scores, CPU s."""

    reading: Reading
    scores: dict[str, Any]
    seconds: float


def own_reading(path: str | os.PathLike[str], truth: Truth, interval: float) -> OwnReading:
    """Read a film as `digitise` does, with its description beside it, and score it.

    A time axis that found no minute's code counts from an arbitrary mark, and says so: it is right up to a shift by
    whole marks. One that shifts on the way has slipped.

    Raises
    ------
    IsochronyError
        It declines.
    """
    started = time.process_time()
    found, _ = read(path)
    spent = time.process_time() - started
    names = order(found.tracks.position, truth)
    qc, lit = found.tracks.qc[names], np.isfinite(truth.column)
    scores = places(found.tracks.position[names], (qc & _DOUBT) != 0, truth)
    shift, error, worst = timing(found.axis.seconds, truth, interval)
    scores |= {
        "flagged": ratio((((qc & _NOT_READ) != 0) & lit).sum(), lit.sum()),
        "single": ratio((((qc & ELONGATION_FLAGS["single_direction"]) != 0) & lit).sum(), lit.sum()),
        "mark_px": marks(found.axis.index, found.axis.row_of_trace[names], shift, interval, truth),
        "time_ms": 1e3 * error,
        "slipped": float(not worst < 0.5 * interval),
    }
    return OwnReading(found, scores, spent)
