"""What one film is made with, and the kinds: what varies with the strength, what else, and what a reader owes it.

The defaults are the film on which every kind builds: two to three minutes of two pendulums at 5 mm/s, scanned at 300
dpi, the first pendulum's trace crossing the difference's, half-second marks with a second gap after each full minute.
What is not here (gravity, periods, phases, places of events) is drawn for each film.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Case:
    """Lengths on the film in mm, on the scan in px; times in s; exposures in units of the emulsion's."""

    # what swings
    duration: tuple[float, float] = (130.0, 200.0)
    """Drawn between."""
    traces: tuple[str, ...] = ("1", "1-2")
    amplitudes: tuple[float, ...] = (6.0, 10.0)
    """mm on the film."""
    levers: tuple[float, ...] = (2000.0, 2000.0)
    """mm/rad."""
    spacing: float = 10.0
    """mm, between traces at rest."""
    swell: float = 0.004
    """Root mean square of x'', m/s^2."""
    damping: float = 2e-5
    # optics
    spot: float = 0.1
    """1 sigma, mm."""
    lamp: float = 0.12
    """Exposure on the axis of a line of slope 12."""
    faint: float = 1.0
    """Of the last trace's lamp."""
    lamp_varies: float = 0.0
    tangent: bool = False
    """Deflection L tan(2 x)/2 instead of L x."""
    offset: float = 0.05
    """mm along the film, of each trace from the one before."""
    # emulsion
    grain: float = 0.04
    """Of density 1 in a pixel of 300 dpi."""
    clump: float = 0.0
    """1 sigma of a grain's clump, px."""
    fog: float = 0.03
    """Exposure of the paper at nominal speed, by stray light through the slit."""
    halo: float = 0.0
    halo_radius: float = 12.0
    """Share of the light that spreads, and 1 sigma in px of 300 dpi."""
    density: float = 1.6
    gamma: float = 1.1
    # drive
    speed: float = 5.0
    """mm/s."""
    wow: float = 0.002
    wow_period: float = 3.7
    drift: float = 0.003
    """Of the speed, from end to end."""
    still: float = 0.0
    stills: int = 1
    """Paper stands, the light goes on; s, and how often."""
    slip: float = 0.0
    slips: int = 3
    """Paper is pulled, mm."""
    speed_change: float = 0.0
    """Relative, for 5 to 15 s."""
    # marks
    interval: float = 0.5
    gap: float = 0.035
    style: str = "gaps"
    """"gaps", "wire" (gaps in all light), "bright lines" (in the fog alone), "dark lines" or "edge"."""
    code: str = "double"
    """Of a full minute: "double", "omitted", "long" or "none"."""
    missing: float = 0.0
    """Share of the marks."""
    false: int = 0
    jitter: float = 0.0003
    """1 sigma of the shutter, s."""
    reversed: bool = False
    # damage
    hairs: int = 0
    dust: int = 0
    scratches: int = 0
    writing: int = 0
    blackouts: int = 0
    """Of .5 to 4 s."""
    # geometry of paper and scan
    crease: float = 0.0
    side_step: float = 0.0
    wander: float = 0.0
    """px of 300 dpi."""
    reference: str = "none"
    """"none", "line" (of a fixed lamp) or "edge" (of the paper, on a white bed)."""
    skew: float = 0.0
    """Degrees."""
    shrinkage: float = 0.0
    strips: int = 1
    turn: float = 0.0
    """Degrees, of the strips against each other."""
    # scan
    dpi: int = 300
    dpi_error: float = 0.0
    """Relative, of the dpi as stated."""
    bits: int = 8
    span: float = 235.0
    """Grey levels between clear and opaque, of 255."""
    black: float = 0.0
    """Grey level of opaque film."""
    negative: bool = False
    sepia: float = 0.0
    tile: int = 0
    extension: str = "tif"
    quality: int = 0
    """Of a JPEG; 0: none."""
    thumbnail: int = 0
    """Of a first page, how many times smaller; 0: none."""

    def amplitudes_of(self, count: int) -> NDArray[np.float64]:
        """Of so many traces; the last value repeats."""
        return np.array([self.amplitudes[min(k, len(self.amplitudes) - 1)] for k in range(count)])

    def levers_of(self, count: int) -> NDArray[np.float64]:
        """As `amplitudes_of`."""
        return np.array([self.levers[min(k, len(self.levers) - 1)] for k in range(count)])


STRENGTHS = ("weak", "middle", "strong")
SOUND, READABLE, REFUSABLE = "sound", "readable", "refusable"
"""Read without a blocking flag; gravity with a right sigma is possible; may be refused, with the right cause."""


@dataclass(frozen=True)
class Kind:
    """One entry of the table."""

    group: str
    """{"sound", "drive", "marks", "slow", "emulsion", "geometry", "file"}"""
    status: tuple[str, str, str]
    varied: Mapping[str, tuple[Any, Any, Any]] = field(default_factory=dict)
    """Field of `Case`: its values, weak, middle and strong."""
    common: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Case` at all strengths."""
    cause: str = ""
    """What a refusal must name."""


_ALL_SOUND = (SOUND, SOUND, SOUND)
_MOSTLY = (SOUND, SOUND, READABLE)
_READABLE = (READABLE, READABLE, READABLE)


def _kind(group: str, status: tuple[str, str, str], varied: Mapping[str, Any], cause: str = "", **common: Any) -> Kind:
    return Kind(group, status, varied, common, cause)


_GRAIN = {"grain": (0.02, 0.05, 0.08)}
_STILL = {"fog": (0.06, 0.02, 0.004)}  # the fainter the bar across the paper, the harder to find
_SLOW = {"missing": (0.0, 0.01, 0.03), "false": (0, 2, 5)}
_STEADY = {"speed": 1.5, "gap": 0.05, "lamp": 0.4, "amplitudes": (8.0, 10.0), "spacing": 26.0}

KINDS: dict[str, Kind] = {
    "typical": _kind("sound", _ALL_SOUND, _GRAIN),
    "resolution": _kind("sound", _ALL_SOUND, {"dpi": (600, 200, 150)}),
    "sepia": _kind("sound", _ALL_SOUND, {"sepia": (0.3, 0.6, 0.9)}),
    "tiles": _kind("sound", _ALL_SOUND, {"tile": (512, 256, 128)}),
    "16 bit": _kind("sound", _ALL_SOUND, _GRAIN, bits=16),
    "inverted": _kind("sound", _ALL_SOUND, _GRAIN, negative=True),
    "png": _kind("sound", _ALL_SOUND, _GRAIN, extension="png"),
    "one trace": _kind("sound", _ALL_SOUND, {"amplitudes": ((10.0,), (7.0,), (4.0,))}, traces=("1",)),
    "two pendulums": _kind(
        "sound", _ALL_SOUND, {"spacing": (30.0, 20.0, 10.0)}, traces=("1", "2"), amplitudes=(8.0, 7.0)
    ),
    "three pendulums": _kind(
        "sound", _ALL_SOUND, {"spacing": (30.0, 20.0, 12.0)}, traces=("1", "1-2", "2-3"), amplitudes=(6.0, 8.0, 8.0)
    ),
    "fast paper": _kind(
        "sound", _ALL_SOUND, {"amplitudes": ((8.0, 12.0), (12.0, 16.0), (16.0, 20.0))}, speed=10.0, spacing=20.0
    ),
    "small swing": _kind("sound", _ALL_SOUND, {"amplitudes": ((5.0, 6.0), (3.0, 4.0), (2.0, 3.0))}),
    "apart": _kind("sound", _ALL_SOUND, {"spacing": (44.0, 32.0, 24.0)}),
    "crossing": _kind("sound", _ALL_SOUND, {"spacing": (12.0, 6.0, 2.0)}),
    "traces offset along": _kind("sound", _ALL_SOUND, {"offset": (0.3, 0.8, 1.5)}),
    "swell": _kind("sound", _ALL_SOUND, {"swell": (0.003, 0.01, 0.02)}),
    "unequal levers": _kind("sound", _ALL_SOUND, {"levers": ((2000.0, 1800.0), (2000.0, 1400.0), (2500.0, 1200.0))}),
    "skew": _kind("sound", _ALL_SOUND, {"skew": (0.1, 0.25, 0.5)}),
    # drive
    "still .5 s": _kind("drive", _READABLE, _STILL, still=0.5),
    "still 1.01 s": _kind("drive", _READABLE, _STILL, still=1.01),
    "still 2.02 s": _kind("drive", _READABLE, _STILL, still=2.02),
    "still 5.05 s": _kind("drive", _READABLE, _STILL, still=5.05),
    "three stills of 1.01 s": _kind("drive", _READABLE, _STILL, still=1.01, stills=3),
    "wow": _kind("drive", _MOSTLY, {"wow": (0.005, 0.015, 0.05)}),
    "drift": _kind("drive", _MOSTLY, {"drift": (0.02, 0.06, 0.2)}),
    "slips": _kind("drive", _READABLE, {"slip": (0.1, 0.5, 2.5)}),
    "short change of speed": _kind("drive", (SOUND, READABLE, READABLE), {"speed_change": (0.05, -0.2, 0.5)}),
    # marks
    "marks missing": _kind("marks", _MOSTLY, {"missing": (0.02, 0.1, 0.3)}),
    "marks false": _kind("marks", _MOSTLY, {"false": (3, 15, 60)}),
    "marks missing and false": _kind("marks", _MOSTLY, {"missing": (0.01, 0.1, 0.2), "false": (2, 10, 30)}),
    "minute omitted": _kind("marks", _MOSTLY, {"missing": (0.0, 0.02, 0.1)}, code="omitted"),
    "minute long": _kind("marks", _MOSTLY, {"missing": (0.0, 0.02, 0.1)}, code="long"),
    "minute uncoded": _kind("marks", _MOSTLY, {"missing": (0.0, 0.02, 0.1)}, code="none"),
    "bright lines": _kind("marks", _READABLE, {"fog": (0.4, 0.3, 0.2)}, style="bright lines", lamp=0.2),
    "dark lines": _kind("marks", _READABLE, {"missing": (0.0, 0.02, 0.1)}, style="dark lines"),
    "edge marks": _kind("marks", _READABLE, {"missing": (0.0, 0.02, 0.1)}, style="edge"),
    "wire": _kind("marks", _READABLE, {"fog": (0.2, 0.1, 0.05)}, style="wire"),
    "dark lines askew": _kind("marks", _READABLE, {"skew": (0.1, 0.25, 0.5)}, style="dark lines"),
    "edge marks askew": _kind("marks", _READABLE, {"skew": (0.1, 0.25, 0.5)}, style="edge"),
    "dark lines minute omitted": _kind(
        "marks", _READABLE, {"missing": (0.0, 0.02, 0.1), "false": (0, 2, 8)}, style="dark lines", code="omitted"
    ),
    "edge marks minute long": _kind(
        "marks", _READABLE, {"missing": (0.0, 0.02, 0.1), "false": (0, 2, 8)}, style="edge", code="long"
    ),
    "edge marks of 1 s": _kind("marks", _READABLE, {"missing": (0.0, 0.02, 0.1)}, style="edge", interval=1.0),
    "dark lines wrong end": _kind("marks", _READABLE, {"missing": (0.0, 0.02, 0.1)}, style="dark lines", reversed=True),
    "dark lines still 1.01 s": _kind("marks", _READABLE, _STILL, style="dark lines", still=1.01),
    "edge marks still 1.01 s": _kind("marks", _READABLE, _STILL, style="edge", still=1.01),
    "bright lines still 1.01 s": _kind(
        "marks", _READABLE, {"fog": (0.4, 0.3, 0.2)}, style="bright lines", lamp=0.2, still=1.01
    ),
    "contacts of 1 s": _kind("marks", _MOSTLY, {"missing": (0.0, 0.02, 0.1)}, interval=1.0),
    "contacts of 2 s": _kind("marks", _MOSTLY, {"missing": (0.0, 0.02, 0.1)}, interval=2.0),
    "from the wrong end": _kind("marks", _MOSTLY, {"missing": (0.0, 0.05, 0.2)}, reversed=True),
    # slow paper: read at the marks
    "slow 200 s": _kind("slow", (SOUND, READABLE, READABLE), _SLOW, duration=(200.0, 200.0), **_STEADY),
    "slow 600 s": _kind("slow", (SOUND, READABLE, READABLE), _SLOW, duration=(600.0, 600.0), **_STEADY),
    # emulsion and damage
    "grain correlated": _kind("emulsion", _ALL_SOUND, {"clump": (0.5, 0.8, 1.4)}),
    "overexposed": _kind("emulsion", _MOSTLY, {"lamp": (0.2, 0.35, 0.8)}),
    "steep curve": _kind("emulsion", _MOSTLY, {"gamma": (1.3, 1.6, 2.2)}, lamp=0.2),
    "black level of the scanner": _kind("emulsion", _MOSTLY, {"black": (8.0, 20.0, 40.0)}, span=210.0),
    "halo": _kind("emulsion", _MOSTLY, {"halo": (0.02, 0.06, 0.15)}),
    "hair": _kind("emulsion", _MOSTLY, {"hairs": (5, 20, 60)}),
    "dust": _kind("emulsion", _MOSTLY, {"dust": (200, 1500, 8000)}),
    "scratches": _kind("emulsion", _MOSTLY, {"scratches": (2, 8, 25)}),
    "handwriting": _kind("emulsion", _MOSTLY, {"writing": (1, 3, 8)}, "ink"),
    "blackouts": _kind("emulsion", _MOSTLY, {"blackouts": (2, 6, 15)}),
    "faint trace": _kind("emulsion", (SOUND, READABLE, REFUSABLE), {"faint": (0.4, 0.15, 0.04)}, "faint"),
    "lamp varying": _kind("emulsion", _MOSTLY, {"lamp_varies": (0.2, 0.6, 0.85)}),
    # geometry
    "creases": _kind("geometry", _READABLE, {"crease": (3.0, 4.0, 5.0)}),
    "sideways steps": _kind("geometry", _READABLE, {"side_step": (3.0, 4.0, 5.0)}),
    "wandering": _kind("geometry", _READABLE, {"wander": (10.0, 20.0, 30.0)}),
    "wandering beside a line": _kind("geometry", _READABLE, {"wander": (10.0, 20.0, 30.0)}, reference="line"),
    "wandering, edge in sight": _kind("geometry", _READABLE, {"wander": (10.0, 20.0, 30.0)}, reference="edge"),
    "dpi stated wrong": _kind("geometry", _READABLE, {"dpi_error": (0.04, -0.1, 0.33)}, "dpi"),
    "tangent optics": _kind(
        "geometry", _READABLE, {"levers": ((500.0, 500.0), (300.0, 300.0), (200.0, 200.0))}, tangent=True
    ),
    "shrunk across": _kind("geometry", _READABLE, {"shrinkage": (0.005, 0.015, 0.04)}),
    "strips turned": _kind("geometry", (SOUND, READABLE, READABLE), {"turn": (0.25, 1.0, 2.0)}, strips=3),
    # files
    "jpeg": _kind("file", (SOUND, READABLE, REFUSABLE), {"quality": (90, 60, 30)}, "compression", extension="jpg"),
    "one bit": _kind("file", (REFUSABLE,) * 3, {"grain": (0.02, 0.04, 0.08)}, "one-bit", bits=1),
    "coarse scan": _kind("file", (READABLE, REFUSABLE, REFUSABLE), {"dpi": (120, 100, 75)}, "resolution"),
    "low contrast": _kind("file", (SOUND, READABLE, REFUSABLE), {"span": (120.0, 40.0, 10.0)}, "contrast", black=90.0),
    "thumbnail first": _kind("file", _READABLE, {"thumbnail": (4, 8, 16)}, "thumbnail"),
}


def case_of(kind: str, strength: str) -> Case:
    """The case of a kind at a strength."""
    entry, place = KINDS[kind], STRENGTHS.index(strength)
    return replace(Case(), **(dict(entry.common) | {name: values[place] for name, values in entry.varied.items()}))


def owed(kind: str, strength: str) -> tuple[str, str]:
    """What a reader owes such a film, and the cause that a refusal must name."""
    return KINDS[kind].status[STRENGTHS.index(strength)], KINDS[kind].cause
