"""`isochrony simulate`: a scene becomes a record and its truth; `isochrony expose`: either becomes a film."""

import argparse
import glob
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import data_schemas
import synth
from data_schemas.errors import IsochronyError, UsageError, naming
from pipeline.cli.files import folder_for_output, orderly, place, read_checked, refuse_clashes, stem
from pipeline.cli.parser import processors
from pipeline.cli.tables import print_json, progress

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.scene import Scene


_WORTHWHILE = 4  # members a further process must have to do, for starting it takes as long as some


def run(options: argparse.Namespace) -> int:
    """Simulate the scene and write both files."""
    if options.tolerance is not None and not 1e-15 <= options.tolerance <= 1e-2:
        raise UsageError(f"--tolerance wants a relative error from 1e-15 to 0.01, not '{options.tolerance:g}'")
    options.vary = options.vary and [_range(word) for word in options.vary]
    if options.ensemble is None:
        for name in ("vary", "workers"):
            if getattr(options, name) is not None:
                raise UsageError(f"--{name} is about ensembles; give --ensemble N too")
    ending = "record.nc" if options.ensemble is None else "ensemble"
    path, out = find_scene(options.scene, options.out, ending)
    if options.json and not options.explain:
        raise UsageError("simulate: --json goes with --explain; add it, or leave --json out")
    if options.explain:
        print_explanation(_scene(path, options), as_json=options.json)
        return 0
    if options.ensemble is not None:
        return _ensemble(options, _scene(path, options), path, out)
    record_path = place([path], out, ".record.nc")[0]
    truth_path = record_path.with_name(stem(record_path) + ".truth.nc")
    refuse_clashes([path], [record_path, truth_path], force=options.force)
    scene = _scene(path, options)
    with orderly(), folder_for_output(record_path.parent), progress(scene.record_id, " samples") as draw:
        samples = synth.simulate_to(scene, record_path, truth_path, overwrite=options.force, progress=draw)
    print(f"{record_path}: {samples} samples of {', '.join(trace.name for trace in scene.traces)}")
    changing = ", to which gravity_course is added" if scene.gravity_course is not None else ""
    print(f"{truth_path}: gravity {scene.gravity:.8f} m/s2{changing}")
    return 0


def _ensemble(options: argparse.Namespace, scene: "Scene", path: Path, out: str | None) -> int:
    """Simulate all members that are not there yet."""
    name = stem(path)
    folder = Path(out) if out is not None else path.with_name(f"{name}.ensemble")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, but an ensemble needs a folder; name another with -o")
    vary = dict(options.vary or [])
    if len(vary) < len(options.vary or []):
        raise UsageError("--vary names a key twice; name each once")
    workers = options.workers or max(1, min(processors(), options.ensemble // _WORTHWHILE))
    with orderly(), folder_for_output(folder), progress(name, " members") as draw:
        how = {"name": name, "vary": vary, "workers": workers, "overwrite": options.force, "progress": draw}
        written = synth.write_ensemble(scene, options.ensemble, folder, **how)
    kept = f", {written.kept} of them kept from before" if written.kept else ""
    print(f"{written.manifest}: {written.made + written.kept} members{kept}")
    return 0


def _scene(path: Path, options: argparse.Namespace) -> "Scene":
    """The scene, with what the options say instead."""
    scene = data_schemas.load_scene(path, allow_paths=options.allow_paths)
    if options.seed is not None:
        scene = scene.model_copy(update={"seed": options.seed})
    if options.tolerance is not None:
        simulation = scene.simulation.model_copy(update={"tolerance": options.tolerance})
        scene = scene.model_copy(update={"simulation": simulation})
    return scene


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


def find_scene(name: str, out: str | None, ending: str) -> tuple[Path, str | None]:
    """Path of the scene, and `-o`: outputs of a shipped scene go to the present folder, not the package."""
    path = shipped(name)
    return path, f"./{name}.{ending}" if out is None and path != Path(name) else out


def shipped(name: str, is_there: Callable[[str], bool] = os.path.isfile) -> Path:
    """Path of a scene; one that ships with the package may be named without one, where nothing else has its name."""
    path = Path(name)
    is_path = is_there(name) or path.suffix or path.parent != Path(".") or glob.has_magic(name)
    return path if is_path else Path(synth.scene_path(name))


def print_explanation(scene: "Scene", *, as_json: bool) -> None:
    """Print terms, propagator, why and expected error; nothing is simulated or written."""
    from synth.explanation import explain

    told = explain(scene)
    if as_json:
        print_json({"record_id": scene.record_id, "title": scene.title, **told})
        return
    wanted = "none: as exact as the propagator can" if told["tolerance"] is None else f"{told['tolerance']:.2g}"
    refused = {"if it refuses": ", then ".join(told["instead"])} if told["instead"] else {}
    error = {"tolerance": wanted, "expected error": f"{told['expected_error']:.2g} of the largest angle"}
    blocks = {
        "scene": {"pendulums": told["pendulums"], "readings": told["readings"]},
        "terms": told["terms"] | {"left out": ", ".join(told["left_out"]) or "nothing"},
        "propagator": {"chosen": told["propagator"], "why": told["why"], **refused, **error},
    }
    print(f"{scene.record_id}: {scene.title}" if scene.title else scene.record_id)
    for heading, entries in blocks.items():
        print(f"\n{heading}")
        for name, words in entries.items():
            print(f"  {name:<19}{words}")


def expose(options: argparse.Namespace) -> int:
    """Expose the film and write the three files."""
    from data_schemas.film_description import description_path

    is_record = options.source.endswith(".nc")
    path, out = Path(options.source), options.out
    if not is_record:
        path, out = find_scene(options.source, out, "film.tif")
    target = place([path], out, ".film.tif")[0]
    truth = synth.film_truth_path(target)
    refuse_clashes([path], [target, description_path(target), truth], force=options.force)
    film = None if options.film is None else synth.load_film(options.film)
    source: DataTree | Scene
    if is_record:
        source = read_checked(path, "record")
    else:
        source = data_schemas.load_scene(path, allow_paths=options.allow_paths)
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
