"""How long the shutter closes, in rows: learned from the film before its gaps are looked for."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.marks.pieces import exposed
from pipeline.film.marks.search import relative_light, steps_a_row
from pipeline.film.parts import Emulsion, Floats, Scan, Tracks

DIM = 0.5  # of the line's light, at the ends of a gap
STEEP = 2.0  # slope from which the spot does not lengthen a gap along the rows
BLACK, BRIGHT = 0.25, 0.75  # of the line's light, within and beside a gap from which the width is learned
SHORTEST, LONGEST = 0.004, 0.15  # of a swing, how long the shutter may close
SAMPLE = 8  # pieces in which the width is learned
LEAST_RUNS = 12


def learned_width(scan: Scan, emulsion: Emulsion, tracks: Tracks) -> float:
    """Rows for which the shutter closes, by the dark runs on steep strokes of some pieces of the film.

    Raises
    ------
    RefusedError
        Too few of them.
    """
    steps = steps_a_row(tracks, tracks.spot)
    length = min(scan.rows, 640)
    runs: list[float] = []
    for begin in np.unique(np.linspace(0, scan.rows - length, SAMPLE).astype(int)):
        exposure = exposed(scan, emulsion, int(begin), int(begin) + length)
        for trace in range(tracks.course.shape[0]):
            light, _ = relative_light(exposure, int(begin), int(begin), int(begin) + length, tracks, trace, 1.0, steps)
            rows = int(begin) + (np.arange(light.size) + 0.5) / steps
            lean = np.abs(tracks.slope[trace][np.minimum(rows.astype(int), scan.rows - 1)])
            runs.extend(_dark_runs(light, lean) / steps)
    inside = np.sort([run for run in runs if SHORTEST < run / tracks.rows_per_swing < LONGEST])
    if inside.size < LEAST_RUNS:
        raise RefusedError(
            f"film: {inside.size} gaps in the traces, too few to tell how long the shutter closed; "
            "state the gap and the rows per second, or check that the film bears time marks"
        )
    within = np.searchsorted(inside, 1.25 * inside) - np.arange(inside.size)
    start = int(np.argmax(within))
    return float(np.median(inside[start : start + within[start]]))


def _dark_runs(light: Floats, lean: Floats) -> Floats:
    """Lengths, in samples, of whole runs of darkness on steep strokes; ends interpolated."""
    dark = light < DIM
    edge = np.flatnonzero(dark[1:] != dark[:-1])
    if edge.size < 2:
        return np.empty(0)
    ahead, behind = light[edge], light[edge + 1]
    cross = edge + (DIM - ahead) / (behind - ahead)
    lengths = []
    for which in np.flatnonzero(dark[edge + 1])[:-1]:
        low, high = edge[which] + 1, edge[which + 1] + 1
        beside = np.concatenate([light[max(low - (high - low), 0) : low], light[high : 2 * high - low]])
        if lean[low:high].min() > STEEP and light[low:high].mean() < BLACK and beside.mean() > BRIGHT:
            lengths.append(cross[which + 1] - cross[which])
    return np.array(lengths)
