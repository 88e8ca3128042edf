"""`isochrony benchmark`: the measured claims of the project, one suite at a time."""

from __future__ import annotations

import argparse
import importlib
from itertools import groupby
from pathlib import Path
from typing import Any

from data_schemas.errors import UsageError
from pipeline.cli.parser import one_of
from pipeline.cli.tables import print_json, print_table

# Suite -> module with `run(*, quick: bool, folder: Path | None) -> rows` and what it shows.
SUITES = {
    "corrections": (
        "pipeline.benchmarks.corrections",
        "what every method leaves (mGal) and costs, on every kind of record; -o resumes",
    ),
    "paper": ("pipeline.benchmarks.paper", "the source paper's own figures, reproduced"),
    "stability": (
        "pipeline.benchmarks.stability",
        "methods and propagators on extreme cases: a value, or refused by name",
    ),
    "uncertainty": (
        "pipeline.benchmarks.uncertainty",
        "random records of every kind by `auto`: whether the stated uncertainty holds; -o resumes",
    ),
    "integrators": ("pipeline.benchmarks.integrators", "propagators against general integrators: time and error"),
    "speed": ("pipeline.benchmarks.speed", "estimation and the command line against what they replace or import"),
    "leave-out": ("pipeline.benchmarks.leave_out", "what `process` imports and spends, method by method"),
    "terms": (
        "pipeline.benchmarks.cost_of_terms",
        "what a scene pays for its terms: run, compile and start-up time, modules",
    ),
    "film": (
        "pipeline.benchmarks.film",
        "films read: error, flags, speed against grain, speed, dpi, crossings, missing marks, and beside peers",
    ),
    "huygens": (
        "pipeline.benchmarks.huygens",
        "clocks on a beam: the paper's regime by every way, lock map, basins, what holds; -o resumes",
    ),
    "batch": (
        "pipeline.benchmarks.batch",
        "a record's cost in a batch beside a bare loop, one process and two, dask, killed and resumed",
    ),
    "bars": ("pipeline.benchmarks.bars", "every promised accuracy and speed: bar, value, limit, pass"),
}
_LISTED = "\n".join(f"  {name:<12} {text}" for name, (_, text) in SUITES.items())

_DESCRIPTION = f"""\
Run a suite of benchmarks on scenes of the project's own and print its rows.

suites:
{_LISTED}"""

_EXAMPLES = """\
examples:
  isochrony benchmark corrections --quick
  isochrony benchmark corrections -o out/      tables, pictures; run again, it goes on where it was interrupted
  isochrony benchmark bars --json > bars.jsonl

exit status: 0; 1 if some rows do not pass and some do; 3 if none passes"""


def add_parser(verbs: Any) -> argparse.ArgumentParser:
    """List the verb and its options."""
    parser: argparse.ArgumentParser = verbs.add_parser(
        "benchmark", help="measured claims, suite by suite", description=_DESCRIPTION, epilog=_EXAMPLES
    )
    parser.add_argument("suite", metavar="SUITE", type=one_of("suite", SUITES), help=", ".join(SUITES))
    parser.add_argument("--quick", action="store_true", help="fewer and shorter records")
    parser.add_argument("--json", action="store_true", help="JSON Lines instead of a table")
    parser.add_argument("-o", dest="out", metavar="FOLDER", help="keep what the suite writes (created if absent)")
    return parser


def run(options: argparse.Namespace) -> int:
    """Run the suite; rows with a key `pass` decide the exit status."""
    folder = None if options.out is None else Path(options.out)
    if folder is not None and folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, but -o must be a folder here; name another")
    suite = importlib.import_module(SUITES[options.suite][0])
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for row in suite.run(quick=options.quick, folder=folder):
        rows.append(row)
        if options.json:
            print_json(row)
    if not options.json:
        for number, (_, table) in enumerate(groupby(rows, key=tuple)):
            if number:
                print()
            print_table(list(table))
    judged = [bool(row["pass"]) for row in rows if row.get("pass") is not None]
    if all(judged):
        return 0
    return 1 if any(judged) else 3
