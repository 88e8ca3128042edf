"""The picture of the suite `corrections`: error against run time, on linear and on real pendulums."""

from __future__ import annotations

import os
import statistics
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = Mapping[str, Any]
FLOOR, TOP = 1e-9, 1e5  # mGal; below the floor lies rounding
MARKS: Mapping[str, tuple[str, str]] = {
    "uncorrected": (SKY, "v"),
    "vening-meinesz": (VERMILION, "^"),
    "panteleev": (ORANGE, "s"),
    "general": (BLUE, "D"),
    "complex": (PURPLE, "P"),
    "projection": (GREEN, "X"),
    "shooting": ("#000000", "o"),
    "joint": ("#8c510a", "H"),
}
"""Method -> colour, mark."""
_LABEL = 0.55  # decades from one label to the next


def draw(points: Sequence[Row], path: str | os.PathLike[str]) -> None:
    """Draw |error| against warm run time: every record as a small mark, each method's medians as a large one.

    Parameters
    ----------
    points : sequence of mapping
        Rows of the suite, one a record and method.
    path : path
        PNG.
    """
    figure = sheet(
        "What each method leaves, and what it costs",
        "small: a record, large: the median of all; run time from record to result, kernels compiled; dashed: 1 mGal",
        13.0,
        6.2,
    )
    grid = figure.add_gridspec(1, 2)
    for place, (title, linear) in enumerate((("linear pendulums", True), ("real pendulums", False))):
        rows = [row for row in points if not row["refused"] and row["case"].startswith("linear") == linear]
        axes = panel(figure, grid[place], title, "run time, ms", "|error|, mGal", xscale="log", yscale="log")
        _draw(axes, rows)
    save(figure, path)


def _draw(axes: Axes, rows: Sequence[Row]) -> None:
    middles: dict[str, tuple[float, float]] = {}
    for method, (colour, mark) in MARKS.items():
        some = [row for row in rows if row["method"] == method]
        if not some:
            continue
        times, errors = [row["ms"] for row in some], [max(abs(row["error_mgal"]), FLOOR) for row in some]
        axes.plot(times, errors, mark, color=colour, markersize=4.0, alpha=0.4, markeredgewidth=0)
        middles[method] = statistics.median(times), statistics.median(errors)
        axes.plot(*middles[method], mark, color=colour, markersize=11, markeredgecolor="white", zorder=4)
    _label(axes, middles)
    axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    axes.set_ylim(FLOOR / 3, TOP)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}" if value < TOP else "")  # beyond, labels stand


def _label(axes: Axes, middles: Mapping[str, tuple[float, float]]) -> None:
    """Name each method right of all marks, with a line to its medians; labels are moved up until none hides another."""
    left, right = axes.get_xlim()
    axes.set_xlim(left, right * (right / left) ** 0.85)
    last = -np.inf
    for method, middle in sorted(middles.items(), key=lambda item: item[1][1]):
        last = max(float(np.log10(middle[1])), last + _LABEL)
        colour = MARKS[method][0]
        axes.annotate(
            f"{method}  {middle[0]:.0f} ms, {middle[1]:.2g} mGal",
            middle,
            xytext=(1.25 * right, 10.0**last),
            textcoords="data",
            fontsize=8.5,
            color=colour,
            va="center",
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6, "shrinkB": 5, "relpos": (0.0, 0.5)},
        )
