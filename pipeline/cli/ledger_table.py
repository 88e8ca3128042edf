"""The ledger of a processed record for a person: what was added to gravity, what was not, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.cli.tables import Column, print_row

_WIDTH = 26  # of the names of corrections
_ONE = (
    Column("  correction", _WIDTH, right=False),
    Column("mGal", 12),
    Column("sigma", 9),
    Column("1e-7 s", 10),
    Column("made from", right=False),
)


def print_ledger(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the ledger of one record.

    Parameters
    ----------
    rows : sequence of mapping
        Its summaries, one a method; those without gravity are passed over. One method is shown with sigma, the change
        of the full period, and what the correction was made from; several stand side by side.
    """
    good = [row for row in rows if row["status"] == "ok" and row.get("ledger")]
    if not good:
        return
    print()
    if len(good) == 1:
        _one(good[0])
    else:
        _several(good)
    _not_applied(good)


def _one(row: Mapping[str, Any]) -> None:
    print(f"ledger of {row['method']}: corrections, added to gravity and (1e-7 s) to the full period")
    print_row(_ONE, [column.heading for column in _ONE])
    for entry in row["ledger"]:
        if entry["applied"]:
            value = [f"{entry['value_mgal']:+.4f}", _sigma(entry["sigma_mgal"]), f"{entry['period_1e-7_s']:+.3f}"]
            print_row(_ONE, [f"  {entry['entry']}", *value, entry["reason"]])
    total = sum(entry["value_mgal"] for entry in row["ledger"])
    period = sum(entry["period_1e-7_s"] for entry in row["ledger"])
    print_row(_ONE, ["  sum", f"{total:+.4f}", "", f"{period:+.3f}"])
    print_row(
        _ONE, ["  reading noise", "", _sigma(row["noise_sigma_mgal"]), "", "1 sigma of gravity from the readings"]
    )
    print(f"  uncorrected {row['uncorrected_m_s2']:.8f} m/s2, gravity {row['gravity_m_s2']:.8f} m/s2", end="")
    print(f", sigma {_sigma(row['gravity_sigma_mgal'])} mGal")
    for name in ("free_air_anomaly", "bouguer_anomaly"):
        if f"{name}_mgal" in row:
            print(f"  {name.replace('_', ' ')} {row[f'{name}_mgal']:+.3f} mGal")


def _several(rows: Sequence[Mapping[str, Any]]) -> None:
    print("ledger: corrections, added to gravity, mGal")
    columns = [_ONE[0], *(Column(str(row["method"]), 12) for row in rows)]
    print_row(columns, [column.heading for column in columns])
    for k, entry in enumerate(rows[0]["ledger"]):
        given = [row["ledger"][k] for row in rows]
        if any(each["applied"] for each in given):
            cells = [f"{each['value_mgal']:+.4f}" if each["applied"] else "-" for each in given]
            print_row(columns, [f"  {entry['entry']}", *cells])
    totals = [sum(entry["value_mgal"] for entry in row["ledger"]) for row in rows]
    print_row(columns, ["  sum", *(f"{total:+.4f}" for total in totals)])


def _not_applied(rows: Sequence[Mapping[str, Any]]) -> None:
    """What no method applied, one line each."""
    for k, entry in enumerate(rows[0]["ledger"]):
        if not any(row["ledger"][k]["applied"] for row in rows):
            print(f"  {entry['entry']:<{_WIDTH - 2}}  not applied: {entry['reason']}")


def _sigma(value: float) -> str:
    """Four decimals, two digits where they would show none, a question mark where nothing is known."""
    if value != value:
        return "?"
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.1e}"
