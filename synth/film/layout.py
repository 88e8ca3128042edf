"""Where the traces lie on the paper, and whether they fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.scene_film import Film
from synth.film.geometry import Geometry
from synth.film.shutter import Light, Marks, light_of
from synth.film.source import Source
from synth.phase import Floats

_SPOTS = 3.0  # sigmas that must be left to the edge
_ROOM = 1.05  # between the steepest slope met at samples and that where a line would double back


@dataclass(frozen=True)
class Layout:
    """Place of each trace.

    Attributes
    ----------
    position, offset, lever : (traces,) array
        Across at rest, mm; later along the film, mm; mm/rad.
    swing : (traces, 2) array
        Smallest and largest elongation, rad.
    rate : (traces,) array
        Largest rate of the elongation, rad/s.
    light : tuple of Light
        When each is lit.
    """

    position: Floats
    offset: Floats
    lever: Floats
    swing: Floats
    rate: Floats
    light: tuple[Light, ...] = ()

    def lit(self, film: Film, marks: Marks, begin: float, end: float, dark: list[list[tuple[float, float]]]) -> Layout:
        """The same with light."""
        return replace(self, light=tuple(light_of(film, marks, begin, end, each) for each in dark))


def lay_out(source: Source, film: Film) -> Layout:
    """Place the traces as the film says, or evenly.

    Raises
    ------
    UsageError
        The film names a trace that the record has not, or a trace does not fit on the paper.
    """
    named = {each.name: each for each in film.traces}
    for name in named:
        if name not in source.traces:
            raise UsageError(f"film.traces names {name!r}; the record has {', '.join(source.traces)}")
    count = len(source.traces)
    position, offset, lever = np.empty(count), np.zeros(count), np.full(count, film.lever)
    for k, name in enumerate(source.traces):
        position[k] = film.paper_width * (k + 0.5) / count
        own = named.get(name)
        if own is not None:
            offset[k] = own.offset
            lever[k] = own.lever if own.lever is not None else film.lever
            position[k] = own.position if own.position is not None else position[k]
    layout = Layout(position, offset, lever, *_extremes(source))
    _refuse_overhang(source, film, layout)
    return layout


def _extremes(source: Source) -> tuple[Floats, Floats]:
    count = len(source.traces)
    swing, rate = np.array([[np.inf, -np.inf]] * count), np.zeros(count)
    for seconds, values in source.blocks():
        with np.errstate(invalid="ignore"):
            swing[:, 0] = np.fmin(swing[:, 0], np.fmin.reduce(values, axis=1))
            swing[:, 1] = np.fmax(swing[:, 1], np.fmax.reduce(values, axis=1))
            if seconds.size > 1:
                rates = np.abs(np.diff(values, axis=1) / np.diff(seconds))
                rate = np.fmax(rate, np.fmax.reduce(rates, axis=1))
    return swing, rate


def _refuse_overhang(source: Source, film: Film, layout: Layout) -> None:
    edge = _SPOTS * film.spot
    for k, name in enumerate(source.traces):
        low, high = layout.position[k] + layout.lever[k] * layout.swing[k]
        if low >= edge and high <= film.paper_width - edge:
            continue
        largest = float(np.max(np.abs(layout.swing[k])))
        room = min(layout.position[k], film.paper_width - layout.position[k]) - edge
        lever = math.floor(0.99 * max(room, 0.0) / largest)
        raise UsageError(
            f"film: trace {name!r} would reach from {low:.1f} to {high:.1f} mm, over the edge of a paper of"
            f" {film.paper_width:g} mm; give lever = {lever:g} or less"
            f" (it is {layout.lever[k]:g} mm/rad), a wider paper_width, or positions"
        )


def refuse_doubling(source: Source, film: Film, layout: Layout, geometry: Geometry) -> None:
    """Refuse a skew or rotation so large that a line would run backwards along the film.

    Raises
    ------
    UsageError
    """
    forwards = geometry.row[1] * film.speed * (1.0 - max(-film.drift, 0.0) - film.wow - 4.0 * film.walk)
    for k, name in enumerate(source.traces):
        if abs(geometry.row[2]) * layout.lever[k] * layout.rate[k] * _ROOM >= forwards:
            slope = layout.lever[k] * layout.rate[k] / film.speed
            raise UsageError(
                f"film.skew = {film.skew:g} with rotation = {film.rotation:g} degrees would make trace {name!r}, of"
                f" slope {slope:.1f}, run backwards along the film; make their difference less than"
                f" {math.degrees(math.atan(forwards / (geometry.row[1] * film.speed) / slope)):.2g} degrees"
            )


def dark_stretches(source: Source) -> list[list[tuple[float, float]]]:
    """Stretches without samples of each trace, (begin, end) s: there the lamp is off."""
    dark: list[list[tuple[float, float]]] = [[] for _ in source.traces]
    last = np.full(len(source.traces), source.begin)
    since = np.full(len(source.traces), True)  # whether a missing sample, or nothing yet, came after the last good one
    for seconds, values in source.blocks():
        for k, row in enumerate(values):
            good = np.flatnonzero(np.isfinite(row))
            if not good.size:
                since[k] = True
                continue
            times = np.concatenate([[last[k]], seconds[good]])
            broken = np.concatenate([[bool(since[k]) or good[0] > 0], np.diff(good) > 1])
            broken |= np.diff(times) > source.longest
            for j in np.flatnonzero(broken).tolist():
                if times[j + 1] > times[j]:
                    dark[k].append((float(times[j]), float(times[j + 1])))
            last[k], since[k] = seconds[good[-1]], good[-1] < row.size - 1
    for k, stretches in enumerate(dark):
        if last[k] < source.end:
            stretches.append((float(last[k]), source.end))
    return dark
