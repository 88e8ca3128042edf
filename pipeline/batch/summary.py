"""One table of all results of a batch, as CSV and as netCDF: the same bytes however the batch came about."""

import csv
import io
import sys
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.variables import attributes, rows_of
from data_schemas.writing import write, write_text
from pipeline.batch.job import Config, owner_of
from pipeline.batch.ledger import Index

if TYPE_CHECKING:
    from xarray import DataTree

NAMES = ("summary.csv", "summary.nc")
MOST_NAMED = 10_000
"""Rows up to which names and reasons are there as text; beyond, they are in the CSV, in the same order."""

_ROWS = rows_of("summary")
TEXTS, CODED, NUMBERS = ([name for name, row in _ROWS.items() if row.dtype == kind] for kind in ("str", "u1", "f8"))


def write_summary(jobs: Sequence[tuple[Path, Config]], ledger: Index, folder: Path) -> list[Path]:
    """Write both tables, a row an input and method, in the order of the inputs.

    Nothing enters that differs from run to run: no time, no host. Inputs that the ledger does not know are left out.
    Tables that are there are replaced. `FileError` where one cannot be written, or the ledger not read.
    """
    swept = dict.fromkeys(f"sweep {key}" for _, config in jobs for key, _ in config.variant)
    columns: dict[str, Any] = {name: [] for name in (*TEXTS, *CODED)}
    columns |= {name: array("d") for name in NUMBERS} | {name: [] for name in swept}
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    for path, config in jobs:
        if config.key in ledger.places:
            for row in _rows(path, config, ledger):
                # numbers so that they read back as the same double
                cells = (row.get(name) for name in columns)
                table.writerow([defused(storable(cell)) if isinstance(cell, str) else cell for cell in cells])
                for name, values in columns.items():
                    value = row.get(name)
                    if name in NUMBERS:
                        values.append(np.nan if value is None else value)
                    elif name not in TEXTS or len(values) <= MOST_NAMED:
                        values.append(sys.intern(value) if name in CODED and value is not None else value)
    paths = [folder / name for name in NAMES]
    write_text(text.getvalue(), paths[0], overwrite=True, owner=owner_of(folder))
    write(tree_of(columns), paths[1], overwrite=True, owner=owner_of(folder))
    return paths


def defused(text: str) -> str:
    """Text that no spreadsheet takes for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def _rows(path: Path, config: Config, ledger: Index) -> list[dict[str, Any]]:
    line = ledger.line(config.key)
    shared = {"input": str(path)} | {f"sweep {key}": value for key, value in config.variant}
    if line["output_sha256"] is None:
        return [shared | {name: line[name] for name in ("status", "error_class", "error")}]
    return [shared | {"output": config.key} | row for row in line["rows"]]


def tree_of(columns: Mapping[str, Any]) -> "DataTree":
    """The table as it is written; keys of scenes that a sweep set have columns called ``sweep KEY``."""
    from xarray import Dataset, DataTree

    variables: dict[str, Any] = {}
    for name, values in columns.items():
        attrs = attributes(f"summary/{name}") if name in _ROWS else {"units": "1"}
        if name not in _ROWS:
            attrs["long_name"] = f"{name.partition(' ')[2]} of the scene, in the scene's own unit"
        if name in CODED:
            codes = {word: code for code, word in enumerate(["none", *filter(None, dict.fromkeys(values))])}
            attrs |= {"flag_values": np.arange(len(codes), dtype=np.uint8), "flag_meanings": " ".join(codes)}
            stored = np.array([codes[word or "none"] for word in values], dtype=np.uint8)
        elif name in TEXTS or any(isinstance(value, str) for value in values):
            if len(values) > MOST_NAMED:
                continue
            stored = np.array([*map(storable, values)], dtype=object)
        else:
            stored = np.array([np.nan if value is None else value for value in values], dtype=np.float64)
        variables[name.replace(" ", "_")] = ("row", stored, attrs)
    attrs = {"Conventions": "CF-1.11", "schema": "isochrony-summary", "schema_version": "1"}
    return DataTree(Dataset(variables, attrs=attrs))


def storable(value: object) -> str:
    """A value as text that any file can hold: what is no UTF-8 or does not print is escaped.

    >>> storable(None), storable(2.5), storable("a\\udcff")
    ('', '2.5', 'a\\\\udcff')
    """
    plain = "" if value is None else str(value)
    plain = plain.encode("utf-8", "backslashreplace").decode()
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in plain)
