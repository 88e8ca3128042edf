"""Error against each factor in turn, and error against run time: every method of the suite `corrections`."""

from __future__ import annotations

import os
import statistics
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.benchmarks.corrections_colours import DRAWN, FLOOR, MARKS
from pipeline.benchmarks.corrections_picture import apart
from pipeline.benchmarks.corrections_points import FACTORS
from pipeline.plots.canvas import GREY, legend, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TOP = 1e5  # mGal
_DECLINED = 2e4  # mGal: where a refusal is marked
_COLUMNS = 5


def draw(points: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Draw |error| against each factor, all else nominal: one panel a factor.

    Parameters
    ----------
    points : sequence of mapping
        Rows of the grids, one a record and method.
    path : path
        PNG.
    """
    figure = sheet(
        "What each method leaves of real pendulums, one factor at a time",
        "|error| against truth, mGal, all else as in the nominal record (noise-free but where noise is the factor); "
        "a cross on top: declined; methods for linear pendulums often coincide",
        16.5,
        9.8,
    )
    rows_of_panels = -(-(len(FACTORS) + 1) // _COLUMNS)
    grid = figure.add_gridspec(rows_of_panels, _COLUMNS)
    for number, factor in enumerate(FACTORS):
        rows = [row for row in points if row["factor"] == factor.name]
        across = f"{factor.name}, {factor.unit}" if factor.unit not in ("", "1") else factor.name
        up = "|error|, mGal" if number % _COLUMNS == 0 else ""
        axes = panel(figure, grid[number // _COLUMNS, number % _COLUMNS], "", across, up, yscale="log")
        values = list(dict.fromkeys(row["value"] for row in rows))
        for method in DRAWN:
            _line(axes, method, [row for row in rows if row["method"] == method])
        axes.set_xticks(range(len(values)), [_short(value) for value in values])
        axes.set_xlim(-0.4, max(len(values), 2) - 0.6)
        axes.set_ylim(FLOOR / 2, _TOP)
        axes.set_yticks([10.0**power for power in range(-8, 5, 2)])
    _key(figure.add_subplot(grid[-1, len(FACTORS) % _COLUMNS :]))
    save(figure, path)


def _line(axes: Axes, method: str, rows: Sequence[Mapping[str, Any]]) -> None:
    colour, mark = MARKS[method]
    errors = np.array([max(abs(row["error_mgal"]), FLOOR) if not row["refused"] else np.nan for row in rows])
    wide = method in ("general", "shooting")
    places = np.arange(len(rows)) + _aside(method)
    axes.plot(places, errors, color=colour, marker=mark, markersize=4.5, linewidth=1.8 if wide else 0.9, label=method)
    declined = places[[bool(row["refused"]) for row in rows]]
    axes.plot(declined, np.full(declined.size, _DECLINED), "x", color=colour, markersize=5)


def _aside(method: str) -> float:
    """A little to one side: methods that agree would hide each other."""
    return 0.03 * (DRAWN.index(method) - 0.5 * (len(DRAWN) - 1))


def _short(value: Any) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if value == 0 or value > 1e-3 else f"{value:.0e}".replace("e-0", "e-")


def _key(axes: Axes) -> None:
    axes.set_axis_off()
    for method in DRAWN:
        colour, mark = MARKS[method]
        axes.plot([], [], color=colour, marker=mark, label=method)
    legend(axes, loc="center", title="method")


def draw_cost(points: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Draw |error| against warm run time: every record as a dot, every method's medians as its mark.

    Parameters
    ----------
    points : sequence of mapping
        Rows of the grids, one a record and method.
    path : path
        PNG.
    """
    figure = sheet(
        "What each method leaves of real pendulums, and what it costs",
        "every record of the grids as a small mark, medians as a large one; "
        "run time from an observation to gravity, kernels compiled",
        11.0,
        7.0,
    )
    axes = panel(
        figure, figure.add_gridspec(1, 1)[0, 0], "", "run time, ms", "|error|, mGal", xscale="log", yscale="log"
    )
    middles: dict[str, tuple[float, float]] = {}
    for method in DRAWN:
        colour, mark = MARKS[method]
        rows = [row for row in points if row["method"] == method and not row["refused"]]
        if not rows:
            continue
        times = [row["ms"] for row in rows]
        errors = [max(abs(row["error_mgal"]), FLOOR) for row in rows]
        axes.plot(times, errors, mark, color=colour, markersize=3.5, alpha=0.35, markeredgewidth=0)
        middle = statistics.median(times), statistics.median(errors)
        middles[method] = middle
        axes.plot(*middle, mark, color=colour, markersize=11, markeredgecolor="white", zorder=4)
    _label(axes, middles)
    axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--", zorder=1)
    axes.set_ylim(FLOOR / 3, _TOP)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    save(figure, path)


def _label(axes: Axes, middles: Mapping[str, tuple[float, float]]) -> None:
    """Name each method right of all marks, with a line to its medians."""
    heights = apart({method: float(np.log10(error)) for method, (_, error) in middles.items()}, 0.55)
    right = 2.0 * axes.get_xlim()[1]
    axes.set_xlim(axes.get_xlim()[0], 12.0 * right)
    for method, middle in middles.items():
        axes.annotate(
            f"{method}  {middle[0]:.3g} ms, {middle[1]:.2g} mGal",
            middle,
            xytext=(right, 10.0 ** heights[method]),
            textcoords="data",
            fontsize=9,
            color=MARKS[method][0],
            va="center",
            arrowprops={
                "arrowstyle": "-", "color": MARKS[method][0], "linewidth": 0.6, "shrinkB": 5, "relpos": (0.0, 0.5)
            },
        )  # fmt: skip
