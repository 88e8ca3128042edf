"""One table of all results of a batch, as CSV and as netCDF: the same bytes however the batch came about."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.writing import write, write_text
from pipeline.batch.config import Config
from pipeline.batch.ledger_index import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

NAMES = ("summary.csv", "summary.nc")
MOST_NAMED = 10_000
"""Rows up to which the netCDF table holds names and reasons as text; beyond, they are in the CSV, in the same order."""

_TEXTS = {
    "record_id": "identity of the record",
    "input": "input file",
    "output": "result file, below the folder of the batch",
    "error": "why there is no value",
    "flags": "flags of the method, separated by blanks",
}
_CODED = {
    "status": "what became of the input by this method",
    "error_class": "kind of the fault",
    "requested_method": "method that was asked for",
    "method": "method that was used",
}
_NUMBERS = {
    "gravity_m_s2": ("m s-2", "gravity"),
    "gravity_sigma_mgal": ("mGal", "standard deviation of gravity"),
    "uncorrected_m_s2": ("m s-2", "gravity without any correction"),
    "noise_sigma_mgal": ("mGal", "standard deviation of gravity by reading noise alone"),
    "correction_mgal": ("mGal", "sum of all corrections"),
    "difference_frequency_rad_s": ("rad s-1", "mean phase speed of the difference, uncorrected"),
    "period_s": ("s", "full period at infinitesimal arc"),
    "period_sigma_s": ("s", "standard deviation of the period"),
    "samples_used": ("1", "samples that were used"),
}


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
    names = [*_TEXTS, *_CODED, *_NUMBERS]
    columns: dict[str, list[Any]] = {name: [] for name in [*names, *(f"sweep {key}" for key in swept)]}
    for path, config in jobs:
        if config.key in ledger.places:
            for row in _rows(path, config, ledger):
                for name, values in columns.items():
                    values.append(row.get(name))
    paths = [folder / name for name in NAMES]
    write_text(_csv(columns), paths[0], overwrite=True)
    write(_tree(columns), paths[1], overwrite=True)
    return paths


def _rows(path: Path, config: Config, ledger: Index) -> list[dict[str, Any]]:
    line = ledger.line(config.key)
    shared = {"input": str(path)} | {f"sweep {key}": value for key, value in config.variant}
    if line["output_sha256"] is None:
        return [shared | {name: line[name] for name in ("status", "error_class", "error")}]
    return [shared | {"output": config.key} | row for row in line["rows"]]


def _csv(columns: dict[str, list[Any]]) -> str:
    """Numbers so that they read back as the same double; what is not there is empty."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(zip(*columns.values(), strict=True))
    # a file name that is no UTF-8 is escaped, not fatal
    return text.getvalue().encode("utf-8", "backslashreplace").decode()


def _tree(columns: dict[str, list[Any]]) -> Any:
    from xarray import Dataset, DataTree

    count = len(columns["status"])
    variables: dict[str, tuple[str, NDArray[Any], dict[str, Any]]] = {}
    for name, values in columns.items():
        if name in _CODED:
            variables[name] = ("row", *_coded(values, _CODED[name]))
        elif name in _NUMBERS:
            units, long_name = _NUMBERS[name]
            variables[name] = ("row", _numbers(values), {"units": units, "long_name": long_name})
        elif name not in _TEXTS and not any(isinstance(value, str) for value in values):
            attrs = {"units": "1", "long_name": f"{name.partition(' ')[2]} of the scene, in the scene's own unit"}
            variables[name.replace(" ", "_")] = ("row", _numbers(values), attrs)
        elif count <= MOST_NAMED:
            attrs = {"units": "1", "long_name": _TEXTS.get(name, f"{name.partition(' ')[2]} of the scene")}
            variables[name.replace(" ", "_")] = ("row", _texts(values), attrs)
    attrs = {"Conventions": "CF-1.11", "schema": "isochrony-summary", "schema_version": "1"}
    return DataTree(Dataset(variables, attrs=attrs))


def _numbers(values: list[Any]) -> NDArray[Any]:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _texts(values: list[Any]) -> NDArray[Any]:
    plain = ("" if value is None else str(value) for value in values)
    return np.array(
        [one.encode("utf-8", "backslashreplace").decode().replace("\0", "?") for one in plain], dtype=object
    )


def _coded(values: list[Any], long_name: str) -> tuple[NDArray[Any], dict[str, Any]]:
    """Few words as numbers, as CF has it; 0 where there is none."""
    words = sorted({str(value) for value in values if value is not None})
    codes = {word: code for code, word in enumerate(words, start=1)}
    numbers = np.array([0 if value is None else codes[str(value)] for value in values], dtype=np.uint8)
    meanings = {"flag_values": np.arange(len(words) + 1, dtype=np.uint8), "flag_meanings": " ".join(["none", *words])}
    return numbers, {"units": "1", "long_name": long_name, **meanings}
