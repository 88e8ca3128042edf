"""Show processed records: a table and the ledger for a person, JSON Lines for a program."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.cli import tables
from pipeline.cli.files import stem
from pipeline.cli.tables import Column, columns, complain, print_header, print_json, print_row, print_text
from pipeline.flag_words import told

_KEYS = (
    "record_id", "input", "output", "status", "error", "requested_method", "method", "gravity_m_s2",
    "gravity_sigma_mgal", "frequency_rad_s", "difference_frequency_rad_s", "corrections_mgal",
    "sensitivity_mgal", "flags", "samples_used", "elapsed_s",
)  # fmt: skip
_ONE = columns("  correction <26", "mGal >12", "sigma >9", "1e-7 s >10")

_KINDS: Mapping[str, Sequence[tuple[str, str, str]]] = {
    "gravity": (
        ("method <14", "method", ""), ("gravity m/s2 >12", "gravity_m_s2", ".8f"),
        ("sigma mGal >10", "gravity_sigma_mgal", "sigma"), ("corrected mGal >14", "corrected", "+.4f"),
    ),
    "period": (
        ("method <14", "method", ""), ("period s >11", "period_s", ".8f"), ("sigma s >8", "period_sigma_s", ".2g"),
    ),
    "pair": (
        ("pair <6", "pair", ""), ("verdict <12", "verdict", ""), ("sure >5", "confidence", ".3f"),
        ("angle deg >9", "angle", ".2f"), ("locked s >9", "lock_time_s", ".1f"), ("slips >5", "slips", ""),
        ("swings/day >10", "rate_difference_per_day", ".3f"), ("sigma >7", "rate_difference_sigma_per_day", ".2g"),
    ),
}  # fmt: skip
"""Columns of what a row may tell: heading, key, form."""


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
    """Prints a record's summaries as soon as they are known, with headings again where the kind of row changes."""

    def __init__(self, inputs: Sequence[Path], *, as_json: bool, with_ledger: bool = False) -> None:
        self._as_json = as_json
        self._with_ledger = with_ledger and not as_json
        self._first = columns(f"record <{max(len(stem(path)) for path in inputs)}")
        self._headed: list[Column] = []
        self._named = ""

    def show(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Print the summaries of one record; what failed goes to stderr in one line."""
        for row in rows:
            if self._as_json:
                print_json(in_order(row))
            if row["method"] is None:  # the input as a whole gave nothing
                complain(row["error"])
            elif not self._as_json:
                self._show_line(row)
        if self._with_ledger:
            print_ledger(rows)
            self._headed = []

    def _show_line(self, row: Mapping[str, Any]) -> None:
        told = {**row, **(row.get("synchrony") or {})}
        kind = "pair" if "pair" in told else "period" if "period_s" in row else "gravity"
        headings, keys, forms = zip(*_KINDS[kind], strict=True)
        name, own = stem(Path(str(row["input"]))), columns(*headings)
        shown, lead = [*self._first, *own], [name]
        if tables.width_of(shown) > tables.LINE:  # the record's name on a line of its own
            shown, lead = [*own], []
        if shown != self._headed:
            print_header(shown)
            self._headed = shown
        if not lead and name != self._named:
            print(f"{name}:")
        self._named = name
        if row["status"] != "ok":
            print_row(shown, [*lead, str(row["method"])])
            print_text(f"{row['status']}: {row['error']}", more=2)
            return
        if (angle := told.get("angle_rad")) is not None:
            told["angle"] = math.degrees(angle)
        told["corrected"] = sum(value or 0.0 for value in row["corrections_mgal"].values())
        print_row(shown, [*lead, *(_cell(told.get(key), form) for key, form in zip(keys, forms, strict=True))])
        flags = "flags: " + ", ".join(row["flags"]) if row["flags"] else ""
        for text in filter(None, (row.get("choice_reason"), flags)):
            print_text(text, more=2)


def _cell(value: Any, form: str) -> str:
    if value is None or value != value:
        return "-"
    return _sigma(value) if form == "sigma" else format(value, form)


def _sigma(value: float | None) -> str:
    """Four decimals, or two digits where four decimals would show none."""
    if value is None or value != value:
        return "?"
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.1e}"


LEAST_SHARE = 0.005  # of the variance, that is printed


def print_ledger(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the ledger of the methods that gave gravity: one with sigmas and reasons, or several side by side."""
    good = [row for row in rows if row["status"] == "ok" and row.get("ledger")]
    if not good:
        return
    print()
    if len(good) == 1:
        _one(good[0])
    else:
        _several(good)
    reasons: dict[str, list[str]] = {}
    for entries in zip(*(row["ledger"] for row in good), strict=True):
        if not any(entry["applied"] for entry in entries):
            reasons.setdefault(entries[0]["reason"], []).append(entries[0]["entry"])
    if reasons:
        print("  not applied:")
    for reason, names in reasons.items():
        print_text(f"{', '.join(names)}: {reason}", more=2)
    for flag in dict.fromkeys(flag for row in good for flag in row["flags"]):
        print_text(f"{flag}: {told(flag)}", 2, more=2)


def _one(row: Mapping[str, Any]) -> None:
    print(f"ledger of {row['method']}: corrections, added to gravity and to the full period")
    print_header(_ONE)
    for entry in row["ledger"]:
        if entry["applied"]:
            value = [f"{entry['value_mgal']:+.4f}", _sigma(entry["sigma_mgal"]), f"{entry['period_1e-7_s']:+.3f}"]
            print_row(_ONE, [f"  {entry['entry']}", *value])
            print_text(entry["reason"], 6)
    total, period = (sum(entry[name] for entry in row["ledger"]) for name in ("value_mgal", "period_1e-7_s"))
    print_row(_ONE, ["  sum", f"{total:+.4f}", "", f"{period:+.3f}"])
    print_row(_ONE, ["  reading noise", "", _sigma(row["noise_sigma_mgal"])])
    print(f"  uncorrected {row['uncorrected_m_s2']:.8f} m/s2, gravity {row['gravity_m_s2']:.8f} m/s2")
    if row["budget"]:
        shares = (f"{name} {100.0 * share:.0f} %" for name, share in row["budget"].items() if share >= LEAST_SHARE)
        print_text(f"variance: {', '.join(shares)}; {row['advice']}", 2, more=2)
    for name in ("free_air_anomaly", "bouguer_anomaly"):
        if f"{name}_mgal" in row:
            print(f"  {name.replace('_', ' ')} {row[f'{name}_mgal']:+.3f} mGal")


def _several(rows: Sequence[Mapping[str, Any]]) -> None:
    print("ledger: corrections, added to gravity, mGal")
    shown = [_ONE[0], *columns(*(f"{row['method']} >12" for row in rows))]
    for places in tables.blocks(shown):
        print_header([shown[each] for each in places])
        some = [rows[each - 1]["ledger"] for each in places[1:]]
        for k, entry in enumerate(rows[0]["ledger"]):
            if any(row["ledger"][k]["applied"] for row in rows):
                cells = [f"{each[k]['value_mgal']:+.4f}" if each[k]["applied"] else "-" for each in some]
                print_row(shown, [f"  {entry['entry']}", *cells])
        print_row(shown, ["  sum", *(f"{sum(entry['value_mgal'] for entry in each):+.4f}" for each in some)])
