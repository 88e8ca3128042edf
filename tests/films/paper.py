"""How the paper runs, when the shutter is closed, and where on the scan a point of the film lies.

Time is the chronometer's within the film, from 0 at the first row; `along` is the place on the paper, mm.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .kinds import Case

Floats = NDArray[np.float64]
Random = np.random.Generator

INCH = 25.4
WIDTH = 127.0  # mm of paper
BED = 40
"""px of 300 dpi of the scanner's bed beside a paper whose edge is in sight."""
AHEAD = 2.0
"""s for which light falls before the first row and after the last."""
_STEP = 1e-3  # s
_RAMP = 0.02  # s, in which paper stops and starts
CODE = 0.125  # s, of the second gap after a full minute
_LONG = 3.0
"""Gaps that a long mark lasts."""
_KINK = 30.0  # px along the film, of a crease


class Drive(NamedTuple):
    """Where the slit stands on the paper at each time."""

    times: Floats
    along: Floats
    """mm, never falling."""
    events: list[dict[str, Any]]
    """Stand-stills, slips and changes of speed."""


def run(case: Case, duration: float, random: Random) -> Drive:
    """Let the paper run."""
    times = np.arange(-AHEAD, duration + AHEAD, _STEP)
    swaying = case.wow * np.sin(2.0 * np.pi * times / case.wow_period + random.uniform(0.0, 2.0 * np.pi))
    speed = case.speed * (1.0 + swaying + case.drift * (times / duration - 0.5))
    events: list[dict[str, Any]] = []

    def during(begin: float, end: float, ramp: float) -> Floats:
        """1 between, with ramps whose halves lie within."""
        return np.clip((times - begin) / ramp + 0.5, 0.0, 1.0) * np.clip((end - times) / ramp + 0.5, 0.0, 1.0)

    for time in _places(case.stills if case.still else 0, duration, random):
        speed *= 1.0 - during(time, time + case.still, _RAMP)
        events.append({"kind": "still", "time": time, "length": case.still})
    for time in _places(case.slips if case.slip else 0, duration, random):
        speed += case.slip / _RAMP * during(time, time + _RAMP, 0.5 * _RAMP)
        events.append({"kind": "slip", "time": time, "length": case.slip})
    if case.speed_change:
        time, length = random.uniform(0.2, 0.7) * duration, random.uniform(5.0, 15.0)
        speed *= 1.0 + case.speed_change * during(time, time + length, 0.3)
        events.append({"kind": "speed change", "time": time, "length": length})
    along = np.concatenate([[0.0], np.cumsum(0.5 * _STEP * (speed[1:] + speed[:-1]))])
    return Drive(times, along - np.interp(0.0, times, along), events)


def _places(count: int, duration: float, random: Random) -> list[float]:
    """One in each of so many equal parts of the film but its ends."""
    edges = np.linspace(0.06, 0.9, count + 1) * duration
    return [float(random.uniform(*pair)) for pair in itertools.pairwise(edges)]


class Mark(NamedTuple):
    """What the chronometer did."""

    time: float
    kind: str
    """"mark", "minute", "code" (of the minute), "false"; "missing" and "omitted" left nothing on the film."""
    begin: float
    end: float


def marks(case: Case, duration: float, offset: float, random: Random) -> list[Mark]:
    """All marks; a full minute is where time and `offset` add to one."""
    out: list[Mark] = []
    for index in range(
        math.ceil((offset - AHEAD) / case.interval), math.floor((offset + duration + AHEAD) / case.interval) + 1
    ):
        time = index * case.interval - offset
        minute = round(index * case.interval, 6) % 60.0 == 0.0
        absent = random.random() < case.missing
        length = case.gap * (_LONG if minute and case.code == "long" else 1.0)
        kind = (
            "omitted" if minute and case.code == "omitted" else "missing" if absent else "minute" if minute else "mark"
        )
        shift = case.jitter * random.normal()
        out.append(Mark(time, kind, time + shift - 0.5 * length, time + shift + 0.5 * length))
        if kind == "minute" and case.code == "double":
            out.append(Mark(time + CODE, "code", time + CODE - 0.5 * case.gap, time + CODE + 0.5 * case.gap))
    stray = random.uniform(0.0, duration, case.false)
    out += [Mark(time, "false", time - 0.5 * case.gap, time + 0.5 * case.gap) for time in stray]
    return sorted(out)


def closed(spans: list[tuple[float, float]], times: Floats) -> Floats:
    """For how long, up to each time, one of the spans has lasted."""
    edges: list[float] = []
    for begin, end in sorted(spans):
        if edges and begin <= edges[-1]:
            edges[-1] = max(edges[-1], end)
        else:
            edges += [begin, end]
    if not edges:
        return np.zeros_like(times)
    lengths = np.diff(edges, prepend=edges[0])
    lengths[::2] = 0.0
    return np.interp(times, edges, np.cumsum(lengths))


class Geometry(NamedTuple):
    """From film to scan: columns and rows in px of the scan as rendered, rows running with time."""

    ratio: float
    """px/mm along; across it is less by the shrinkage."""
    across: float
    height: int
    width: int
    margin: float
    """px left of the paper."""
    sideways: Floats
    """px by which the film lies to the right, at each row of the film from -height/8 on."""
    skew: float

    def wandered(self, rows: Floats) -> Floats:
        """px by which the film lies to the right on some rows."""
        start = -(self.height // 8)
        return np.interp(rows, np.arange(start, start + self.sideways.size), self.sideways)

    def place(self, x: Floats, along: Floats) -> tuple[Floats, Floats]:
        """Rows and columns of points of the film, in mm."""
        rows = along * self.ratio
        columns = self.margin + x * self.across
        columns = columns + self.wandered(rows)
        sine, cosine = math.sin(self.skew), math.cos(self.skew)
        middle, centre = 0.5 * self.height, 0.5 * self.width
        rows, columns = rows - middle, columns - centre
        return middle + rows * cosine - columns * sine, centre + columns * cosine + rows * sine


def lay(case: Case, along: float, dpi: int, random: Random) -> tuple[Geometry, list[dict[str, Any]]]:
    """Lay a film of so many mm on the scanner; with what was done to the paper."""
    ratio, scale = dpi / INCH, dpi / 300.0
    height = int(along * ratio)
    margin = BED * scale if case.reference == "edge" else 0.0
    rows = np.arange(-(height // 8), height + height // 8 + 2, dtype=float)
    sideways, events = np.zeros(rows.size), []
    if case.wander:
        for period in random.uniform(400.0, 3000.0, 4) * scale:
            sideways += np.sin(2.0 * np.pi * rows / period + random.uniform(0.0, 2.0 * np.pi))
        sideways *= case.wander * scale / np.abs(sideways).max()
    for row in random.uniform(0.1, 0.9, 3 if case.crease else 0) * height:
        sideways += random.choice([-1, 1]) * case.crease * scale * np.exp(-np.abs(rows - row) / (_KINK * scale))
        events.append({"kind": "crease", "row": row})
    for row in random.uniform(0.1, 0.9, 2 if case.side_step else 0) * height:
        sideways += random.choice([-1, 1]) * case.side_step * scale * (rows > row)
        events.append({"kind": "side step", "row": row})
    skew = math.radians(case.skew) * random.choice([-1, 1])
    across = ratio * (1.0 - case.shrinkage)
    width = int(WIDTH * across + 2.0 * margin)
    return Geometry(ratio, across, height, width, margin, sideways, skew), events
