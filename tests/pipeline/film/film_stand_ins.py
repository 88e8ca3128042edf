"""A reading of a film as ideal trackers would hand it over, without any image."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.film.normal_points import normal_points
from pipeline.film.parts import Strobe, TimeAxis, Tracks
from pipeline.film.reading import Reading
from pipeline.film.scan.files import in_memory
from pipeline.film.scan.opening import OpenScan

ROWS_PER_SECOND, INTERVAL, SCALE, LEVER = 60.0, 0.5, 25.4 / 300, 2000.0
PERIODS = {"1": 1.00966, "2": 1.009760966}
RESTS = (375.0, 1125.0)


def angles(t: np.ndarray) -> dict[str, np.ndarray]:
    one = 5e-3 * np.cos(2 * np.pi * t / PERIODS["1"] + 0.4) + 1e-3 * np.sin(2 * np.pi * t / 11.0)
    two = 4e-3 * np.cos(2 * np.pi * t / PERIODS["2"] + 2.2) + 1e-3 * np.sin(2 * np.pi * t / 11.0)
    return {"1": one, "1-2": one - two}


def reading(
    tmp_path: Path,
    *,
    seconds: float = 60.0,
    noise: float = 0.0,
    kind: str = "continuous",
    swapped: bool = False,
    strobe_late: float = 0.0,
    wander: float = 0.0,
    seed: int = 0,
) -> Reading:
    """Two traces, "1" at the left unless `swapped`; the strobe may lag by some seconds, and paper `wander`, px."""
    rng = np.random.default_rng(seed)
    count = round(seconds * ROWS_PER_SECOND)
    t = (np.arange(count) + 0.5) / ROWS_PER_SECOND
    order = ("1-2", "1") if swapped else ("1", "1-2")

    def columns(when: np.ndarray) -> np.ndarray:
        values, aside = angles(when), wander * np.sin(2 * np.pi * when / 17.0)
        return np.array([rest + aside + values[name] * LEVER / SCALE for rest, name in zip(RESTS, order, strict=True)])

    step = 1e-3 / ROWS_PER_SECOND
    course = columns(t)
    slope = (columns(t + step) - columns(t - step)) / 2e-3
    curvature = (columns(t + step) - 2.0 * course + columns(t - step)) / 1e-6
    tracks = Tracks(
        position=course + noise * rng.standard_normal(course.shape),
        sigma=np.full(course.shape, noise or 0.1),
        course=course,
        slope=slope,
        curvature=curvature,
        brightness=np.ones(course.shape),
        qc=np.zeros(course.shape, dtype=np.uint16),
        rows_per_swing=ROWS_PER_SECOND * PERIODS["1"],
        spot=1.2,
    )
    index = np.arange(1, int(seconds / INTERVAL))
    rows = index * INTERVAL * ROWS_PER_SECOND
    axis = TimeAxis(
        index=index,
        row=rows,
        row_sigma=np.full(index.size, 0.1),
        shear=0.0,
        offset=np.zeros(2),
        row_of_trace=np.array([rows, rows]),
        interval=INTERVAL,
        seconds=t,
        seconds_sigma=np.full(count, 1e-4),
        flags=("marks-false",),
        rate_sigma=0.0,
    )
    places = columns(index * INTERVAL - strobe_late) + noise * rng.standard_normal((2, index.size))
    strobe = Strobe(index, places, np.full(places.shape, noise or 0.1), np.zeros(places.shape, dtype=np.uint16))
    path = tmp_path / "night.film.tif"
    path.write_bytes(b"the image")
    image = in_memory(np.full((count, 1500), 220, dtype=np.uint8), path)
    scan = OpenScan(image, SCALE, (path,))
    between = normal_points(tracks, axis, 25.0)
    from pipeline.film.normal_points import compare
    from pipeline.film.reading import at_marks

    samples = between if kind == "continuous" else at_marks(strobe, axis)
    difference = compare(tracks, axis, between, strobe)
    return Reading(scan, tracks, axis, strobe, samples, kind, SCALE, difference, ("lines are light on dark film",))
