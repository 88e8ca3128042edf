"""A suite's rows: bars, files, a progress bar, points that are kept, times; the history of ratios, and its picture.

A finished point is found again by its configuration and by every source that may move its numbers: an interrupted run
goes on, and changed code is computed anew. Times are of the processor, warm, of rivals that take turns in one run.
"""

import contextlib
import csv
import functools
import hashlib
import io
import json
import math
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from tqdm import tqdm

from data_schemas.errors import FileError, UsageError
from data_schemas.writing import write_text
from pipeline.plots.canvas import GREY, PALETTE, color_of, draws, legend, panel, save, sheet
from pipeline.provenance import versions
from synth.kernels.cache import PACKAGES, ROOT

Row = dict[str, Any]
Item = TypeVar("Item")
RATIO = "times"  # how the unit of a ratio of processor times begins
Given = TypeVar("Given")
Call = Callable[[], Any]
HISTORY = "history.jsonl"
_KEYS = {"date", "machine", "versions", "suite", "quick", "bar", "value", "limit"}  # of a line of the history
_NO_NUMBERS = (("pipeline", "cli"), ("pipeline", "plots"))  # which present what others compute


def write(path: Path, table: Sequence[Mapping[str, Any]]) -> None:
    """Write rows that share their keys as CSV; no rows give an empty file."""
    stream = io.StringIO(newline="")
    if table:
        writer = csv.DictWriter(stream, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    write_text(stream.getvalue(), path, overwrite=True)


def progress(items: Iterable[Item], what: str) -> Iterable[Item]:
    """Items with a bar that is drawn if stderr is a terminal."""
    return cast("Iterable[Item]", tqdm(items, desc=what, disable=None, leave=False))


def at_most(bar: str, value: float, limit: float, unit: str = "") -> Row:
    """A bar that holds where the value is not above the limit; NaN never holds."""
    return reported(bar, value, unit) | {"limit": f"<= {limit:.4g}", "pass": bool(value <= limit)}


def at_least(bar: str, value: float, limit: float, unit: str = "") -> Row:
    """A bar that holds where the value is not below the limit."""
    return reported(bar, value, unit) | {"limit": f">= {limit:.4g}", "pass": bool(value >= limit)}


def holds(bar: str, fact: bool, limit: str) -> Row:
    """A bar that is a fact or not."""
    return reported(bar, float(fact)) | {"limit": limit, "pass": fact}


def reported(bar: str, value: float, unit: str = "") -> Row:
    """A figure beside a bar, which promises nothing and decides nothing."""
    return {"bar": bar, "value": float(value), "limit": "reported", "unit": unit, "pass": None}


def not_measured(bar: str, limit: str, why: str) -> Row:
    """A bar that cannot be judged here, such as a peer that is not installed; it decides nothing."""
    return reported(bar, math.nan, why) | {"limit": limit}


def rms(values: Any) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


def kept(folder: Path | None, configuration: Mapping[str, Any], make: Callable[[], list[Row]]) -> list[Row]:
    """Rows of a point: those in `points/` of the folder if it was finished before, else made, and kept there."""
    if folder is None:
        return make()
    name = hashlib.sha256(json.dumps([sources(), configuration], sort_keys=True).encode()).hexdigest()[:24]
    path = folder / "points" / f"{name}.json"
    with contextlib.suppress(OSError, ValueError, KeyError):  # not there, or not whole
        return list(json.loads(path.read_text(encoding="utf-8"))["rows"])
    rows = make()
    path.parent.mkdir(exist_ok=True)
    write_text(json.dumps({"configuration": configuration, "rows": rows}, indent=1), path, overwrite=True)
    return rows


@functools.cache
def sources() -> str:
    """SHA-256 of the code that simulates and reduces."""
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        place = path.relative_to(ROOT)
        if place.parts[:2] not in _NO_NUMBERS:
            digest.update(place.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def timed(call: Callable[[], Given]) -> tuple[Given, float]:
    """What a call gives, and its processor time, all threads and finished child processes, s."""
    started = _spent()
    given = call()
    return given, _spent() - started


def _spent() -> float:
    children = os.times()  # which counts in hundredths of a second: process_time does not know children
    return time.process_time() + children.children_user + children.children_system


def rounds(calls: Mapping[str, Call], repeats: int = 5, batch: int = 1) -> dict[str, list[float]]:
    """Times of rivals that take turns in `repeats` rounds, s a call, after one that is not counted; `batch` at once."""
    for call in calls.values():
        call()
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            taken[name].append(statistics.median(timed(call)[1] for _ in range(batch)))
    return taken


def median_ratio(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Median of the ratios of times that were taken in the same rounds."""
    return statistics.median(one / other for one, other in zip(slow, fast, strict=True))


def times(bar: str, own: Sequence[float], rival: Sequence[float], limit: float | None) -> Row:
    """A bar on the median of these ratios, with their range; reported alone without a limit."""
    every = [one / other for one, other in zip(own, rival, strict=True)]
    value, unit = median_ratio(own, rival), f"{RATIO}, {min(every):.3g} to {max(every):.3g}"
    return reported(bar, value, unit) if limit is None else at_most(bar, value, limit, unit)


def command(*words: str, **environment: str) -> Call:
    """A call that runs a program with this tree's packages, for its output; `CalledProcessError` if it fails."""
    given = tree_environment() | environment
    return lambda: subprocess.run(words, env=given, check=True, capture_output=True, text=True).stdout


def tree_environment() -> dict[str, str]:
    """Environment in which a child process finds the same packages, installed or not."""
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])}


def read_history(path: Path) -> list[Row]:
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


def append_history(path: Path, suite: str, rows: Sequence[Row], *, quick: bool) -> None:
    """Append the ratios among a suite's rows, with date, machine and versions, and draw the file beside it (PNG)."""
    lines = read_history(path)
    run = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.node()}, {platform.machine()}, {os.cpu_count()} processors",
        "versions": json.loads(versions()), "suite": suite, "quick": quick,
    }  # fmt: skip
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
        draw_history([*lines, *new], path.with_suffix(".png"))


def draw_history(lines: Sequence[Row], path: Path) -> None:
    """Draw every bar's ratio over its limit, run after run; above 1 it holds, whichever way the limit is meant."""
    from matplotlib.ticker import LogLocator

    judged = [line for line in lines if line["limit"][:2] in ("<=", ">=")]
    runs = list(dict.fromkeys(line["date"] for line in lines))
    figure = sheet("Ratios of processor times", f"from {runs[0]} to {runs[-1]} · above 1 a bar holds", 14.0, 6.5)
    axes = panel(figure, figure.add_gridspec(1, 1)[0], "", "run", "ratio over its limit", yscale="log")
    axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--")
    for number, bar in enumerate(dict.fromkeys(line["bar"] for line in judged)):
        some = [line for line in judged if line["bar"] == bar]
        places = [runs.index(line["date"]) + 1 for line in some]
        ratios = [(line["value"] / float(line["limit"][3:])) ** (-1 if line["limit"][0] == "<" else 1) for line in some]
        words = f"{bar}: {some[-1]['value']:.3g} ({some[-1]['limit']})"
        style = "o--" if number >= len(PALETTE) else "o-"
        axes.plot(places, ratios, style, color=color_of(number), markersize=4, label=words)
    axes.set_xticks(range(1, len(runs) + 1))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    if judged:
        legend(axes, loc="center left", bbox_to_anchor=(1.0, 0.5), labelspacing=0.8)
    save(figure, path)
