"""The picture of the demo: what was read, how the amplitudes went, and what the correction does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.plots.canvas import PALETTE, panel, sheet
from pipeline.plots.record import draw_whole
from pipeline.plots.result import draw_amplitudes, draw_gravity, draw_phase_speed, subtitle

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import DataTree


def demo_figure(record: DataTree, result: DataTree, true_gravity: float) -> Figure:
    """Draw a record and its result on one sheet.

    Parameters
    ----------
    record, result : DataTree
        As `pipeline.process` took and gave them.
    true_gravity : float
        m s-2; the methods' errors are counted from it.
    """
    time = np.asarray(record.dataset["time"].values, dtype=np.float64)
    time = time - time[0]
    labels = [str(label) for label in record["record"].dataset["trace"].values][:2]
    figure = sheet("From a ship's record to gravity", subtitle(result), 12.0, 10.0)
    grid = figure.add_gridspec(3, 2)
    for column, label in enumerate(labels):
        kind = "the difference" if "-" in label else "a single pendulum"
        axes = panel(figure, grid[0, column], f"Recorded: {kind}, trace {label}", "", "")
        draw_whole(axes, time, np.asarray(record["record"].dataset["elongation"].values[column]), PALETTE[2 * column])
    draw_amplitudes(panel(figure, grid[1, 0], "Amplitude of each harmonic", "", ""), result)
    draw_gravity(panel(figure, grid[1, 1], "Error of each method", "", ""), result, true_gravity)
    draw_phase_speed(panel(figure, grid[2, :], "Phase speed of the difference pendulum", "", ""), result)
    return figure
