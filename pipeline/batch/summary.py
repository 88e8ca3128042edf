"""One table of all results of a batch, as CSV and as netCDF: the same bytes however the batch came about."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from data_schemas.writing import write, write_text
from pipeline.batch.config import Config
from pipeline.batch.ledger_index import Index
from pipeline.batch.summary_columns import Columns, storable

NAMES = ("summary.csv", "summary.nc")


def write_summary(jobs: Sequence[tuple[Path, Config]], ledger: Index, folder: Path) -> list[Path]:
    """Write both tables, a row an input and method, in the order of the inputs.

    Nothing enters that differs from run to run: no time, no host. Inputs that the ledger does not know are left out.

    Parameters
    ----------
    jobs : sequence of (Path, Config)
    ledger : Index
    folder : Path
        Of the tables, which are replaced.

    Returns
    -------
    list of Path

    Raises
    ------
    FileError
        A table cannot be written, or the ledger not read.
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
                table.writerow([storable(cell) if isinstance(cell, str) else cell for cell in cells])
    paths = [folder / name for name in NAMES]
    write_text(text.getvalue(), paths[0], overwrite=True)
    write(columns.tree(), paths[1], overwrite=True)
    return paths


def _rows(path: Path, config: Config, ledger: Index) -> list[dict[str, Any]]:
    line = ledger.line(config.key)
    shared = {"input": str(path)} | {f"sweep {key}": value for key, value in config.variant}
    if line["output_sha256"] is None:
        return [shared | {name: line[name] for name in ("status", "error_class", "error")}]
    return [shared | {"output": config.key} | row for row in line["rows"]]
