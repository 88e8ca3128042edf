"""Ratios of processor times, run after run: a file (JSON Lines) that `benchmark` appends to, and its picture."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from data_schemas.errors import FileError, UsageError
from pipeline.benchmarks.tables import RATIO, Row, draws
from pipeline.plots.canvas import GREY, PALETTE, legend, panel, save, sheet
from pipeline.provenance import versions

NAME = "history.jsonl"
_KEYS = {"date", "machine", "versions", "suite", "quick", "bar", "value", "limit"}


def read(path: Path) -> list[dict[str, Any]]:
    """Lines of a history, none where it is not begun; `UsageError` for a file that is something else."""
    try:
        lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        if all(isinstance(line, dict) and line.keys() >= _KEYS for line in lines):
            return lines
    except FileNotFoundError:
        return []
    except (OSError, ValueError):
        pass
    raise UsageError(f"{path}: is no history of benchmarks; name another file with --history")


def append(path: Path, suite: str, rows: Sequence[Row], *, quick: bool) -> None:
    """Append the ratios among a suite's rows, with date, machine and versions, and draw the file beside it (PNG)."""
    lines = read(path)
    date = datetime.now(UTC).isoformat(timespec="seconds")
    machine = f"{platform.node()}, {platform.machine()}, {os.cpu_count()} processors"
    run = {"date": date, "machine": machine, "versions": json.loads(versions()), "suite": suite, "quick": quick}
    ratios = [row for row in rows if str(row.get("unit", "")).startswith(RATIO) and math.isfinite(row["value"])]
    new = [run | {key: row[key] for key in ("bar", "value", "limit")} for row in ratios]
    if not new:
        return
    try:
        with path.open("a", encoding="utf-8") as stream:
            stream.writelines(json.dumps(line, ensure_ascii=False) + "\n" for line in new)
    except OSError as fault:
        raise FileError(f"{path}: cannot be written ({fault.strerror}); choose another with --history") from fault
    if draws():
        draw([*lines, *new], path.with_suffix(".png"))


def draw(lines: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw every bar's ratio over its limit, run after run; above 1 it holds, whichever way the limit is meant."""
    from matplotlib.ticker import LogLocator

    judged = [line for line in lines if line["limit"][:2] in ("<=", ">=")]
    runs = list(dict.fromkeys(line["date"] for line in lines))
    figure = sheet("Ratios of processor times", f"from {runs[0]} to {runs[-1]} · above 1 a bar holds", 14.0, 6.5)
    axes = panel(figure, figure.add_gridspec(1, 1)[0], "", "run", "ratio over its limit", yscale="log")
    for number, bar in enumerate(bars := dict.fromkeys(line["bar"] for line in judged)):
        points = []
        for line in (line for line in judged if line["bar"] == bar):
            limit, value = float(line["limit"][3:]), line["value"]
            points.append((runs.index(line["date"]) + 1, limit / value if line["limit"][0] == "<" else value / limit))
            words = f"{bar}: {value:.3g} ({line['limit']})"
        color, style = PALETTE[number % len(PALETTE)], "o-" if number < len(PALETTE) else "o--"
        axes.plot(*zip(*points, strict=True), style, color=color, markersize=4, label=words)
    axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--")
    axes.set_xticks(range(1, len(runs) + 1))
    axes.set_ylim(min(axes.get_ylim()[0], 0.5), max(axes.get_ylim()[1], 2.0))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    if bars:
        legend(axes, loc="center left", bbox_to_anchor=(1.0, 0.5), labelspacing=0.8)
    save(figure, path)
