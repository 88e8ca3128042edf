"""A single pendulum: its period against its amplitude, beside the law of the finite arc."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.period.cycles import arc_factor
from pipeline.plots.canvas import BLUE, GREY, ORANGE, VERMILION, legend, panel, sheet
from pipeline.plots.series import Floats, robust_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset, DataTree


def period_figure(result: DataTree) -> Figure:
    """Draw a result with the group `period`: period against amplitude above, what the law leaves of it below."""
    table = result.children["period"].to_dataset(inherit=False)
    period, sigma = float(table["period"]), float(table["period_sigma"])
    name = result.attrs.get("record_id", "without a name")
    figure = sheet(
        "Period of a single pendulum against its arc",
        f"record {name} · at infinitesimal arc {period:.6f} s ± {sigma:.2g} s · {table.sizes['cycle']} cycles",
        11.0,
        7.2,
    )
    grid = figure.add_gridspec(2, 1, height_ratios=(1.5, 1))
    _draw_periods(panel(figure, grid[0], "Cycle by cycle", "", "full period, s"), table, period)
    left = panel(figure, grid[1], "What the law leaves", "amplitude, rad", "period / law − 1, %")
    _draw_remainder(left, table, period)
    return figure


def _draw_periods(axes: Axes, table: Dataset, period: float) -> None:
    amplitude, cycles = _values(table, "amplitude"), _values(table, "cycle_period")
    axes.plot(amplitude, cycles, "o", markersize=2.2, color=GREY, alpha=0.6, label="one cycle")
    if "cycle_period_smoothed" in table:
        axes.plot(amplitude, _values(table, "cycle_period_smoothed"), color=BLUE, label="smoothed")
    arc = np.linspace(0.0, 1.03 * float(np.nanmax(amplitude)), 300)
    law = period * arc_factor(arc)
    axes.plot(arc, law, "--", color=VERMILION, label="finite-arc law (elliptic integral)")
    axes.set_ylim(*robust_limits(np.concatenate([cycles, law])))
    axes.set_xlim(0.0, arc[-1])
    legend(axes, loc="upper left")


def _draw_remainder(axes: Axes, table: Dataset, period: float) -> None:
    amplitude, cycles = _values(table, "amplitude"), _values(table, "cycle_period")
    scales = {"amplitude as recorded": (1.0, GREY)}
    if "amplitude_scale" in table and "amplitude-scale" in table["flag"].values:
        scale = 1.0 + float(table["amplitude_scale"])
        scales[f"amplitude times {scale:.4f}, as fitted"] = (scale, BLUE)
    shown = []
    for label, (scale, color) in scales.items():
        remainder = 100.0 * (cycles / arc_factor(scale * amplitude) / period - 1.0)
        axes.plot(amplitude, remainder, "o", markersize=2.2, color=color, label=label)
        shown.append(remainder)
    axes.axhline(0.0, color="black", linewidth=0.7)
    axes.axhspan(-0.1, 0.1, color=ORANGE, alpha=0.18, linewidth=0)
    axes.annotate("±0.1 %", (1.005, 0.0), xycoords=("axes fraction", "data"), va="center", fontsize=8.5)
    # Where the swing has nearly died its cycles scatter most: they must not press all others onto one line.
    low, high = robust_limits(np.concatenate(shown), hidden=4.0)
    low, high = min(low, -0.25), max(high, 0.25)
    outside = int(sum(((values < low) | (values > high)).sum() for values in shown))
    axes.set_ylim(low, high)
    axes.set_xlim(0.0, 1.03 * float(np.nanmax(amplitude)))
    axes.set_xlabel("amplitude, rad" + (f" ({outside} points lie beyond the frame)" if outside else ""))
    legend(axes, loc="lower right", ncols=2)


def _values(table: Dataset, name: str) -> Floats:
    return np.asarray(table[name].values, dtype=np.float64)
