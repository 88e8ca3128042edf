"""Traces of a film, row by row: the recipe."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.emulsion import FilmEmulsion
from pipeline.film.parts import Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.outcome import flag_lost
from pipeline.film.tracking.passes import SECTION_SWINGS, Film, backward, forward
from pipeline.film.tracking.pieces import run, start
from pipeline.film.tracking.probing import SURE, probe
from pipeline.film.tracking.section import Section, follow_from, follow_together, read_section

NOTHING = (
    "no swinging trace found on the film: lines that turn at regular intervals are looked for, dark on light, with rows"
    " running along time; check the orientation and polarity of the scan, or give period and traces"
)


NEAR_PIECES, FAR_PIECES = 3, 8  # looked at from the film's start, and between there and what is followed back
LEAD_SWINGS = 8.0  # before the first section, on which traces that were not found there may be followed
LEAST_READ = 0.15
STRANGE = 4.0


def track(
    scan: OpenScan,
    emulsion: FilmEmulsion,
    *,
    count: int | None = None,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Tracks:
    """Find the traces of a film, follow them both ways and read them row by row.

    Parameters
    ----------
    scan, emulsion
        Of `measure_emulsion`.
    count : int, optional
        Number of traces, if known.
    jobs : int
        Threads that may work.
    progress : callable, optional
        Called with rows done and rows to do.

    Raises
    ------
    RefusedError
        Nothing swings on the film, or fewer traces than were expected.
    """
    sigma = float(np.sqrt(emulsion.grain[0]))
    given = Optics(emulsion.spot, 0.0, emulsion.curve, emulsion.grain) if emulsion.spot else None

    def darkness(first: int, stop: int) -> NDArray[np.float32]:
        return emulsion.darkness(scan.read(first, stop), first)

    probed = probe(darkness, scan.rows, sigma, count, given)
    if probed is None:
        raise RefusedError(NOTHING)
    section, optics = probed
    traces = len(section.swings)
    if count is not None and traces < count:
        raise RefusedError(
            f"count is {count} traces but {traces} were found on the film: give the number that swing on it"
        )
    film = Film(scan, emulsion, optics, section.period)
    begin = _led_in(film, _first_section(film, section))
    total = 2 * scan.rows
    tell = (lambda done: progress(done, total)) if progress is not None else (lambda done: None)
    ahead = forward(film, begin, tell, jobs)
    tracks, misfit = backward(film, ahead, tell, jobs)
    for k in range(traces):
        _refuse_strangers(misfit[k], k)
        flag_lost(tracks.position[k], tracks.course[k], tracks.qc[k], film.period)
    _refuse_unread(tracks)
    _refuse_doubles(tracks)
    return tracks


def _refuse_strangers(misfit: NDArray[np.float32], trace: int) -> None:
    """Refuse a film on which something else lies on a trace for most of its way."""
    known = misfit[np.isfinite(misfit)]
    usual = float(np.quantile(known, 0.75)) if known.size else 0.0
    if usual > STRANGE:
        raise RefusedError(
            f"trace {trace + 1} of the film does not look like one line: on a quarter of its rows the mean square"
            f" residual is over {usual:.1f} times the grain's, at most {STRANGE:g} is allowed; another trace may lie"
            " on it: give count, or cut the film where it can be read"
        )


def _refuse_unread(out: Tracks) -> None:
    """Refuse a film on which a trace was found but not read."""
    read = np.isfinite(out.position).mean(axis=1)
    if read.max() < LEAST_READ:
        raise RefusedError(NOTHING)
    worst = int(np.argmin(read))
    if read[worst] < LEAST_READ * read.max():
        raise RefusedError(
            f"trace {worst + 1} of the film was found but read on {100.0 * read[worst]:.0f} % of the rows only, the"
            f" best on {100.0 * read.max():.0f} %: scan again, cut the film where it can be read, or give count"
        )


def _refuse_doubles(out: Tracks) -> None:
    """Refuse a film on which two traces are read as one line for most of their way."""
    for a in range(out.course.shape[0]):
        for b in range(a):
            away = np.abs(out.course[a] - out.course[b]) / np.sqrt(1.0 + out.slope[a] ** 2)
            away = away[np.isfinite(away)]
            if away.size and float(np.mean(away < out.spot)) > 0.5:
                raise RefusedError(
                    f"traces {b + 1} and {a + 1} of the film lie on each other on more than half of the rows: give"
                    " count, or cut the film where they lie apart"
                )


def _led_in(film: Film, section: Section) -> Section:
    """A section with some rows before it, on which its traces, which were not found there, may be followed."""
    first = max(0, section.first - round(LEAD_SWINGS * film.period))
    darkness = film.darkness(first, section.first + section.darkness.shape[0])
    begin = section.first + section.begin - first
    return follow_from(section.swings, darkness, first, begin, film.optics, 1.0) if first < section.first else section


def _first_section(film: Film, probed: Section) -> Section:
    """The first section of the film on which all traces are found, or are still followed when the film runs back."""
    ahead = [first for first, _ in film.pieces if first < probed.first]
    for first in ahead[:NEAR_PIECES]:
        section = _all_of(film, probed, first)
        if section is not None:
            return section
    rewound = _rewound(film, probed)
    rest = [first for first in ahead[NEAR_PIECES:] if first < rewound.first]
    for first in rest[:: max(1, len(rest) // FAR_PIECES)]:
        section = _all_of(film, probed, first)
        if section is not None:
            return section
    return rewound


def _all_of(film: Film, probed: Section, first: int) -> Section | None:
    """The traces found anew on the section that begins at a row, None unless they are all found."""
    traces = len(probed.swings)
    piece = film.darkness(first, min(film.scan.rows, first + round(SECTION_SWINGS * film.period)))
    section = read_section(piece, first, film.optics, film.period, traces, least=SURE)
    return section if section is not None and len(section.swings) == traces else None


def _rewound(film: Film, probed: Section) -> Section:
    """The earliest piece to which all traces of a section can be followed back."""
    begun = start(probed.swings, probed.first + probed.begin + 0.5)
    stop, section = probed.first + probed.begin + 1, probed
    while stop > 0:
        first = max(0, stop - round(SECTION_SWINGS * film.period))
        darkness = film.darkness(first, stop)
        piece = run(begun, darkness, first, -1, film.optics)
        if not begun.alive.all():
            break
        pieces = [piece.of(k) for k in range(len(probed.swings))]
        followed = follow_together(darkness, first, pieces, film.optics, SURE)
        if followed is None or len(followed.swings) < len(probed.swings):
            break
        stop, section = first, followed
    return section
