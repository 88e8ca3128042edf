"""Pictures of the suite `huygens`: the paper's Fig. 2 with every way on it, and the maps of locking and of basins."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, VERMILION, legend, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Row = Mapping[str, Any]
_LOOKS: dict[str, dict[str, Any]] = {
    "paper": {"color": GREY, "linestyle": "--", "linewidth": 2.4},
    "corrected chain": {"color": VERMILION, "linewidth": 2.2, "alpha": 0.6},
    "balance": {"color": BLUE, "linestyle": "", "marker": "s", "markersize": 9, "fillstyle": "none"},
    "orbit": {"color": GREEN, "linestyle": "", "marker": "o", "markersize": 5.5},
    "motion": {"color": "black", "linestyle": "", "marker": "x", "markersize": 6},
}
_QUANTITIES = (("beta", "beta"), ("q", "q = 2X/l"), ("tau", "tau"), ("k", "k = d eta/d chi"))
_ENDS = (("in phase", BLUE), ("antiphase", VERMILION), ("quadrature", GREEN), ("elsewhere yet", "#dddddd"))


def draw_curves(rows: Sequence[Row], path: str | os.PathLike[str]) -> None:
    """Draw beta (the paper's Fig. 2), q, tau and k over alpha; a line or a mark for each way."""
    figure = sheet(
        "The synchronous regime of Kanunnikov and Lamper, by every way there is",
        "delta0 = 0.02, nu = 5.714e-5 as in their Fig. 2 (top left); delta = 0.02; system (2), where it is a saddle",
        11.5,
        8.4,
    )
    grid = figure.add_gridspec(2, 2)
    for number, (key, label) in enumerate(_QUANTITIES):
        title = f"{key}(alpha)"
        axes = panel(figure, grid[number // 2, number % 2], title, "alpha, rad", label)
        for way, look in _LOOKS.items():
            chosen = sorted((row for row in rows if row["way"] == way), key=lambda row: float(row["alpha"]))
            values = np.array([float(row[key]) for row in chosen])
            if np.isfinite(values).any():
                axes.plot([float(row["alpha"]) for row in chosen], values, label=way, **look)
        legend(axes)
    save(figure, path)


def draw_maps(
    lock: tuple[Floats, Floats, Sequence[Row]],
    edges: Sequence[Row],
    basin: tuple[Floats, Floats, Sequence[Row]],
    path: str | os.PathLike[str],
) -> None:
    """Draw where clocks lock over tau and chi with theory's edge, and what starts of the full system end in."""
    figure = sheet(
        "What locks, and what it ends in",
        "left: system (2), 2,000 swings a cell from near quadrature, slower slips count as locked; "
        "right: full system, swing 0.4 rad, beam begun at rest",
        12.5,
        6.2,
    )
    grid = figure.add_gridspec(1, 2)
    chis, taus, rows = lock
    tongue = panel(figure, grid[0], "Locked (blue) and slipping", "tau", "chi")
    locked = np.array([row["locked"] for row in rows], dtype=float).T
    _cells(tongue, taus, chis, locked, ["#f1f1f1", BLUE])
    for key, color, said in (
        ("edge_by_theory", ORANGE, "edge by theory, leading order"),
        ("edge_by_balance", "black", "edge of the slow flow"),
    ):
        tongue.plot(taus, [float(row[key]) for row in edges], color=color, linewidth=1.8, label=said)
    tongue.set_ylim(0.0, float(chis[-1]))
    legend(tongue, loc="upper left")
    phases, sizes, ends = basin
    axes = panel(
        figure, grid[1], "Ends of the full system", "first phase difference, rad", "first swing of the second / S0"
    )
    _cells(axes, phases, sizes, np.array([row["ends"] for row in ends], dtype=float), [color for _, color in _ENDS])
    from matplotlib.patches import Patch

    counts = np.bincount(np.concatenate([row["ends"] for row in ends]).astype(int), minlength=len(_ENDS))
    shown = [Patch(color=color, label=name) for (name, color), count in zip(_ENDS, counts, strict=True) if count]
    legend(axes, handles=shown, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=len(shown))
    save(figure, path)


def _cells(axes: Axes, across: Floats, up: Floats, values: Floats, colours: Sequence[str]) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    axes.grid(visible=False)
    axes.pcolormesh(across, up, values, cmap=ListedColormap(list(colours)), norm=norm, shading="nearest")
