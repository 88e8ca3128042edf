"""One table of all results of a batch, as CSV and as netCDF: the same bytes however the batch came about."""

from __future__ import annotations

import csv
import io
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
    swept = list(dict.fromkeys(key for _, config in jobs for key, _ in config.variant))
    columns = Columns(swept)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns.names)
    for path, config in jobs:
        if config.key in ledger.places:
            for row in _rows(path, config, ledger):
                columns.add(row)
                # numbers so that they read back as the same double
                cells = (row.get(name) for name in columns.names)
                table.writerow([defused(storable(cell)) if isinstance(cell, str) else cell for cell in cells])
    paths = [folder / name for name in NAMES]
    write_text(text.getvalue(), paths[0], overwrite=True, owner=owner_of(folder))
    write(columns.tree(), paths[1], overwrite=True, owner=owner_of(folder))
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


class Columns:
    """A table that grows by rows; keys of scenes that a sweep set have columns called ``sweep KEY``.

    Attributes
    ----------
    names : list of str
        Of all columns, in order.
    """

    def __init__(self, swept: Sequence[str]) -> None:
        self._swept: dict[str, list[Any]] = {f"sweep {key}": [] for key in swept}
        self._texts: dict[str, list[str]] = {name: [] for name in TEXTS}
        self._codes = {name: array("B") for name in CODED}
        self._words: dict[str, dict[str, int]] = {name: {} for name in CODED}
        self._numbers = {name: array("d") for name in NUMBERS}
        self.names = [*TEXTS, *CODED, *NUMBERS, *self._swept]

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row; what it does not have is empty, 0 or NaN."""
        for name, values in self._swept.items():
            values.append(row.get(name))
        for name, texts in self._texts.items():
            if len(texts) <= MOST_NAMED:
                texts.append(storable(row.get(name)))
        for name, codes in self._codes.items():
            word, known = row.get(name), self._words[name]
            codes.append(0 if word is None else known.setdefault(word, len(known) + 1))
        for name, numbers in self._numbers.items():
            value = row.get(name)
            numbers.append(np.nan if value is None else value)

    def tree(self) -> DataTree:
        """The table as it is written."""
        from xarray import Dataset, DataTree

        variables: dict[str, Any] = {}
        for name, texts in self._texts.items():
            if len(texts) <= MOST_NAMED:
                variables[name] = ("row", np.array(texts, dtype=object), attributes(f"summary/{name}"))
        for name, codes in self._codes.items():
            words = ["none", *self._words[name]]
            meanings = {"flag_values": np.arange(len(words), dtype=np.uint8), "flag_meanings": " ".join(words)}
            variables[name] = ("row", np.array(codes, dtype=np.uint8), attributes(f"summary/{name}") | meanings)
        for name, numbers in self._numbers.items():
            variables[name] = ("row", np.array(numbers), attributes(f"summary/{name}"))
        for name, values in self._swept.items():
            attrs = {"units": "1", "long_name": f"{name.partition(' ')[2]} of the scene, in the scene's own unit"}
            if not any(isinstance(value, str) for value in values):
                stored = np.array([np.nan if value is None else value for value in values], dtype=np.float64)
                variables[name.replace(" ", "_")] = ("row", stored, attrs)
            elif len(values) <= MOST_NAMED:
                variables[name.replace(" ", "_")] = ("row", np.array([*map(storable, values)], dtype=object), attrs)
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
