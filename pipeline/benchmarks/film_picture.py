"""The picture of the suite `film`: error and accepted part against every property, one line a reader."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.plots.canvas import BLUE, ORANGE, VERMILION, panel, save, sheet

_COLOURS = {
    "isochrony": BLUE,
    "column argmax": VERMILION,
    "centroid": ORANGE,
}
PROMISED = 0.20  # px rms, normal to the line, at 300 dpi
_MEASURES = (
    ("normal_px", "error normal to the line, px", "log"),
    ("accepted", "part of the rows read", "linear"),
    ("wrong_unflagged", "part wrong by 1 px, unflagged", "linear"),
)


def draw(table: Sequence[Mapping[str, Any]], path: str | os.PathLike[str]) -> None:
    """Draw the table of films as PNG.

    Parameters
    ----------
    table
        Rows of the suite's films.
    path : path
    """
    axes_names = list(dict.fromkeys(row["axis"] for row in table))
    speeds = {
        name: float(
            np.median([row["mpx_s"] for row in table if row["reader"] == name and not row["refused"]] or [np.nan])
        )
        for name in _COLOURS
    }
    said = ", ".join(f"{name} {speed:.3g}" for name, speed in speeds.items() if np.isfinite(speed))
    figure = sheet(
        "Reading films: error, rows read and silent errors, against grain, speed, resolution, crossings, missing marks",
        f"dashed: promised; Mpx per CPU second: {said}",
        3.1 * len(axes_names) + 0.4,
        9.0,
    )
    grid = figure.add_gridspec(len(_MEASURES), len(axes_names))
    for across, axis in enumerate(axes_names):
        rows = [row for row in table if row["axis"] == axis]
        for down, (measure, words, scale) in enumerate(_MEASURES):
            last = down == len(_MEASURES) - 1
            axes = panel(
                figure, grid[down, across], axis if down == 0 else "", axis if last else "",
                words if across == 0 else "", yscale=scale,
            )  # fmt: skip
            for name, colour in _COLOURS.items():
                points = sorted((row["value"], row[measure]) for row in rows if row["reader"] == name)
                points = [point for point in points if np.isfinite(point[1])]  # a refused film has no error
                if points:
                    axes.plot(*np.array(points).T, color=colour, marker="o", markersize=4.0, label=name)
            if scale == "log":
                errors = [row[measure] for row in table if row[measure] > 0.0]
                axes.set_ylim(0.7 * min(errors, default=0.1), 1.5 * max(errors, default=1.0))
                axes.axhline(PROMISED, color="0.4", linewidth=0.8, linestyle="--")
            else:
                axes.set_ylim(-0.02, 1.02)
            if across == 0 and down == 1:
                axes.legend(fontsize=7.5, frameon=False, loc="lower left")
    save(figure, path)
