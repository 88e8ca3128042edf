"""Filter over the lattice: prediction errors and their derivatives, and what the smoother needs of them.

The state's covariance holds what is random (ship, kicks); whatever is a constant (gravity, damping, zeros, the start of
the free swing) is a column beside it: the prediction's derivative, taken through the same gain. One sweep then gives
the normal matrix of all constants, whose priors can be chosen afterwards (de Jong 1991). With even sampling the gain
settles and is kept; a gap lets it move again.

What runs at each node makes no views of arrays and calls no kernel that takes arrays, `sweep` itself apart: Numba would
count references there, which costs more than the arithmetic.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import Flow
from pipeline.joint.kinds import GAIN, START, ZERO
from pipeline.joint.passes import Columns, Kept, Pass, Readings, Slots
from pipeline.joint.remainder import (
    collocate,
    derive_errors,
    differentiate,
    ends_of,
    force_columns,
    join_ends,
    jolt,
    reach,
    tilt,
)
from pipeline.joint.updating import (
    add_noise,
    change_of,
    clear,
    copy,
    factorise,
    lift,
    pick,
    pull_aside,
    recognise,
    row_of,
    set_aside,
    square_up,
    substitute,
)
from synth.kernels.compiled import kernel

ANYWHERE = 0.1  # rad
ROWS = 256  # prediction errors that are multiplied out at once
CHUNK = 64  # nodes whose places on a given path are found at once
UNEVEN = 8  # nodes after which the covariance is made symmetric again
SETTLED = 2e-6  # relative change of a gain from node to node below which it is kept


@kernel
def loosen(flow: Flow, i: int, covariance: Floats) -> None:
    """Let pendulum i be anywhere within its swing."""
    covariance[2 * i, 2 * i] += ANYWHERE**2
    covariance[2 * i + 1, 2 * i + 1] += flow.kappa[i] * ANYWHERE**2


@kernel
def follow(
    about: Floats, k: int, end: int, to_nodes: Floats, onward: Floats, ends: Floats, along: Floats, away: Floats
) -> None:
    """What a path is at the nodes of the steps from node k on, and at their ends beside the flow; see `join_ends`."""
    count = min(along.shape[0], end - k)
    last = min(count, about.shape[0] - k - 1)
    path = about[k : k + along.shape[0] + 1].astype(np.float64)
    np.dot(path[:count], to_nodes, along[:count])
    away[:last] = np.dot(path[1 : last + 1], ends) - np.dot(path[:last], onward)


@kernel
def lay_known(known: Floats, k: int, nodes: Floats) -> None:
    """Add the vertical acceleration that is known."""
    if known.shape[0] > 0:
        for m in range(3):
            nodes[nodes.size - 3 + m] += known[k, m]


@kernel
def lay_by(columns: Columns, of_traces: np.ndarray, trace: int, seen: Floats, j: int, buffer: Floats, row: int) -> None:
    """Lay a whitened error and its derivatives into the buffer.

    The scale of a trace moves a reading by itself, which tells nothing beside an unknown motion of the ship: that is
    taken off, and what was known before it stays.
    """
    last = seen.shape[1] - 1
    for c in range(last + 1):
        buffer[row, c] = seen[j, c]
    for n in range(of_traces.size):
        c = of_traces[n]
        if columns.kind[c] == GAIN and (columns.member[c] == trace or columns.member[c] < 0):
            buffer[row, c] += seen[j, last]


@kernel
def sum_up(buffer: Floats, rows: int, normal: Floats) -> None:
    """Add the products of whitened errors and derivatives."""
    normal[:] += np.dot(buffer[:rows].T, buffer[:rows])


@kernel
def keep_step(keep: Kept, s: int, ahead: Floats, push: Floats) -> None:
    """Keep what a step makes of the pendulums."""
    if s < keep.swing.shape[0]:
        for r in range(push.shape[1]):
            for q in range(ahead.shape[1]):
                keep.swing[s, r, q] = ahead[r, q]
    for n in range(push.shape[0]):
        for r in range(push.shape[1]):
            keep.push[s, n, r] = push[n, r]


@kernel
def keep_errors(keep: Kept, start: int, slots: Slots, used: int, seen: Floats) -> None:
    """Keep the whitened errors of a node's readings."""
    for j in range(used):
        for c in range(seen.shape[1]):
            keep.errors[slots.reading[j] - start, c] = -seen[j, c]


@kernel
def keep_gain(keep: Kept, begin: int, slots: Slots, used: int, root: Floats, gain: Floats) -> None:
    """Keep the whitened rows of a node's readings, and their gains, from row `begin` on."""
    for j in range(used):
        for r in range(gain.shape[1]):
            total = slots.row[j, r]
            for q in range(j):
                total -= root[j, q] * keep.row[begin + q, r]
            keep.row[begin + j, r] = total / root[j, j]
            keep.gain[begin + j, r] = gain[j, r]


@kernel
def sweep(
    flow: Flow,
    readings: Readings,
    columns: Columns,
    known: Floats,
    recorded: Floats,
    slope: Floats,
    about: Floats,
    breaks: np.ndarray,
    begin: int,
    end: int,
    gate: float,
    of: Pass,
    keep: Kept,
) -> bool:
    """Filter nodes `begin` to `end`, with derivatives by all constants; whether every covariance stayed positive.

    Derivatives and state stand side by side, (d, c + 1), and go through the same products, as `seen` of the readings
    does: what is predicted of them less what was read. The covariance is left alone once the gain has settled.

    Parameters
    ----------
    known, recorded, slope : (k, 3) arrays
        At the nodes of each step: Z that acts beside the states; recorded heave; its derivative with time. Each may be
        empty where nothing asks for it.
    about : (k, d) array
        Path about which the flow is linearised; empty: the prediction itself.
    breaks : (b, 2) array of int
        Nodes, in order, at which a pendulum is where nothing before tells, and that pendulum.
    gate : float
        Readings whose error is larger than so many deviations are left out; 0: none.
    """
    count, size = flow.kappa.size, of.state.shape[0]
    two, constants, between = 2 * count, of.state.shape[1] - 1, 6 * count + 6
    most = 4
    for k in range(begin, end):
        most = max(most, readings.first[k + 1] - readings.first[k] + 3)
    covariance, updated, moved = of.covariance.copy(), np.empty((size, size)), np.empty((size, size))
    state, state_updated, now = of.state.copy(), np.empty((size, constants + 1)), np.empty((1, size))
    ahead, to_nodes = flow.rows[between:].copy(), np.ascontiguousarray(flow.rows[:between].T)
    ahead_columns, ends = np.ascontiguousarray(ahead.T), ends_of(flow)
    along, away, onward = np.empty((CHUNK, between)), np.empty((CHUNK, 4 + two)), np.dot(ahead_columns, ends)
    nodes, extra, rest, by = np.zeros(between), np.zeros(two), np.zeros((count, 3, 4)), np.zeros((3, 4))
    slots = Slots(
        np.zeros(most, dtype=np.int64), np.full(most, -1), np.zeros(most), np.zeros(most), np.zeros((most, size)),
        np.zeros((most, 3)),
    )  # fmt: skip
    square, root = np.zeros((most, most)), np.zeros((most, most))
    seen, gain, old_gain = np.zeros((most, constants + 1)), np.zeros((most, size)), np.zeros((most, size))
    buffer, rows = np.zeros((ROWS, constants + 1)), 0
    forced = np.flatnonzero((columns.kind > START) & (columns.kind < ZERO))
    of_traces = np.flatnonzero(columns.kind >= ZERO)
    push = np.zeros((forced.size + 2, two))
    plain = not flow.sine and not np.any(flow.quadratic) and not np.any(flow.dry) and known.shape[0] == 0
    keeping, kept, end_kept = keep.swing.shape[0] > 0, 0, 0
    given = about.shape[0] > 0
    joined = flow.sine and given
    asked = not plain or forced.size > 0 or flow.heave_noise > 0.0
    moving, before, product, at_break = True, -1, 1.0, 0
    for k in range(begin, end):
        while at_break < breaks.shape[0] and breaks[at_break, 0] <= k:
            if breaks[at_break, 0] == k:
                loosen(flow, breaks[at_break, 1], covariance)
                moving = True
            at_break += 1
        used = pick(readings, k, slots, of)
        alike = recognise(readings, slots, used) and used == before
        if not alike:
            for j in range(used):
                row_of(flow, readings, slots.reading[j], slots, j)
        before, moving = used, moving or not alike
        if asked:
            if not given:
                for q in range(size):
                    now[0, q] = state[q, constants]
                reach(to_nodes, now, nodes)
            else:
                at = (k - begin) % CHUNK
                if at == 0:
                    follow(about, k, end, to_nodes, onward, ends, along, away)
                for m in range(between):
                    nodes[m] = along[at, m]
            lay_known(known, k, nodes)
        np.dot(slots.row[:used], state, seen[:used])
        if not plain:
            for i in range(count):
                collocate(flow, i, nodes, rest)
            pull_aside(slots, used, readings, rest, seen)
        for j in range(used):
            if of_traces.size > 0:
                which = slots.reading[j]
                derive_errors(readings, columns, of_traces, which, k * flow.step + slots.offset[j], state, seen, j)
            seen[j, constants] -= readings.value[slots.reading[j]]
        if moving:
            np.dot(slots.row[:used], covariance, gain[:used])
            square_up(slots, used, gain, square)
        over = False
        for j in range(used):
            deviation = np.sqrt(square[j, j])
            of.errors[slots.reading[j]] = -seen[j, constants] / deviation
            over = over or (gate > 0.0 and abs(seen[j, constants]) > gate * deviation)
        if over:
            if not moving:  # a reading over the gate lets the gain move
                moving = True
                np.dot(slots.row[:used], covariance, gain[:used])
            used, alike, before = set_aside(slots, used, gate, of, seen, gain), False, -1
            square_up(slots, used, gain, square)
        change = 1.0
        if used > 0:
            if moving:
                if not factorise(square, used, root):
                    return False
                substitute(root, used, gain)
                clear(gain, used)
                lift(covariance, gain, gain, used, updated)
                if not flow.varying:
                    change = change_of(gain, used, old_gain, covariance)
            substitute(root, used, seen)
            clear(seen, used)
            lift(state, gain, seen, used, state_updated)
            for j in range(used):
                product *= root[j, j]
                of.whitened[slots.reading[j]], of.scale[slots.reading[j]] = -seen[j, constants], root[j, j]
                lay_by(columns, of_traces, slots.trace[j], seen, j, buffer, rows)
                rows += 1
                if rows == ROWS:
                    sum_up(buffer, rows, of.normal)
                    rows = 0
            if not 1e-100 < product < 1e100:
                of.totals[0] += np.log(product)
                product = 1.0
            of.totals[1] += used
            if keep.errors.shape[0] > 0:
                keep_errors(keep, readings.first[begin], slots, used, seen)
            if keeping:
                if moving:
                    kept, end_kept = end_kept, end_kept + used
                    keep_gain(keep, kept, slots, used, root, gain)
                keep.first[k - begin] = kept
        else:
            if moving:
                copy(covariance, updated)
            copy(state, state_updated)
        if k + 1 == readings.first.size - 1:
            if moving:
                copy(updated, covariance)
            copy(state_updated, state)
            break
        # to the next node
        settling = moving and alike and not flow.varying and change < SETTLED and used > 0
        if asked and not given:
            for q in range(size):
                now[0, q] = state_updated[q, constants]
            reach(to_nodes, now, nodes)
            lay_known(known, k, nodes)
            if not plain:
                for i in range(count):
                    collocate(flow, i, nodes, rest)
        if joined:
            join_ends(flow, away, (k - begin) % CHUNK, nodes, rest)
        if not plain:
            for i in range(count):
                differentiate(flow, i, known, k, nodes, rest, by, extra)
                tilt(flow, i, by, ahead, ahead_columns)
        for r in range(two if plain else 0):
            extra[r] = 0.0  # a knock of the step before
        np.dot(ahead, state_updated, state)
        if moving:
            np.dot(ahead, updated, moved)
            np.dot(moved, ahead_columns, updated)
            add_noise(updated, flow.noise, k % UNEVEN == 0, covariance)
        if forced.size > 0:
            force_columns(flow, columns, forced, nodes, recorded, slope, k, push, extra)
        if flow.heave_noise > 0.0:
            jolt(flow, nodes, push)
        for r in range(two):
            push[forced.size, r] = extra[r]  # what is left of the sine law
            state[r, constants] += extra[r]
            for n in range(forced.size):
                state[r, forced[n]] += push[n, r]
            if moving and flow.heave_noise > 0.0:
                for q in range(two):
                    covariance[r, q] += push[forced.size + 1, r] * push[forced.size + 1, q]
        if keeping:
            keep_step(keep, k - begin, ahead, push)
        moving = moving and not settling
    sum_up(buffer, rows, of.normal)
    of.totals[0] += np.log(product)
    of.state[:], of.covariance[:] = state, covariance
    return True
