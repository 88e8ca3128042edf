"""Traces of a film, row by row: the recipe."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.emulsion.film_emulsion import FilmEmulsion
from pipeline.film.parts import Expected, Scan, Tracks
from pipeline.film.tracking.judgement import flag_lost
from pipeline.film.tracking.optics import Optics
from pipeline.film.tracking.ordering import order
from pipeline.film.tracking.passes import Film, Outcome, backward, forward
from pipeline.film.tracking.probing import SURE, probe
from pipeline.film.tracking.section import Section, read_section

NOTHING = (
    "no swinging trace found on the film: lines that turn at regular intervals are looked for, dark on light, with rows"
    " running along time; check the orientation and polarity of the scan, or give period and traces"
)


LEAST_READ = 0.15
STRANGE = 4.0


def track(
    scan: Scan,
    emulsion: FilmEmulsion,
    *,
    expected: Expected | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Tracks:
    """Find the traces of a film, follow them both ways and read them row by row.

    Parameters
    ----------
    scan, emulsion
        Of `measure_emulsion`.
    expected : Expected, optional
        What is known beforehand.
    progress : callable, optional
        Called with rows done and rows to do.

    Raises
    ------
    RefusedError
        Nothing swings on the film, or fewer traces than were expected.
    """
    expected = expected or Expected()
    sigma = float(np.sqrt(emulsion.grain[0]))
    given = Optics(emulsion.spot, 0.0, emulsion.curve, emulsion.grain) if emulsion.spot else None

    def darkness(first: int, stop: int) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
        return emulsion.darkness(scan.read(first, stop), first)

    probed = probe(darkness, scan.rows, sigma, expected.spot, expected.rows_per_swing, expected.count, given)
    if probed is None:
        raise RefusedError(NOTHING)
    section, optics = probed
    traces = len(section.swings)
    if expected.count is not None and traces < expected.count:
        raise RefusedError(
            f"count is {expected.count} traces but {traces} were found on the film: give the number that swing on it"
        )
    film = Film(scan, emulsion, optics, section.period)
    begin = _first_section(film, section)
    total = 2 * scan.rows
    tell = (lambda done: progress(done, total)) if progress is not None else (lambda done: None)
    ahead = forward(film, begin, tell)
    blank = float(emulsion.blank.darkness.max())
    out = Outcome.empty(traces, scan.rows, optics.shear, float(np.log10(emulsion.full_scale / 0.75)) - blank)
    backward(film, ahead, tell, out)
    for k in range(traces):
        _refuse_strangers(out, k)
        flag_lost(out.position[k], out.course[k], out.qc[k], film.period)
    _refuse_unread(out)
    _refuse_doubles(out, optics.spot)
    rank = order(out.course, out.slope, expected)
    return Tracks(
        out.position[rank],
        out.sigma[rank],
        out.course[rank],
        out.slope[rank],
        out.curvature[rank],
        out.brightness[rank],
        out.qc[rank],
        film.period,
        optics.spot,
    )


def _refuse_strangers(out: Outcome, trace: int) -> None:
    """Refuse a film on which something else lies on a trace for most of its way."""
    known = out.misfit[trace][np.isfinite(out.misfit[trace])]
    misfit = float(np.quantile(known, 0.75)) if known.size else 0.0
    if misfit > STRANGE:
        raise RefusedError(
            f"trace {trace + 1} of the film does not look like one line: on a quarter of its rows the mean square"
            f" residual is over {misfit:.1f} times the grain's, at most {STRANGE:g} is allowed; another trace may lie"
            " on it: give count, or cut the film where it can be read"
        )


def _refuse_unread(out: Outcome) -> None:
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


def _refuse_doubles(out: Outcome, spot: float) -> None:
    """Refuse a film on which two traces are read as one line for most of their way."""
    for a in range(out.course.shape[0]):
        for b in range(a):
            away = np.abs(out.course[a] - out.course[b]) / np.sqrt(1.0 + out.slope[a] ** 2)
            away = away[np.isfinite(away)]
            if away.size and float(np.mean(away < spot)) > 0.5:
                raise RefusedError(
                    f"traces {b + 1} and {a + 1} of the film lie on each other on more than half of the rows: give"
                    " count, or cut the film where they lie apart"
                )


def _first_section(film: Film, probed: Section) -> Section:
    """The first section of the film on which all traces are found."""
    height = round(6.0 * film.period)
    for first, _ in film.pieces:
        if first >= probed.first:
            break
        piece = film.darkness(first, min(film.scan.rows, first + height))
        section = read_section(piece, first, film.optics, film.period, len(probed.swings), least=SURE)
        if section is not None and len(section.swings) == len(probed.swings):
            return section
    return probed
