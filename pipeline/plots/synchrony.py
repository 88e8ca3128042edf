"""Periods: of a single pendulum against its amplitude, and clocks on one support, how they keep step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.period.cycles import arc_factor
from pipeline.plots import canvas
from pipeline.plots.canvas import BLUE, GREY, ORANGE, VERMILION, color_of, legend, note, panel, robust_limits, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset, DataTree

_MARKS = ("in phase", "quadrature", "antiphase", "quadrature")  # of each quarter of a turn
_LEAST_REACH = 0.3  # turns either side: so that a named angle is always in sight


def period_figure(result: DataTree) -> Figure:
    """Draw a result with the group `period`: period against amplitude above, what the law leaves of it below."""
    table = result.children["period"].to_dataset(inherit=False)
    period, sigma = float(table["period"]), float(table["period_sigma"])
    words = f"at infinitesimal arc {period:.6f} s ± {sigma:.2g} s · {table.sizes['cycle']} cycles"
    figure = sheet("Period of a single pendulum against its arc", f"{canvas.record_of(result)} · {words}", 11.0, 7.2)
    grid = figure.add_gridspec(2, 1, height_ratios=(1.5, 1))
    _draw_periods(panel(figure, grid[0], "Cycle by cycle", "", "full period, s"), table, period)
    left = panel(figure, grid[1], "What the law leaves", "amplitude, rad", "period / law − 1, %")
    _draw_remainder(left, table, period)
    return figure


def _draw_periods(axes: Axes, table: Dataset, period: float) -> None:
    amplitude, cycles = table["amplitude"].values, table["cycle_period"].values
    axes.plot(amplitude, cycles, "o", markersize=2.2, color=GREY, alpha=0.6, label="one cycle")
    if "cycle_period_smoothed" in table:
        axes.plot(amplitude, table["cycle_period_smoothed"].values, color=BLUE, label="smoothed")
    arc = np.linspace(0.0, 1.03 * float(np.nanmax(amplitude)), 300)
    law = period * arc_factor(arc)
    axes.plot(arc, law, "--", color=VERMILION, label="finite-arc law (elliptic integral)")
    axes.set(xlim=(0.0, arc[-1]), ylim=robust_limits(np.concatenate([cycles, law])))
    legend(axes, loc="upper left")


def _draw_remainder(axes: Axes, table: Dataset, period: float) -> None:
    amplitude, cycles = table["amplitude"].values, table["cycle_period"].values
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
    words = "amplitude, rad" + (f" ({outside} points lie beyond the frame)" if outside else "")
    axes.set(xlim=(0.0, 1.03 * float(np.nanmax(amplitude))), ylim=(low, high), xlabel=words)
    legend(axes, loc="lower right", ncols=2)


def synchrony_figure(result: DataTree) -> Figure:
    """Draw a result with the group `synchrony`: phase differences in turns, verdicts, amplitudes, Allan deviations."""
    table = result["synchrony"].dataset
    time = canvas.values(result, "/", "time")
    pairs = zip(*(table[name].values for name in ("pair", "verdict", "confidence")), strict=True)
    told = [f"{pair} {verdict} ({100.0 * float(sure):.1f} %)" for pair, verdict, sure in pairs]
    figure = sheet("Clocks that share a support", f"{canvas.record_of(result)} · {', '.join(told)}", 11.0, 7.6)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.3, 1))
    _differences(panel(figure, grid[0, :], "Phase of one less the other", "time, s", "turns"), time, table)
    sizes = panel(figure, grid[1, 0], "Amplitudes", "time, s", "rad")
    steady = panel(figure, grid[1, 1], "How steady each clock is", "averaging time, s", "Allan deviation of the rate")
    for k, label in enumerate(str(each) for each in table["clock"].values):
        sizes.plot(time, table["amplitude"].values[k], color=color_of(k), label=f"clock {label}")
        if "allan_deviation" in table:
            taus = table["averaging_time"].values
            steady.loglog(taus, table["allan_deviation"].values[k], "o-", markersize=3, color=color_of(k))
    legend(sizes)
    if "allan_deviation" not in table:
        note(steady, table.attrs.get("allan_deviation_absent") or "too short")
    return figure


def _differences(axes: Axes, time: np.ndarray, table: Dataset) -> None:
    turns = table["phase_difference"].values / (2.0 * np.pi)
    for k, pair in enumerate(str(each) for each in table["pair"].values):
        color, shown = color_of(k), turns[k] - np.floor(np.nanmin(turns[k]))
        axes.plot(time, shown, color=color, label=pair)
        since = float(table["lock_time"].values[k])
        if np.isfinite(since):
            axes.axvline(since, color=color, linestyle=":", linewidth=1.0)
    low, high = axes.get_ylim()
    middle, reach = 0.5 * (low + high), max(0.5 * (high - low), _LEAST_REACH)
    low, high = middle - reach, middle + reach
    axes.set_ylim(low, high)
    for quarter in range(int(np.ceil(4.0 * low)), int(np.floor(4.0 * high)) + 1) if high - low < 4.0 else ():
        axes.axhline(0.25 * quarter, color=GREY, linewidth=0.6, linestyle="--")
        place, word = (1.005, 0.25 * quarter), _MARKS[quarter % 4]
        axes.annotate(word, place, xycoords=("axes fraction", "data"), va="center", fontsize=8)
    legend(axes)
