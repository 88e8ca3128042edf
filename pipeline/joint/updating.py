"""Rows of a node's readings in the state, and what they move it by."""

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import NODES, POINTS, Flow
from pipeline.joint.passes import Pass, Readings, Slots
from pipeline.joint.remainder import JOINED, LEFT, Steps
from synth.kernels.compiled import kernel, summing_kernel


@kernel
def row_of(flow: Flow, readings: Readings, which: int, slots: Slots, j: int) -> None:
    """Into slot j: row of a reading in the state, its slope in time, and the pull of the steps on either side."""
    size, traces = slots.row.shape[1], readings.combination.shape[0]
    trace, tau, square = readings.trace[which], readings.offset[which], flow.gravity * flow.kappa.mean()
    for q in range(size):
        slots.row[j, q] = slots.rate[j, q] = slots.heave[j, q] = 0.0
    slots.beside[j] = 0.0
    for m in range(POINTS):
        for b in range(2):  # the nodes lie alike, seen from the end of the step before
            at = m if b == 0 else POINTS - 1 - m
            t = tau if b == 0 else -tau
            pull, factor = 0.0, t * t
            for e in range(POINTS):
                swung = square * t * t / ((e + 3) * (e + 4))
                pull += factor * flow.pull[at, e] * (1.0 - swung * (1.0 - square * t * t / ((e + 5) * (e + 6))))
                factor *= t
            slots.pull[j, b, m] = pull
    power, before, third = 1.0, 0.0, 1.0
    share = 0.5 * tau * tau * (1.0 - square * tau * tau / 12.0)
    for e in range(flow.horizontal.shape[0]):
        if trace < traces:
            for i in range(flow.kappa.size):
                factor, slope = power * readings.combination[trace, i], e * before * readings.combination[trace, i]
                for q in range(size):
                    slots.row[j, q] += factor * flow.angles[i, e, q]
                    slots.rate[j, q] += slope * flow.angles[i, e, q]
            for q in range(size):
                slots.heave[j, q] += third * share * flow.vertical[e, q]
            third *= tau / 3.0
        elif trace == traces:
            for q in range(size):
                slots.row[j, q] += power * flow.horizontal[e, q]
        else:
            for q in range(size):
                slots.row[j, q] += power * flow.vertical[e, q]
                slots.rate[j, q] += e * before * flow.vertical[e, q]
        power, before = power * tau, power
        if before == 0.0:
            break
    for q in range(size):
        slots.level[j, q] = slots.row[j, q]


@summing_kernel
def lay_heave(flow: Flow, readings: Readings, slots: Slots, used: int, steps: Steps, path: Floats, s: int) -> None:
    """What the ship's vertical motion does between the node and readings, into their rows, about row s of a path. Two
    integrations weigh what is nearer the node more: the angles are taken as they are at a third of the way."""
    size = slots.row.shape[1]
    apart = (NODES[1] - NODES[0]) * flow.step
    for j in range(used):
        trace, tau = slots.trace[j], slots.offset[j]
        if trace >= readings.combination.shape[0] or tau == 0.0:
            continue
        near, next_, step = (POINTS - 1, POINTS - 2, s - 1) if tau < 0.0 and s > 0 else (0, 1, s)
        ahead = (abs(tau) / 3.0 if step < s else tau / 3.0) / apart - NODES[0] * flow.step / apart
        lever, own = 0.0, 0.0
        for i in range(flow.kappa.size):
            by = steps.by[i, 3, near, step] + ahead * (steps.by[i, 3, next_, step] - steps.by[i, 3, near, step])
            lever += readings.combination[trace, i] * by
        for q in range(2 * flow.kappa.size, size):
            slots.row[j, q] = slots.level[j, q] + lever * slots.heave[j, q]
            own += slots.heave[j, q] * path[s, q]
        slots.beside[j] = lever * own  # which the pull has too


@kernel
def pick(readings: Readings, k: int, slots: Slots) -> tuple[int, bool]:
    """Put the readings of node k that are used into the slots; how many, and whether such stood there before."""
    used, alike = 0, True
    for which in range(readings.first[k], readings.first[k + 1]):
        if readings.variance[which] < np.inf:
            trace, offset, variance = readings.trace[which], readings.offset[which], readings.variance[which]
            alike = alike and slots.trace[used] == trace and slots.offset[used] == offset
            alike = alike and slots.variance[used] == variance
            slots.reading[used], slots.trace[used] = which, trace
            slots.offset[used], slots.variance[used] = offset, variance
            used += 1
    return used, alike


@kernel
def pull_aside(slots: Slots, used: int, readings: Readings, rest: Floats, s: int, seen: Floats) -> None:
    """Add to what is seen of each reading what the linear flow leaves out since the node, where step s begins; without
    a step before it, step s is gone on with backwards."""
    last = seen.shape[1] - 1
    for j in range(used):
        trace = slots.trace[j]
        seen[j, last] -= slots.beside[j]
        back = 1 if slots.offset[j] < 0.0 and s > 0 else 0
        plane = JOINED if back else LEFT
        if trace < readings.combination.shape[0]:
            for i in range(rest.shape[0]):
                moved = slots.pull[j, back, 0] * rest[i, plane, 0, s - back]
                moved += slots.pull[j, back, 1] * rest[i, plane, 1, s - back]
                moved += slots.pull[j, back, 2] * rest[i, plane, 2, s - back]
                moved += slots.pull[j, back, 3] * rest[i, plane, 3, s - back]
                seen[j, last] += readings.combination[trace, i] * moved


@summing_kernel
def deviate(slots: Slots, used: int, gain: Floats) -> None:
    """Deviations of a node's prediction errors, from rows times covariance."""
    for j in range(used):
        square = slots.variance[j]
        for r in range(gain.shape[1]):
            square += gain[j, r] * slots.row[j, r]
        slots.deviation[j] = np.sqrt(square)


@summing_kernel
def whiten(slots: Slots, used: int, gain: Floats, root: Floats) -> bool:
    """Gains and Cholesky factor of a node's prediction errors, from rows times covariance; whether it went."""
    for j in range(used):
        for q in range(j):
            total = 0.0
            for r in range(gain.shape[1]):
                total += gain[q, r] * slots.row[j, r]
            root[j, q] = total
            for r in range(gain.shape[1]):
                gain[j, r] -= total * gain[q, r]
        square = slots.variance[j]
        for r in range(gain.shape[1]):
            square += gain[j, r] * slots.row[j, r]
        if not square > 0.0:
            return False
        root[j, j] = np.sqrt(square)
        for r in range(gain.shape[1]):
            gain[j, r] /= root[j, j]
    return True


@kernel
def substitute(root: Floats, used: int, rows: Floats) -> None:
    """Forward substitution of a lower factor, row by row."""
    for j in range(used):
        for q in range(j):
            factor = root[j, q]
            for c in range(rows.shape[1]):
                rows[j, c] -= factor * rows[q, c]
        factor = 1.0 / root[j, j]
        for c in range(rows.shape[1]):
            rows[j, c] *= factor


@kernel
def change_of(gain: Floats, used: int, old: Floats, covariance: Floats) -> float:
    """Largest change of a gain since it was noted, relative to it and to the state's deviation; notes the new one."""
    change = 0.0
    for r in range(gain.shape[1]):
        most, off = 0.0, 0.0
        for j in range(used):
            most = max(most, abs(gain[j, r]))
            off = max(off, abs(gain[j, r] - old[j, r]))
            old[j, r] = gain[j, r]
        spread = most + np.sqrt(max(covariance[r, r], 0.0))
        if spread > 0.0:
            change = max(change, off / spread)
    return change


@kernel
def set_aside(slots: Slots, used: int, gate: float, of: Pass, seen: Floats, gain: Floats) -> int:
    """Leave out the readings over the gate; how many stay."""
    stay = 0
    for j in range(used):
        which = slots.reading[j]
        if abs(of.errors[which]) > gate:
            of.totals[2] += 1.0
            continue
        slots.reading[stay], slots.trace[stay], slots.variance[stay] = which, slots.trace[j], slots.variance[j]
        for r in range(gain.shape[1]):
            gain[stay, r], slots.row[stay, r] = gain[j, r], slots.row[j, r]
        for c in range(seen.shape[1]):
            seen[stay, c] = seen[j, c]
        stay += 1
    return stay


@summing_kernel
def lift(predicted: Floats, gain: Floats, seen: Floats, used: int, updated: Floats) -> None:
    """Take off what readings move states, (d, n), by; `gain`, (u, d), and `seen`, (u, n), go on in zeros to fours."""
    for j in range(used, max(used + (-used) % 4, 4)):
        for r in range(predicted.shape[0]):
            gain[j, r] = 0.0
        for q in range(predicted.shape[1]):
            seen[j, q] = 0.0
    for r in range(predicted.shape[0]):
        a, b, c, d = gain[0, r], gain[1, r], gain[2, r], gain[3, r]
        for q in range(predicted.shape[1]):
            updated[r, q] = predicted[r, q] - a * seen[0, q] - b * seen[1, q] - c * seen[2, q] - d * seen[3, q]
    for j in range(4, used, 4):
        for r in range(predicted.shape[0]):
            a, b, c, d = gain[j, r], gain[j + 1, r], gain[j + 2, r], gain[j + 3, r]
            for q in range(predicted.shape[1]):
                updated[r, q] -= a * seen[j, q] + b * seen[j + 1, q] + c * seen[j + 2, q] + d * seen[j + 3, q]


@kernel
def add_drive(flow: Flow, push: Floats, begin: int, s: int, covariance: Floats) -> None:
    """Add what the process noise of vertical motion does within step s, from rows `begin` and the next of `push`."""
    two = push.shape[1]
    for a in range(2):
        for r in range(two):
            for q in range(covariance.shape[0]):
                by = push[begin + a, r, s] * flow.driven[a, q]
                covariance[r, q] += by
                covariance[q, r] += by
        for b in range(2):
            square = 0.0
            for q in range(two, covariance.shape[0]):
                square += flow.driven[a, q] * flow.vertical[b, q]
            for r in range(two):
                for q in range(two):
                    covariance[r, q] += push[begin + a, r, s] * square * push[begin + b, q, s]


@kernel
def add_noise(moved: Floats, noise: Floats, symmetric: bool, covariance: Floats) -> None:
    """Covariance at the next node: the moved one, made symmetric where asked, and the process noise."""
    for r in range(noise.shape[0]):
        for q in range(noise.shape[0]):
            covariance[r, q] = moved[r, q] + noise[r, q]
    if symmetric:
        for r in range(noise.shape[0]):
            for q in range(r):
                covariance[r, q] = covariance[q, r] = 0.5 * (covariance[r, q] + covariance[q, r])
