"""A first look at the film: sections here and there, what swings on them, and with what spot and curve."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.film.emulsion import FilmEmulsion, ToneCurve, plain_emulsion
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.calibrate import calibrate, measure_shear, open_rows
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.section import Section, read_section
from pipeline.film.tracking.seeding import find_swings, spot_size

FIRST_ROWS = 512
MOST_ROWS = 4096
PLACES = (0.5, 0.15, 0.85, 0.3, 0.7, 0.02, 0.95)
MORE_PLACES = (0.4, 0.6, 0.22, 0.78, 0.09, 0.91, 0.35, 0.65, 0.45, 0.55)  # where none of the others shows all traces
ENOUGH = 3  # sections with traces
REFINEMENTS = 3
SURE = 0.6  # share of rows read, with the film's own optics, by which a trace is one
ASKEW = (0.0, 0.009, -0.009, 0.018, -0.018, 0.027, -0.027)  # rows a column: half a degree and its multiples
Darkness = Callable[[int, int], NDArray[np.float32]]


def measure_emulsion(scan: OpenScan) -> FilmEmulsion:
    """Blank film, grain, characteristic curve and spot, from strips spread over the film, dark lines on light."""
    plain = plain_emulsion(scan)
    sigma = float(np.sqrt(plain.grain[0]))
    probed = probe(lambda first, stop: plain.darkness(scan.read(first, stop), first), scan.rows, sigma)
    if probed is None:
        return plain
    _, optics = probed
    return FilmEmulsion(scan.full_scale, plain.blank, optics.curve, optics.grain, optics.spot)


def first_optics(darkness: NDArray[np.float32], sigma: float) -> Optics:
    """What a piece of film shows of spot and curve before any trace is known."""
    darkest = 1.1 * float(np.quantile(darkness, 1.0 - min(2e-4, 20.0 / darkness.size)))
    curve = ToneCurve(max(darkest, 3.0 * sigma), 0.2, 1.5)
    return Optics(spot_size(darkness), 0.0, curve, np.array([sigma**2, 10.0 * sigma**2]))


def sections(rows: int, height: int) -> Iterator[tuple[int, int]]:
    """Pieces to look at, the likeliest first."""
    seen: list[int] = []
    for place in (*PLACES, *MORE_PLACES):
        first = int(np.clip(round(place * rows - 0.5 * height), 0, max(0, rows - height)))
        if all(abs(first - other) >= height // 2 for other in seen):
            seen.append(first)
            yield first, min(rows, first + height)


def probe(
    darkness: Darkness, rows: int, sigma: float, count: int | None = None, optics: Optics | None = None
) -> tuple[Section, Optics] | None:
    """The section that shows most traces, and optics fitted to it; None if nothing swings on the film."""
    height = FIRST_ROWS
    while True:
        tried: list[tuple[int, int]] = []
        read: list[tuple[Section, Optics]] = []
        for first, stop in sections(rows, height):
            whole = _whole(read, count)
            if len(whole) == ENOUGH or (len(tried) >= len(PLACES) and (whole or count is None or not read)):
                break
            piece = darkness(first, stop)
            guess = optics or first_optics(piece, sigma)
            found = _read_askew(piece, first, guess, read[0][0].period if read else None, count)
            tried.append((first, stop))
            if found is not None:
                read.append(found)
        if read:
            break
        if height >= min(rows, MOST_ROWS):
            return None
        height *= 2
    section, guess = max(_whole(read, count) or read, key=lambda each: open_rows(each[0], each[1].spot))
    section, known = refine(section, guess, fixed=optics is not None)
    for first, stop in tried if count is None else sections(rows, height):
        if first == section.first or len(section.swings) == count:
            continue
        other = read_section(darkness(first, stop), first, known, section.period, count, least=SURE)
        if other is not None and len(other.swings) > len(section.swings):
            section = other
    return section, known


def _whole(read: list[tuple[Section, Optics]], count: int | None) -> list[tuple[Section, Optics]]:
    """The sections that show as many traces as there are: where one is missing, two may have been taken for one."""
    return [each for each in read if count is None or len(each[0].swings) == count]


def refine(section: Section, optics: Optics, fixed: bool) -> tuple[Section, Optics]:
    """Optics fitted to the section, the section read anew with them, and so on: a first guess of the curve misleads."""
    for turn in range(REFINEMENTS):
        optics = optics.with_(shear=optics.shear + measure_shear(section))
        if not fixed:
            optics = calibrate(section, optics)
        again = read_section(section.darkness, section.first, optics, section.period, None, least=SURE)
        if again is None:
            break
        section = again
        if fixed and turn == 1:
            break
    return section, optics


def _read_askew(
    piece: NDArray[np.float32], first: int, guess: Optics, period: float | None, count: int | None
) -> tuple[Section, Optics] | None:
    """A section read with the first of several ways the slit may stand to the rows that leads anywhere."""
    seeds = find_swings(piece, first, guess.spot, float(np.sqrt(guess.grain[0])), period)
    for askew in ASKEW:
        optics = guess.with_(shear=guess.shear + askew)
        section = read_section(piece, first, optics, period, count, seeds)
        if section is not None:
            return section, optics
    return None
