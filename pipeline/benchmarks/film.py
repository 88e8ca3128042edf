"""Suite `film`: films of every kind exposed, read, and compared with their truth, beside what others read lines with.

One row a film and reader, errors normal to the line, px rms; then every promise.
"""

import math
import statistics
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import synth
from data_schemas.errors import IsochronyError
from data_schemas.scene import Scene, load_scene
from data_schemas.scene_recording import Dimming, Film, Stretch
from pipeline.benchmarks.film_scores import Truth, own_reading, peers
from pipeline.benchmarks.tables import Row, at_least, at_most, holds, not_measured, progress
from pipeline.conditions import MGAL
from pipeline.film.digitise import digitise
from pipeline.processing import process

GRAIN = 0.05
MIDDLE = 63.5  # mm, of the paper
HALF_HOUR, HARD_SECONDS = 1800.0, 300.0
MOST_WRONG = 1e-4
_LEAST_READ = 0.5  # of the rows; a film of which less is read counts as not read
_SECONDS, _QUICK_SECONDS, _WARM_SECONDS = 300.0, 130.0, 70.0

NOTHING: Row = {
    "normal_px": math.nan, "flat_px": math.nan, "accepted": 0.0, "wrong_unflagged": 0.0, "amplitude_bias": math.nan,
    "crossings": 0, "swaps": 0,
    **dict.fromkeys(("flagged", "single", "mark_px", "time_ms", "slipped", "mpx_s"), math.nan),
}  # fmt: skip
"""Scores of a film that was refused."""


class Case(NamedTuple):
    """One film: which property is varied, what it is here, and what that makes."""

    axis: str
    value: float
    scene: Scene
    film: Film


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield a row a film and reader, then a row a promise; quick: two minutes, ends of axes, none of half an hour."""
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "case.film.tif"
        short = next(cases(_WARM_SECONDS, quick=True))  # no film is charged with what is compiled at first use
        synth.expose(short.scene, short.film, path)
        digitise(path)
        for case in progress(list(cases(_QUICK_SECONDS if quick else _SECONDS, quick=quick)), "film"):
            yield from rows_of(case, path)
        if quick:
            yield not_measured("films of half an hour: accuracy, gravity, speed", "", "the full run makes them")
            return
        yield from hard(path)
        yield from _accuracy(path)
        for name, limit in (("typical", 1.0), ("historic-slow", 5.0)):
            yield from _gravity(name, limit, path)


def rows_of(case: Case, path: Path) -> Iterator[Row]:
    """Rows of one film: the project's reading, then its peers."""
    truth, scores, refusal = _read(case.film, path, case.scene)
    named = {"axis": case.axis, "value": case.value}
    yield named | {"reader": "isochrony"} | NOTHING | scores | {"refused": refusal}
    for name, scores in peers(path, truth):
        yield named | {"reader": name} | NOTHING | scores | {"refused": ""}


def scene(seconds: float) -> Scene:
    """The shipped scene of the films, of some length."""
    return load_scene(synth.scene_path("film")).model_copy(update={"duration": seconds})


def crossing(apart: float, **parts: Any) -> Film:
    """A film whose two traces rest so many mm apart."""
    places = [{"name": name, "position": MIDDLE + side * apart} for name, side in (("1", -0.5), ("1-2", 0.5))]
    return Film.model_validate({"grain": GRAIN, "traces": places, **parts})


def cases(seconds: float, *, quick: bool) -> Iterator[Case]:
    """Every film of the table; quick: the ends of each axis alone."""
    axes: dict[str, tuple[tuple[float, float, float], Callable[[float], Film]]] = {
        "grain": ((0.02, 0.05, 0.10), lambda value: Film(grain=value)),
        "speed, mm/s": ((2.8, 5.0, 10.0), lambda value: Film(grain=GRAIN, speed=value)),
        "resolution, dpi": ((200.0, 300.0, 600.0), lambda value: Film(grain=GRAIN, dpi=value)),
        "traces apart, mm": ((0.0, 8.0, 16.0), crossing),
        "marks missing": ((0.0, 0.1, 0.25), lambda value: Film(grain=GRAIN, missing_marks=value, spurious_marks=1)),
    }
    course = scene(seconds)
    for axis, (values, film) in axes.items():
        for value in values[::2] if quick else values:
            yield Case(axis, value, course, film(value))


def hard_films(seconds: float) -> dict[str, Film]:
    """Films that may be declined but not read wrongly, by name."""
    return {
        "steep: 2.8 mm/s, grain 0.07": Film(grain=0.07, speed=2.8),
        "traces that touch without crossing": crossing(touching(seconds)),
        "heavy dirt and fog, low contrast": Film(
            grain=0.07, fog=0.5, fog_gradient=0.2, density_max=1.2, dust=100.0, scratches=10.0, handwriting=3
        ),
        "blackout of 10 s": Film(grain=GRAIN, blackouts=(Stretch(start=150.0, stop=160.0),)),
        "lamp at 15 % for 30 s": Film(grain=GRAIN, dimmings=(Dimming(start=150.0, stop=180.0, factor=0.15),)),
        "torn end": Film(grain=GRAIN, torn_end=100.0),
        "upside down": Film(grain=GRAIN, upside_down=True),
    }


def touching(seconds: float) -> float:
    """How far apart traces must rest so that they just touch, mm."""
    elongation: Any = synth.simulate(scene(seconds))[0]["record"].dataset["elongation"].values
    return float(np.max(elongation[0] - elongation[1]) * Film().lever)


def hard(path: Path) -> Iterator[Row]:
    """One row a hard film, and how many were read."""
    read = 0
    for name, film in progress(hard_films(HARD_SECONDS).items(), "hard films"):
        _, scores, refusal = _read(film, path, scene(HARD_SECONDS))
        if refusal:
            yield holds(f"{name}: refused", True, "read or refused")
            continue
        is_right = scores["wrong_unflagged"] <= MOST_WRONG and not scores["slipped"]
        read += bool(is_right and scores["accepted"] >= _LEAST_READ)
        words = f"{scores['accepted']:.0%} of rows read, {scores['wrong_unflagged']:.1e} wrong"
        yield holds(f"{name}: {words}", bool(is_right), "read or refused")
    yield at_least("hard films that were read", read, 5)


def _read(film: Film, path: Path, course: Scene) -> tuple[Truth, Row, str]:
    """Truth of a film that is exposed to a scene, and scores of its reading, or why there are none."""
    truth = Truth.of(synth.expose(course, film, path, overwrite=True))
    try:
        return truth, own_reading(path, truth, film.mark_interval), ""
    except IsochronyError as fault:
        return truth, {}, str(fault)


_LIMITS = (
    ("normal error", "normal_px", 0.20, "px rms"),
    ("normal error of flat parts", "flat_px", 0.22, "px rms"),
    ("amplitude bias", "amplitude_bias", 1e-3, ""),
    ("mark position on one trace", "mark_px", 0.20, "px rms"),
    ("slices flagged", "flagged", 0.01, ""),
    ("single direction", "single", 0.02, ""),
    ("wrong and unflagged", "wrong_unflagged", MOST_WRONG, ""),
    ("swaps", "swaps", 0.0, ""),
)  # What is promised, the score, its largest size and its unit


def _accuracy(path: Path) -> Iterator[Row]:
    """Of films with a grain of 0.05, and the speed of reading them."""
    speeds = []
    for words, film, accepted, crossed in (
        ("traces apart", Film(grain=GRAIN), 0.83, 0),
        ("traces crossing, 8 mm apart", crossing(8.0), 0.78, 1000),
        ("traces crossing, resting at one place", crossing(0.0), 0.78, 1000),
    ):
        _, scores, refusal = _read(film, path, scene(HALF_HOUR))
        if refusal:
            yield holds(f"{words}: read ({refusal})", False, "read")
            continue
        speeds.append(scores["mpx_s"])
        for what, score, limit, unit in _LIMITS:
            yield at_most(f"{words}: {what}", abs(scores[score]), limit, unit)
        yield at_least(f"{words}: slices accepted", scores["accepted"], accepted)
        yield at_least(f"{words}: crossings met", scores["crossings"], crossed)
    speed = statistics.median(speeds) if speeds else math.nan
    yield at_least("speed of all of digitise, one core", speed, 12.0, "Mpx per CPU second")


def _gravity(name: str, limit: float, path: Path) -> Iterator[Row]:
    """From a scene to film to gravity."""
    course = scene(HALF_HOUR)
    synth.expose_to(course, name, path, overwrite=True)
    try:
        table = process(digitise(path))["gravity"].dataset
    except IsochronyError as fault:
        yield holds(f"{name} film of 30 minutes to gravity: refused ({fault})", False, f"within {limit:g} mGal")
        return
    error = abs(float(table["gravity"].values[0]) - course.gravity) / MGAL
    sigma = float(table["gravity_sigma"].values[0])
    yield at_most(f"{name} film of 30 minutes: gravity", error, limit, "mGal")
    yield at_most(f"{name} film of 30 minutes: gravity over its 95 % interval", error / (1.96 * sigma), 1.0)
