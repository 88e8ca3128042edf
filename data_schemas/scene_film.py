"""The section `film` of a scene: a photographic film exposed to the traces, with every defect a film may have."""

from __future__ import annotations

from data_schemas.film_making import FilmCamera, FilmDrive, FilmMarks
from data_schemas.film_scanning import FilmDirt, FilmEmulsion, FilmScanner
from data_schemas.scene_fields import quantity
from data_schemas.scene_recording import Seed


class Film(FilmCamera, FilmMarks, FilmDrive, FilmEmulsion, FilmDirt, FilmScanner):
    """A film and its scan. Every defect is absent unless it is named.

    Examples
    --------
    >>> Film(speed=1.5, grain=0.05).gap
    0.03
    """

    seed: Seed | None = quantity(None, "1", "all chance of the film comes from this number; left out: the scene's")
