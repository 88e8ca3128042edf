"""Everything about a film that is settled before its first row is exposed."""

from __future__ import annotations

from dataclasses import dataclass

from data_schemas.scene_film import Film
from synth.film.course import Course
from synth.film.dirt import Dirt
from synth.film.geometry import Geometry, geometry_of
from synth.film.layout import Layout, dark_stretches, lay_out, refuse_doubling
from synth.film.shutter import Marks, set_marks
from synth.film.source import Source
from synth.film.strips import NODE, Development, Exposure
from synth.film.transport import Transport


@dataclass(frozen=True)
class FilmPlan:
    """What is exposed, on what, where and when."""

    source: Source
    film: Film
    seed: int
    layout: Layout
    transport: Transport
    geometry: Geometry
    marks: Marks

    def exposure(self) -> Exposure:
        """The camera, at the begin of the film."""
        begin, end = self.source.begin, self.source.end
        node = min(NODE, self.source.step)
        course = Course(self.source, node)
        return Exposure(self.film, self.geometry, self.transport, self.layout, course, begin, end, node)

    def development(self) -> Development:
        """The dark room and the scanner."""
        return Development(self.film, self.geometry, Dirt(self.film, self.geometry, self.seed), self.seed)


def plan_film(source: Source, film: Film, seed: int) -> FilmPlan:
    """Lay a film out.

    Raises
    ------
    UsageError
        The swing does not fit on the paper, or the film lies too crooked.
    """
    layout = lay_out(source, film)
    transport = Transport(film, source.begin, source.end, seed)
    geometry = geometry_of(film, transport.length, layout.offset)
    refuse_doubling(source, film, layout, geometry)
    marks = set_marks(film, source.begin, source.end, seed)
    layout = layout.lit(film, marks, source.begin, source.end, dark_stretches(source))
    return FilmPlan(source, film, seed, layout, transport, geometry, marks)
