"""Drawing a film and what is read of it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from data_schemas.errors import RecordError, RefusedError, UsageError
from pipeline.cli.faults import naming
from pipeline.cli.film_options import description, reading_options
from pipeline.cli.film_progress import film_progress
from pipeline.cli.outputs import make_folder


def draw_film(path: Path, output: Path, options: argparse.Namespace) -> int:
    """Read a film and draw it; of a film that cannot be read the image alone, with the reason, and status 3."""
    from pipeline.film.digitise import open_film, read
    from pipeline.plots import film_figure, save, unread_figure

    if options.start is not None and options.stop is not None and options.stop <= options.start:
        raise UsageError(f"plot: --to {options.stop:g} is not after --from {options.start:g}")
    said = reading_options(options)
    try:
        with film_progress(path.name) as progress:
            reading, _ = read(
                path,
                description(options),
                options=said,
                orientation=options.orientation,
                lines=options.lines,
                reading=options.reading,
                jobs=options.jobs,
                progress=progress,
            )
        figure = film_figure(reading, options.start, options.stop)
        status = 0
    except (RefusedError, RecordError) as fault:
        scan, _ = open_film(path, description(options), said, orientation=options.orientation, lines=options.lines)
        told = naming(path, str(fault))
        print(f"isochrony: {told}", file=sys.stderr)
        figure = unread_figure(scan, told)
        status = fault.exit_status
    make_folder(output)
    save(figure, output)
    print(output)
    return status
