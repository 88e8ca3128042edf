"""Filter over the lattice: prediction errors and their derivatives, and what the smoother needs of them.

The state's covariance holds what is random (ship, kicks); whatever is a constant (gravity, damping, zeros, the start of
the free swing) is a column beside it: the prediction's derivative, taken through the same gain. One sweep then gives
the normal matrix of all constants, whose priors can be chosen afterwards (de Jong 1991). With even sampling the gain
settles and is kept; a gap lets it move again.
"""

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import remainder, updating
from pipeline.joint.flow import POINTS, Flow
from pipeline.joint.forcing import derive_errors, remain
from pipeline.joint.kinds import GAIN, READ_HEAVE_SCALE
from pipeline.joint.passes import Columns, Kept, Pass, Readings, Slots, Task
from pipeline.joint.remainder import Steps, collocate, lay_known, multiply, reach
from synth.kernels.compiled import kernel

ANYWHERE = 0.1  # rad
ROWS = 256  # prediction errors that are multiplied out at once
CHUNK = 64  # nodes whose places on a given path are found at once
UNEVEN = 8  # nodes after which the covariance is made symmetric again
FORGOTTEN = 1e-140  # of a derivative; products of such are no normal numbers
SETTLED = 2e-6  # relative change of a gain from node to node below which it is kept


class Room(NamedTuple):
    """What a sweep works in; d states, c constants, u readings a node at most and rounding up to fours."""

    ahead: Floats
    ahead_columns: Floats  # (d, d) derivative of the step, and its transpose: transposed in place, it is slow
    updated: Floats
    moved: Floats  # (d, d) the covariance with a node's readings; carried on by the step
    state: Floats  # (d, c + 1) as `Pass.state`, with a node's readings
    slots: Slots
    steps: Steps  # n of them
    root: Floats  # (u, u) of the readings' covariance
    seen: Floats  # (u, c + 1) readings as predicted less as read, with their derivatives
    gain: Floats
    old_gain: Floats  # (u, d)
    buffer: Floats  # (ROWS, c + 1) whitened errors with their derivatives
    square: Floats  # (c + 1, c + 1)
    path: Floats  # (n + 1, d) along the steps


def room_for(task: Task, begin: int, end: int, of: Pass) -> Room:
    """Room for a sweep."""
    size, width = of.state.shape
    slots = slots_for(task.readings, begin, end, size)
    u = slots.reading.size
    n, ahead = CHUNK if task.about.shape[0] else 1, task.flow.ahead
    shapes = ((u, u), (u, width), (u, size), (u, size), (ROWS, width), (width, width), (n + 1, size))
    return Room(
        ahead.copy(), np.ascontiguousarray(ahead.T), np.empty((size, size)), np.empty((size, size)),
        np.empty((size, width)), slots, remainder.room_for(task.flow, task.columns.forced.size, n),
        *map(np.zeros, shapes),
    )  # fmt: skip


def settled(task: Task, size: int, nodes: slice) -> Floats:
    """Covariance of the states, (d, d), before the readings of one of some nodes, after more of them whose readings are
    alike than there are: by doubling (Anderson & Moore 1979, eq. 6.7.14)."""
    begin, end, _ = nodes.indices(task.readings.first.size - 1)
    first, there = task.readings.first[begin:end], np.isfinite(task.readings.variance)
    node = begin + int(np.argmax(np.add.reduceat(there, np.minimum(first, there.size - 1), dtype=np.int64)))
    slots = slots_for(task.readings, node, node + 1, size)
    used, _ = updating.pick(task.readings, node, slots)
    for j in range(used):
        updating.row_of(task.flow, task.readings, slots.reading[j], slots, j)
    told = slots.row[:used].T / slots.variance[:used] @ slots.row[:used]
    ahead, covariance = task.flow.ahead.T, task.flow.noise
    for _ in range((end - begin).bit_length()):
        part = np.linalg.solve(np.eye(size) + told @ covariance, np.concatenate([ahead, told], axis=1))
        told = told + ahead @ part[:, size:] @ ahead.T
        more = ahead.T @ covariance @ part[:, :size]
        covariance, ahead = covariance + 0.5 * (more + more.T), ahead @ part[:, :size]
    return covariance


def slots_for(readings: Readings, begin: int, end: int, size: int) -> Slots:
    """Slots for the readings of nodes `begin` to `end`."""
    u = max(4, int(np.diff(readings.first[begin : end + 1]).max(initial=0)) + 3)
    shapes = ((u,), (u,), (u,), *[(u, size)] * 4, (u,), (u, 2, POINTS))
    return Slots(np.zeros(u, dtype=np.int64), np.full(u, -1), *map(np.zeros, shapes))


@kernel
def add(factor: float, what: Floats, to: Floats) -> None:
    """Add a matrix times a factor."""
    for r in range(what.shape[0]):
        for q in range(what.shape[1]):
            to[r, q] += factor * what[r, q]


@kernel
def apart(covariance: Floats, last: int) -> float:
    """Variance of the first pendulum's angle less that of the last, whose place is given; 0 of one alone."""
    return float(covariance[0, 0] - 2.0 * covariance[0, last] + covariance[last, last])


@kernel
def forget(columns: Floats) -> None:
    """Set to 0 what is so small that its products slow processors down."""
    for r in range(columns.shape[0]):
        for c in range(columns.shape[1]):
            if abs(columns[r, c]) < FORGOTTEN:
                columns[r, c] = 0.0


@kernel
def follow(flow: Flow, about: Floats, k: int, path: Floats, steps: Steps) -> None:
    """What a path is at the nodes of the steps from node k on, and at their ends beside the flow; see `join_ends`."""
    for s in range(min(path.shape[0], about.shape[0] - k)):
        for q in range(path.shape[1]):
            path[s, q] = about[k + s, q]
    multiply(flow.to_nodes, path[:-1].T, steps.nodes)
    multiply(flow.ends, path[1:].T, steps.away)
    multiply(flow.ahead_to_ends, path[:-1].T, steps.led)
    add(-1.0, steps.led, steps.away)


@kernel
def turn(flow: Flow, swing: Floats, s: int, ahead: Floats, ahead_columns: Floats) -> None:
    """Turn the rows of the pendulums in a step's derivative, and their transpose; see `Steps.swing`."""
    n = swing.shape[1] // 2
    for i in range(swing.shape[0]):
        for r in range(2):
            at = 2 * i + r
            for q in range(ahead.shape[0]):
                ahead[at, q] = ahead_columns[q, at] = flow.ahead[at, q] + swing[i, r * n + s, q]


@kernel
def lay_by(columns: Columns, trace: int, traces: int, seen: Floats, j: int, buffer: Floats, row: int) -> None:
    """Lay a whitened error and its derivatives into the buffer. The scale of a trace moves a reading by itself, which
    tells nothing beside an unknown motion of the ship: that is taken off, and what was known before it stays."""
    last = seen.shape[1] - 1
    for c in range(last + 1):
        buffer[row, c] = seen[j, c]
    for n in range(columns.of_traces.size):
        c = columns.of_traces[n]
        scales = columns.kind[c] == GAIN or columns.kind[c] == READ_HEAVE_SCALE
        if scales and (columns.member[c] == trace or (columns.member[c] < 0 and trace < traces)):
            buffer[row, c] += seen[j, last]


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
def sweep(task: Task, begin: int, end: int, of: Pass, keep: Kept, room: Room) -> bool:
    """Filter nodes `begin` to `end`, with derivatives by all constants; whether every covariance stayed positive.
    Derivatives and state stand side by side, (d, c + 1), as in `seen`: readings as predicted less as read."""
    flow, readings, columns, known, about, plain = (
        task.flow, task.readings, task.columns, task.known, task.about, task.plain,
    )  # fmt: skip
    forced, breaks, two, constants = columns.forced, task.breaks, 2 * flow.kappa.size, of.state.shape[1] - 1
    covariance, state, state_updated, updated, moved = of.covariance, of.state, room.state, room.updated, room.moved
    ahead, ahead_columns, slots, steps, path = room.ahead, room.ahead_columns, room.slots, room.steps, room.path
    root, seen, gain, buffer, rows = room.root, room.seen, room.gain, room.buffer, 0
    keeping, kept, end_kept = keep.swing.shape[0] > 0, 0, 0
    given = about.shape[0] > 0
    joined, at, chunk = flow.sine and given, 0, begin - CHUNK
    width = path.shape[0] - 1
    push, impulses = steps.push, forced.size + (3 if flow.heaves else 1)
    asked = not plain or forced.size > 0 or flow.heave_noise > 0.0
    moving, rested, before, product, at_break = True, task.settled.shape[0] == 0, -1, 1.0, 0
    for k in range(begin, end):
        while at_break < breaks.shape[0] and breaks[at_break, 0] <= k:
            if breaks[at_break, 0] == k:
                i = breaks[at_break, 1]
                covariance[2 * i, 2 * i] += ANYWHERE**2
                covariance[2 * i + 1, 2 * i + 1] += flow.kappa[i] * ANYWHERE**2
                moving = True
            at_break += 1
        used, alike = updating.pick(readings, k, slots)
        alike = alike and used == before
        if not alike:
            for j in range(used):
                updating.row_of(flow, readings, slots.reading[j], slots, j)
        before, moving = used, moving or not alike
        if given and asked:
            at = k - chunk
            if at == CHUNK:
                chunk = max(k - 1, 0)  # one step is at hand before the node
                at = k - chunk
                follow(flow, about, chunk, path, steps)
                remain(task, joined, chunk, min(CHUNK, end - chunk), steps)
        elif not plain:
            reach(flow.to_nodes, state, steps.nodes)
            lay_known(known, k, width, steps.nodes)
            collocate(flow, plain, width, steps)
        if joined and flow.heaves:
            updating.lay_heave(flow, readings, slots, used, steps, path, at)
        multiply(slots.row[:used], state, seen[:used])
        if not plain:
            updating.pull_aside(slots, used, readings, steps.rest, at, seen)
        for j in range(used):
            derive_errors(readings, columns, slots.reading[j], k * flow.step, slots, state, seen, j)
            seen[j, constants] -= readings.value[slots.reading[j]]
        if moving:
            multiply(slots.row[:used], covariance, gain[:used])
            updating.deviate(slots, used, gain)
        over = False
        for j in range(used):
            if of.errors.shape[0] > 0:
                of.errors[slots.reading[j]] = -seen[j, constants] / slots.deviation[j]
            over = over or (task.gate > 0.0 and abs(seen[j, constants]) > task.gate * slots.deviation[j])
        if over:
            if not moving:  # a reading over the gate lets the gain move
                moving = True
                multiply(slots.row[:used], covariance, gain[:used])
            used, alike, before = updating.set_aside(slots, used, task.gate, of, seen, gain), False, -1
        change = 1.0
        if moving:
            if not updating.whiten(slots, used, gain, root):
                return False
            updating.lift(covariance, gain, gain, used, updated)
            if not flow.sine and used > 0:
                change = updating.change_of(gain, used, room.old_gain, covariance)
        updating.substitute(root, used, seen)
        updating.lift(state, gain, seen, used, state_updated)
        for j in range(used):
            product *= root[j, j]
            of.whitened[slots.reading[j]], of.scale[slots.reading[j]] = -seen[j, constants], root[j, j]
            lay_by(columns, slots.trace[j], readings.combination.shape[0], seen, j, buffer, rows)
            rows += 1
            if rows == ROWS:
                multiply(buffer.T, buffer, room.square)
                add(1.0, room.square, of.normal)
                rows = 0
        if not 1e-100 < product < 1e100:
            of.totals[0] += np.log(product)
            product = 1.0
        of.totals[1] += used
        for j in range(used if keep.errors.shape[0] > 0 else 0):
            for c in range(constants + 1):
                keep.errors[slots.reading[j] - readings.first[begin], c] = -seen[j, c]
        if keeping:
            if moving and used > 0:
                kept, end_kept = end_kept, end_kept + used
                keep_gain(keep, kept, slots, used, root, gain)
            keep.first[k - begin] = kept
        if k + 1 == readings.first.size - 1:
            break
        # to the next node
        settling = moving and alike and not flow.sine and used > 0 and change < SETTLED
        if asked and not given:
            reach(flow.to_nodes, state_updated, steps.nodes)
            remain(task, joined, k, width, steps)
        if not plain:
            turn(flow, steps.swing, at, ahead, ahead_columns)
        multiply(ahead, state_updated, state)
        if k % UNEVEN == 0:
            forget(state)
        if moving:
            multiply(ahead, updated, moved)
            multiply(moved, ahead_columns, updated)
            updating.add_noise(updated, flow.noise, k % UNEVEN == 0, covariance)
            if flow.heaves:
                updating.add_drive(flow, push, forced.size + 1, at, covariance)
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
        # what moves the pendulums settles over hours: the gain would be kept where it crawls
        if settling and not rested and apart(covariance, two - 2) < apart(task.settled, two - 2):
            rested = True
            for r in range(covariance.shape[0]):
                for q in range(covariance.shape[1]):
                    covariance[r, q] = task.settled[r, q]
        else:
            moving = moving and not settling
    multiply(buffer[:rows].T, buffer[:rows], room.square)
    add(1.0, room.square, of.normal)
    of.totals[0] += np.log(product)
    return True
