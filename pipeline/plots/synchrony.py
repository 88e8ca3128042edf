"""Clocks on one support: phase differences, amplitudes, and how steady each clock is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.plots.canvas import GREY, PALETTE, legend, note, panel, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset, DataTree

_MARKS = {0.0: "in phase", 0.25: "quadrature", 0.5: "antiphase", 0.75: "quadrature"}
_LEAST_REACH = 0.3  # turns either side: so that a named angle is always in sight


def synchrony_figure(result: DataTree) -> Figure:
    """Draw a result with the group `synchrony`: phase differences in turns, verdicts, amplitudes, Allan deviations."""
    table = result["synchrony"].dataset
    time = np.asarray(result.dataset["time"].values, dtype=np.float64)
    pairs = zip(*(table[name].values for name in ("pair", "verdict", "confidence")), strict=True)
    told = [f"{pair} {verdict} ({100.0 * float(sure):.1f} %)" for pair, verdict, sure in pairs]
    name = result.attrs.get("record_id", "without a name")
    figure = sheet("Clocks that share a support", f"record {name} · {', '.join(told)}", 11.0, 7.6)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.3, 1))
    _differences(panel(figure, grid[0, :], "Phase of one less the other", "time, s", "turns"), time, table)
    sizes = panel(figure, grid[1, 0], "Amplitudes", "time, s", "rad")
    steady = panel(figure, grid[1, 1], "How steady each clock is", "averaging time, s", "Allan deviation of the rate")
    for k, label in enumerate(str(each) for each in table["clock"].values):
        sizes.plot(time, table["amplitude"].values[k], color=PALETTE[k % len(PALETTE)], label=f"clock {label}")
        if "allan_deviation" in table:
            taus = table["averaging_time"].values
            steady.loglog(taus, table["allan_deviation"].values[k], "o-", markersize=3, color=PALETTE[k % len(PALETTE)])
    legend(sizes)
    if "allan_deviation" not in table:
        note(steady, table.attrs.get("allan_deviation_absent") or "too short")
    return figure


def _differences(axes: Axes, time: np.ndarray, table: Dataset) -> None:
    turns = table["phase_difference"].values / (2.0 * np.pi)
    for k, pair in enumerate(str(each) for each in table["pair"].values):
        color = PALETTE[k % len(PALETTE)]
        shown = turns[k] - np.floor(np.nanmin(turns[k]))
        axes.plot(time, shown, color=color, label=pair)
        since = float(table["lock_time"].values[k])
        if np.isfinite(since):
            axes.axvline(since, color=color, linestyle=":", linewidth=1.0)
    low, high = axes.get_ylim()
    middle, reach = 0.5 * (low + high), max(0.5 * (high - low), _LEAST_REACH)
    low, high = middle - reach, middle + reach
    axes.set_ylim(low, high)
    if high - low < 4.0:
        for whole in range(int(np.floor(low)), int(np.ceil(high)) + 1):
            for part, word in _MARKS.items():
                if low <= whole + part <= high:
                    axes.axhline(whole + part, color=GREY, linewidth=0.6, linestyle="--")
                    place = (1.005, whole + part)
                    axes.annotate(word, place, xycoords=("axes fraction", "data"), va="center", fontsize=8)
    legend(axes)
