"""The jobs of a batch from the words of the command line, and what it tells: its plan, and what became of all."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import data_schemas
import synth
from data_schemas.contents import shown
from data_schemas.errors import UsageError
from pipeline.batch.campaign import Job, Tally, holds
from pipeline.batch.config import Config
from pipeline.batch.inputs import MOST, Input, Variant, find_inputs, grid, parse_sweep
from pipeline.batch.ledger import NAME, Index, Log
from pipeline.cli.batch_kinds import KINDS, member_of
from pipeline.cli.faults import exit_status
from pipeline.cli.tables import complain

_MIB = 1 << 20
_MOST_TOLD = 10  # faults on stderr; the summary has all
_FEW = 4  # inputs named
_LONGEST = 4096  # letters of a path


def jobs_of(options: argparse.Namespace, folder: Path) -> list[Job]:
    """Every input with its settings, in order.

    `UsageError` for words that mean no file, options that contradict each other, an unknown method; `SceneError` for a
    key of a sweep that its scene does not have.
    """
    from pipeline.cli.process import reduction_options, requested_methods
    from pipeline.provenance import command_line

    methods = requested_methods("batch", options.method)
    inputs = find_inputs([_shipped(word) for word in options.inputs], KINDS)
    points = _points(options, inputs)
    command = command_line()
    made = []
    for one in inputs:
        for member, variant in points if one.kind.name == "scene" and points else [(0, ())]:
            key = f"{one.name}-{member:0{len(str(len(points)))}d}.result.nc" if member else f"{one.name}.result.nc"
            config = Config(
                key=key,
                folder=folder,
                kind=one.kind,
                method=methods,
                **reduction_options(options),
                member=member,
                variant=variant,
                memory=None if options.trusted else options.memory * _MIB,
                allow_paths=options.allow_paths,
                command=command,
            )
            made.append((one.path, config))
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


def _shipped(word: str) -> str:
    """Path of a shipped scene that is named without one."""
    path = Path(word)
    if os.path.exists(path) or path.suffix or path.parent != Path(".") or any(mark in word for mark in "*?["):
        return word

    return str(synth.scene_path(word))


def tell_plan(jobs: Sequence[Job], folder: Path, versions: str, options: argparse.Namespace) -> int:
    """Say of each input whether it would be done, at most `--limit` of them; nothing is made or changed."""
    known = Index(folder, versions) if os.path.exists(folder / NAME) else None
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
    named = {"ok": f"ok ({flagged} with flags)" if flagged else "ok"}
    text = ", ".join(
        f"{counts[status]} {named.get(status, status)}" for status in ("ok", "refused", "failed") if counts[status]
    )
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
    from pipeline.cli.summary_rows import failure, in_order
    from pipeline.cli.tables import print_json
    from pipeline.summary import summaries

    line: dict[str, Any] = ledger.line(config.key)
    if line["output_sha256"] is None:
        print_json(failure(path, ",".join(config.method), line["status"], line["error"]))
        return
    for row in summaries(data_schemas.read(config.output)):
        print_json(in_order({**row, "input": str(path), "output": str(config.output)}))
