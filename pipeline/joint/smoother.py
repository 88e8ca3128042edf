"""The smoothed path, backwards by adjoints over what the filter kept."""

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.filtering import ANYWHERE
from pipeline.joint.flow import Flow
from pipeline.joint.passes import Kept, Readings, Task
from synth.kernels.compiled import kernel, summing_kernel


def smooth(
    task: Task, begin: int, end: int, pushed: Floats, state: Floats, covariance: Floats, whitened: Floats, keep: Kept,
    adjoint: Floats, path: Floats,
) -> None:  # fmt: skip
    """Smoothed states of a stretch, into `path`, (s, d): adjoints backwards, then states forward by what drives them
    (Koopman 1993). `pushed`, (f + 1,): change of the constants that move the pendulums since the sweep, last 1;
    `state`, (d,), changed, and `covariance`, predicted for the first node, and errors `whitened`, (r,), at the changed
    constants; `adjoint`, (d,), of the predicted state behind the stretch, of its first node on return."""
    two, ahead, room = keep.swing.shape[1], task.flow.ahead, np.zeros((2, adjoint.size))
    look_back(task, begin, end, whitened, keep, adjoint, room, path)
    driven, onward = path[: end - begin] @ task.flow.noise, np.zeros((adjoint.size - two, adjoint.size))
    onward[:, two:] = ahead[two:, two:].T
    state += covariance @ adjoint
    go_on(task, begin, end, pushed, keep, onward, driven, state, room, path)


@kernel
def look_back(
    task: Task, begin: int, end: int, whitened: Floats, keep: Kept, adjoint: Floats, room: Floats, path: Floats
) -> None:
    """Adjoints of a stretch into `path`; `room`: (2, d)."""
    readings, ahead = task.readings, task.flow.ahead[keep.swing.shape[1] :]
    for k in range(end - 1, begin - 1, -1):
        if k + 2 < readings.first.size:
            step_back(keep, k - begin, ahead, adjoint, room[0])
        gather_readings(readings, k, begin, whitened, keep, adjoint, room[0])
        for q in range(adjoint.size):
            path[k - begin, q] = adjoint[q]


@kernel
def go_on(
    task: Task, begin: int, end: int, pushed: Floats, keep: Kept, onward: Floats, driven: Floats, state: Floats,
    room: Floats, path: Floats,
) -> None:  # fmt: skip
    """States of a stretch in place of their adjoints, by what these make of the noise."""
    flow, breaks, at_break = task.flow, task.breaks, 0
    for k in range(begin, end):
        while at_break < breaks.shape[0] and breaks[at_break, 0] <= k:
            if breaks[at_break, 0] == k:
                i = breaks[at_break, 1]
                state[2 * i] += ANYWHERE**2 * path[k - begin, 2 * i]
                state[2 * i + 1] += flow.kappa[i] * ANYWHERE**2 * path[k - begin, 2 * i + 1]
            at_break += 1
        for q in range(state.size):
            path[k - begin, q] = state[q]
        if k + 1 < end:
            step_on(flow, keep, k - begin, onward, driven, pushed, path, state, room[0], room[1])


@summing_kernel
def step_back(keep: Kept, s: int, ahead: Floats, adjoint: Floats, later: Floats) -> None:
    """The adjoint of a node from that of the next one, (d,); the ship's part of the step is `ahead`."""
    two, size = keep.swing.shape[1], adjoint.size
    for q in range(size):
        later[q], adjoint[q] = adjoint[q], 0.0
    for r in range(two):
        for q in range(size):
            adjoint[q] += later[r] * keep.swing[min(s, keep.swing.shape[0] - 1), r, q]
    add_rows(ahead, later, two, adjoint)


@summing_kernel
def step_on(
    flow: Flow, keep: Kept, s: int, onward: Floats, driven: Floats, pushed: Floats, path: Floats, state: Floats,
    before: Floats, felt: Floats,
) -> None:  # fmt: skip
    """The smoothed state of the node after s, (d,), and what drives it, by the next adjoint, still in `path`."""
    two, size = keep.swing.shape[1], state.size
    for q in range(size):
        before[q], state[q] = state[q], driven[s + 1, q]
    first = pushed.size
    if flow.heaves:
        for a in range(2):
            felt[a] = 0.0
            for q in range(two):
                felt[a] += keep.push[s, first + a, q] * path[s + 1, q]
        for a in range(2):
            for q in range(size):
                state[q] += felt[a] * flow.driven[a, q]
        for a in range(2):
            felt[a] = 0.0
            for q in range(two, size):
                felt[a] += flow.vertical[a, q] * state[q]
        for a in range(2):
            for r in range(two):
                state[r] += keep.push[s, first + a, r] * felt[a]
        first += 2
    for r in range(two):
        total = 0.0
        for q in range(size):
            total += keep.swing[min(s, keep.swing.shape[0] - 1), r, q] * before[q]
        for n in range(pushed.size):
            total += pushed[n] * keep.push[s, n, r]
        state[r] += total
    for n in range(first, keep.push.shape[1]):
        impulse = 0.0
        for q in range(two):
            impulse += keep.push[s, n, q] * path[s + 1, q]
        for r in range(two):
            state[r] += impulse * keep.push[s, n, r]
    add_rows(onward, before, two, state)


@summing_kernel
def add_rows(rows: Floats, factors: Floats, begin: int, to: Floats) -> None:
    """Add rows times factors, these from place `begin` on, to a vector; four at a time."""
    whole = rows.shape[0] - rows.shape[0] % 4
    for r in range(0, whole, 4):
        at = begin + r
        a, b, c, d = factors[at], factors[at + 1], factors[at + 2], factors[at + 3]
        for q in range(to.size):
            to[q] += a * rows[r, q] + b * rows[r + 1, q] + c * rows[r + 2, q] + d * rows[r + 3, q]
    for r in range(whole, rows.shape[0]):
        for q in range(to.size):
            to[q] += factors[begin + r] * rows[r, q]


@summing_kernel
def gather_readings(
    readings: Readings, k: int, begin: int, whitened: Floats, keep: Kept, adjoint: Floats, change: Floats
) -> None:
    """Add to the adjoint what the readings of node k say; kept from node `begin` on."""
    size, j = adjoint.size, keep.first[k - begin]
    for q in range(size):
        change[q] = 0.0
    for which in range(readings.first[k], readings.first[k + 1]):
        if np.isfinite(whitened[which]):
            rest = whitened[which]
            for q in range(size):
                rest -= keep.gain[j, q] * adjoint[q]
            for q in range(size):
                change[q] += keep.row[j, q] * rest
            j += 1
    for q in range(size):
        adjoint[q] += change[q]
