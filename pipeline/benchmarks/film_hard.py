"""Hard films: each is read, or refused by name; none may be wrong without a word."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import IsochronyError
from data_schemas.film_fields import Dimming
from data_schemas.scene_film import Film
from data_schemas.scene_recording import Stretch
from pipeline.benchmarks.bar import Row, at_least, holds
from pipeline.benchmarks.film_cases import GRAIN, crossing, scene
from pipeline.benchmarks.film_own import own_reading
from pipeline.benchmarks.film_scores import Truth
from pipeline.benchmarks.progress import progress

_SECONDS = 300.0
_LEAST_READ = 0.5  # of the rows; a film of which less is read counts as not read
MOST_WRONG = 1e-4
LEAST = 5


def films() -> dict[str, Film]:
    """The hard films, by name."""
    return {
        "steep: 2.8 mm/s, grain 0.07": Film(grain=0.07, speed=2.8),
        "traces that touch without crossing": crossing(_touching()),
        "heavy dirt and fog, low contrast": Film(
            grain=0.07, fog=0.5, fog_gradient=0.2, density_max=1.2, dust=100.0, scratches=10.0, handwriting=3
        ),
        "blackout of 10 s": Film(grain=GRAIN, blackouts=(Stretch(start=150.0, stop=160.0),)),
        "lamp at 15 % for 30 s": Film(grain=GRAIN, dimmings=(Dimming(start=150.0, stop=180.0, factor=0.15),)),
        "torn end": Film(grain=GRAIN, torn_end=100.0),
        "upside down": Film(grain=GRAIN, upside_down=True),
    }


def rows(folder: Path) -> Iterator[Row]:
    """One row a hard film, and how many were read."""
    import synth

    read = 0
    path = folder / "hard.film.tif"
    for name, film in progress(films().items(), "hard films"):
        truth = Truth.of(synth.expose(scene(_SECONDS), film, path, overwrite=True))
        try:
            scores = own_reading(path, truth, film.mark_interval).scores
        except IsochronyError:
            yield holds(f"{name}: refused", True, "read or refused")
            continue
        is_right = scores["wrong_unflagged"] <= MOST_WRONG and not scores["slipped"]
        read += bool(is_right and scores["accepted"] >= _LEAST_READ)
        words = f"{scores['accepted']:.0%} of rows read, {scores['wrong_unflagged']:.1e} wrong"
        yield holds(f"{name}: {words}", bool(is_right), "read or refused")
    yield holds("photograph of something else: refused", _refuses_landscape(folder), "refused")
    yield at_least("hard films that were read", read, LEAST)


def _touching() -> float:
    """How far apart traces must rest so that they just touch, mm."""
    import synth

    record, _ = synth.simulate(scene(_SECONDS))
    elongation: Any = record["record"].dataset["elongation"].values
    return float(np.max(elongation[0] - elongation[1]) * Film().lever)


def _refuses_landscape(folder: Path) -> bool:
    """Whether clouds over a ridge are declined."""
    import tifffile
    from scipy.ndimage import gaussian_filter

    from pipeline.film.digitise import digitise
    from pipeline.film.knowledge import FilmOptions

    chance = np.random.default_rng(0)
    clouds = sum(size * gaussian_filter(chance.normal(size=(2000, 1500)), size) for size in (3.0, 12.0, 50.0))
    picture = 150.0 + 60.0 * np.asarray(clouds)
    ridge = 1300.0 + 150.0 * gaussian_filter(chance.normal(size=1500), 60.0) * 60.0
    picture[np.arange(2000)[:, None] > ridge] -= 90.0
    path = folder / "landscape.tif"
    tifffile.imwrite(path, np.clip(picture, 0, 255).astype(np.uint8), resolution=(300, 300), resolutionunit="INCH")
    try:
        digitise(path, options=FilmOptions(traces=("1",), periods={"": 1.01}))
    except IsochronyError:
        return True
    return False
