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
from pipeline.joint.flow import POINTS, Flow
from pipeline.joint.forcing import derive_errors, remain
from pipeline.joint.kinds import CUBIC, GAIN, START, ZERO
from pipeline.joint.passes import Columns, Kept, Pass, Readings, Slots
from pipeline.joint.remainder import Steps, collocate, ends_of, lay_known, reach, room_for, sources
from pipeline.joint.updating import (
    add,
    add_drive,
    add_noise,
    change_of,
    clear,
    copy,
    factorise,
    lay_heave,
    lift,
    pick,
    pull_aside,
    recognise,
    row_of,
    set_aside,
    square_up,
    substitute,
    take_off,
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
def follow(about: Floats, k: int, rows: Floats, ends: Floats, onward: Floats, path: Floats, steps: Steps) -> None:
    """What a path is at the nodes of the steps from node k on, and at their ends beside the flow; see `join_ends`."""
    for s in range(min(path.shape[0], about.shape[0] - k)):
        for q in range(path.shape[1]):
            path[s, q] = about[k + s, q]
    np.dot(rows, path[:-1].T, steps.nodes)
    np.dot(ends, path[1:].T, steps.away)
    take_off(np.dot(onward, path[:-1].T), steps.away)


@kernel
def turn(flow: Flow, swing: Floats, s: int, ahead: Floats, ahead_columns: Floats) -> None:
    """Turn the rows of the pendulums in a step's derivative, and their transpose; see `Steps.swing`."""
    n, end = swing.shape[1] // 2, flow.rows.shape[0] - ahead.shape[0]
    for i in range(swing.shape[0]):
        for r in range(2):
            at = 2 * i + r
            for q in range(ahead.shape[0]):
                ahead[at, q] = ahead_columns[q, at] = flow.rows[end + at, q] + swing[i, r * n + s, q]


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
    add(np.dot(buffer[:rows].T, buffer[:rows]), normal)


@kernel
def keep_step(keep: Kept, s: int, ahead: Floats, push: Floats, at: int) -> None:
    """Keep what a step makes of the pendulums; it is the one `at` its place in `push`."""
    if s < keep.swing.shape[0]:
        for r in range(push.shape[1]):
            for q in range(ahead.shape[1]):
                keep.swing[s, r, q] = ahead[r, q]
    for n in range(push.shape[0]):
        for r in range(push.shape[1]):
            keep.push[s, n, r] = push[n, r, at]


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
def kinds_between(columns: Columns, least: int, end: int) -> np.ndarray:
    """Which constants are of a kind from `least` up to `end`."""
    count, chosen = 0, np.empty(columns.kind.size, dtype=np.int64)
    for c in range(columns.kind.size):
        if least <= columns.kind[c] < end:
            chosen[count] = c
            count += 1
    return chosen[:count]


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
    known, recorded, slope : (k, 4) arrays
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
    two, constants, between = 2 * count, of.state.shape[1] - 1, flow.rows.shape[0] - size
    most = 4
    for k in range(begin, end):
        most = max(most, readings.first[k + 1] - readings.first[k] + 3)
    covariance, updated, moved = of.covariance.copy(), np.empty((size, size)), np.empty((size, size))
    state, state_updated = of.state.copy(), np.empty((size, constants + 1))
    ahead, to_nodes = flow.rows[between:].copy(), flow.rows[:between].copy()
    ends, rows_left = ends_of(flow), sources(flow)
    ahead_columns, onward = np.ascontiguousarray(ahead.T), np.dot(ends, ahead)  # transposed in place, products are slow
    slots = Slots(
        np.zeros(most, dtype=np.int64), np.full(most, -1), np.zeros(most), np.zeros(most), np.zeros((most, size)),
        np.zeros((most, size)), np.zeros((most, size)), np.zeros((most, size)), np.zeros(most),
        np.zeros((most, 2, POINTS)),
    )  # fmt: skip
    square, root = np.zeros((most, most)), np.zeros((most, most))
    seen, gain, old_gain = np.zeros((most, constants + 1)), np.zeros((most, size)), np.zeros((most, size))
    buffer, rows = np.zeros((ROWS, constants + 1)), 0
    forced, of_traces = kinds_between(columns, START + 1, ZERO), kinds_between(columns, ZERO, CUBIC + 1)
    plain = not flow.sine and known.shape[0] == 0
    for i in range(count):
        plain = plain and flow.quadratic[i] == 0.0 and flow.dry[i] == 0.0
    keeping, kept, end_kept = keep.swing.shape[0] > 0, 0, 0
    given = about.shape[0] > 0
    joined, at, chunk = flow.sine and given, 0, begin - CHUNK
    width = CHUNK if given else 1
    path = np.zeros((width + 1, size))
    steps = room_for(flow, forced.size, width)
    push, impulses = steps.push, forced.size + (3 if flow.heaves else 1)
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
        if given and asked:
            at = k - chunk
            if at == CHUNK:
                chunk = max(k - 1, 0)  # one step is at hand before the node
                at, some = k - chunk, min(CHUNK, end - chunk)
                follow(about, chunk, to_nodes, ends, onward, path, steps)
                remain(flow, columns, forced, known, recorded, slope, rows_left, plain, joined, chunk, some, steps)
        elif not plain:
            reach(to_nodes, state, steps.nodes)
            lay_known(known, k, width, steps.nodes)
            collocate(flow, plain, width, steps)
        if joined and flow.heaves:
            lay_heave(flow, readings, slots, used, steps, path, at)
        np.dot(slots.row[:used], state, seen[:used])
        if not plain:
            pull_aside(slots, used, readings, steps.rest, at, seen)
        for j in range(used):
            if of_traces.size > 0:
                which = slots.reading[j]
                derive_errors(readings, columns, of_traces, which, k * flow.step, slots, state, seen, j)
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
            reach(to_nodes, state_updated, steps.nodes)
            remain(flow, columns, forced, known, recorded, slope, rows_left, plain, joined, k, width, steps)
        if not plain:
            turn(flow, steps.swing, at, ahead, ahead_columns)
        np.dot(ahead, state_updated, state)
        if moving:
            np.dot(ahead, updated, moved)
            np.dot(moved, ahead_columns, updated)
            add_noise(updated, flow.noise, k % UNEVEN == 0, covariance)
            if flow.heaves:
                add_drive(flow, push, forced.size + 1, at, covariance)
        for r in range(two):
            state[r, constants] += push[forced.size, r, at]  # what is left of the sine law
            for n in range(forced.size):
                state[r, forced[n]] += push[n, r, at]
        for n in range(impulses, push.shape[0] if moving else 0):
            for r in range(two):
                for q in range(two):
                    covariance[r, q] += push[n, r, at] * push[n, q, at]
        if keeping:
            keep_step(keep, k - begin, ahead, push, at)
        moving = moving and not settling
    sum_up(buffer, rows, of.normal)
    of.totals[0] += np.log(product)
    copy(state, of.state)
    copy(covariance, of.covariance)
    return True
