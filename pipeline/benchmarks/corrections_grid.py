"""Every method on every record of the grids: error against truth, sigma, warm run time, or why it declined."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

from data_schemas.errors import IsochronyError
from data_schemas.scene import Scene
from pipeline.benchmarks.corrections_points import Place, Point, scene
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.progress import progress
from pipeline.benchmarks.trials import outcome
from pipeline.methods import PAIR_METHODS
from pipeline.observation import Observation, observe
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by
from synth import simulate

Row = dict[str, Any]
REPEATS = 3  # timed runs of each method in a full run
_WARM = 660.0  # s: a record that no method declines, so that every kernel is compiled


def measured(places: Sequence[Place], kept: Kept, *, quick: bool) -> Iterator[list[Row]]:
    """Rows of each place, one a method; places that were kept are read, others are computed and kept."""
    warm: set[str] = set()
    for place in progress(places, "corrections", len(places)):
        repeats = 1 if quick else REPEATS
        made = scene(place.point)
        configuration = {"scene": made.model_dump(mode="json"), "repeats": repeats, "methods": list(PAIR_METHODS)}
        rows = kept.get(configuration)
        if rows is None:
            kind = place.point.sampling
            if kind not in warm:
                reduce(scene(replace(Point(), sampling=kind, length=_WARM)), 1)
                warm.add(kind)
            rows = reduce(made, repeats)
            kept.put(configuration, rows)
        yield [_place(place) | row for row in rows]


def _place(place: Place) -> Row:
    value = " x ".join(f"{each:g}" for each in place.value) if isinstance(place.value, tuple) else place.value
    return {"factor": place.factor, "value": value, "unit": place.unit, **asdict(place.point)}


def reduce(made: Scene, repeats: int) -> list[Row]:
    """One row a method; a scene or record that is declined as a whole is declined by each."""
    try:
        seen = observe(simulate(made)[0])
    except IsochronyError as refusal:
        return [_declined(name, str(refusal)) for name in PAIR_METHODS]
    return [_row(name, seen, made.gravity, repeats) for name in PAIR_METHODS]


def _row(name: str, seen: Observation, gravity: float, repeats: int) -> Row:
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        try:
            reduction = reduce_by(name, prepare(seen), 0.0)
        except IsochronyError as refusal:  # the record has no difference to prepare
            return _declined(name, str(refusal))
        taken.append(time.perf_counter() - started)
    found = outcome(reduction, gravity)
    if found.refusal:
        return _declined(name, found.refusal)
    return {
        "method": name,
        "used": reduction.method,
        "error_mgal": float(found.error),
        "sigma_mgal": float(found.sigma),
        "ms": 1e3 * statistics.median(taken),
        "flags": " ".join(found.flags),
        "refused": "",
    }


def _declined(name: str, why: str) -> Row:
    nan = math.nan
    return {"method": name, "used": "", "error_mgal": nan, "sigma_mgal": nan, "ms": nan, "flags": "", "refused": why}
