"""Dust, scratches, handwriting and a torn end: what chance and people leave on a film."""

from __future__ import annotations

from data_schemas.scene_film import Film
from synth.film.geometry import Geometry
from synth.film.pixels import Pixels


class Dirt:
    """All dirt of a film."""

    def __init__(self, film: Film, geometry: Geometry, seed: int) -> None:
        self._film = film

    def soil(self, image: Pixels, first: int) -> None:
        """Change the density of some rows, the first of which is number `first`, in place."""
