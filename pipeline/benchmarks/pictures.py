"""The pictures of the suites `corrections`, `integrators` and `huygens`."""

from __future__ import annotations

import os
import statistics
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.problems import CLOSED, COLLOCATION, EXPLICIT, PICARD, RADAU
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, legend, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipeline.benchmarks.integrators import Point

Row = Mapping[str, Any]
FLOOR, TOP = 1e-9, 1e5  # mGal; below the floor lies rounding
MARKS: Mapping[str, tuple[str, str]] = {
    "uncorrected": (SKY, "v"), "vening-meinesz": (VERMILION, "^"), "panteleev": (ORANGE, "s"), "general": (BLUE, "D"),
    "complex": (PURPLE, "P"), "projection": (GREEN, "X"), "shooting": ("#000000", "o"), "joint": ("#8c510a", "H"),
}  # fmt: skip
"""Method -> colour, mark."""
LOOKS: Mapping[str, tuple[str, str]] = {
    CLOSED: (BLUE, "o"), PICARD: (GREEN, "o"), COLLOCATION: (ORANGE, "o"), RADAU: (VERMILION, "o"),
    EXPLICIT: (PURPLE, "o"), "heyoka": ("#000000", "D"), "CyRK DOP853": (GREY, "s"), "CyRK RADAU": (GREY, "s"),
    "scipy DOP853": ("#8c8c8c", "^"), "scipy Radau": ("#8c8c8c", "v"),
    "CVODE Adams": ("#b0b0b0", "P"), "CVODE BDF": ("#b0b0b0", "X"),
}  # fmt: skip
"""Method -> colour and mark; the project's are coloured, peers grey."""
_COLUMNS = 4
_LEAST_ERROR = 1e-17
_LOGARITHMIC: Any = {"xscale": "log", "yscale": "log"}

_WAYS: dict[str, dict[str, Any]] = {
    "paper": {"color": GREY, "linestyle": "--", "linewidth": 2.4},
    "corrected chain": {"color": VERMILION, "linewidth": 2.2, "alpha": 0.6},
    "balance": {"color": BLUE, "linestyle": "", "marker": "s", "markersize": 9, "fillstyle": "none"},
    "orbit": {"color": GREEN, "linestyle": "", "marker": "o", "markersize": 5.5},
    "motion": {"color": "black", "linestyle": "", "marker": "x", "markersize": 6},
}
_QUANTITIES = (("beta", "beta"), ("q", "q = 2X/l"), ("tau", "tau"), ("k", "k = d eta/d chi"))


def draw_corrections(points: Sequence[Row], path: str | os.PathLike[str]) -> None:
    """Draw |error| against warm run time: every record as a small mark, each method's medians as a large one."""
    words = (
        "small: a record, large: the median of all; run time from record to result, kernels compiled; dashed: 1 mGal"
    )
    figure = sheet("What each method leaves, and what it costs", words, 14.5, 6.2)
    grid = figure.add_gridspec(1, 2)
    for place, (title, linear) in enumerate((("linear pendulums", True), ("real pendulums", False))):
        rows = [row for row in points if not row["refused"] and row["case"].startswith("linear") == linear]
        _draw_points(panel(figure, grid[place], title, "run time, ms", "|error|, mGal", **_LOGARITHMIC), rows)
    save(figure, path)


def _draw_points(axes: Axes, rows: Sequence[Row]) -> None:
    for method, (colour, mark) in MARKS.items():
        some = [row for row in rows if row["method"] == method]
        times, errors = [row["ms"] for row in some], [max(abs(row["error_mgal"]), FLOOR) for row in some]
        axes.plot(times, errors, mark, color=colour, markersize=4.0, alpha=0.4, markeredgewidth=0)
        if some:
            middle = statistics.median(times), statistics.median(errors)
            words = f"{method}  {middle[0]:.0f} ms, {middle[1]:.2g} mGal"
            axes.plot(*middle, mark, color=colour, label=words, markersize=11, markeredgecolor="white", zorder=4)
    axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    axes.set_ylim(FLOOR / 3, TOP)
    legend(axes, loc="center left", bbox_to_anchor=(1.0, 0.5), title="medians", labelspacing=1.0)


def draw_integrators(races: Mapping[str, tuple[str, Sequence[Point]]], path: str | os.PathLike[str]) -> None:
    """Draw every problem, given with the source of its truth and its points."""
    words = (
        "largest error over the largest size, against the truth named above each panel; warm processor time, medians"
    )
    figure = sheet("Error against time", words, 16.5, 8.4)
    grid = figure.add_gridspec(2, _COLUMNS)
    for number, (name, (source, points)) in enumerate(races.items()):
        place = grid[number // _COLUMNS, number % _COLUMNS]
        axes = panel(figure, place, f"{name}\n", "processor time, ms", "error", **_LOGARITHMIC)
        axes.text(0.0, 1.015, f"against {source}", transform=axes.transAxes, fontsize=8, color=GREY)
        for method in LOOKS:
            some = (point for point in points if point.method == method and point.seconds)
            line = [(point.ms, max(point.error, _LEAST_ERROR)) for point in some if np.isfinite(point.error)]
            if line:
                axes.plot(*np.array(line).T, **_look(method))
    key = figure.add_subplot(grid[1, _COLUMNS - 1])
    key.set_axis_off()
    every = [point for _, points in races.values() for point in points]
    absent = {point.method for point in every if "not installed" in point.note}
    for method in LOOKS:
        if method in absent or any(point.method == method and point.seconds for point in every):
            words = f"{method}, not installed" if method in absent else method
            key.plot([], [], label=words, **_look(method))
    legend(key, loc="center left", title="method")
    save(figure, path)


def _look(method: str) -> dict[str, Any]:
    """Of a line; the project's own are larger and in front."""
    colour, mark = LOOKS[method]
    own = mark == "o"
    size = {"markersize": 5.5, "linewidth": 2.0, "zorder": 3} if own else {"markersize": 4.0, "linewidth": 1.0}
    return {"color": colour, "marker": mark, **size}


def draw_regime(rows: Sequence[Row], path: str | os.PathLike[str]) -> None:
    """Draw beta (the paper's Fig. 2), q, tau and k over alpha; a line or a mark for each way."""
    words = "delta0 = 0.02, nu = 5.714e-5 as in their Fig. 2 (top left); delta = 0.02; system (2), where it is a saddle"
    figure = sheet("The synchronous regime of Kanunnikov and Lamper, by every way there is", words, 11.5, 8.4)
    grid = figure.add_gridspec(2, 2)
    for number, (key, label) in enumerate(_QUANTITIES):
        axes = panel(figure, grid[number // 2, number % 2], f"{key}(alpha)", "alpha, rad", label)
        for way, look in _WAYS.items():
            chosen = sorted((row for row in rows if row["way"] == way), key=lambda row: float(row["alpha"]))
            values = np.array([float(row[key]) for row in chosen])
            if np.isfinite(values).any():
                axes.plot([float(row["alpha"]) for row in chosen], values, label=way, **look)
        legend(axes)
    save(figure, path)


def draw_locking(
    chis: Floats, taus: Floats, rows: Sequence[Row], edges: Sequence[Row], path: str | os.PathLike[str]
) -> None:
    """Draw where clocks lock over tau and chi, with theory's edge and the slow flow's."""
    from matplotlib.colors import ListedColormap

    words = "system (2), 2,000 swings a cell from near quadrature; slower slips count as locked"
    figure = sheet("What locks (blue) and what slips", words, 7.4, 6.2)
    axes = panel(figure, figure.add_gridspec(1, 1)[0], "", "tau", "chi")
    axes.grid(visible=False)
    locked = np.array([row["locked"] for row in rows], dtype=float).T
    axes.pcolormesh(taus, chis, locked, cmap=ListedColormap(["#f1f1f1", BLUE]), shading="nearest", vmin=0.0, vmax=1.0)
    for key, color, words in (
        ("edge_by_theory", ORANGE, "edge by theory, leading order"),
        ("edge_by_balance", "black", "edge of the slow flow"),
    ):
        axes.plot(taus, [float(row[key]) for row in edges], color=color, linewidth=1.8, label=words)
    axes.set_ylim(0.0, float(chis[-1]))
    legend(axes, loc="upper left")
    save(figure, path)
