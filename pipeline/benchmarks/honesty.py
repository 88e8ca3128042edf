"""Suite `honesty`: records of every kind and strength by the methods named; does the stated uncertainty hold?

With a folder: a row a record (CSV), a picture a method, and finished records, from which an interrupted run goes on.
"""

import math
import time
from collections.abc import Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from xarray import DataTree

from data_schemas.errors import IsochronyError, UsageError
from pipeline.benchmarks.kinds import INSTRUMENT, KINDS, SEA, STRENGTHS
from pipeline.benchmarks.plain import gravity_at
from pipeline.benchmarks.records import Made, record
from pipeline.benchmarks.tables import Row, at_most, kept, progress, rms, write
from pipeline.plots.canvas import save, sheet

EXACT = 1e-3  # mGal; a smaller error is right whatever sigma says
_95 = 1.96  # sigma
_CRASHED = "crashed: "
SEEDS, QUICK_SEEDS = 5, 2
QUICK = ("swell", "heave not recorded", "one gap", "outliers", "half-second marks", "zero of the first trace")
DURATION: float | None = None  # s, instead of each kind's own
_STEPS = (
    (2.0, "#cfe8dc", "worst error below 2 sigma"),
    (3.0, "#e8f1c8", "2 to 3"),
    (4.0, "#fbe7a1", "3 to 4"),
    (5.0, "#f6b26b", "4 to 5"),
    (math.inf, "#e0703c", "above 5: sigma does not hold"),
)
_REFUSED = "#dcdcdc"
GROUPS = {"sea": SEA, "instrument": INSTRUMENT}
_HEADINGS = {"sea": "Ship, pendulums, reading", "instrument": "Instrument"}


def reduced(made: Made, method: str) -> Row:
    """Reduce a record as a user would; the row has ``resolved`` (method), ``error_mgal``, ``sigma_mgal``, ``z``,
    ``flags``, ``refused`` (why), ``band_z`` (of gravity along the track) and ``seconds`` of processor time."""
    from pipeline.processing import process
    from pipeline.summary import summaries

    absent = dict.fromkeys(("error_mgal", "sigma_mgal", "z", "band_z"), math.nan)
    row: Row = {"resolved": "", **absent, "flags": "", "refused": ""}
    began = time.process_time()
    try:
        result = process(made.tree, method=method)
        (summary,) = summaries(result)
        row["refused"] = summary["error"] or ""
    except IsochronyError as refusal:
        row["refused"] = str(refusal)
    except Exception as fault:  # a crash is a row too, and fails a bar of its own
        row["refused"] = f"{_CRASHED}{fault!r}"
    row["seconds"] = time.process_time() - began
    if row["refused"]:
        return row
    error, sigma = (summary["gravity_m_s2"] - made.gravity) * 1e5, summary["gravity_sigma_mgal"]
    values = {"error_mgal": error, "sigma_mgal": sigma, "z": in_sigmas(error, sigma), "band_z": _band(result, made)}
    return row | values | {"resolved": summary["method"], "flags": " ".join(summary["flags"])}


def in_sigmas(error: float, sigma: float) -> float:
    """Error over sigma; 0 for an error too small to matter, infinite where a value or its sigma is missing."""
    if abs(error) < EXACT:
        return 0.0
    return error / sigma if sigma > 0.0 and math.isfinite(error) else math.inf


def _band(result: DataTree, made: Made) -> float:
    """Root mean square of the error of gravity along the track over its sigma."""
    if "course" not in result.children:
        return math.nan
    course = result["course"].dataset
    truth = np.array([gravity_at(each, made.law) for each in np.asarray(result["time"].values)])
    return rms((course["gravity_course"].values - truth) * 1e5 / course["gravity_course_sigma"].values)


def by_kind(rows: Sequence[Row]) -> list[Row]:
    """One row for each method, kind and strength."""
    cells: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        cells.setdefault((row["method"], row["kind"], row["strength"]), []).append(row)
    table = []
    for (method, kind, strength), some in cells.items():
        group = "sea" if kind in SEA else "instrument"
        flags = " ".join(dict.fromkeys(flag for row in some for flag in row["flags"].split()))
        cell = {"method": method, "group": group, "kind": kind, "strength": strength} | statistics(some)
        table.append(cell | {"seconds": float(np.median([row["seconds"] for row in some])), "flags": flags})
    return sorted(table, key=lambda row: row["method"])


def by_strength(rows: Sequence[Row]) -> list[Row]:
    """One row for each method and strength, and for all strengths."""
    return [
        {"sums": method, "strength": strength}
        | statistics([row for row in rows if row["method"] == method and strength in (row["strength"], "all")])
        for method in dict.fromkeys(row["method"] for row in rows)
        for strength in (*STRENGTHS, "all")
    ]


def statistics(rows: Sequence[Row]) -> Row:
    """Counts, errors and errors in sigmas of some records; NaN of none."""
    estimates = [row for row in rows if not row["refused"]]
    sizes = np.array([abs(row["z"]) for row in estimates] or [math.nan])
    return {
        "records": len(rows),
        "refused": len(rows) - len(estimates),
        "error_rms_mgal": rms([row["error_mgal"] for row in estimates]),
        "sigma_median_mgal": float(np.median([row["sigma_mgal"] for row in estimates] or [math.nan])),
        "worst_z": float(np.max(sizes)),
        "rms_z": rms(sizes),
        "band_rms_z": rms([row["band_z"] for row in estimates if math.isfinite(row["band_z"])]),
        "within_95": float(np.mean(sizes <= _95)) if estimates else math.nan,
        "beyond_4_sigma": int(np.sum(sizes > 4.0)),
        "beyond_5_sigma": int(np.sum(sizes > 5.0)),
    }


def bars(rows: Sequence[Row]) -> list[Row]:
    """The promises: errors stay within sigma, and few records are refused."""
    table = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        sums = statistics(own)
        far = sums["beyond_4_sigma"] / (sums["records"] - sums["refused"] or math.nan)
        table.append(at_most(f"{method}: beyond 4 sigma, share of those not refused", far, 1e-3))
        table.append(at_most(f"{method}: beyond 5 sigma", sums["beyond_5_sigma"], 0.0))
        for words, names, limit in (("weak and middle", STRENGTHS[:2], 0.01), ("strong", STRENGTHS[2:], 0.15)):
            some = [bool(row["refused"]) for row in own if row["strength"] in names]
            table.append(at_most(f"{method}: refused, share of {words}", sum(some) / max(len(some), 1), limit))
        crashed = sum(row["refused"].startswith(_CRASHED) for row in own)
        table.append(at_most(f"{method}: crashed", crashed, 0.0))
    return table


def run(
    *, quick: bool, folder: Path | None, methods: Sequence[str] = ("auto",), only: str = "", seeds: int | None = None
) -> Iterator[Row]:
    """Yield a row a kind and strength, then sums by strength, then the promises. `methods` as `pipeline.process` takes
    them, one at a time; `only` is a group or part of a kind's name, empty for all; `seeds` is the number of records of
    each kind and strength; quick: a few kinds, and fewer records."""
    kinds = [name for name in KINDS if only in name or name in GROUPS.get(only, ())]
    kinds = [name for name in kinds if only or not quick or name in QUICK]
    if not kinds:
        raise UsageError(f"--kind: no group or kind of the suite is like '{only}'; the kinds are {', '.join(KINDS)}")
    count = seeds or (QUICK_SEEDS if quick else SEEDS)
    each = [(kind, strength, seed) for seed in range(count) for kind in kinds for strength in STRENGTHS]
    rows = [row for place in progress(each, "honesty") for row in _one(*place, methods, folder)]
    table = by_kind(rows)
    if folder is not None:
        write(folder / "honesty-records.csv", rows)
        for method in methods:
            draw([row for row in table if row["method"] == method], method, folder / f"honesty-{method}.png")
    yield from table
    yield from by_strength(rows)
    yield from bars(rows)


def _one(kind: str, strength: str, seed: int, methods: Sequence[str], folder: Path | None) -> list[Row]:
    """Rows of one record, by each method; the record is made only if some method has not seen it."""
    made, rows = cache(lambda: record(kind, strength, seed, duration=DURATION)), list[Row]()
    for method in methods:
        what = {"method": method, "kind": kind, "strength": strength, "seed": seed}
        configuration = {"suite": "honesty", "duration": DURATION, **what}
        rows += kept(folder, configuration, partial(lambda each: [each | reduced(made(), each["method"])], what))
    return rows


def draw(table: Sequence[Row], method: str, path: Path) -> None:
    """Draw the table (rows of `by_kind`) of one method, named in the heading, as PNG: two columns of kinds."""
    from matplotlib.patches import Patch

    lines: list[str] = []
    for group, heading in _HEADINGS.items():
        kinds = dict.fromkeys(row["kind"] for row in table if row["group"] == group)
        lines += [heading, *kinds] if kinds else []
    half = (len(lines) + 1) // 2
    records = max(row["records"] for row in table)
    words = f"in each cell: median sigma in mGal, and z, the largest |error|/sigma; records a cell: {records}"
    figure = sheet(f"Whether the stated uncertainty holds: {method}", words, 13.5, 0.215 * half + 1.75)
    grid = figure.add_gridspec(1, 2)
    cells = {(row["kind"], row["strength"]): row for row in table}
    for place, part in enumerate((lines[:half], lines[half:])):
        _draw_cells(figure.add_subplot(grid[place]), part, half, cells)
    named = [*(step[1:] for step in _STEPS), (_REFUSED, "every record refused by name")]
    steps = [Patch(facecolor=color, label=label) for color, label in named]
    figure.legend(handles=steps, loc="outside lower center", ncols=len(steps), frameon=False, fontsize=8.5)
    save(figure, path)


def _draw_cells(axes: Any, kinds: Sequence[str], height: int, cells: dict[tuple[str, str], Row]) -> None:
    """One column of the picture: a line a kind, a cell a strength."""
    for down, kind in enumerate(kinds):
        for across, strength in enumerate(STRENGTHS):
            if (row := cells.get((kind, strength))) is None:
                continue
            is_refused = row["refused"] == row["records"]
            color = _REFUSED if is_refused else next(color for most, color, _ in _STEPS if not row["worst_z"] > most)
            axes.barh(down, 1.0, 1.0, across, color=color, edgecolor="white", linewidth=1.5)
            words = f"±{row['sigma_median_mgal']:.2g}  z {row['worst_z']:.3g}"
            words += f"  {row['refused']} ref." if row["refused"] else ""
            shown = "refused" if is_refused else words
            axes.text(across + 0.5, down, shown, ha="center", va="center_baseline", fontsize=7.8)
    axes.set(xlim=(0, len(STRENGTHS)), ylim=(height - 0.5, -0.5))
    axes.set_yticks(range(len(kinds)), kinds, fontsize=8.5)
    for label in axes.get_yticklabels():
        label.set_fontweight("bold" if label.get_text() in _HEADINGS.values() else "normal")
    axes.set_xticks([k + 0.5 for k in range(len(STRENGTHS))], STRENGTHS, fontsize=9.0, fontweight="bold")
    axes.tick_params(length=0, labeltop=True, labelbottom=False)
    axes.spines[:].set_visible(False)
