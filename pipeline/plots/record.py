"""A record as it was read: every trace whole, and twenty seconds of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.plots.canvas import PALETTE, note, panel, sheet
from pipeline.plots.series import Floats, angle_scale, draw_band, over_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataTree

_ZOOM = 20.0  # s
_MOST_TRACES = 8


def record_figure(record: DataTree) -> Figure:
    """Draw each trace of a valid record in a row: the whole at the left, twenty seconds at the right."""
    time = np.asarray(record.dataset["time"].values, dtype=np.float64)
    time = time - time[0]
    traces = record["record"].dataset["elongation"]
    labels = [str(label) for label in record["record"].dataset["trace"].values][:_MOST_TRACES]
    values = np.asarray(traces.values, dtype=np.float64)[: len(labels)]
    figure = sheet("Elongations of the record", _subtitle(record, time, traces.values), 11.0, 0.9 + 2.3 * len(labels))
    grid = figure.add_gridspec(len(labels), 2, width_ratios=(2.4, 1))
    for row, label in enumerate(labels):
        color = PALETTE[row % len(PALETTE)]
        draw_whole(panel(figure, grid[row, 0], f"trace {label}"), time, values[row], color)
        _draw_zoom(panel(figure, grid[row, 1], f"{_ZOOM:g} s of it"), time, values[row], color)
    return figure


def draw_whole(axes: Axes, time: Floats, values: Floats, color: str) -> None:
    """Draw one trace from end to end, with its missing stretches open and both labels."""
    angle, unit = angle_scale(float(np.nanmax(np.abs(values), initial=0.0)))
    draw_band(axes, over_time(axes, time, f"elongation, {unit}"), values * angle, color=color, label="")


def _draw_zoom(axes: Axes, time: Floats, values: Floats, color: str) -> None:
    start = max(0.0, 0.5 * time[-1] - 0.5 * _ZOOM)
    shown = (time >= start) & (time <= start + _ZOOM)
    angle, unit = angle_scale(float(np.nanmax(np.abs(values), initial=0.0)))
    axes.set_xlabel(f"seconds after {start:.0f} s")
    axes.set_ylabel(f"elongation, {unit}")
    if not np.isfinite(values[shown]).any():
        note(axes, "no reading here")
        return
    # With few readings a line between them would suggest a motion that was not seen.
    dense = shown.sum() > 8 * _ZOOM
    line, marker, size = ("-", "", 0) if dense else ("", "o", 2.5)
    axes.plot(time[shown] - start, values[shown] * angle, line + marker, markersize=size, color=color)
    axes.set_xlim(0.0, min(_ZOOM, float(time[-1])))


def _subtitle(record: DataTree, time: Floats, elongation: Floats) -> str:
    missing = 100.0 * float(np.isnan(elongation).mean())
    step = float(np.median(np.diff(time)))
    return (
        f"record {record.attrs.get('record_id', 'without a name')} · {time.size} samples, {step:.4g} s apart"
        f" · {missing:.2g} % missing"
    )
