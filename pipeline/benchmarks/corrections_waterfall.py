"""The residual after each entry of the ledger in turn, on one record on which everything acts."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pipeline.benchmarks.corrections_ledger import UNCORRECTED
from pipeline.plots.canvas import BLUE, GREEN, GREY, VERMILION, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(ledger: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Draw one panel a method, its entries from top to bottom.

    Parameters
    ----------
    ledger : sequence of mapping
        Rows of `corrections_ledger.waterfall`.
    path : path
        PNG.
    """
    methods = list(dict.fromkeys(row["method"] for row in ledger))
    longest = max((sum(row["method"] == method for row in ledger) for method in methods), default=1)
    figure = sheet(
        "What is left of the error after each entry of the ledger",
        "real pendulums in swell, heave and vibration, a losing chronometer, warm thin air, "
        "a tilted and turning plane, a ship under way; blue: nearer to the truth, red: further from it",
        5.0 * max(len(methods), 1),
        2.4 + 0.42 * longest,
    )
    grid = figure.add_gridspec(1, max(len(methods), 1))
    found = [0.0, *(row["residual_mgal"] for row in ledger)]
    margin = 0.08 * (max(found) - min(found)) or 1.0
    for number, method in enumerate(methods):
        rows = [row for row in ledger if row["method"] == method]
        axes = panel(figure, grid[0, number], method, "residual, mGal", "")
        _steps(axes, rows)
        axes.set_xlim(min(found) - margin, max(found) + margin)
    save(figure, path)


def _steps(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    before = 0.0
    for place, row in enumerate(rows):
        left = row["residual_mgal"]
        if row["entry"] == UNCORRECTED:
            axes.barh(place, left, color=GREY, height=0.6)
        elif row["applied"]:
            colour = BLUE if abs(left) <= abs(before) else VERMILION
            axes.barh(place, left - before, left=before, color=colour, height=0.6)
        axes.plot([left, left], [place - 0.3, place + 1.3 if place + 1 < len(rows) else place + 0.3], color="black",
                  linewidth=0.8)  # fmt: skip
        before = left
    axes.axvline(0.0, color=GREEN, linewidth=1.2)
    axes.set_yticks(range(len(rows)), [_name(row) for row in rows])
    for label, row in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_color("black" if row["applied"] else GREY)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    last = rows[-1]
    axes.set_xlabel(f"residual, mGal; at the end {_signed(last['residual_mgal'])} ± {last['total_sigma_mgal']:.2g}")


def _name(row: Mapping[str, Any]) -> str:
    name = str(row["entry"]).replace("non_", "non-").replace("_", " ")
    if row["entry"] == UNCORRECTED:
        return f"{name}\n{_signed(row['residual_mgal'])}"
    return f"{name}\n{_signed(row['value_mgal'])}" if row["applied"] else f"{name}\nnot applied"


def _signed(value: float) -> str:
    return f"{value:+.4g}".replace("-", "−")
