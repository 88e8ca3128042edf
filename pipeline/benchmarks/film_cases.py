"""Films of the suite `film`: one property at a time away from 300 dpi, 5 mm/s and a grain of 0.05; and hard films."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.scene import Scene, load_scene
from data_schemas.scene_film import Dimming, Film
from data_schemas.scene_recording import Stretch

GRAIN = 0.05
MIDDLE = 63.5  # mm, of the paper


@dataclass(frozen=True)
class Case:
    """One film.

    Attributes
    ----------
    axis, value
        Which property is varied, and what it is here.
    scene : Scene
    film : Film
    """

    axis: str
    value: float
    scene: Scene
    film: Film


def scene(seconds: float) -> Scene:
    """The shipped scene of the films, of some length."""
    from synth import scene_path

    return load_scene(scene_path("film")).model_copy(update={"duration": seconds})


def crossing(apart: float, **parts: Any) -> Film:
    """A film whose two traces rest so many mm apart."""
    places = [
        {"name": "1", "position": MIDDLE - 0.5 * apart},
        {"name": "1-2", "position": MIDDLE + 0.5 * apart},
    ]
    return Film.model_validate({"grain": GRAIN, "traces": places, **parts})


def cases(seconds: float, *, quick: bool) -> Iterator[Case]:
    """Every film of the table; quick: the ends of each axis alone."""
    course = scene(seconds)

    def along(axis: str, values: tuple[float, ...], film: Any) -> Iterator[Case]:
        for value in (values[0], values[-1]) if quick else values:
            yield Case(axis, value, course, film(value))

    yield from along("grain", (0.02, 0.05, 0.10), lambda value: Film(grain=value))
    yield from along("speed, mm/s", (2.8, 5.0, 10.0), lambda value: Film(grain=GRAIN, speed=value))
    yield from along("resolution, dpi", (200.0, 300.0, 600.0), lambda value: Film(grain=GRAIN, dpi=value))
    yield from along("traces apart, mm", (0.0, 8.0, 16.0), crossing)
    yield from along(
        "marks missing", (0.0, 0.1, 0.25), lambda value: Film(grain=GRAIN, missing_marks=value, spurious_marks=1)
    )


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
    import synth

    elongation: Any = synth.simulate(scene(seconds))[0]["record"].dataset["elongation"].values
    return float(np.max(elongation[0] - elongation[1]) * Film().lever)
