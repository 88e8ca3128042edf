"""When light falls on the film: the chronometer's shutter, the lamp, and stretches without a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_film import Film
from synth.phase import Floats
from synth.seeds import generator

_MINUTE = 60.0


@dataclass(frozen=True)
class Marks:
    """Every gap of the shutter, and those that were left out, in order of time.

    Attributes
    ----------
    time : (marks,) array
        Their middle, s.
    minute, missing, spurious : (marks,) array of uint8
        Second gap of a full minute; left out; no mark at all.
    """

    time: Floats
    minute: NDArray[np.uint8]
    missing: NDArray[np.uint8]
    spurious: NDArray[np.uint8]


@dataclass(frozen=True)
class Light:
    """Stretches of constant light, in order and apart: begin, end, s, and factor of the lamp, (stretches,) each."""

    begin: Floats
    end: Floats
    factor: Floats

    def between(self, first: float, last: float) -> Light:
        """The stretches that touch a time."""
        here = slice(
            int(np.searchsorted(self.end, first, side="left")), int(np.searchsorted(self.begin, last, side="right"))
        )
        return Light(self.begin[here], self.end[here], self.factor[here])


def set_marks(film: Film, begin: float, end: float, seed: int) -> Marks:
    """The chronometer's marks at multiples of the interval, and what chance makes of them."""
    if not film.gap:
        empty = np.zeros(0, np.uint8)
        return Marks(np.zeros(0), empty, empty, empty)
    index = np.arange(np.ceil(begin / film.mark_interval - 1e-9), np.floor(end / film.mark_interval + 1e-9) + 1)
    mark = (index + 0.0) * film.mark_interval  # no negative zero
    absent = generator(seed, "film missing marks").random(mark.size) < film.missing_marks
    within = np.abs(mark - _MINUTE * np.round(mark / _MINUTE))
    full = within < 0.25 * min(film.mark_interval, _MINUTE) if film.minute_code else np.zeros(mark.size, bool)
    second = mark[full] + film.minute_code
    false = generator(seed, "film spurious marks").uniform(begin, end, film.spurious_marks)
    time = np.concatenate([mark, second, false])
    sizes = mark.size, second.size, false.size
    minute = np.repeat(np.array([0, 1, 0], np.uint8), sizes)
    spurious = np.repeat(np.array([0, 0, 1], np.uint8), sizes)
    missing = np.concatenate([absent, absent[full], np.zeros(false.size, bool)]).astype(np.uint8)
    order = np.argsort(time, kind="stable")
    return Marks(time[order], minute[order], missing[order], spurious[order])


def light_of(film: Film, marks: Marks, begin: float, end: float, dark: list[tuple[float, float]]) -> Light:
    """What falls on the film of one trace.

    Parameters
    ----------
    film, marks
    begin, end : float
        Of the record, s: before and after, the lamp is off.
    dark : list of (begin, end)
        Stretches without a record, s.
    """
    shut = marks.time[marks.missing == 0]
    closed = [(at - 0.5 * film.gap, at + 0.5 * film.gap) for at in shut.tolist()]
    closed += [(each.start, each.stop) for each in film.blackouts] + dark
    weak = [(each.start, each.stop, each.factor) for each in film.dimmings]
    # the factor changes at these moments only; log of it would be additive, zeros are counted apart
    edges = np.unique(np.clip(np.array([begin, end, *(t for pair in closed for t in pair),
                                        *(t for triple in weak for t in triple[:2])]), begin, end))  # fmt: skip
    count = np.zeros(edges.size, np.int64)
    for first, last in closed:
        count[np.searchsorted(edges, min(max(first, begin), end))] += 1
        count[np.searchsorted(edges, min(max(last, begin), end))] -= 1
    is_open = np.cumsum(count)[:-1] == 0
    middle = 0.5 * (edges[1:] + edges[:-1])
    factor = np.full(middle.size, film.lamp)
    for first, last, part in weak:
        factor[(middle > first) & (middle < last)] *= part
    lit = is_open & (factor > 0.0)
    return Light(edges[:-1][lit], edges[1:][lit], factor[lit])
