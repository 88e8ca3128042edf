"""Promises of the film: accuracy, speed, hard films, and the way from a scene to gravity and back."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator
from pathlib import Path

from data_schemas.errors import IsochronyError
from data_schemas.scene_film import Film
from pipeline.benchmarks.bar import Row, at_least, at_most, holds, not_measured
from pipeline.benchmarks.film_cases import GRAIN, crossing, hard_films, scene
from pipeline.benchmarks.film_scores import Truth, own_reading
from pipeline.benchmarks.progress import progress
from pipeline.gravity import MGAL

HALF_HOUR, HARD_SECONDS = 1800.0, 300.0
MOST_WRONG = 1e-4
_LEAST_READ = 0.5  # of the rows; a film of which less is read counts as not read


def rows(folder: Path, *, quick: bool) -> Iterator[Row]:
    """Yield every promise; those that need half an hour of film are left out when quick. The folder is for films."""
    if quick:
        yield not_measured("films of half an hour: accuracy, gravity, speed", "", "the full run makes them")
        return
    yield from hard(folder)
    yield from _accuracy(folder)
    for name, limit in (("typical", 1.0), ("historic-slow", 5.0)):
        yield from _gravity(name, limit, folder)


def hard(folder: Path) -> Iterator[Row]:
    """One row a hard film, and how many were read."""
    read = 0
    for name, film in progress(hard_films(HARD_SECONDS).items(), "hard films"):
        path, truth = _exposed(film, folder, HARD_SECONDS)
        try:
            scores = own_reading(path, truth, film.mark_interval).scores
        except IsochronyError:
            yield holds(f"{name}: refused", True, "read or refused")
            continue
        is_right = scores["wrong_unflagged"] <= MOST_WRONG and not scores["slipped"]
        read += bool(is_right and scores["accepted"] >= _LEAST_READ)
        words = f"{scores['accepted']:.0%} of rows read, {scores['wrong_unflagged']:.1e} wrong"
        yield holds(f"{name}: {words}", bool(is_right), "read or refused")
    yield at_least("hard films that were read", read, 5)


def _exposed(film: Film, folder: Path, seconds: float = HALF_HOUR) -> tuple[Path, Truth]:
    import synth

    path = folder / "bar.film.tif"
    return path, Truth.of(synth.expose(scene(seconds), film, path, overwrite=True))


def _accuracy(folder: Path) -> Iterator[Row]:
    """Of films with a grain of 0.05, and the speed of reading them."""
    speeds = []
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
        yield at_most(f"{words}: wrong and unflagged", scores["wrong_unflagged"], MOST_WRONG)
        if scores["crossings"]:
            yield at_least(f"{words}: crossings met", scores["crossings"], 1000)
            yield at_most(f"{words}: swaps", scores["swaps"], 0)
    speed = statistics.median(speeds) if speeds else math.nan
    yield at_least("speed of all of digitise, one core", speed, 10.0, "Mpx per CPU second")


def _gravity(name: str, limit: float, folder: Path) -> Iterator[Row]:
    """From a scene to film to gravity."""
    import synth
    from pipeline.film.digitise import digitise
    from pipeline.processing import process

    path, course = folder / "bar.film.tif", scene(HALF_HOUR)
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
