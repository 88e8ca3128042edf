"""`isochrony simulate`: a scene becomes a record and its truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from pipeline.cli.outputs import make_folder, place, refuse_clashes, stem
from pipeline.cli.parser import whole_number

_DESCRIPTION = """\
Simulate a scene (TOML): pendulums, motion of the support and recording, exactly and from the scene's seed.

Two files are written: NAME.record.nc, what the instrument saw (elongations in rad against time in s), and
NAME.truth.nc, what it should have found (gravity in m/s2, frequencies in rad/s): processing never reads it.
A scene that ships with the package may be named without a path, such as `demo`."""

_EXAMPLES = """\
examples:
  isochrony simulate ship.toml                    ship.record.nc and ship.truth.nc beside the scene
  isochrony simulate ship.toml --seed 7 -o out/   another noise, in the folder out
  isochrony simulate demo -o night.record.nc      the shipped scene; the truth goes to night.truth.nc"""


def add_parser(verbs: Any) -> argparse.ArgumentParser:
    """List the verb and its options."""
    parser: argparse.ArgumentParser = verbs.add_parser(
        "simulate",
        help="make a record and its truth from a scene",
        description=_DESCRIPTION,
        epilog=_EXAMPLES,
    )
    parser.add_argument("scene", metavar="SCENE", help="scene file (TOML), or the name of a shipped scene")
    parser.add_argument("-o", dest="out", metavar="PATH", help="record file, or folder for both files (ends with /)")
    parser.add_argument("--seed", type=whole_number("--seed"), metavar="N", help="seed instead of the scene's own")
    parser.add_argument("--force", action="store_true", help="overwrite existing outputs")
    return parser


def run(options: argparse.Namespace) -> int:
    """Simulate the scene and write both files."""
    import data_schemas
    import synth

    path, out = _find(options.scene, options.out)
    record_path = place([path], out, ".record.nc")[0]
    truth_path = record_path.with_name(stem(record_path) + ".truth.nc")
    refuse_clashes([path], [record_path, truth_path], force=options.force)
    scene = data_schemas.load_scene(path)
    if options.seed is not None:
        scene = scene.model_copy(update={"seed": options.seed})
    record, truth = synth.simulate(scene)
    make_folder(record_path)
    data_schemas.write(record, record_path, overwrite=options.force)
    data_schemas.write(truth, truth_path, overwrite=options.force)
    traces = ", ".join(str(label) for label in record["record"].dataset["trace"].values)
    print(f"{record_path}: {record.sizes['time']} samples of {traces}")
    print(f"{truth_path}: gravity {float(truth['truth']['gravity']):.8f} m/s2")
    return 0


def _find(name: str, out: str | None) -> tuple[Path, str | None]:
    """Path of the scene, and `-o`: outputs of a shipped scene go to the present folder, not the package."""
    path = Path(name)
    if path.is_file() or path.suffix or path.parent != Path("."):
        return path, out
    import synth

    shipped = Path(synth.scene_path(name))
    return shipped, out if out is not None else f"./{name}.record.nc"
