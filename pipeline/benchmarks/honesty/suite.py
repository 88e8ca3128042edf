"""Suite `honesty`: records of every kind and strength by the methods named; does the stated uncertainty hold?

With a folder: a row a record (CSV), a row a kind and strength (CSV), everything (JSON), a picture a method, and the
finished records, so that a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from data_schemas.errors import UsageError
from pipeline.benchmarks.honesty import score
from pipeline.benchmarks.honesty.kinds import KINDS, STRENGTHS
from pipeline.benchmarks.honesty.records import record
from pipeline.benchmarks.honesty.score import Row
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.tables import progress, write, write_json

SEEDS, QUICK_SEEDS = 5, 2
QUICK = ("swell", "heave not recorded", "one gap", "outliers", "half-second marks", "zero of the first trace")
DURATION: float | None = None
"""s, instead of each kind's own."""


def run(
    *,
    quick: bool,
    folder: Path | None,
    methods: Sequence[str] = ("auto",),
    only: str = "",
    seeds: int | None = None,
) -> Iterator[Row]:
    """Yield a row a kind and strength, then sums by strength, then the promises.

    Parameters
    ----------
    quick : bool
        A few kinds, and fewer records of each.
    folder : Path or None
        Where tables, pictures and finished records go.
    methods : sequence of str
        As `pipeline.process` takes them, one at a time.
    only : str
        A group, or part of a kind's name; empty for all.
    seeds : int, optional
        Records of each kind and strength.
    """
    kinds = [name for name, kind in KINDS.items() if (only in name or only == kind.group)]
    kinds = [name for name in kinds if only or not quick or name in QUICK]
    if not kinds:
        raise UsageError(f"--kind: no group or kind of the suite is like '{only}'; the kinds are {', '.join(KINDS)}")
    count = seeds or (QUICK_SEEDS if quick else SEEDS)
    each = [(kind, strength, seed) for seed in range(count) for kind in kinds for strength in STRENGTHS]
    kept = Kept(folder)
    rows = [row for place in progress(each, "honesty") for row in _one(*place, methods, kept)]
    table, sums, promises = score.by_kind(rows), score.by_strength(rows), score.bars(rows)
    if folder is not None:
        from pipeline.benchmarks.honesty.picture import draw

        write(folder / "honesty-records.csv", rows)
        write(folder / "honesty.csv", table)
        tables = {"kinds": table, "strengths": sums, "bars": promises, "records": rows}
        write_json(folder / "honesty.json", tables)
        for method in methods:
            draw([row for row in table if row["method"] == method], method, folder / f"honesty-{method}.png")
    yield from ({name: value for name, value in row.items() if name != "why_refused"} for row in table)
    yield from sums
    yield from promises


def _one(kind: str, strength: str, seed: int, methods: Sequence[str], kept: Kept) -> list[Row]:
    """Rows of one record, by each method; the record is made only if some method has not seen it."""
    made, rows = None, []
    for method in methods:
        what = {"method": method, "kind": kind, "strength": strength, "seed": seed}
        configuration = {"suite": "honesty", "duration": DURATION, **what}
        found = kept.get(configuration)
        if found is None:
            made = made or record(kind, strength, seed, duration=DURATION)
            found = [what | score.reduced(made, method)]
            kept.put(configuration, found)
        rows += found
    return rows
