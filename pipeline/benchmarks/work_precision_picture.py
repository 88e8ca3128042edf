"""The pictures of the suite `integrators`: error against time, one line a method, each named at its end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.benchmarks.growth import Growth
from pipeline.benchmarks.work_precision import Point
from pipeline.plots.canvas import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, note, panel, save, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "closed form": BLUE,
    "Picard collocation": GREEN,
    "beam collocation": GREEN,
    "Radau": VERMILION,
    "explicit": PURPLE,
    "splitting": SKY,
}
"""The project's propagators; peers are grey, heyoka apart."""
PEER, HEYOKA = "#8c8c8c", ORANGE
_MARKERS = {"heyoka": "D", "CyRK": "s", "scipy": "^", "CVODE": "v"}
_WIDTH, _HEIGHT = 11.0, 6.6  # in
_LEAST = 1e-17
_LINE = 0.034  # height of a label, of the panel's


def draw(title: str, reference: str, points: Sequence[Point], path: str | os.PathLike[str]) -> None:
    """Draw one problem.

    Parameters
    ----------
    title, reference : str
        What was solved, and against what errors are measured.
    points
        Of one problem.
    path : path
        PNG.
    """
    figure = sheet(
        f"Error against time: {title}",
        f"largest error over the largest size, against {reference}; warm CPU time, medians of five",
        _WIDTH,
        _HEIGHT,
    )
    axes = panel(figure, figure.add_gridspec(1, 1)[0, 0], "", "CPU time, ms", "error", xscale="log", yscale="log")
    lines = _lines(points)
    if not lines:
        note(axes, "nobody gave a value")
        save(figure, path)
        return
    _limits(axes, lines)
    for name, line in lines.items():
        own = name in COLOURS
        axes.plot(
            *line.T,
            color=_colour(name),
            marker="o" if own else _MARKERS.get(name.split()[0], "s"),
            markersize=6.0 if own else 4.0,
            markeredgecolor="white",
            markeredgewidth=0.6,
            linewidth=2.2 if own else 1.0,
            linestyle="--" if name.endswith("Python face") else "-",
            zorder=3 if own else 2,
        )
    _label(axes, lines)
    _declined(axes, points)
    save(figure, path)


def _lines(points: Sequence[Point]) -> dict[str, np.ndarray]:
    """Time and error of each method, loosest tolerance first."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for point in points:
        if point.seconds and np.isfinite(point.error):
            lines.setdefault(point.method, []).append((point.ms, max(point.error, _LEAST)))
    return {name: np.array(line) for name, line in lines.items()}


def _limits(axes: Axes, lines: dict[str, np.ndarray]) -> None:
    every = np.concatenate(list(lines.values()))
    low, high = np.log10(every.min(axis=0)), np.log10(every.max(axis=0))
    room = high[0] - low[0]
    axes.set_xlim(10.0 ** (low[0] - 0.04 * room - 0.05), 10.0 ** (high[0] + 0.30 * room + 0.1))  # labels stand right
    axes.set_ylim(10.0 ** (low[1] - 0.6), 10.0 ** (high[1] + 0.6))


def _label(axes: Axes, lines: dict[str, np.ndarray]) -> None:
    """Name each line right of its most precise point, moved up or down until no label stands on another."""
    placed: list[tuple[float, float, float]] = []
    ends = {
        name: axes.transAxes.inverted().transform(axes.transData.transform(line[-1])) for name, line in lines.items()
    }
    marks = [spot for line in lines.values() for spot in _along(axes, line)]
    for name, (x, y) in sorted(ends.items(), key=lambda item: float(item[1][1])):
        left, width = x + 0.014, 0.0088 * len(name)
        height = min(
            (y + sign * step * 0.25 * _LINE for step in range(80) for sign in (1, -1)),
            key=lambda level: (_hidden(left, width, level, placed, marks), abs(level - y)),
        )
        placed.append((left, width, height))
        axes.annotate(
            name,
            (x, y),
            xytext=(left, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=9 if name in COLOURS else 8,
            fontweight="bold" if name in COLOURS else "normal",
            color=_colour(name) if name in COLOURS or name == "heyoka" else GREY,
            va="center",
            arrowprops={"arrowstyle": "-", "color": _colour(name), "linewidth": 0.6, "shrinkA": 0, "shrinkB": 2},
        )


def _along(axes: Axes, line: np.ndarray) -> np.ndarray:
    """Places along a line, in parts of the panel."""
    corners = axes.transAxes.inverted().transform(axes.transData.transform(line))
    parts = np.linspace(0.0, len(corners) - 1.0, 16 * len(corners))
    return np.column_stack([np.interp(parts, np.arange(len(corners)), column) for column in corners.T])


def _hidden(
    left: float, width: float, level: float, placed: Sequence[tuple[float, float, float]], marks: Sequence[np.ndarray]
) -> int:
    """How many labels and parts of lines a label would stand on; leaving the panel counts as many."""
    labels = sum(left < other + size and other < left + width and abs(level - at) < _LINE for other, size, at in placed)
    spots: int = sum(left < x < left + width and abs(level - y) < 0.6 * _LINE for x, y in marks)
    return 40 * labels + spots + 400 * (not 0.02 < level < 0.98)


def _declined(axes: Axes, points: Sequence[Point]) -> None:
    """Who gave nothing, and in short why."""
    gave = {point.method for point in points if point.seconds}
    absent = {
        p.method: "not installed" if "not installed" in p.note else "declines" for p in points if p.method not in gave
    }
    if absent:
        words = "\n".join(f"{name}: {why}" for name, why in absent.items())
        axes.text(0.995, 0.99, words, transform=axes.transAxes, fontsize=8, color=GREY, va="top", ha="right")


def _colour(name: str) -> str:
    return COLOURS.get(name, HEYOKA if name == "heyoka" else PEER)


def draw_growth(grown: Sequence[Growth], path: str | os.PathLike[str]) -> None:
    """Draw how errors grow, one panel a case, with the slopes that unbiased rounding gives."""
    cases = list(dict.fromkeys(each.case for each in grown if each.swings.size))
    figure = sheet(
        "How errors grow over many oscillations",
        "largest error so far over the largest angle; p: exponent fitted from 30 oscillations on; dotted: t^1/2, t^3/2",
        4.4 * max(len(cases), 1) + 0.4,
        4.9,
    )
    grid = figure.add_gridspec(1, max(len(cases), 1))
    for number, case in enumerate(cases):
        axes = panel(figure, grid[0, number], case, "oscillations", "error", xscale="log", yscale="log")
        shown = [each for each in grown if each.case == case and each.swings.size]
        for each in shown:
            kept = (each.errors > 0.0) & (each.swings >= 1.0)
            colour = COLOURS.get(each.method, GREY)
            axes.plot(each.swings[kept], each.errors[kept], color=colour, linewidth=2.0)
            words = f"{each.method}, p = {round(each.exponent, 2) + 0.0:.2f}"
            place = (float(each.swings[kept][0]), float(each.errors[kept][-1]))
            axes.annotate(
                words, place, xytext=(2, 5), textcoords="offset points", fontsize=8.5, color=colour, fontweight="bold"
            )
        _slopes(axes, shown)
    save(figure, path)


def _slopes(axes: Axes, shown: Sequence[Growth]) -> None:
    swings = shown[0].swings[shown[0].swings >= 1.0]
    low, high = axes.get_ylim()
    for power in (0.5, 1.5):
        axes.plot(swings, low * 2.0 * swings**power, color=GREY, linewidth=0.9, linestyle=":", zorder=1)
    axes.set_ylim(low, high * 3.0)
