"""`isochrony validate`, `schema`, `explain`, `join`, `import` and `warm`: verbs of a few lines each."""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import data_schemas
import synth
from data_schemas.errors import UsageError, naming
from pipeline.cli.files import exit_status, place, read_checked, refuse_clashes, store
from pipeline.cli.parser import number, one_of, pairs, periods
from pipeline.flag_words import FLAGS
from pipeline.methods import METHODS
from synth.kernels.cache import WATCHERS, cache_folder, stamp

_DURATION, _OF_FILM = 120.0, 150.0  # s, of what is worked on to compile kernels


def validate(options: argparse.Namespace) -> int:
    """Check each file; the exit status says whether all, some or none are good."""
    good = 0
    for name in options.files:
        faults = data_schemas.validate(name)
        for line in [naming(name, fault) for fault in faults] or [f"{name}: good"]:
            print(line, flush=True)
        good += not faults
    return exit_status(good, len(options.files))


def schema(options: argparse.Namespace) -> int:
    """Print a schema."""
    print(json.dumps(data_schemas.json_schema(options.name), indent=2, ensure_ascii=False))
    return 0


def explain(options: argparse.Namespace) -> int:
    """Say of a flag, or of all, what it means and what to do."""
    for name in FLAGS if options.flag is None else (one_of("flag", FLAGS)(options.flag),):
        meaning, remedy, blocks = FLAGS[name]
        blocked = f"\n  process refuses records that bear it, unless --accept {name} is given" if blocks else ""
        print(f"{name}\n  {meaning}\n  remedy: {remedy}{blocked}")
    return 0


def join(options: argparse.Namespace) -> int:
    """Put the parts together."""
    from pipeline.joining import join_records

    inputs, output = [Path(name) for name in options.parts], Path(options.out)
    refuse_clashes(inputs, [output], force=options.force)
    record = join_records([read_checked(path, "record") for path in inputs], [str(path) for path in inputs])
    data_schemas.write(record, output, overwrite=options.force)
    times = record.dataset["time"].values
    print(f"{output}: {len(inputs)} parts, {times.size} samples over {times[-1] - times[0]:.0f} s")
    return 0


def import_table(options: argparse.Namespace) -> int:
    """Import the table and write the record."""
    from pipeline.importing.record import ImportOptions, import_csv

    path = Path(options.table)
    output = place([path], options.out, ".record.nc")[0]
    refuse_clashes([path], [output], force=options.force)
    constants = _instrument(options)
    stated, gravity = constants.pop("period", {}), constants.pop("reference_gravity", None)
    recorded = {"vertical_acceleration": options.heave, "horizontal_acceleration": options.horizontal}
    meaning = ImportOptions(
        time=options.time,
        columns=tuple(options.column),
        unit=options.unit or "",
        lever=options.lever,
        periods=(stated if isinstance(stated, dict) else {"": stated}) | periods("import", options.period),
        gravity=gravity if options.gravity is None else options.gravity,
        combinations=pairs("import", "--combination", options.combination),
        accelerations={name: column for name, column in recorded.items() if column is not None},
        position=options.xy,
        noise=options.noise,
        instrument=constants,
    )
    record = import_csv(path, meaning)
    store(record, output, force=options.force)
    traces = ", ".join(str(label) for label in record["record"].dataset["trace"].values)
    time = record.dataset["time"].values
    print(f"{output}: {time.size} samples of {traces} over {time[-1]:.6g} s")
    return 0


def _instrument(options: argparse.Namespace) -> dict[str, Any]:
    """Constants of the TOML file, and of options, which go before it."""
    from data_schemas.text_files import load_toml

    found: dict[str, Any] = {}
    if options.instrument is not None:
        found |= load_toml(options.instrument, "constants of an instrument", UsageError)
    damping = pairs("import", "--damping", options.damping)
    given = {
        "damping_rate": {label: number("--damping")(rate) for label, rate in damping.items()} or None,
        "latitude": options.latitude,
        "scale_uncertainty": options.scale,
        "zero_uncertainty": 0.0 if options.zero_known else None,
    }
    return found | {name: value for name, value in given.items() if value is not None}


def warm(_options: argparse.Namespace) -> int:
    """Do a little of everything."""
    begun, compiled = time.perf_counter(), list[str]()
    made_from = stamp(__file__)
    ready = cache_folder() / f"ready-{made_from}"
    if made_from is not None and ready.exists():
        print("all kernels are ready")
        return 0
    WATCHERS[:] = [compiled.append]
    with tempfile.TemporaryDirectory(prefix="isochrony-") as folder:
        every = list(_steps(Path(folder)))
        for number, (what, do) in enumerate(every, 1):
            before, count = time.perf_counter(), len(compiled)
            do()
            told = f"{len(compiled) - count} kernels compiled, {time.perf_counter() - before:.0f} s"
            print(f"{number} of {len(every)}: {what}: {told}", file=sys.stderr, flush=True)
    for other in ready.parent.glob("ready-*"):
        other.unlink(missing_ok=True)
    if made_from is not None:
        ready.touch()
    print(f"all kernels are ready: {len(compiled)} compiled in {time.perf_counter() - begun:.0f} s")
    return 0


def _steps(folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """What is done, and how it is called."""
    from pipeline.batch.executors import warm as use
    from pipeline.film.digitise import digitise

    def scene(name: str, longest: float) -> Any:
        shipped = data_schemas.load_scene(synth.scene_path(name))
        return shipped.model_copy(update={"duration": min(shipped.duration, longest)})

    film = folder / "warm.film.tif"
    yield "process", partial(use, [name for name in METHODS if name != "auto"])
    for name in sorted(synth.scenes()):
        yield f"simulate {name}", partial(lambda each: synth.simulate(scene(each, _DURATION)), name)
    yield "expose", lambda: synth.expose_to(scene("film", _OF_FILM), synth.load_film("typical"), film)
    yield "digitise", partial(digitise, film)
