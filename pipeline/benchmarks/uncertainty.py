"""Suite `uncertainty`: random records of every kind by `auto`; does the stated uncertainty hold, and where it does not,
does a flag say so?

With a folder: a row a record (CSV), everything (JSON), and the finished records, so that a run that was interrupted
goes on where it stopped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from data_schemas.errors import IsochronyError
from pipeline.benchmarks import json_table, random_scenes
from pipeline.benchmarks.bar import at_least, at_most
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.progress import progress

Row = dict[str, Any]
FULL, QUICK = 400, 40
EXACT = 1e-3
"""mGal; a smaller error is right whatever sigma says."""
FAR = 4.0  # sigmas
_WITHIN, _FAR_AND_SILENT = 0.9, 0.02  # shares


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield a row a kind of records (a record is of several), then the promises. Quick: a tenth as many records."""
    kept = Kept(folder)
    records = [one(number, kept) for number in progress(range(QUICK if quick else FULL), "uncertainty")]
    names = dict.fromkeys(name for record in records for name in record["kinds"].split("; "))
    table = [summed(name, [record for record in records if name in record["kinds"].split("; ")]) for name in names]
    table.insert(0, summed("all", records))
    every = table[0]
    promises = [
        at_least("within 2 sigma, of the records without a flag", every["within_2_sigma"], _WITHIN),
        at_most(
            f"beyond {FAR:g} sigma and without a flag", every["far_and_silent"] / every["records"], _FAR_AND_SILENT
        ),
    ]
    yield from table
    yield from promises
    if folder is not None:
        write(folder / "uncertainty.csv", records)
        json_table.write(folder / "uncertainty.json", {"kinds": table, "records": records, "bars": promises})


def one(number: int, kept: Kept) -> Row:
    """What `auto` makes of the record of that number; errors in mGal."""
    configuration = {"suite": "uncertainty", "number": number}
    found = kept.get(configuration)
    if found is None:
        found = [_made(number)]
        kept.put(configuration, found)
    return found[0]


def _made(number: int) -> Row:
    import synth
    from pipeline.processing import process
    from pipeline.summary import summaries

    scene = random_scenes.scene(number)
    row: Row = {"number": number, "kinds": "; ".join(random_scenes.kinds(scene))}
    record, _ = synth.simulate(scene)
    try:
        (told,) = summaries(process(record, method="auto"))
    except IsochronyError as refusal:
        told = {"status": "refused", "error": str(refusal)}
    good = told["status"] == "ok"
    error, sigma = (
        ((told["gravity_m_s2"] - scene.gravity) * 1e5, told["gravity_sigma_mgal"]) if good else (math.nan,) * 2
    )
    return row | {
        "method": told["method"] if good else "",
        "error_mgal": error,
        "sigma_mgal": sigma,
        "error_over_sigma": ratio(error, sigma),
        "flags": " ".join(told["flags"]) if good else "",
        "refused": "" if good else told["error"],
    }


def ratio(error: float, sigma: float) -> float:
    """Error over sigma; 0 for an error too small to matter."""
    return 0.0 if abs(error) < EXACT else error / sigma


def summed(kind: str, records: list[Row]) -> Row:
    """One row of all records of a kind."""
    read = [record for record in records if not record["refused"]]
    clean = [abs(record["error_over_sigma"]) for record in read if not record["flags"]]
    worst = max(read, key=lambda record: abs(record["error_over_sigma"]) * (not record["flags"]), default=None)
    return {
        "kind": kind,
        "records": len(records),
        "refused": len(records) - len(read),
        "flagged": sum(bool(record["flags"]) for record in read),
        "within_2_sigma": sum(size <= 2.0 for size in clean) / len(clean) if clean else math.nan,
        "far_and_silent": sum(size > FAR for size in clean),
        "worst_silent": max(clean, default=math.nan),
        "its_number": worst["number"] if worst and clean else None,
    }
