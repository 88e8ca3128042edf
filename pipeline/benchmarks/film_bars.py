"""Promises of the film: accuracy, marks, speed, memory, and the way from a scene to gravity and back."""

from __future__ import annotations

import math
import statistics
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import IsochronyError
from data_schemas.scene_film import Film
from pipeline.benchmarks import film_hard
from pipeline.benchmarks.bar import Row, at_least, at_most, holds, not_measured
from pipeline.benchmarks.clock import tree_environment
from pipeline.benchmarks.film_cases import GRAIN, crossing, scene
from pipeline.benchmarks.film_own import OwnReading, own_reading
from pipeline.benchmarks.film_peers import ROUTE
from pipeline.benchmarks.film_scores import Truth, phase, rms
from pipeline.gravity import MGAL

_HALF_HOUR = 1800.0
_PERIOD = 1.00966
_FEW, _MANY = 3_000, 60_000  # rows


def rows(table: Sequence[dict[str, Any]], folder: Path, *, quick: bool) -> Iterator[Row]:
    """Yield every promise; those that need half an hour of film are left out when quick.

    Parameters
    ----------
    table
        The rows of the suite's films.
    folder : Path
        For films.
    """
    if quick:
        yield not_measured(
            "films of half an hour: accuracy, marks, phase, gravity, speed, memory", "", "the full run makes them"
        )
        return
    yield from film_hard.rows(folder)
    speeds: list[float] = []
    yield from _accuracy(folder, speeds)
    yield from _speed(speeds, table)
    yield from _marks(folder)
    for name, limit in (("typical", 1.0), ("historic-slow", 5.0)):
        yield from _gravity(name, limit, folder)
    for what, growth in memory_growth(folder).items():
        yield at_most(f"{what}: memory grown from {_FEW} to {_MANY} rows", growth, 50.0, "MiB")


def _speed(speeds: Sequence[float], table: Sequence[dict[str, Any]]) -> Iterator[Row]:
    """Of the films of half an hour, and times that of the cheapest path on films of 300 dpi and 5 mm/s."""
    usual = [row for row in table if row["axis"] in ("grain", "traces apart, mm", "marks missing")]
    others = [row["mpx_s"] for row in usual if row["reader"] == ROUTE]
    speed = statistics.median(speeds) if speeds else math.nan
    yield at_least("speed of all of digitise, one core", speed, 10.0, "Mpx per CPU second")
    if others:
        yield at_least(f"times faster than {ROUTE}", speed / statistics.median(others), 20.0)
    else:
        yield not_measured(f"times faster than {ROUTE}", ">= 20", "not installed: extra 'peers'")


def _exposed(film: Film, folder: Path) -> tuple[Path, Truth]:
    import synth

    path = folder / "bar.film.tif"
    return path, Truth.of(synth.expose(scene(_HALF_HOUR), film, path, overwrite=True))


def _accuracy(folder: Path, speeds: list[float]) -> Iterator[Row]:
    """Of films with a grain of 0.05; the speeds at which they were read are appended, Mpx per CPU s."""
    for words, film, accepted in (
        ("traces apart", Film(grain=GRAIN), 0.83),
        ("traces crossing, 8 mm apart", crossing(8.0), 0.78),
        ("traces crossing, resting at one place", crossing(0.0), 0.78),
    ):
        path, truth = _exposed(film, folder)
        try:
            found = own_reading(path, truth, film.mark_interval)
        except IsochronyError as fault:
            yield holds(f"{words}: read ({fault})", False, "read")
            continue
        scores = found.scores
        speeds.append(found.reading.scan.rows * found.reading.scan.columns / 1e6 / found.seconds)
        yield at_most(f"{words}: normal error", scores["normal_px"], 0.20, "px rms")
        yield at_most(f"{words}: normal error of flat parts", scores["flat_px"], 0.22, "px rms")
        yield at_most(f"{words}: amplitude bias", abs(scores["amplitude_bias"]), 1e-3)
        yield at_most(f"{words}: mark position on one trace", scores["mark_px"], 0.20, "px rms")
        yield at_least(f"{words}: slices accepted", scores["accepted"], accepted)
        yield at_most(f"{words}: slices flagged", scores["flagged"], 0.01)
        yield at_most(f"{words}: single direction", scores["single"], 0.02)
        yield at_most(f"{words}: wrong and unflagged", scores["wrong_unflagged"], 1e-4)
        if scores["crossings"]:
            yield at_least(f"{words}: crossings met", scores["crossings"], 1000)
            yield at_most(f"{words}: swaps", scores["swaps"], 0)
        yield from _phases(words, found, truth)


def _phases(words: str, found: OwnReading, truth: Truth) -> Iterator[Row]:
    """Phase of the difference, by either reading."""
    from pipeline.film.normal_points import normal_points
    from pipeline.film.reading import at_marks

    reading, trace = found.reading, len(truth.column) - 1
    errors = {}
    for name, samples in (
        ("strobe", at_marks(reading.strobe, reading.axis)),
        ("continuous", normal_points(reading.tracks, reading.axis, 25.0)),
    ):
        each = phase(samples.time - found.shift, samples.column[found.names[trace]], trace, truth, _PERIOD)
        errors[name] = 1e3 * rms(each[np.isfinite(each)])
    yield at_most(f"{words}: phase of the difference per 30 s, strobe", errors["strobe"], 5.0, "mrad rms")
    yield at_most(f"{words}: continuous over strobe", errors["continuous"] / errors["strobe"], 2.0)


def _marks(folder: Path) -> Iterator[Row]:
    """No slip of the index, or the film is refused."""
    for words, film in (
        ("20 % of marks missing, 20 false", Film(grain=GRAIN, missing_marks=0.2, spurious_marks=20)),
        ("25 % missing, wow 3 %, skew 0.5 degrees", Film(grain=GRAIN, missing_marks=0.25, wow=0.03, skew=0.5)),
    ):
        path, truth = _exposed(film, folder)
        try:
            slipped, what = bool(own_reading(path, truth, film.mark_interval).scores["slipped"]), "read"
        except IsochronyError:
            slipped, what = False, "refused"
        yield holds(f"{words}: no slip ({what})", not slipped, "no slip, or refused")


def _gravity(name: str, limit: float, folder: Path) -> Iterator[Row]:
    """From a scene to film to gravity."""
    import synth
    from pipeline.film.digitise import digitise
    from pipeline.processing import process

    path, course = folder / "bar.film.tif", scene(_HALF_HOUR)
    synth.expose_to(course, name, path, overwrite=True)
    try:
        result = process(digitise(path))
    except IsochronyError as fault:
        yield holds(f"{name} film of 30 minutes to gravity: refused ({fault})", False, f"within {limit:g} mGal")
        return
    error = abs(float(result["gravity"].dataset["gravity"].values[0]) - course.gravity) / MGAL
    sigma = float(result["gravity"].dataset["gravity_sigma"].values[0])
    yield at_most(f"{name} film of 30 minutes: gravity", error, limit, "mGal")
    yield at_most(f"{name} film of 30 minutes: gravity over its 95 % interval", error / (1.96 * sigma), 1.0)


def memory_growth(folder: Path) -> dict[str, float]:
    """How much more memory a long film takes than a short one, to expose and to read, MiB; each in its own process."""
    film = Film()
    path = folder / "memory.film.tif"
    peaks: dict[str, list[float]] = {"expose": [], "digitise": []}
    for count in (_FEW, _FEW, _MANY):  # the first compiles, which takes memory of its own
        seconds = (count * 25.4 / film.dpi - 2 * film.margin) / film.speed
        for what, found in peaks.items():
            words = [sys.executable, "-m", "pipeline.benchmarks.film_probe", what, str(path), str(seconds)]
            done = subprocess.run(words, env=tree_environment(), check=True, capture_output=True, text=True)
            found.append(float(done.stdout))
    return {what: long - short for what, (_, short, long) in peaks.items()}
