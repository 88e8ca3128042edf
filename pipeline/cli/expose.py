"""`isochrony expose`: a record or a scene becomes a photographic film, with what is known of it and its truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import data_schemas
import synth
from pipeline.cli.faults import read_checked
from pipeline.cli.outputs import folder_for_output, orderly, place, refuse_clashes
from pipeline.cli.parser import whole_number
from pipeline.cli.tables import progress

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.scene import Scene

HELP = "put a record or a scene on photographic film"
DESCRIPTION = """\
Expose a photographic film to a record (.nc) or a scene (TOML, or the name of a shipped one), develop and scan it.
Needs the extra `film` (tifffile).

Three files are written: NAME.film.tif, the image (BigTIFF, rows along the film), NAME.film.toml, what an observer
knows of the film, and NAME.film.truth.nc, what he does not (time, elongation and pixel of every row and trace):
reading the film never uses it. The samples of a record are joined by a smooth curve; where it has none, the lamp
is off. A scene is simulated without noise and gaps of its recording.

--film takes a shipped film (clean, typical, bad, historic-slow) or a TOML file with the keys of a scene's section
[film]; without it, the section of the scene counts, or a film without any defect. All sizes are assumed."""

EXAMPLES = """\
examples:
  isochrony expose ship.record.nc --film typical      ship.film.tif, .film.toml and .film.truth.nc beside the record
  isochrony expose night.toml                         the film that the scene names
  isochrony expose night.toml --film mine.toml --seed 7 -o out/"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """List the options."""
    add = parser.add_argument
    add("source", metavar="RECORD|SCENE", help="record (.nc), scene (.toml), or the name of a shipped scene")
    add("-o", dest="out", metavar="FILM", help="image (.tif), or folder (ends with /); default beside the input")
    add("--film", metavar="NAME|FILE", help="shipped film, or TOML file with the keys of a scene's section [film]")
    add("--seed", type=whole_number("--seed"), metavar="N", help="seed of the film's chance instead of its own")
    add("--allow-paths", action="store_true", help="the scene's tables may lie outside its folder")
    add("--force", action="store_true", help="overwrite existing outputs")


def run(options: argparse.Namespace) -> int:
    """Expose the film and write the three files."""
    from data_schemas.errors import IsochronyError, naming
    from data_schemas.film_description import description_path
    from pipeline.cli.simulate import find_scene

    if options.source.endswith(".nc"):
        path, out = Path(options.source), options.out
    else:
        path, out = find_scene(options.source, options.out, "film.tif")
    target = place([path], out, ".film.tif")[0]
    truth = synth.film_truth_path(target)
    refuse_clashes([path], [target, description_path(target), truth], force=options.force)
    film = None if options.film is None else synth.load_film(options.film)
    source = _source(path, allow_paths=options.allow_paths)
    try:
        with orderly(), folder_for_output(target.parent), progress(target.name, " rows") as draw:
            made = synth.expose_to(source, film, target, seed=options.seed, overwrite=options.force, progress=draw)
    except IsochronyError as fault:
        raise type(fault)(naming(path, str(fault))) from None
    traces = ", ".join(made.traces)
    print(f"{made.image}: {made.rows} x {made.columns} px, {made.length:.4g} m of film, traces {traces}")
    print(f"{made.description}: what is known of it")
    print(f"{made.truth}: what is not")
    return 0


def _source(path: Path, *, allow_paths: bool) -> DataTree | Scene:
    if path.suffix == ".nc":
        return read_checked(path, "record")

    return data_schemas.load_scene(path, allow_paths=allow_paths)
