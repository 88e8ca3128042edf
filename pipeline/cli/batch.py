"""`isochrony batch`: kinds of input, jobs from the words of the command line, what is told of them."""

import argparse
import os
import sys
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import data_schemas
import synth
from data_schemas.contents import shown
from data_schemas.errors import FileError, UsageError
from pipeline.batch import campaign
from pipeline.batch.campaign import Job, Tally, holds
from pipeline.batch.inputs import MOST, Input, Variant, find_inputs, grid, parse_sweep
from pipeline.batch.job import Allow, Config, Kind
from pipeline.batch.ledger import NAME, Index, Ledger, Log
from pipeline.batch.summary import NAMES, write_summary
from pipeline.cli.files import exit_status, folder_for_output, orderly, refuse_clashes
from pipeline.cli.parser import processors
from pipeline.cli.process import reduction_options, requested_methods
from pipeline.cli.simulate import shipped
from pipeline.cli.summary_rows import failure, in_order
from pipeline.cli.tables import complain, print_json, progress
from pipeline.provenance import command_line, versions

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.scene import Scene

_TLS = {"tls_ca": "tls_ca_file", "tls_cert": "tls_client_cert", "tls_key": "tls_client_key"}  # as dask names them
_MIB = 1 << 20
_MOST_TOLD = 10  # faults on stderr; the summary has all
_FEW = 4  # inputs named
_LONGEST = 4096  # letters of a path
_TIFF = (".tif", ".tiff")


def read_record(path: Path, _config: Config, allow: Allow) -> "DataTree":
    """A record file: looked over, then read."""
    return data_schemas.read(path, declared=allow)


def simulate_scene(path: Path, config: Config, allow: Allow) -> "DataTree":
    """A scene, or a member of it: simulated, its truth forgotten."""
    scene = data_schemas.load_scene(path, allow_paths=config.allow_paths)
    if config.member:
        scene = member_of(scene, config.member, config.variant)
    allow(8 * scene.count * (len(scene.traces) + 1))
    record, _ = synth.simulate(scene)
    return record


def member_of(scene: "Scene", number: int, variant: Variant) -> "Scene":
    """One point of a grid, with a seed of its own; `SceneError` for a key that the scene has not, or a bad value."""
    from synth.ensemble import member, member_scenes

    vary: dict[str, Any] = {key: lambda _chance, value=value: value for key, value in variant}
    next(member_scenes(scene, 1, vary=vary))  # an unknown key is told with the nearest known one
    return member(scene, number, vary=vary)


def digitise_film(path: Path, _config: Config, allow: Allow) -> "DataTree":
    """The scan of a film: read by what stands in NAME.film.toml beside it."""
    from pipeline.film.digitise import digitise

    # read piece by piece, the rows' arrays apart; other formats than TIFF are decoded whole, from a fifth of their size
    piecewise = path.suffix.lower() in _TIFF
    allow(path.stat().st_size // 8 if piecewise else 5 * path.stat().st_size)
    return digitise(path)


def description_beside(path: Path) -> Path:
    """Where the description of a film is kept."""
    from data_schemas.film_description import description_path

    return description_path(path)


KINDS = (
    Kind("record", (".record.nc", ".nc"), read_record),
    Kind("film", _TIFF, digitise_film, beside=description_beside),
    Kind("film as PNG or JPEG", (".png", ".jpg", ".jpeg"), digitise_film, searched=False, beside=description_beside),
    Kind("scene", (".toml",), simulate_scene, searched=False),
)  # All kinds, by the endings of their files


def run(options: argparse.Namespace) -> int:
    """Do the jobs that the options name, and tell what became of them."""
    _refuse_contradictions(options)
    folder = Path(options.out)
    jobs = jobs_of(options, folder)
    begun = os.path.lexists(folder / NAME)
    if begun and not (options.resume or options.retry_failed or options.force or options.dry_run):
        raise UsageError(f"{folder}: a batch was begun there; go on with --resume, or do it anew with --force")
    inputs = list(dict.fromkeys(path for path, _ in jobs))
    outputs = [config.output for _, config in jobs] + [folder / name for name in NAMES]
    refuse_clashes(inputs, outputs, force=begun or options.force)
    if options.dry_run:
        return tell_plan(jobs, folder, options)
    tally = Tally(len(jobs))
    with folder_for_output(folder), Ledger(folder, versions()) as ledger, Log(folder) as log:
        log.event("begin", command=sys.argv, inputs=len(jobs), versions=versions())
        try:
            is_summed = _do(options, jobs, ledger, log, tally)
        except (KeyboardInterrupt, SystemExit) as leaving:
            log.event("interrupted", done=tally.done, kept=tally.kept)
            told = f"{tally.done + tally.kept} of {tally.total} inputs are done; the same with --resume goes on"
            complain(f"interrupted: {told}")
            return leaving.code if isinstance(leaving, SystemExit) and isinstance(leaving.code, int) else 130
        status = tell_end(jobs, ledger, folder, tally, log, as_json=options.json)
        return status if is_summed else max(status, 1)


def _refuse_contradictions(options: argparse.Namespace) -> None:
    """Refuse options that contradict each other before any work; the files of TLS by their names in dask."""
    if not options.out:
        raise UsageError("batch: -o wants a folder, not an empty name")
    if options.executor == "serial" and not options.trusted:
        raise UsageError("batch: --executor serial reads inputs in this process, unguarded; add --trusted if they are")
    if options.executor == "serial" and (options.scheduler is not None or options.jobs is not None):
        raise UsageError("batch: --executor serial has one process; leave --jobs and --scheduler out")
    if options.scheduler is not None and options.jobs is not None:
        raise UsageError("batch: --jobs is about this machine; with --scheduler the cluster's workers count")
    given = [getattr(options, name) for name in _TLS]
    if any(given) and not (all(given) and (options.scheduler or "").startswith("tls://")):
        raise UsageError("batch: --tls-ca, --tls-cert and --tls-key go together, with --scheduler tls://HOST:PORT")
    for path in filter(None, given):
        if not os.path.isfile(path):
            raise UsageError(f"{path}: is not a file; give the certificate or key in PEM")
    if options.force and (options.resume or options.retry_failed):
        raise UsageError("batch: --force does everything anew, --resume keeps what was done; give one of them")

    options.security = {of_dask: path for of_dask, path in zip(_TLS.values(), given, strict=True) if path is not None}


def _do(options: argparse.Namespace, jobs: list[Job], ledger: Ledger, log: Log, tally: Tally) -> bool:
    """Do the work; whether the summary could be written."""
    folder = Path(options.out)
    with orderly(), progress("batch", " records") as draw:
        campaign.remove_leftovers(folder)
        how = {"anew": options.force, "retry_failed": options.retry_failed, "limit": options.limit, "progress": draw}
        try:
            campaign.run(jobs, ledger, _executor(options, jobs), log, tally, **how)
        finally:
            campaign.remove_leftovers(folder)  # of processes that were ended
        try:
            write_summary(jobs, ledger, folder)
        except FileError as fault:  # the results are there all the same
            complain(f"{fault}; then --resume writes it")
            return False
    return True


def _executor(options: argparse.Namespace, jobs: list[Job]) -> Any:
    """The executor asked for, as a function of jobs alone."""
    limits = {"methods": jobs[0][1].method, "timeout": options.timeout}
    if options.scheduler is not None:
        from pipeline.batch.cluster import clustered

        return partial(clustered, address=options.scheduler, security=options.security, told=complain, **limits)
    from pipeline.batch.executors import pooled, serial

    if options.executor == "serial":
        return serial
    return partial(pooled, workers=min(options.jobs or processors(), len(jobs)), **limits)


def jobs_of(options: argparse.Namespace, folder: Path) -> list[Job]:
    """Every input with its settings, in order; `UsageError`, `SceneError`: words, options or keys that do not fit."""
    methods = requested_methods("batch", options.method)
    inputs = find_inputs([str(shipped(word, os.path.exists)) if word else "" for word in options.inputs], KINDS)
    points = _points(options, inputs)
    memory = None if options.trusted else options.memory * _MIB
    shared = {"folder": folder, "method": methods, "memory": memory, "allow_paths": options.allow_paths}
    shared |= {"command": command_line(), **reduction_options(options)}
    made = []
    for one in inputs:
        for member, variant in points if one.kind.name == "scene" and points else [(0, ())]:
            number = f"-{member:0{len(str(len(points)))}d}" if member else ""
            key = f"{one.name}{number}.result.nc"
            made.append((one.path, Config(key=key, kind=one.kind, member=member, variant=variant, **shared)))
    return made


def _points(options: argparse.Namespace, inputs: list[Input]) -> list[tuple[int, Variant]]:
    """Members of every scene, by number; none where scenes are to be taken as they are."""
    if not options.sweep and options.repeat is None:
        return []
    scenes = [one for one in inputs if one.kind.name == "scene"]
    if not scenes:
        raise UsageError("--sweep and --repeat are about scenes (.toml); name one, or leave them out")
    variants = grid([parse_sweep(word) for word in options.sweep or []])
    repeat = options.repeat or 1
    if len(variants) * repeat > MOST:
        raise UsageError(f"--sweep with --repeat makes more than {MOST} members; make the grid smaller")
    for one in scenes:  # a sweep that no member could be made by is told now, as `SceneError`
        member_of(data_schemas.load_scene(one.path, allow_paths=options.allow_paths), 1, variants[0])
    return list(enumerate((variant for variant in variants for _ in range(repeat)), start=1))


def tell_plan(jobs: Sequence[Job], folder: Path, options: argparse.Namespace) -> int:
    """Say of each input whether it would be done, at most `--limit` of them; nothing is made or changed."""
    known = Index(folder, versions()) if os.path.exists(folder / NAME) else None
    done = kept = 0
    for path, config in jobs:
        held = not options.force and known is not None and holds(path, config, known, retry_failed=options.retry_failed)
        waits = not held and options.limit is not None and done >= options.limit
        done, kept = done + (not held and not waits), kept + held
        what = "keep" if held else "wait" if waits else "do"
        print(f"{what}  {shown(path, _LONGEST)} -> {shown(config.output, _LONGEST)}", flush=True)
    print(f"{done} to do, {kept} to keep, {len(jobs) - done - kept} to wait")
    return 0


def tell_end(jobs: Sequence[Job], ledger: Index, folder: Path, tally: Tally, log: Log, *, as_json: bool) -> int:
    """Say what became of everything; return the exit status."""
    if as_json:
        for path, config in jobs:
            if config.key in ledger.places:
                _print_json(path, config, ledger)
    done = {config.key: ledger.places[config.key].status for _, config in jobs if config.key in ledger.places}
    counts, bad = Counter(done.values()), [key for key, status in done.items() if status != "ok"]
    for key in bad[:_MOST_TOLD]:
        complain(ledger.line(key)["error"])
    if len(bad) > _MOST_TOLD:
        complain(f"and {len(bad) - _MOST_TOLD} more, see {folder / 'summary.csv'}")
    flagged = _flagged(jobs, ledger)
    left = tally.total - counts.total()
    words = {"ok": f"ok ({flagged} with flags)" if flagged else "ok", "refused": "refused", "failed": "failed"}
    text = ", ".join(f"{counts[status]} {word}" for status, word in words.items() if counts[status])
    log.event("end", done=tally.done, kept=tally.kept, left=left, **counts)
    if not as_json:
        waiting = f"; {left} left for --resume" if left else ""
        print(f"{folder / 'summary.csv'}: {text or 'nothing'} of {tally.total} inputs, {tally.kept} kept{waiting}")
    return exit_status(counts["ok"], tally.total - left)


def _flagged(jobs: Sequence[Job], ledger: Index) -> int:
    """How many inputs have flags; told on the way, so that the ledger is read once: those that have one record id."""
    named: dict[str, dict[Path, None]] = {}
    flagged = 0
    for path, config in jobs:
        if (found := ledger.places.get(config.key)) is not None and found.status == "ok":
            rows = ledger.line(config.key)["rows"]
            flagged += any(row.get("flags") for row in rows)
            if not config.member and rows:
                named.setdefault(str(rows[0].get("record_id")), {})[path] = None
    alike = {name: paths for name, paths in named.items() if len(paths) > 1}
    for name, paths in list(alike.items())[:_MOST_TOLD]:
        some = ", ".join(shown(path, _LONGEST) for path in list(paths)[:_FEW]) + (", .." if len(paths) > _FEW else "")
        complain(f"{len(paths)} inputs have the record id '{name}': {some}; are they the same record?")
    return flagged


def _print_json(path: Path, config: Config, ledger: Index) -> None:
    """The objects that `process` prints, read back from the result."""
    from pipeline.summary import summaries

    line: dict[str, Any] = ledger.line(config.key)
    if line["output_sha256"] is None:
        print_json(failure(path, ",".join(config.method), line["status"], line["error"]))
        return
    for row in summaries(data_schemas.read(config.output)):
        print_json(in_order({**row, "input": str(path), "output": str(config.output)}))
