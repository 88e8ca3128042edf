"""The picture of the suite `corrections`: error against run time, one panel a case, every method named at its point."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.plots.canvas import BLUE, GREEN, GREY, VERMILION, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FLOOR = 1e-9  # mGal: rounding of gravity itself
_LABELS = 1.25  # of the longest time: where labels begin
_WHOLE = 1.0  # mGal: what a survey at sea would notice
_MET = 1e-2  # mGal: the bar of the right methods


def draw(errors: Mapping[str, Mapping[str, float]], times: Mapping[str, float], path: str | os.PathLike[str]) -> None:
    """Draw the table.

    Parameters
    ----------
    errors : mapping
        Case to method to error, mGal; NaN = refused.
    times : mapping
        Method to run time, ms.
    path : path
        PNG.
    """
    figure = sheet(
        "What each method leaves, and what it costs",
        "error against truth and warm run time of a 30-minute record at 25 Hz, noise-free linear pendulums in swell",
        12.5,
        8.2,
    )
    grid = figure.add_gridspec(2, 3)
    low = min(times.values()) / 1.2
    high = (max(times.values()) * _LABELS) ** 2 / low  # half the width is for the labels
    for number, (case, found) in enumerate(errors.items()):
        axes = panel(
            figure, grid[number // 3, number % 3], case, "run time, ms", "|error|, mGal", xscale="log", yscale="log"
        )
        _scale(axes, low, high)
        _points(axes, found, times)
    _explain(figure.add_subplot(grid[1, 2]))
    save(figure, path)


def _scale(axes: Axes, low: float, high: float) -> None:
    axes.set_xlim(low, high)
    axes.set_ylim(FLOOR / 6.0, 5e4)
    ticks = [tick for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500) if low <= tick <= high]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_yticks([10.0**power for power in range(-9, 5, 2)])
    axes.axhspan(FLOOR / 6.0, _MET, color=GREEN, alpha=0.07, linewidth=0)
    axes.axhline(_WHOLE, color=GREY, linewidth=0.8, linestyle="--")


def _points(axes: Axes, found: Mapping[str, float], times: Mapping[str, float]) -> None:
    drawn = {name: max(abs(error), FLOOR) for name, error in found.items() if np.isfinite(error)}
    refused = [name for name in found if name not in drawn]
    heights = apart({name: float(np.log10(error)) for name, error in drawn.items()})
    for name, error in drawn.items():
        colour = GREEN if error <= _MET else VERMILION if error >= _WHOLE else BLUE
        axes.plot(times[name], error, "o", color=colour, markersize=6, markeredgecolor="white", zorder=3)
        axes.annotate(
            f"{name}  {_number(error)}",
            (times[name], error),
            xytext=(max(times.values()) * _LABELS, 10.0 ** heights[name]),
            textcoords="data",
            fontsize=8,
            color=colour,
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.5,
                "shrinkA": 1,
                "shrinkB": 3,
                "relpos": (0.0, 0.5),
            },
        )
    if refused:
        axes.text(
            0.03,
            0.97,
            "refused by name:\n" + "\n".join(refused),
            transform=axes.transAxes,
            fontsize=8,
            color=GREY,
            va="top",
        )


def apart(heights: Mapping[str, float], least: float = 0.62) -> dict[str, float]:
    """Move labels up, the lowest first, until none stands on another (decades)."""
    placed: dict[str, float] = {}
    last = -np.inf
    for name, height in sorted(heights.items(), key=lambda item: item[1]):
        last = placed[name] = max(height, last + least)
    return placed


def _number(error: float) -> str:
    return (
        "< 1e-9"
        if error <= FLOOR
        else f"{error:.0e}"
        if error < 1e-3
        else f"{error:.2g}"
        if error < 10
        else f"{error:.0f}"
    )


def _explain(axes: Axes) -> None:
    axes.set_axis_off()
    axes.text(
        0.0,
        0.95,
        "How to read it\n\n"
        "green   right: below 0.01 mGal (shaded)\n"
        "blue     between\n"
        "red       wrong: above 1 mGal (dashed)\n\n"
        "vening-meinesz   (9) at minute marks, raw first pendulum\n"
        "panteleev-averaged   (27), mean subtracted from a slope\n"
        "panteleev   (27), integrated, then regressed\n"
        "general   (38) with the model's phase speeds\n"
        "complex   complex form of (27)\n"
        "projection   exact linear identity\n"
        "shooting   exact identity, here the linear one\n\n"
        "Run time: observation to gravity, kernels compiled,\nmedian of several rounds in which methods take turns.",
        transform=axes.transAxes,
        fontsize=9,
        va="top",
        linespacing=1.45,
    )
