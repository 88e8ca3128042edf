"""`isochrony plot`: a record, a result or a film as a picture."""

import argparse
import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import data_schemas
from data_schemas.errors import RecordError, RefusedError, UsageError, naming
from pipeline.cli.digitise import description, film_options, read_film
from pipeline.cli.files import make_folder, place, read_checked, refuse_clashes, refuse_faults
from pipeline.cli.tables import complain
from pipeline.plots.canvas import require_matplotlib, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from data_schemas.layouts import Kind

_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"\x89PNG", b"\xff\xd8\xff")


def run(options: argparse.Namespace) -> int:
    """Draw the file and write the picture; status 3 for a film that is drawn and could not be read."""
    require_matplotlib()
    path = Path(options.file)
    is_film = is_image(path)
    # with its kind in its name, so that pictures of a record and its result do not fight for one
    kind = ".film" if is_film else next((end for end in (".record", ".result") if path.name.endswith(f"{end}.nc")), "")
    output = place([path], options.out, f"{kind}.png")[0]
    refuse_clashes([path], [output], force=options.force)
    if output.suffix.lower() != ".png":
        raise UsageError(f"{output}: pictures are written as PNG; end the name with .png")
    figure, status = _film(path, options) if is_film else (_tree(path, options), 0)
    make_folder(output)
    save(figure, output)
    print(output)
    return status


def _tree(path: Path, options: argparse.Namespace) -> "Figure":
    """Draw a record or a result."""
    from pipeline.plots.result import period_figure, record_figure, result_figure, synchrony_figure

    if options.start is not None or options.stop is not None:
        raise UsageError("plot: --from and --to go with the image of a film; drop them here")
    tree = data_schemas.read(path)
    kind: Kind = "result" if tree.attrs.get("schema") == "isochrony-result" else "record"
    refuse_faults(path, data_schemas.check(tree, kind))
    if options.truth is not None and (kind == "record" or "gravity" not in tree.children):
        raise UsageError("plot: --truth goes with a result that has a gravity; drop it here")
    if kind == "record":
        return record_figure(tree)
    if "period" in tree.children:
        return period_figure(tree)
    if "synchrony" in tree.children:
        return synchrony_figure(tree)
    # the figure is given the number and never the truth
    truth = None if options.truth is None else read_checked(Path(options.truth), "truth")
    return result_figure(tree, true_gravity=None if truth is None else float(truth["truth"]["gravity"]))


def _film(path: Path, options: argparse.Namespace) -> "tuple[Figure, int]":
    """Read a film and draw it; of a film that cannot be read the image alone, with the reason."""
    from pipeline.film.digitise import open_film
    from pipeline.plots.film import film_figure, unread_figure

    if options.start is not None and options.stop is not None and options.stop <= options.start:
        raise UsageError(f"plot: --to {options.stop:g} is not after --from {options.start:g}")
    try:
        return film_figure(read_film([path], options)[0], options.start, options.stop), 0
    except (RefusedError, RecordError) as fault:
        scan, _ = open_film(path, description(options), film_options(options))
        told = naming(path, str(fault))
        complain(told)
        return unread_figure(scan, told), fault.exit_status


def is_image(path: Path) -> bool:
    """Whether a file begins as TIFF, PNG or JPEG do; a file that cannot be read does not."""
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            with path.open("rb") as stream:
                return stream.read(4).startswith(_MAGIC)
    return False
