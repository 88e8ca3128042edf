"""Offsets between the traces and shear of the image, to a hundredth of a pixel, from all marks."""

from __future__ import annotations

import numpy as np

from pipeline.film.marks.drive import Drive
from pipeline.film.parts import Floats

ENOUGH = 24  # marks seen on several traces


def refined(rows: Floats, sigma: Floats, columns: Floats, found: Drive) -> tuple[Floats, float]:
    """Offsets of the traces, the first one's 0, and shear, by least squares.

    Of marks that several traces show, the row is free, so that nothing of theirs is taken for the paper's motion. If
    there are too few of those, rows are held to the motion found: a trace now left and now right of its middle tells
    the shear.

    Parameters
    ----------
    rows, sigma, columns : (traces, marks) arrays
        Of the gaps, px; NaN = missing.
    found : Drive
        The paper's motion and the gaps that were believed.
    """
    traces = len(rows)
    used = found.used & np.isfinite(rows) & np.isfinite(columns)
    weight = np.where(used, 1.0 / (sigma**2 + found.floor**2), 0.0)
    terms = np.zeros((traces + 2, traces, rows.shape[1]))  # offsets, shear, what is left
    for trace in range(traces):
        terms[trace, trace] = 1.0
    terms[traces] = np.where(used, columns, 0.0)
    terms[traces + 1] = np.where(used, rows - found.row, 0.0)
    several = used.sum(axis=0) > 1
    if several.sum() >= ENOUGH:
        weight[:, ~several] = 0.0
    total = np.maximum(weight.sum(axis=0), 1e-300)
    mean = np.einsum("km,pkm->pm", weight, terms) / total
    terms[:, :, several] -= mean[:, None, several]
    normal = np.einsum("km,pkm,qkm->pq", weight, terms, terms)
    free = [*range(1, traces), traces] if traces > 1 else [0, 1]  # of one trace, what lies even is the paper's
    size = normal[np.ix_(free, free)] + 1e-9 * np.diag(np.diag(normal)[free]) + 1e-12 * np.eye(len(free))
    value = np.linalg.solve(size, normal[free, traces + 1])
    offset = np.zeros(traces)
    if traces > 1:
        offset[1:] = value[:-1]
    return offset, float(value[-1])
