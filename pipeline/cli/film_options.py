"""What the user may say of a film, on the command line: shared by `digitise` and `plot`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.cli.parser import add_meaning_options, number, one_of, pairs, periods, whole_number
from pipeline.cli.progress import progress

if TYPE_CHECKING:
    from data_schemas.film_description import FilmDescription
    from pipeline.film.knowledge import FilmOptions, Known
    from pipeline.film.reading import Reading

_FOR_READING = [
    ("--dpi", "N", "pixels per inch, where the image does not say or is wrong"),
    ("--mark-interval", "S", "time between the chronometer's marks (assumed 0.5)"),
    ("--speed", "MM_S", "nominal speed of the film"),
]
_TRACE = "trace and its pendulums, from the left to the right at rest; repeatable"


def add_film_options(parser: argparse.ArgumentParser) -> None:
    """List the options of reading a film and of making a record of it."""
    add_reading_options(parser)
    add_meaning_options(parser, "optical lever (assumed 2000)")


def add_reading_options(parser: Any) -> None:
    """List the options of reading a film."""
    add = parser.add_argument
    add("--description", metavar="FILE", help="what is known of the film (TOML; default NAME.film.toml beside it)")
    for option, name, text in _FOR_READING:
        add(option, type=number(option, above=0.0), metavar=name, help=text)
    add(
        "--marks",
        type=one_of("kind of marks", ("double", "long", "omitted", "none")),
        metavar="CODE",
        help="at each full minute the shutter closes twice (double), for longer (long), not at all (omitted) or as "
        "ever (none); default: what repeats every minute",
    )
    add("--trace", action="append", default=[], metavar="NAME[:A[-B]]", help=_TRACE)
    turns = ("auto", "0", "90", "180", "270")
    add(
        "--orientation",
        type=one_of("orientation", turns),
        default="auto",
        metavar="DEGREES",
        help="turn the image clockwise so that time runs down: auto (default; the long side), 0, 90, 180 or 270",
    )
    add(
        "--lines",
        type=one_of("kind of lines", ("auto", "dark", "light")),
        default="auto",
        metavar="TONE",
        help="dark on light film, light on dark, or auto (default)",
    )
    add(
        "--reading",
        type=one_of("reading", ("auto", "continuous", "strobe")),
        default="auto",
        metavar="HOW",
        help="continuous (between the marks), strobe (at the marks alone) or auto (default)",
    )
    add(
        "--rate", type=number("--rate", above=0.0), metavar="HZ", help="samples a second, continuous (default up to 25)"
    )
    add(
        "--edits",
        nargs="?",
        const="",
        metavar="FILE",
        help="apply a person's edits (default NAME.edits.toml beside the film)",
    )
    add(
        "--jobs",
        type=whole_number("--jobs", 1, 64),
        default=1,
        metavar="N",
        help="processor cores to use, 1 (default) to 64",
    )


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

    return FilmOptions(
        mark_interval=options.mark_interval,
        marks=options.marks,
        speed=options.speed,
        dpi=options.dpi,
        traces=tuple(options.trace),
    )


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


def read_film(
    film: Sequence[Path], options: argparse.Namespace, said: FilmOptions, rows: tuple[int, int | None] | None = None
) -> tuple[Reading, Known]:
    """Read a film, or some of its rows, as the options say, with a progress bar."""
    from pipeline.film.digitise import read

    with progress(film[0].name, " rows") as draw:
        return read(
            film,
            description(options),
            options=said,
            orientation=options.orientation,
            lines=options.lines,
            reading=options.reading,
            rate=options.rate,
            edits=edits_of(film[0], options),
            rows=rows,
            jobs=options.jobs,
            progress=draw,
        )
