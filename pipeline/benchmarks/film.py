"""Suite `film`: films of every kind exposed, read, and compared with their truth, beside what others read lines with.

The first table: one row a film and reader; errors are normal to the line, px rms. The second: every promise.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from data_schemas.errors import IsochronyError
from pipeline.benchmarks import film_bars
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.film_cases import Case, cases
from pipeline.benchmarks.film_peers import readings
from pipeline.benchmarks.film_scores import Truth, order, own_reading, places
from pipeline.benchmarks.progress import progress

_SECONDS, _QUICK_SECONDS, _WARM_SECONDS = 300.0, 130.0, 70.0

NOTHING: dict[str, Any] = {
    "normal_px": math.nan, "flat_px": math.nan, "accepted": 0.0, "wrong_unflagged": 0.0, "amplitude_bias": math.nan,
    "crossings": 0, "swaps": 0, "flagged": math.nan, "single": math.nan, "mark_px": math.nan, "time_ms": math.nan,
    "slipped": math.nan,
}  # fmt: skip
"""Scores of a film that was refused."""


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a film and reader, then one row a promise.

    Quick: films of two minutes, the ends of each axis, and no promise that needs half an hour of film. With a folder:
    both tables as CSV.
    """
    table: list[dict[str, Any]] = []
    seconds = _QUICK_SECONDS if quick else _SECONDS
    with tempfile.TemporaryDirectory() as temporary:
        _warm_up(Path(temporary) / "case.film.tif")
        for case in progress(list(cases(seconds, quick=quick)), "film"):
            for row in rows_of(case, Path(temporary) / "case.film.tif"):
                table.append(row)
                yield row
        promises = []
        for row in film_bars.rows(Path(temporary), quick=quick):
            promises.append(row)
            yield row
    if folder is not None:
        write(folder / "film.csv", table)
        write(folder / "film-bars.csv", promises)


def _warm_up(path: Path) -> None:
    """Read a short film once, so that no film is charged with what is compiled at first use."""
    import synth
    from pipeline.film.digitise import digitise

    case = next(cases(_WARM_SECONDS, quick=True))
    synth.expose(case.scene, case.film, path, overwrite=True)
    digitise(path)


def rows_of(case: Case, path: Path) -> Iterator[dict[str, Any]]:
    """Rows of one film: the project's reading, then its peers."""
    import synth
    from pipeline.film.digitise import open_film
    from pipeline.film.knowledge import FilmOptions

    tree = synth.expose(case.scene, case.film, path, overwrite=True)
    truth = Truth.of(tree)
    named = {"axis": case.axis, "value": case.value}
    pixels = truth.column.shape[1] * round(case.film.paper_width * case.film.dpi / 25.4)
    started = time.process_time()
    try:
        found = own_reading(path, truth, case.film.mark_interval)
        scores, refusal, spent = found.scores, "", found.seconds
    except IsochronyError as fault:
        scores, refusal, spent = NOTHING, str(fault), time.process_time() - started
    yield {**named, "reader": "isochrony", **scores, "mpx_s": pixels / 1e6 / spent, "refused": refusal}
    scan, _ = open_film(path, None, FilmOptions())
    started = time.process_time()
    for name, position in readings(scan, truth):
        spent = time.process_time() - started
        scored = places(position[order(position, truth)], None, truth)
        yield {**named, "reader": name, **NOTHING, **scored, "mpx_s": pixels / 1e6 / spent, "refused": ""}
        started = time.process_time()
