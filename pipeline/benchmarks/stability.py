"""Suite `stability`: every method of one difference on every extreme record, every propagator on every extreme motion.

A value with its error, or refused by name, never silently wrong.

A cell of the records is right if its error lies within five of its sigmas or if it carries a flag that says what is
wrong. Which cells may refuse is written down here beforehand; for the motions, in `stability_expected`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from data_schemas.errors import IsochronyError
from pipeline.benchmarks import stability_matrix
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.extremes import Extreme, extremes
from pipeline.benchmarks.progress import progress
from pipeline.gravity import MGAL
from pipeline.methods import PAIR_METHODS
from pipeline.processing import process
from pipeline.summary import summaries

SIGMAS = 5.0
FLOOR = 1e-3  # mGal: numerical error that no sigma speaks of

INEXACT = {
    "uncorrected": "leaves the non-isochronism in: its error is what it shows",
    "vening-meinesz": "lets the slow motion leak in: its error is what it shows",
}
"""Methods whose value is off by more than sigma by their nature; judged only where nothing can be right."""

NOTHING_THERE = {"noise-above-stated", "residual-not-white"}
"""Flags one of which a value must carry where there is no gravity to be had."""

_PHASE = ("uncorrected", "vening-meinesz", "panteleev", "general")
_ALL = PAIR_METHODS
MAY_REFUSE: Mapping[str, tuple[tuple[str, ...], str]] = {
    "a through zero": (_PHASE, "the phase of a vanishing amplitude means nothing"),
    "huge arc, sine, stated": (_ALL, "series in the arc and linear identities do not hold at 1 rad"),
    "huge arc, sine, unsaid": (_ALL, "series in the arc and linear identities do not hold at 1 rad"),
    "all NaN, first pendulum": (_ALL, "without the first pendulum there is no correction"),
    "10 s long": (_ALL, "ten swings hold no window in which the harmonic is told from the swell"),
    "two samples a swing": (("projection", "shooting"), "quadrature needs eight readings a swing"),
    "less than two a swing": (_ALL, "below two readings a swing the harmonic is an image of itself"),
    "pure noise": (_ALL, "there is no swing"),
    "nominal period 5 % long": (_ALL, "the swing is not where the record says"),
    "nominal period 20 % long": (_ALL, "the swing is not where the record says"),
}
"""Record -> methods that may decline it, and why. Every other cell must give a value."""


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a record, one cell a method (errors in mGal); then one row a motion, one cell a propagator.

    Quick and full are the same. With a folder: both matrices as CSV.
    """
    records = []
    for extreme in progress(extremes(), "stability"):
        records.append(judge(extreme, reduce(extreme)))
        yield records[-1]
    motions = []
    for row in stability_matrix.rows():
        motions.append(row)
        yield row
    if folder is not None:
        write(folder / "stability-records.csv", records)
        write(folder / "stability-motions.csv", motions)


def reduce(extreme: Extreme) -> dict[str, dict[str, Any]]:
    """Summary of every method on the record; a record that is declined as a whole is declined by each."""
    try:
        rows = summaries(process(extreme.make(), method=PAIR_METHODS))
    except IsochronyError as refusal:
        return {name: {"status": "refused", "error": str(refusal), "flags": []} for name in PAIR_METHODS}
    return {str(row["requested_method"]): row for row in rows}


def judge(extreme: Extreme, found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    allowed = MAY_REFUSE.get(extreme.name, ((), ""))[0]
    silent = [name for name, row in found.items() if row["status"] == "ok" and not _right(name, row, extreme)]
    unlisted = [name for name, row in found.items() if row["status"] != "ok" and name not in allowed]
    cells = {name: _cell(row, extreme) for name, row in found.items()}
    return {
        "record": extreme.name,
        **cells,
        "silently_wrong": " ".join(silent),
        "refused_unlisted": " ".join(unlisted),
        "pass": not silent and not unlisted,
    }


def error(row: Mapping[str, Any], extreme: Extreme) -> float:
    """Error of gravity, mGal; NaN where the record amounts to no gravity at all."""
    if extreme.gravity is None:
        return math.nan
    return (float(row["gravity_m_s2"]) - extreme.gravity) / MGAL


def _right(name: str, row: Mapping[str, Any], extreme: Extreme) -> bool:
    if extreme.gravity is None:
        return not NOTHING_THERE.isdisjoint(row["flags"])
    if row["flags"]:
        return True
    return name in INEXACT or abs(error(row, extreme)) <= SIGMAS * float(row["gravity_sigma_mgal"]) + FLOOR


def _cell(row: Mapping[str, Any], extreme: Extreme) -> str:
    if row["status"] != "ok":
        return f"refused: {row['error']}"
    value = error(row, extreme)
    shown = f"{row['gravity_m_s2']:.6f} m/s2" if math.isnan(value) else f"{value:.3g}"
    flags = f" [{' '.join(row['flags'])}]" if row["flags"] else ""
    return f"{shown} +- {row['gravity_sigma_mgal']:.2g}{flags}"
