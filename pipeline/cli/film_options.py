"""What the user may say of a film, on the command line: shared by `digitise` and `plot`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.cli.parser import add_meaning_options, number, one_of, pairs, periods, whole_number
from pipeline.cli.tables import progress

if TYPE_CHECKING:
    from data_schemas.film_description import FilmDescription
    from pipeline.film.knowledge import FilmOptions, Known
    from pipeline.film.reading import Reading

_MARKS = """\
at each full minute the shutter closes twice (double), for longer (long), not at all (omitted) or as ever (none); \
default: what repeats every minute"""
_TURN = "turn the image clockwise so that time runs down: auto (default; the long side), 0, 90, 180 or 270"
_LINES = "dark on light film, light on dark, or auto (default)"
_READING = "continuous (between the marks), strobe (at the marks alone) or auto (default)"
_NUMBERS = (
    ("--dpi", "N", "pixels per inch, where the image does not say or is wrong"),
    ("--mark-interval", "S", "time between the chronometer's marks (assumed 0.5)"),
    ("--speed", "MM_S", "nominal speed of the film"),
    ("--rate", "HZ", "samples a second, continuous (default up to 25)"),
)
_CHOICES: tuple[tuple[str, str, str, str, str | None, str], ...] = (
    ("--marks", "kind of marks", "double long omitted none", "CODE", None, _MARKS),
    ("--orientation", "orientation", "auto 0 90 180 270", "DEGREES", "auto", _TURN),
    ("--lines", "kind of lines", "auto dark light", "TONE", "auto", _LINES),
    ("--reading", "reading", "auto continuous strobe", "HOW", "auto", _READING),
)  # Option, what it is called, its values, metavar, default, help


def add_film_options(parser: argparse.ArgumentParser) -> None:
    """List the options of reading a film and of making a record of it."""
    add_reading_options(parser)
    add_meaning_options(parser, "optical lever (assumed 2000)")


def add_reading_options(parser: Any) -> None:
    """List the options of reading a film."""
    add = parser.add_argument
    add("--description", metavar="FILE", help="what is known of the film (TOML; default NAME.film.toml beside it)")
    for option, name, text in _NUMBERS:
        add(option, type=number(option, above=0.0), metavar=name, help=text)
    trace = "trace and its pendulums, from the left to the right at rest; repeatable"
    add("--trace", action="append", default=[], metavar="NAME[:A[-B]]", help=trace)
    for option, what, values, name, default, text in _CHOICES:
        add(option, type=one_of(what, values.split()), default=default, metavar=name, help=text)
    edits = "apply a person's edits (default NAME.edits.toml beside the film)"
    add("--edits", nargs="?", const="", metavar="FILE", help=edits)
    jobs = "processor cores to use, 1 (default) to 64"
    add("--jobs", type=whole_number("--jobs", 1, 64), default=1, metavar="N", help=jobs)


def film_options(options: argparse.Namespace) -> FilmOptions:
    """All options, as `make_record` takes them."""
    from dataclasses import replace

    return replace(
        reading_options(options),
        lever=options.lever,
        combinations=pairs("digitise", "--combination", options.combination),
        periods=periods("digitise", options.period),
        gravity=options.gravity,
    )


def reading_options(options: argparse.Namespace) -> FilmOptions:
    """What matters for reading the film."""
    from pipeline.film.knowledge import FilmOptions

    given = {name: getattr(options, name) for name in ("mark_interval", "marks", "speed", "dpi")}
    return FilmOptions(traces=tuple(options.trace), **given)


def description(options: argparse.Namespace) -> FilmDescription | None:
    """The description named on the command line, None where none is: then the one beside the film counts."""
    if options.description is None:
        return None
    from data_schemas.film_description import load_description

    return load_description(Path(options.description))


def edits_of(film: Path, options: argparse.Namespace) -> Path | None:
    """File of the edits that are to be applied to a film."""
    from data_schemas.film_edits import edits_path

    if options.edits is None:
        return None
    return Path(options.edits) if options.edits else edits_path(film)


def scan_options(options: argparse.Namespace) -> dict[str, Any]:
    """How the image is looked at, as the reader takes it."""
    return {name: getattr(options, name) for name in ("orientation", "lines", "reading", "rate")}


def read_film(
    film: Sequence[Path], options: argparse.Namespace, said: FilmOptions, rows: tuple[int, int | None] | None = None
) -> tuple[Reading, Known]:
    """Read a film, or some of its rows, as the options say, with a progress bar."""
    from pipeline.film.digitise import read

    given = {"options": said, "edits": edits_of(film[0], options), "rows": rows, "jobs": options.jobs}
    with progress(film[0].name, " rows") as draw:
        return read(film, description(options), **scan_options(options), **given, progress=draw)
