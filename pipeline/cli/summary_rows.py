"""Show the summaries of processed records: a table for a person, JSON Lines for a program."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.cli.ledger_table import print_ledger
from pipeline.cli.outputs import stem
from pipeline.cli.tables import Column, print_header, print_json, print_row

_KEYS = (
    "record_id", "input", "output", "status", "error", "requested_method", "method", "gravity_m_s2",
    "gravity_sigma_mgal", "frequency_rad_s", "difference_frequency_rad_s", "corrections_mgal",
    "sensitivity_mgal", "flags", "samples_used", "elapsed_s",
)  # fmt: skip
_MOST_SHOWN = 4  # corrections on the line of a record; more are added up
_SHORT = {
    "non_isochronism": "non-isochronism",
    "finite_arc": "arc",
    "horizontal_acceleration": "horizontal",
    "vertical_acceleration": "vertical",
    "transverse_acceleration": "transverse",
    "air_density": "air",
    "base_tie": "base",
}


def failure(path: Path, requested: str, status: str, error: str) -> dict[str, Any]:
    """Summary of an input that gave nothing: every key of the contract, null but for the reason."""
    row: dict[str, Any] = dict.fromkeys(_KEYS)
    row.update(record_id=stem(path), input=str(path), status=status, error=error, requested_method=requested)
    row.update(frequency_rad_s={}, corrections_mgal={}, sensitivity_mgal={}, flags=[])
    return row


def in_order(row: Mapping[str, Any]) -> dict[str, Any]:
    """A summary with the contract's keys first, in the contract's order."""
    return {**{key: row[key] for key in _KEYS if key in row}, **row}


class SummaryPrinter:
    """Prints each record's summaries as soon as they are known.

    A row of a single trace (a period, no gravity) has other columns: the headings are printed again when the
    kind changes.
    """

    def __init__(self, inputs: Sequence[Path], *, as_json: bool, with_ledger: bool = False) -> None:
        self._as_json = as_json
        self._with_ledger = with_ledger and not as_json
        self._width = max(len(stem(path)) for path in inputs)
        self._headed: list[Column] = []

    def show(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Print the summaries of one record; what failed goes to stderr as one line."""
        for row in rows:
            if self._as_json:
                print_json(in_order(row))
            if row["method"] is None:  # the input as a whole gave nothing
                print(f"isochrony: {' '.join(str(row['error']).split())}", file=sys.stderr, flush=True)
            elif not self._as_json:
                self._show_line(row)
        if self._with_ledger:
            print_ledger(rows)
            self._headed = []

    def _show_line(self, row: Mapping[str, Any]) -> None:
        single = "period_s" in row
        pair = row.get("synchrony")
        kind = _SYNCHRONY if pair else _PERIOD if single else _GRAVITY
        columns = [Column("record", self._width, right=False), Column("method", 14, right=False), *kind]
        if columns != self._headed:
            print_header(columns)
            self._headed = columns
        lead = [stem(Path(str(row["input"]))), str(row["method"])]
        if row["status"] != "ok":
            print_row(columns, lead)
            print(f"    {row['status']}: {row['error']}", flush=True)
            return
        value = (
            _synchrony(pair)
            if pair
            else [_number(row["period_s"], ".8f"), _number(row["period_sigma_s"], ".2g")]
            if single
            else [
                _number(row["gravity_m_s2"], ".8f"),
                _small(row["gravity_sigma_mgal"]),
                _corrections(row["corrections_mgal"]),
            ]
        )
        flags = ", ".join(row["flags"]) or "none"
        print_row(columns, [*lead, *value, _number(1e3 * row["elapsed_s"], ".1f"), flags])
        if row.get("choice_reason"):
            print(f"    {row['choice_reason']}", flush=True)


_TAIL = (Column("time ms"), Column("flags", right=False))
_GRAVITY = (
    Column("gravity m/s2", 12),
    Column("sigma mGal", 10),
    Column("corrections mGal", 38, right=False),
    *_TAIL,
)
_SYNCHRONY = (
    Column("pair", 6, right=False),
    Column("verdict", 12, right=False),
    Column("sure", 5),
    Column("angle deg", 9),
    Column("locked s", 9),
    Column("slips", 5),
    Column("swings/day", 11),
    Column("sigma", 8),
    *_TAIL,
)
_PERIOD = (Column("period s", 11), Column("sigma s", 8), *_TAIL)


def _number(value: float | None, form: str) -> str:
    return "-" if value is None or value != value else format(value, form)


def _synchrony(pair: Mapping[str, Any]) -> list[str]:
    angle = pair["angle_rad"]
    return [
        pair["pair"],
        pair["verdict"],
        _number(pair["confidence"], ".3f"),
        _number(None if angle is None else math.degrees(angle), ".2f"),
        _number(pair["lock_time_s"], ".1f"),
        str(pair["slips"]),
        _number(pair["rate_difference_per_day"], ".3f"),
        _number(pair["rate_difference_sigma_per_day"], ".2g"),
    ]


def _small(value: float | None) -> str:
    """Four decimals, or two digits where four decimals would show none."""
    return _number(value, ".4f" if value is None or abs(value) >= 1e-3 else ".1e")


def _corrections(entries: Mapping[str, float | None]) -> str:
    parts = [f"{_SHORT.get(name, name)} {_number(value, '+.4f')}" for name, value in entries.items() if value]
    if len(parts) > _MOST_SHOWN:
        return f"{sum(value or 0.0 for value in entries.values()):+.4f} in {len(parts)} corrections"
    return ", ".join(parts) or "none"
