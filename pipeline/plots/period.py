"""A single pendulum: its period against its amplitude, beside the law of the finite arc."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.plots.canvas import BLUE, GREY, ORANGE, VERMILION, legend, panel, sheet
from pipeline.plots.series import Floats, robust_limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import DataTree


def period_figure(result: DataTree) -> Figure:
    """Draw the result of a single pendulum: period against amplitude above, what is left of it below.

    Parameters
    ----------
    result : DataTree
        A valid result with the group `period`.
    """
    table = result["period"].dataset
    period, sigma = float(table["period"]), float(table["period_sigma"])
    amplitude = np.asarray(table["amplitude"].values, dtype=np.float64)
    name = result.attrs.get("record_id", "without a name")
    figure = sheet(
        "Period of a single pendulum against its arc",
        f"record {name} · at infinitesimal arc {period:.6f} s ± {sigma:.2g} s · {amplitude.size} cycles",
        11.0,
        7.2,
    )
    grid = figure.add_gridspec(2, 1, height_ratios=(1.5, 1))
    whole = panel(figure, grid[0], "Cycle by cycle", "", "full period, s")
    cycles = np.asarray(table["cycle_period"].values, dtype=np.float64)
    whole.plot(amplitude, cycles, "o", markersize=2.2, color=GREY, alpha=0.6, label="one cycle")
    if "cycle_period_smoothed" in table:
        whole.plot(amplitude, table["cycle_period_smoothed"].values, color=BLUE, label="smoothed")
    arc = np.linspace(0.0, 1.03 * float(np.nanmax(amplitude)), 300)
    whole.plot(
        arc,
        period * finite_arc_factor(arc),
        "--",
        color=VERMILION,
        label="finite-arc law (elliptic integral)",
    )
    whole.set_ylim(*robust_limits(np.concatenate([cycles, period * finite_arc_factor(arc)])))
    whole.set_xlim(0.0, arc[-1])
    legend(whole, loc="upper left")
    left = panel(figure, grid[1], "What the law leaves", "amplitude, rad", "period / law − 1, %")
    ratio = 100.0 * (cycles / finite_arc_factor(amplitude) / period - 1.0)
    left.plot(amplitude, ratio, "o", markersize=2.2, color=GREY, alpha=0.6)
    if "cycle_period_smoothed" in table:
        smoothed = np.asarray(table["cycle_period_smoothed"].values, dtype=np.float64)
        left.plot(amplitude, 100.0 * (smoothed / finite_arc_factor(amplitude) / period - 1.0), color=BLUE)
    left.axhline(0.0, color="black", linewidth=0.7)
    left.axhspan(-0.1, 0.1, color=ORANGE, alpha=0.18, linewidth=0)
    left.annotate(
        "±0.1 %", (0.995, 0.1), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8.5
    )
    left.set_ylim(*robust_limits(np.append(ratio, [-0.2, 0.2])))
    left.set_xlim(0.0, arc[-1])
    return figure


def finite_arc_factor(amplitude: Floats) -> Floats:
    """Period of a pendulum over its period at infinitesimal arc.

    Parameters
    ----------
    amplitude : array
        rad, below pi.

    Returns
    -------
    array
        (2/pi) K(sin(amplitude/2)), through the arithmetic-geometric mean: 1 / agm(1, cos(amplitude/2)).

    Examples
    --------
    >>> round(float(finite_arc_factor(np.array([3.1]))[0]), 11)
    3.34849644557
    """
    one, other = np.ones_like(amplitude), np.cos(0.5 * amplitude)
    for _ in range(8):  # the digits double at each step: 8 suffice for float64 below 3.1416 rad
        one, other = 0.5 * (one + other), np.sqrt(one * other)
    return 1.0 / one
