"""The picture of the suite: kinds by strengths, each cell coloured by the worst |z|, with sigma and z in it."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipeline.benchmarks.honesty.kinds import STRENGTHS
from pipeline.plots.canvas import GREY, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = dict[str, Any]
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


def draw(table: Sequence[Row], method: str, path: str | os.PathLike[str]) -> None:
    """Draw the table of one method.

    Parameters
    ----------
    table : sequence of dict
        Rows of `suite.by_kind`.
    method : str
        Its name, for the heading.
    path : path
        PNG.
    """
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
