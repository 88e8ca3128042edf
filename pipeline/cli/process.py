"""`isochrony process`: records become gravity."""

import argparse
import sys
from collections.abc import Iterable
from itertools import zip_longest
from pathlib import Path
from textwrap import fill
from typing import Any

from data_schemas.errors import IsochronyError, UsageError
from pipeline.cli.files import exit_status, outcome_of, place, read_checked, refuse_clashes, store
from pipeline.cli.parser import did_you_mean, one_of
from pipeline.cli.summary_rows import SummaryPrinter, failure
from pipeline.flag_words import BLOCKING
from pipeline.methods import DECLARED, METHODS, known

_WORDS = {name: each.words for name, each in DECLARED.items()} | {"all": "every one of the above but auto"}
LISTED = "".join(
    "\n" + fill(words, 78, initial_indent=f"  {name:<14}  ", subsequent_indent=18 * " ")
    for name, words in _WORDS.items()
)


def reduction_options(options: argparse.Namespace) -> dict[str, Any]:
    """What says how records are reduced, the methods apart, as `pipeline.process` takes it."""
    accepted = sorted({one_of("flag", BLOCKING)(name) for name in options.accept})
    return {"pair": options.pair, "gain_uncertainty": options.gain_uncertainty, "accept": tuple(accepted)}


def run(options: argparse.Namespace) -> int:
    """Process every record; a bad one does not stop the others."""
    if options.synchrony and (options.method != "auto" or options.pair is not None or options.ledger):
        raise UsageError("process: --synchrony gives no gravity; drop --method, --pair and --ledger")
    names = ("synchrony",) if options.synchrony else requested_methods("process", options.method)
    requested = names[0] if len(names) == 1 else list(names)
    how = reduction_options(options)
    inputs = [Path(name) for name in options.records]
    if options.no_output and options.out is not None:
        raise UsageError("process: -o and --no-output contradict each other; give one of them")
    outputs = [] if options.no_output else place(inputs, options.out, ".result.nc")
    refuse_clashes(inputs, outputs, force=options.force)
    with_ledger = options.ledger or (len(inputs) == 1 and not options.synchrony)
    printer = SummaryPrinter(inputs, as_json=options.json, with_ledger=with_ledger)
    good = 0
    for path, output in _with_progress(list(zip_longest(inputs, outputs))):
        try:
            rows = _one(path, output, requested, options, how)
        except IsochronyError as fault:
            outcome = outcome_of(fault, path, alone=len(inputs) == 1)
            rows = [failure(path, "synchrony" if options.synchrony else options.method, *outcome)]
        printer.show(rows)
        good += any(row["status"] == "ok" for row in rows)
    return exit_status(good, len(inputs))


def _one(
    path: Path, output: Path | None, requested: str | list[str], options: argparse.Namespace, how: dict[str, Any]
) -> list[dict[str, Any]]:
    record = read_checked(path, "record")
    # imported after the check: a bad record is told before the kernels are loaded
    from pipeline.summary import summaries

    if options.synchrony:
        from pipeline.synchronism.recipe import synchrony

        result = synchrony(record, accept=how["accept"])
    else:
        from pipeline.processing import process

        result = process(record, method=requested, full=options.full, **how)
    rows = [{**row, "input": str(path), "output": None} for row in summaries(result)]
    if output is not None and any(row["status"] == "ok" for row in rows):
        store(result, output, force=options.force)
        rows = [{**row, "output": str(output)} for row in rows]
    return rows


def requested_methods(verb: str, text: str) -> tuple[str, ...]:
    """The methods asked for by `--method`, checked before any record is read; `UsageError` for one unknown or twice."""
    every = [name for name in METHODS if name != "auto"]
    names = [name for part in text.split(",") for name in (every if part.strip() == "all" else [part.strip()])]
    for name in names:
        if not known(name):
            raise UsageError(f"{verb}: unknown method '{name}'{did_you_mean(name, (*METHODS, 'all'))}")
    if len(set(names)) < len(names):
        raise UsageError(f"{verb}: --method {text} names a method twice; name each once")
    return tuple(names)


def _with_progress(jobs: list[Any]) -> Iterable[Any]:
    """The jobs, with a progress bar on stderr if a person watches and there is more than one."""
    if len(jobs) == 1 or not sys.stderr.isatty():
        return jobs
    from tqdm import tqdm

    bar: Iterable[Any] = tqdm(jobs, unit="record", file=sys.stderr, leave=False)
    return bar
