"""Suite `honesty`: records of every kind and strength by the methods named; does the stated uncertainty hold?

With a folder: a row a record (CSV), a row a kind and strength (CSV), everything (JSON), a picture a method, and the
finished records, so that a run that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.errors import IsochronyError, UsageError
from pipeline.benchmarks.honesty.kinds import KINDS, STRENGTHS
from pipeline.benchmarks.honesty.records import Made, record
from pipeline.benchmarks.tables import Kept, at_most, progress, write, write_json
from pipeline.plots.canvas import GREY, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Row = dict[str, Any]
EXACT = 1e-3
"""mGal; a smaller error is right whatever sigma says."""
_95 = 1.96  # sigma
_CRASHED = "crashed: "
SEEDS, QUICK_SEEDS = 5, 2
QUICK = ("swell", "heave not recorded", "one gap", "outliers", "half-second marks", "zero of the first trace")
DURATION: float | None = None
"""s, instead of each kind's own."""
_STEPS = (
    (2.0, "#cfe8dc", "worst error below 2 sigma"),
    (3.0, "#e8f1c8", "2 to 3"),
    (4.0, "#fbe7a1", "3 to 4"),
    (5.0, "#f6b26b", "4 to 5"),
    (math.inf, "#e0703c", "above 5: sigma does not hold"),
)
_REFUSED = "#dcdcdc"
_HEADINGS = {"sea": "Ship, pendulums, reading", "instrument": "Instrument"}
_ROW, _CELL, _LABEL, _MARGIN = 0.215, 1.42, 2.35, 1.75  # inches


def reduced(made: Made, method: str) -> Row:
    """Reduce a record as a user would, from what it states.

    Returns
    -------
    dict
        ``resolved`` (method), ``error_mgal``, ``sigma_mgal``, ``z``, ``flags``, ``refused`` (why) and ``seconds``.
    """
    from pipeline.processing import process
    from pipeline.summary import summaries

    row = {"resolved": "", "error_mgal": math.nan, "sigma_mgal": math.nan, "z": math.nan, "flags": "", "refused": ""}
    began = time.perf_counter()
    try:
        (found,) = summaries(process(made.tree, method=method))
    except IsochronyError as refusal:
        return row | {"refused": str(refusal), "seconds": time.perf_counter() - began}
    except Exception as fault:  # a crash is a row too, and fails a bar of its own
        return row | {"refused": f"{_CRASHED}{fault!r}", "seconds": time.perf_counter() - began}
    row["seconds"] = time.perf_counter() - began
    if found["status"] != "ok":
        return row | {"refused": found["error"]}
    error, sigma = (found["gravity_m_s2"] - made.gravity) * 1e5, found["gravity_sigma_mgal"]
    flags = " ".join(found["flags"])
    values = {"error_mgal": error, "sigma_mgal": sigma, "z": in_sigmas(error, sigma), "flags": flags}
    return row | {"resolved": found["method"]} | values


def in_sigmas(error: float, sigma: float) -> float:
    """Error over sigma; 0 for an error too small to matter, infinite where a value or its sigma is missing."""
    if abs(error) < EXACT:
        return 0.0
    return error / sigma if sigma > 0.0 and math.isfinite(error) else math.inf


def by_kind(rows: Sequence[Row]) -> list[Row]:
    """One row for each method, kind and strength."""
    return [
        _cell(method, kind, strength, found)
        for method in dict.fromkeys(row["method"] for row in rows)
        for kind in KINDS
        for strength in STRENGTHS
        if (found := [r for r in rows if (r["method"], r["kind"], r["strength"]) == (method, kind, strength)])
    ]


def _cell(method: str, kind: str, strength: str, rows: Sequence[Row]) -> Row:
    read = [row for row in rows if not row["refused"]]
    sizes = _sizes(read)
    errors = np.array([row["error_mgal"] for row in read])
    sigmas = [row["sigma_mgal"] for row in read]
    cell = {"method": method, "group": KINDS[kind].group, "kind": kind, "strength": strength, "records": len(rows)}
    return cell | {
        "refused": len(rows) - len(read),
        "error_rms_mgal": float(np.sqrt(np.mean(errors**2))) if read else math.nan,
        "sigma_median_mgal": float(np.median(sigmas)) if read else math.nan,
        "worst_z": max(sizes, default=math.nan),
        "within_95": sum(size <= _95 for size in sizes) / len(sizes) if sizes else math.nan,
        "seconds": float(np.median([row["seconds"] for row in rows])),
        "flags": " ".join(dict.fromkeys(flag for row in rows for flag in row["flags"].split())),
        "why_refused": "; ".join(dict.fromkeys(row["refused"] for row in rows if row["refused"])),
    }


def by_strength(rows: Sequence[Row]) -> list[Row]:
    """One row for each method and strength, and for all strengths."""
    table = []
    for method in dict.fromkeys(row["method"] for row in rows):
        for strength in (*STRENGTHS, "all"):
            some = [row for row in rows if row["method"] == method and strength in (row["strength"], "all")]
            sizes = np.array(_sizes(row for row in some if not row["refused"]))
            line = {"method": method, "strength": strength, "records": len(some)}
            line["refused_share"] = 1.0 - sizes.size / len(some) if some else math.nan
            for limit in (4, 5):
                line[f"beyond_{limit}_sigma"] = int(np.sum(sizes > limit))
                line[f"share_beyond_{limit}"] = float(np.mean(sizes > limit)) if sizes.size else math.nan
            line["within_95"] = float(np.mean(sizes <= _95)) if sizes.size else math.nan
            line["rms_z"] = float(np.sqrt(np.mean(sizes**2))) if sizes.size else math.nan
            line["median_z"] = float(np.median(sizes)) if sizes.size else math.nan
            table.append(line)
    return table


def bars(rows: Sequence[Row]) -> list[Row]:
    """The promises: errors stay within sigma, and few records are refused."""
    found = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        sizes = _sizes(row for row in own if not row["refused"])
        far = sum(size > 4.0 for size in sizes) / len(sizes) if sizes else math.nan
        found.append(at_most(f"{method}: beyond 4 sigma, share of those not refused", far, 1e-3))
        found.append(at_most(f"{method}: beyond 5 sigma", sum(size > 5.0 for size in sizes), 0.0))
        for words, names, limit in (("weak and middle", STRENGTHS[:2], 0.01), ("strong", STRENGTHS[2:], 0.15)):
            some = [bool(row["refused"]) for row in own if row["strength"] in names]
            found.append(at_most(f"{method}: refused, share of {words}", sum(some) / max(len(some), 1), limit))
        crashed = sum(row["refused"].startswith(_CRASHED) for row in own)
        found.append(at_most(f"{method}: crashed", crashed, 0.0))
    return found


def _sizes(rows: Iterable[Row]) -> list[float]:
    return [abs(row["z"]) for row in rows]


def run(
    *, quick: bool, folder: Path | None, methods: Sequence[str] = ("auto",), only: str = "", seeds: int | None = None
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
    table, sums, promises = by_kind(rows), by_strength(rows), bars(rows)
    if folder is not None:
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
            found = [what | reduced(made, method)]
            kept.put(configuration, found)
        rows += found
    return rows


def draw(table: Sequence[Row], method: str, path: str | os.PathLike[str]) -> None:
    """Draw the table (rows of `by_kind`) of one method, named in the heading, as PNG."""
    lines: list[str] = []
    for group, heading in _HEADINGS.items():
        kinds = list(dict.fromkeys(row["kind"] for row in table if row["group"] == group))
        lines += [heading, *kinds] if kinds else []
    half = (len(lines) + 1) // 2
    columns = [part for part in (lines[:half], lines[half:]) if part]
    records = max(row["records"] for row in table)
    words = f"in each cell: median sigma in mGal, and z, the largest |error|/sigma; records a cell: {records}"
    size = len(columns) * (_LABEL + len(STRENGTHS) * _CELL) + 0.3, half * _ROW + _MARGIN
    figure = sheet(f"Whether the stated uncertainty holds: {method}", words, *size)
    grid = figure.add_gridspec(2, len(columns), height_ratios=[half * _ROW, 0.3])
    cells = {(row["kind"], row["strength"]): row for row in table}
    for place, part in enumerate(columns):
        _column(figure.add_subplot(grid[0, place]), part, half, cells)
    _legend(figure.add_subplot(grid[1, :]))
    save(figure, path)


def _column(axes: Axes, kinds: Sequence[str], height: int, cells: dict[tuple[str, str], Row]) -> None:
    from matplotlib.patches import Rectangle

    for down, kind in enumerate(kinds):
        for across, strength in enumerate(STRENGTHS):
            row = cells.get((kind, strength))
            if row is None:
                continue
            axes.add_patch(Rectangle((across, down), 1, 1, facecolor=_colour(row), edgecolor="white", linewidth=1.5))
            for x, text, side in _words(row):
                axes.text(across + x, down + 0.54, text, ha=side, va="center", fontsize=7.8)
    axes.set(xlim=(0, len(STRENGTHS)), ylim=(height, 0))
    axes.set_yticks([k + 0.5 for k in range(len(kinds))], kinds, fontsize=8.5)
    for words, label in zip(kinds, axes.get_yticklabels(), strict=True):
        label.set_fontweight("bold" if words in _HEADINGS.values() else "normal")
    axes.set_xticks([k + 0.5 for k in range(len(STRENGTHS))], STRENGTHS, fontsize=9.0, fontweight="bold")
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _colour(row: Row) -> str:
    if row["refused"] == row["records"]:
        return _REFUSED
    return next((colour for limit, colour, _ in _STEPS if row["worst_z"] <= limit), _STEPS[-1][1])


def _words(row: Row) -> list[tuple[float, str, str]]:
    """Texts of a cell with their places and sides."""
    if row["refused"] == row["records"]:
        return [(0.5, "refused", "center")]
    size = row["worst_z"]
    z = f"z {size:.1f}" if size < 9.95 else f"z {size:.0f}" if size < 1e5 else f"z {size:.0e}"
    found = [(0.06, f"±{number(row['sigma_median_mgal'])}", "left"), (0.94, z, "right")]
    if row["refused"]:
        found.append((0.56, f"{row['refused']} ref.", "center"))
    return found


def number(value: float) -> str:
    """Two digits that matter, and no more characters than a cell holds.

    >>> [number(value) for value in (0.00421, 0.05, 1.23, 9.96, 1234.0, 2.5e5, 4e-6)]
    ['0.0042', '0.050', '1.2', '10', '1234', '2e+05', '4e-06']
    """
    if not 1e-4 <= value < 1e5:
        return f"{value:.0e}"
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:#.2g}"


def _legend(axes: Axes) -> None:
    from matplotlib.patches import Patch

    steps = [Patch(facecolor=colour, label=words) for _, colour, words in _STEPS]
    refused = Patch(facecolor=_REFUSED, label="every record refused by name")
    axes.set_axis_off()
    axes.legend(
        handles=[*steps, refused], loc="center", ncols=len(_STEPS) + 1, frameon=False, fontsize=8.5, labelcolor=GREY
    )
