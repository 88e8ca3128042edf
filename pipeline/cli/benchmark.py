"""`isochrony benchmark`: the measured claims of the project, one suite at a time."""

import argparse
import importlib
from itertools import groupby
from pathlib import Path
from typing import Any

from data_schemas.errors import UsageError
from pipeline.benchmarks import tables
from pipeline.cli.parser import one_of
from pipeline.cli.process import requested_methods
from pipeline.cli.tables import print_json, print_table

SUITES = (
    "corrections", "paper", "stability", "honesty", "integrators", "film", "huygens", "batch", "bars",
)  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Run the suite; rows with a key `pass` decide the exit status."""
    one_of("suite", SUITES)(options.suite)
    folder = None if options.out is None else Path(options.out)
    if folder is not None and folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file, but -o must be a folder here; name another")
    ratios = Path(options.history) if options.history else None if folder is None else folder / tables.HISTORY
    if ratios is not None:
        tables.read_history(ratios)  # that it is one is told before the work
    own = _own(options)
    suite = importlib.import_module(f"pipeline.benchmarks.{options.suite}")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for row in suite.run(quick=options.quick, folder=folder, **own):
        rows.append(row)
        if options.json:
            print_json(row)
    for number, table in enumerate(list(each) for _, each in groupby(rows, key=tuple)):
        if not options.json:
            print("\n" * (number > 0), end="")
            print_table(table)
        if folder is not None:
            tables.write(folder / f"{options.suite}{f'-{next(iter(table[0]))}' if number else ''}.csv", table)
    if ratios is not None:
        tables.append_history(ratios, options.suite, rows, quick=options.quick)
    judged = [bool(row["pass"]) for row in rows if row.get("pass") is not None]
    if all(judged):
        return 0
    return 1 if any(judged) else 3


def _own(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments that the suite `honesty` alone takes."""
    given = {name: value for name in ("method", "kind", "seeds") if (value := getattr(options, name)) is not None}
    if given and options.suite != "honesty":
        raise UsageError(f"--{next(iter(given))} is of the suite honesty; drop it for {options.suite}")
    if "method" in given:
        given["methods"] = requested_methods("benchmark", given.pop("method"))
    if "kind" in given:
        given["only"] = given.pop("kind")
    return given
