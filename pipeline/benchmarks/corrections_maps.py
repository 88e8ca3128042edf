"""Error maps over period difference and psi/a: one panel a method, one logarithmic scale of colours for all."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.benchmarks.corrections_colours import DRAWN
from pipeline.benchmarks.corrections_points import MAP
from pipeline.plots.canvas import GREY, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipeline.arrays import Floats

LOWEST, HIGHEST = 1e-6, 1e3  # mGal: ends of the colours
DECLINED: dict[str, Any] = {"facecolor": "#dddddd", "edgecolor": GREY, "hatch": "///", "linewidth": 0}
_MANY = 7  # columns from which a cell is too narrow for its number


def draw(points: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Draw the map of each method; cells that a method declined are grey and hatched.

    Parameters
    ----------
    points : sequence of mapping
        Rows of the grids, one a record and method.
    path : path
        PNG.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    rows = [row for row in points if row["factor"] == MAP]
    norm, colours = LogNorm(LOWEST, HIGHEST), colormaps["viridis"]
    figure = sheet(
        "What each method leaves of real pendulums, over period difference and slow motion",
        "|error| against truth, mGal; noise-free, heave recorded; grey and hatched: the method declined",
        13.5 if len({row["difference"] for row in rows}) < _MANY else 17.0,
        7.6,
    )
    grid = figure.add_gridspec(2, 4)
    for number, method in enumerate(DRAWN):
        across, up, errors = field([row for row in rows if row["method"] == method])
        place = grid[number // 4, number % 4]
        axes = panel(figure, place, method, "relative period difference", "psi/a")
        _cells(axes, errors, norm, colours)
        axes.set_xticks(range(len(across)), [_power(value) for value in across])
        axes.set_yticks(range(len(up)), [f"{value:g}" for value in up])
    key = figure.add_subplot(grid[1, 3])
    key.set_axis_off()
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=key.inset_axes((0.12, 0.0, 0.09, 1.0)), extend="both")
    bar.set_label("|error|, mGal")
    key.add_patch(Rectangle((0.55, 0.9), 0.12, 0.1, transform=key.transAxes, **DECLINED))
    key.text(0.71, 0.95, "declined", transform=key.transAxes, va="center", fontsize=8.5)
    save(figure, path)


def field(rows: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float], Floats]:
    """Period differences, psi/a, and |error| of one method, (psi/a, period difference), NaN where it declined."""
    across = sorted({float(row["difference"]) for row in rows})
    up = sorted({_slow(row) for row in rows})
    errors = np.full((len(up), len(across)), np.nan)
    for row in rows:
        errors[up.index(_slow(row)), across.index(float(row["difference"]))] = abs(row["error_mgal"])
    return across, up, errors


def _slow(row: Mapping[str, Any]) -> float:
    return round(float(row["slow"]) / float(row["arc"]), 6)


def _cells(axes: Axes, errors: Floats, norm: Any, colours: Any) -> None:
    from matplotlib.patches import Rectangle

    axes.imshow(np.clip(errors, LOWEST / 10, None), norm=norm, cmap=colours, origin="lower", aspect="auto")
    axes.grid(visible=False)
    narrow = errors.shape[1] >= _MANY
    for j, i in np.ndindex(*errors.shape):
        error = float(errors[j, i])
        if math.isnan(error):
            axes.add_patch(Rectangle((i - 0.5, j - 0.5), 1, 1, **DECLINED))
            continue
        axes.text(
            i,
            j,
            number(error, short=narrow),
            ha="center",
            va="center",
            fontsize=6.5 if narrow else 8,
            color="black" if norm(max(error, LOWEST)) > 0.6 else "white",
        )


def number(error: float, *, short: bool = False) -> str:
    """An error in few characters.

    >>> number(3.3e-6), number(0.0164), number(452.3), number(3.3e-6, short=True)
    ('3e-6', '0.016', '452', '3e-6')
    """
    if error < 1e-3:
        return f"{error:.0e}".replace("e-0", "e-") if error else "0"
    if error >= 99.5 or (short and error >= 9.5):
        return f"{error:.0f}"
    return f"{error:.1g}" if short else f"{error:.2g}"


def _power(value: float) -> str:
    """Powers of ten alone: what lies between them is plain from its neighbours, and would not fit."""
    digit, power = f"{value:.0e}".split("e")
    return f"$10^{{{int(power)}}}$" if digit == "1" else ""
