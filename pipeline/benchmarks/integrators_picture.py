"""The picture of the suite `integrators`: error against time, a panel a problem, a line a method."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.benchmarks.own import CLOSED, COLLOCATION, EXPLICIT, PICARD, RADAU
from pipeline.benchmarks.work_precision import Point
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, legend, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOKS: Mapping[str, tuple[str, str]] = {
    CLOSED: (BLUE, "o"),
    PICARD: (GREEN, "o"),
    COLLOCATION: (ORANGE, "o"),
    RADAU: (VERMILION, "o"),
    EXPLICIT: (PURPLE, "o"),
    "heyoka": ("#000000", "D"),
    "CyRK DOP853": (GREY, "s"),
    "CyRK RADAU": (GREY, "s"),
    "scipy DOP853": ("#8c8c8c", "^"),
    "scipy Radau": ("#8c8c8c", "v"),
    "CVODE Adams": ("#b0b0b0", "P"),
    "CVODE BDF": ("#b0b0b0", "X"),
}
"""Method -> colour and mark; the project's are coloured, peers grey."""
_COLUMNS = 3
_LEAST = 1e-17


def draw(races: Mapping[str, tuple[str, Sequence[Point]]], path: str | os.PathLike[str]) -> None:
    """Draw every problem.

    Parameters
    ----------
    races : mapping
        Problem to the source of its truth and its points.
    path : path
        PNG.
    """
    figure = sheet(
        "Error against time",
        "largest error over the largest size, against the truth named above each panel; warm processor time, medians",
        13.5,
        8.4,
    )
    grid = figure.add_gridspec(2, _COLUMNS)
    for number, (name, (source, points)) in enumerate(races.items()):
        place = grid[number // _COLUMNS, number % _COLUMNS]
        axes = panel(figure, place, f"{name}\n", "processor time, ms", "error", xscale="log", yscale="log")
        axes.text(0.0, 1.015, f"against {source}", transform=axes.transAxes, fontsize=8, color=GREY)
        _lines(axes, points)
    _key(figure.add_subplot(grid[1, _COLUMNS - 1]), [point for _, points in races.values() for point in points])
    save(figure, path)


def _lines(axes: Axes, points: Sequence[Point]) -> None:
    drawn = [point for point in points if point.seconds and np.isfinite(point.error)]
    for method, (colour, mark) in LOOKS.items():
        line = [(point.ms, max(point.error, _LEAST)) for point in drawn if point.method == method]
        if line:
            own = mark == "o"
            axes.plot(
                *np.array(line).T,
                color=colour,
                marker=mark,
                markersize=5.5 if own else 4.0,
                linewidth=2.0 if own else 1.0,
                zorder=3 if own else 2,
            )


def _key(axes: Axes, points: Sequence[Point]) -> None:
    """Names of those who gave a value somewhere, and who is not installed."""
    axes.set_axis_off()
    for method, (colour, mark) in LOOKS.items():
        if any(point.method == method and point.seconds for point in points):
            axes.plot([], [], color=colour, marker=mark, label=method)
    if axes.lines:
        legend(axes, loc="center left", title="method")
    absent = dict.fromkeys(point.method for point in points if "not installed" in point.note)
    if absent:
        words = "not installed:\n" + "\n".join(absent)
        axes.text(1.0, 0.5, words, transform=axes.transAxes, fontsize=8.5, color=GREY, ha="right", va="center")
