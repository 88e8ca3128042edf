"""The smoothed path, backwards by adjoints over what the filter kept."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.filtering import ANYWHERE
from pipeline.joint.flow import Flow
from pipeline.joint.passes import Kept, Readings
from synth.kernels.compiled import kernel, summing_kernel


@kernel
def smooth(
    flow: Flow,
    readings: Readings,
    breaks: np.ndarray,
    begin: int,
    end: int,
    pushed: Floats,
    state: Floats,
    covariance: Floats,
    whitened: Floats,
    keep: Kept,
    adjoint: Floats,
    path: Floats,
) -> None:
    """Smoothed states of a stretch: adjoints backwards, then the states forward by what drives them (Koopman 1993).

    Parameters
    ----------
    breaks : (b, 2) array of int
        As in `sweep`.
    pushed : (f + 1,) array
        Change of the constants that move the pendulums since the sweep; last: 1.
    state : (d,) array, changed
        Predicted for the stretch's first node at the changed constants.
    covariance : (d, d) array
        Of it.
    whitened : (r,) array
        Prediction errors at the changed constants.
    adjoint : (d,) array, changed
        Of the predicted state behind the stretch; of its first node on return.
    path : (k, d) array, out
        Smoothed states; rows `begin` to `end` are written.
    """
    two, size, start = keep.swing.shape[1], adjoint.size, readings.first[begin]
    ahead, later = flow.rows[flow.rows.shape[0] - size :], np.zeros(size)
    for k in range(end - 1, begin - 1, -1):
        s = k - begin
        if k + 2 < readings.first.size:
            for q in range(size):
                later[q], adjoint[q] = adjoint[q], 0.0
            for r in range(two):
                for q in range(size):
                    adjoint[q] += later[r] * keep.swing[s, r, q]
            for r in range(two, size):
                for q in range(two, size):
                    adjoint[q] += later[r] * ahead[r, q]
        gather_readings(readings, k, start, whitened, keep, adjoint, later)
        for q in range(size):
            path[k, q] = adjoint[q]
    at_break = 0
    for r in range(size):
        for q in range(size):
            state[r] += covariance[r, q] * adjoint[q]
    for k in range(begin, end):
        while at_break < breaks.shape[0] and breaks[at_break, 0] <= k:
            if breaks[at_break, 0] == k:
                i = breaks[at_break, 1]
                state[2 * i] += ANYWHERE**2 * path[k, 2 * i]
                state[2 * i + 1] += flow.kappa[i] * ANYWHERE**2 * path[k, 2 * i + 1]
            at_break += 1
        for q in range(size):
            path[k, q] = state[q]
        if k + 1 < end:
            step_on(flow, keep, k - begin, pushed, path, k, later)
            for q in range(size):
                state[q] = later[q]


@summing_kernel
def step_on(flow: Flow, keep: Kept, s: int, pushed: Floats, path: Floats, k: int, state: Floats) -> None:
    """The smoothed state of the next node, (d,), from that of node k and the next one's adjoint in `path`."""
    two, size, offset, last = keep.swing.shape[1], state.size, flow.rows.shape[0] - state.size, keep.push.shape[1] - 1
    impulse = 0.0
    for q in range(two):
        impulse += keep.push[s, last, q] * path[k + 1, q]
    for r in range(size):
        total = 0.0
        for q in range(size):
            total += flow.noise[r, q] * path[k + 1, q]
        if r < two:
            for q in range(size):
                total += keep.swing[s, r, q] * path[k, q]
            for n in range(pushed.size):
                total += pushed[n] * keep.push[s, n, r]
            total += impulse * keep.push[s, last, r]
        else:
            for q in range(two, size):
                total += flow.rows[offset + r, q] * path[k, q]
        state[r] = total


@summing_kernel
def gather_readings(
    readings: Readings, k: int, start: int, whitened: Floats, keep: Kept, adjoint: Floats, change: Floats
) -> None:
    """Add to the adjoint what the readings of node k say; kept from reading `start` on."""
    size = adjoint.size
    for q in range(size):
        change[q] = 0.0
    for which in range(readings.first[k], readings.first[k + 1]):
        if np.isfinite(whitened[which]):
            j = which - start
            rest = whitened[which]
            for q in range(size):
                rest -= keep.gain[j, q] * adjoint[q]
            for q in range(size):
                change[q] += keep.row[j, q] * rest
    for q in range(size):
        adjoint[q] += change[q]
