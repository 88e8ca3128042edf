"""Pictures of the suite `huygens`: the paper's Fig. 2 with every way on it, and the map of locking."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, VERMILION, legend, panel, save, sheet

Row = Mapping[str, Any]
_LOOKS: dict[str, dict[str, Any]] = {
    "paper": {"color": GREY, "linestyle": "--", "linewidth": 2.4},
    "corrected chain": {"color": VERMILION, "linewidth": 2.2, "alpha": 0.6},
    "balance": {"color": BLUE, "linestyle": "", "marker": "s", "markersize": 9, "fillstyle": "none"},
    "orbit": {"color": GREEN, "linestyle": "", "marker": "o", "markersize": 5.5},
    "motion": {"color": "black", "linestyle": "", "marker": "x", "markersize": 6},
}
_QUANTITIES = (("beta", "beta"), ("q", "q = 2X/l"), ("tau", "tau"), ("k", "k = d eta/d chi"))


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


def draw_map(
    chis: Floats, taus: Floats, rows: Sequence[Row], edges: Sequence[Row], path: str | os.PathLike[str]
) -> None:
    """Draw where clocks lock over tau and chi, with theory's edge and the slow flow's."""
    from matplotlib.colors import ListedColormap

    figure = sheet(
        "What locks (blue) and what slips",
        "system (2), 2,000 swings a cell from near quadrature; slower slips count as locked",
        7.4,
        6.2,
    )
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
