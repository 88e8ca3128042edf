"""`digitise`: the image of a film becomes a record."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import RefusedError, UsageError
from data_schemas.film_description import FilmDescription, description_path, film_stem, load_description
from data_schemas.film_edits import FilmEdits, load_edits
from pipeline.film.following import Progress, find_time
from pipeline.film.knowledge import FilmOptions, Known
from pipeline.film.reading import Reading, read_traces
from pipeline.film.record import make_record
from pipeline.film.scan.opening import OpenScan, open_scan

if TYPE_CHECKING:
    import xarray as xr

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def digitise(
    paths: Paths,
    description: FilmDescription | None = None,
    *,
    options: FilmOptions | None = None,
    edits: FilmEdits | str | os.PathLike[str] | None = None,
    rows: tuple[int, int | None] | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Read the image of a film into a record.

    Parameters
    ----------
    paths : path or sequence of path
        One image (TIFF, PNG, JPEG), or overlapping strips of one film in order.
    description : FilmDescription, optional
        What is known of the film; left out: NAME.film.toml beside the image, if it is there.
    options : FilmOptions, optional
        What stands before the description: lever, speed, traces, periods and the like; how the image is taken and read.
    edits : FilmEdits or path, optional
        What a person corrects (NAME.edits.toml); applied only where it is given.
    rows : (int, int or None), optional
        First row of the film that is read, and the one behind the last; None: to its end.
    jobs : int
        Processor cores to use.
    progress : function, optional
        Told the stage, how much of it is done, and of how much.

    Returns
    -------
    DataTree
        A record (see `data_schemas`); its group /film says how it was read and what had to be assumed.

    Raises
    ------
    UsageError
        An option that cannot be meant, or several traces without periods.
    FileError
        The image cannot be read.
    RefusedError, RecordError
        It shows no film that can be read with certainty.

    Examples
    --------
    >>> record = digitise("ship.film.tif", options=FilmOptions(traces=["1"]))  # doctest: +SKIP
    """
    found, known = read(paths, description, options, edits=edits, rows=rows, jobs=jobs, progress=progress)
    return make_record(found, known, film_stem(found.scan.paths[0]))


def read(
    paths: Paths,
    description: FilmDescription | None = None,
    options: FilmOptions | None = None,
    *,
    edits: FilmEdits | str | os.PathLike[str] | None = None,
    rows: tuple[int, int | None] | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[Reading, Known]:
    """Read the image of a film, without making a record of it; parameters and faults as of `digitise`."""
    edits, options = load_edits(edits) if isinstance(edits, str | os.PathLike) else edits, options or FilmOptions()
    if edits is not None:  # rows and columns count on the scan turned so
        if options.orientation not in ("auto", str(edits.orientation)):
            raise UsageError(f"orientation {options.orientation}: the edits were made at {edits.orientation} degrees")
        options = replace(options, orientation=str(edits.orientation))
    scan, known = open_film(paths, description, options)
    if rows is not None:
        if edits is not None:
            raise UsageError("rows: edits count on the whole film; give times instead, or no edits")
        scan = scan.part(*rows)
    traces, axis = find_time(scan, known, edits, jobs, progress)
    if isinstance(axis, RefusedError):
        raise axis
    return read_traces(traces, axis, known, jobs), known


def open_film(
    paths: Paths, description: FilmDescription | None = None, options: FilmOptions | None = None
) -> tuple[OpenScan, Known]:
    """Open the image of a film with what is known of it: as given, or as described beside it."""
    first = Path(paths if isinstance(paths, str | os.PathLike) else paths[0] if len(paths) else "")
    beside = description_path(first)
    if description is None and beside.is_file():
        description = load_description(beside)
    known = Known(description, options)
    orientation, lines = known.options.orientation, known.options.lines
    return open_scan(paths, dpi=known.dpi, orientation=orientation, lines=lines), known
