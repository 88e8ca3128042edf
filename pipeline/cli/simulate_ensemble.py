"""`isochrony simulate SCENE --ensemble N`: many members of a scene in one folder, with a table of them."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError
from pipeline.cli.outputs import folder_for_output, orderly, stem
from pipeline.cli.parser import positive, processors
from pipeline.cli.progress import progress

if TYPE_CHECKING:
    from data_schemas.scene import Scene

_WORTHWHILE = 4  # members a further process must have to do, for starting it takes as long as some


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options that make an ensemble of it."""
    group = parser.add_argument_group("ensembles")
    group.add_argument(
        "--ensemble", type=positive("--ensemble"), metavar="N",
        help="N members, each with a seed of its own, into a folder (-o; default NAME.ensemble)",
    )  # fmt: skip
    group.add_argument(
        "--vary", type=_range, action="append", metavar="KEY=LOW:HIGH",
        help="let a key of the scene vary evenly, such as pendulums.0.start.phase=0:6.28 (may be given again)",
    )  # fmt: skip
    group.add_argument(
        "--workers", type=positive("--workers"), metavar="N", help="processes (default: one a processor); same results"
    )


def check_options(options: argparse.Namespace) -> None:
    """Raise `UsageError` for options that mean nothing without an ensemble."""
    if options.ensemble is None:
        for name in ("vary", "workers"):
            if getattr(options, name) is not None:
                raise UsageError(f"--{name} is about ensembles; give --ensemble N too")


def run(options: argparse.Namespace, scene: Scene, path: Path, out: str | None) -> int:
    """Simulate all members that are not there yet."""
    from synth import write_ensemble

    name = stem(path)
    folder = Path(out) if out is not None else path.with_name(f"{name}.ensemble")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, but an ensemble needs a folder; name another with -o")
    vary = dict(options.vary or [])
    if len(vary) < len(options.vary or []):
        raise UsageError("--vary names a key twice; name each once")
    workers = options.workers or max(1, min(processors(), options.ensemble // _WORTHWHILE))
    with orderly(), folder_for_output(folder), progress(name, " members") as draw:
        written = write_ensemble(
            scene,
            options.ensemble,
            folder,
            name=name,
            vary=vary,
            workers=workers,
            overwrite=options.force,
            progress=draw,
        )
    kept = f", {written.kept} of them kept from before" if written.kept else ""
    print(f"{written.manifest}: {written.made + written.kept} members{kept}")
    return 0


def _range(word: str) -> tuple[str, tuple[float, float]]:
    key, given, ends = word.partition("=")
    low, both, high = ends.partition(":")
    try:
        if not (key and given and both):
            raise ValueError
        pair = float(low), float(high)
    except ValueError:
        raise UsageError(f"--vary wants KEY=LOW:HIGH, such as gravity=9.7:9.9, not '{word}'") from None
    if not all(map(math.isfinite, pair)):
        raise UsageError(f"--vary wants finite ends, not '{word}'")
    return key, pair
