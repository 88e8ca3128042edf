"""`isochrony digitise`: images of films become records."""

import argparse
import importlib.util
import os
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from data_schemas.errors import IsochronyError, RefusedError, UsageError, naming
from pipeline.cli.files import exit_status, outcome_of, place, refuse_clashes, stem, store
from pipeline.cli.parser import pairs, periods
from pipeline.cli.tables import complain, print_json, progress

if TYPE_CHECKING:
    from data_schemas.film_description import FilmDescription
    from pipeline.film.knowledge import FilmOptions, Known
    from pipeline.film.reading import Reading


def run(options: argparse.Namespace) -> int:
    """Read every film; a bad one does not stop the others."""
    if options.edits and not options.edits.endswith(".toml"):  # the film stood behind the option
        options.films, options.edits = [options.edits, *options.films], ""
    if not options.films:
        raise UsageError("digitise: no film is named; give the image of a film")
    films = [[Path(name) for name in options.films]] if options.strips else [[Path(name)] for name in options.films]
    firsts = [film[0] for film in films]
    outputs = place(firsts, options.out, ".record.nc")
    previews = [output.with_name(f"{stem(output)}.film.png") for output in outputs] if options.preview else []
    every = [path for film in films for path in film]
    refuse_clashes(every, [*outputs, *previews], force=options.force)
    if options.preview:
        from pipeline.plots.canvas import require_matplotlib

        require_matplotlib()
    film_options(options)  # what cannot be meant is told before any work
    _stretch(options)
    if options.table:
        return _table(films, outputs, options)
    good = 0
    for film, output in zip(films, outputs, strict=True):
        try:
            row = _one(film, output, options)
        except IsochronyError as fault:
            status, error = outcome_of(fault, film[0], alone=len(films) == 1)
            row = {"record_id": stem(film[0]), "input": str(film[0]), "output": None, "status": status, "error": error}
        _show(row, as_json=options.json)
        good += row["status"] == "ok"
    return exit_status(good, len(films))


def _one(film: list[Path], output: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Read one film, write its record, and say what was read."""
    import time

    from pipeline.film.digitise import make_record, summary

    start = time.perf_counter()
    rows, span = _stretch(options)
    reading, known = read_film(film, options, rows)
    reading = reading if span is None else reading.between(*span)
    record = make_record(reading, known, stem(film[0]))
    store(record, output, force=options.force)
    if options.preview:
        from pipeline.plots.canvas import save
        from pipeline.plots.film import film_figure

        save(film_figure(reading), output.with_name(f"{stem(output)}.film.png"))
    row = {"input": str(film[0]), "output": str(output), "status": "ok", "error": None, **summary(record, reading)}
    row["elapsed_s"] = time.perf_counter() - start
    return row


def _stretch(options: argparse.Namespace) -> tuple[tuple[int, int | None] | None, tuple[float, float] | None]:
    """Rows that are to be read, and times that are to be kept, s; None: all."""
    rows, times = [0.0, inf], [-inf, inf]
    for k, (option, word) in enumerate((("--from", options.start), ("--to", options.stop))):
        if word is not None:
            try:
                (rows if word.endswith("px") else times)[k] = float(word.removesuffix("px"))
            except ValueError:
                raise UsageError(f"{option} wants seconds, or a row as 1200px, not '{word}'") from None
    for low, high in (rows, times):
        if not high > low:
            raise UsageError(f"digitise: --to {high:g} is not after --from {low:g}")
    first, last = int(rows[0]), None if rows[1] == inf else int(rows[1])
    return None if rows == [0.0, inf] else (first, last), None if times == [-inf, inf] else (times[0], times[1])


def _table(films: list[list[Path]], outputs: list[Path], options: argparse.Namespace) -> int:
    """Open a film at the table; its record is written when the person is done."""
    if any(importlib.util.find_spec(name) is None for name in ("starlette", "uvicorn", "pebble")):
        raise UsageError("the table needs starlette, uvicorn and pebble; pip install 'isochrony[table]'")
    from pipeline.film.table.server import serve
    from pipeline.film.table.session import Session

    if len(films) > 1:
        raise UsageError("digitise --table: one film at a time")
    if options.start is not None or options.stop is not None:
        raise UsageError("digitise --table: the whole film lies on the table; drop --from and --to")
    with progress(films[0][0].name, " rows") as draw:
        edits = edits_of(films[0][0], options.edits or "")
        jobs = max(options.jobs, min(2, os.cpu_count() or 1))  # a person waits; numbers are the same
        given = {"edits": edits, "who": options.by, "jobs": jobs, "progress": draw}
        session = Session.open(films[0], description(options), film_options(options), **given)
    try:
        serve(session, port=options.port, browser=not options.no_browser)
    finally:
        session.close()
    if session.record is None:
        raise RefusedError(naming(films[0][0], str(session.refusal)))
    store(session.record, outputs[0], force=options.force)
    print(outputs[0])
    return 0


def _show(row: dict[str, Any], *, as_json: bool) -> None:
    """Print what was read on stdout; what failed, was assumed or is to be distrusted on stderr."""
    if as_json:
        print_json(row)
    if row["status"] != "ok":
        complain(row["error"])
        return
    for said in (*row["assumed"], *row["notes"]):
        complain(f"{row['input']}: {said}")
    if not as_json:
        from pipeline.film.reading import share_read

        missing, flags = row["missing_fraction"].values(), ", ".join(row["flags"]) or "no flags"
        part = share_read(row["reading"], row["accepted_fraction"], sum(missing) / len(missing))
        told = f"{row['samples']} samples of {', '.join(row['traces'])} over {row['duration_s']:.6g} s"
        print(f"{row['output']}: {told}, {part}, {row['reading']}; {flags}", flush=True)


def film_options(options: argparse.Namespace) -> "FilmOptions":
    """What the options say of the film, as the reader and `make_record` take it."""
    from pipeline.film.knowledge import FilmOptions

    names = ["lever", "gravity", "mark_interval", "marks", "speed", "dpi", "orientation", "lines", "reading", "rate"]
    said = vars(options)  # a picture is in px: it wants neither lever nor periods
    given: dict[str, Any] = {name: said.get(name) for name in names}
    combinations = pairs("digitise", "--combination", said.get("combination", ()))
    labelled = periods("digitise", said.get("period", ()))
    return FilmOptions(traces=tuple(options.trace), combinations=combinations, periods=labelled, **given)


def description(options: argparse.Namespace) -> "FilmDescription | None":
    """The description named on the command line, None where none is: then the one beside the film counts."""
    if options.description is None:
        return None
    from data_schemas.film_description import load_description

    return load_description(Path(options.description))


def edits_of(film: Path, name: str | None) -> Path | None:
    """File of the edits that are to be applied to a film, by the word of `--edits`."""
    from data_schemas.film_edits import edits_path

    return edits_path(film) if name == "" else None if name is None else Path(name)


def read_film(
    film: Sequence[Path], options: argparse.Namespace, rows: tuple[int, int | None] | None = None
) -> "tuple[Reading, Known]":
    """Read a film, or some of its rows, as the options say, with a progress bar."""
    from pipeline.film.digitise import read

    edits = edits_of(film[0], options.edits)
    with progress(film[0].name, " rows") as draw:
        return read(
            film, description(options), film_options(options), edits=edits, rows=rows, jobs=options.jobs, progress=draw
        )
