"""What acts on the pendulums in steps beside the state, by constants and by noise, and all that steps do together."""

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds, remainder
from pipeline.joint.flow import NODES, POINTS, Flow
from pipeline.joint.passes import Columns, Readings, Slots, Task
from pipeline.joint.remainder import COSINE, SHARES, SINE, TURNED, Steps, multiply
from synth.kernels.compiled import kernel

FADED = 1e-4  # rad s-1: change of a fading speed for its derivative


@kernel
def remain(task: Task, joined: bool, k: int, n: int, steps: Steps) -> None:
    """All that the steps from node k do beside their linear flow, from what that makes of the path at the nodes."""
    flow, sources = task.flow, task.flow.sources
    remainder.lay_known(task.known, k, n, steps.nodes)
    remainder.collocate(flow, task.plain, n, steps)
    if joined:
        remainder.join_ends(flow, n, steps)
    if task.plain:
        for r in range(steps.extra.shape[0]):
            for s in range(n):
                steps.extra[r, s] = 0.0  # a knock of steps before
    else:
        remainder.differentiate(flow, task.known, k, n, steps)
        for i in range(sources.shape[0]):
            multiply(steps.factor[i].reshape(sources.shape[1], -1).T, sources[i], steps.swing[i])
    force_columns(task, k, n, steps)
    if flow.heaves:
        drive(flow, joined, task.columns.forced.size + 1, n, steps)
    if flow.heave_noise > 0.0:
        jolt(flow, n, steps)


@kernel
def force_columns(task: Task, k: int, n: int, steps: Steps) -> None:
    """What constants that move the pendulums add to derivatives in the steps from node k; knocks also to `extra`."""
    flow, columns, recorded, slope = task.flow, task.columns, task.recorded, task.slope
    nodes, rest, push, extra, force = steps.nodes, steps.rest, steps.push, steps.extra, steps.room[0]
    weight = steps.weight
    count, begin, end = flow.kappa.size, k * flow.step, (k + n) * flow.step
    horizontal, vertical = 2 * POINTS * count, 2 * POINTS * count + POINTS
    for f in range(columns.forced.size):
        c = columns.forced[f]
        kind, centre, width = columns.kind[c], columns.centre[c], columns.width[c]
        for r in range(2 * count):
            for s in range(n):
                push[f, r, s] = 0.0
        if kind == kinds.KNOCK:
            i = columns.member[c]
            own = np.sqrt(flow.kappa[i] * flow.gravity)
            for s in range(n):
                left = begin + (s + 1) * flow.step - centre - width
                if 0.0 < left <= flow.step:
                    push[f, 2 * i, s], push[f, 2 * i + 1, s] = np.sin(own * left) / own, np.cos(own * left)
                    extra[2 * i, s] += columns.value[c] * push[f, 2 * i, s]
                    extra[2 * i + 1, s] += columns.value[c] * push[f, 2 * i + 1, s]
            continue
        if kind == kinds.GRAVITY and width > 0.0 and (end <= centre - 2.0 * width or begin >= centre + 2.0 * width):
            continue
        for i in range(count):
            if columns.member[c] >= 0 and columns.member[c] != i:
                continue
            kappa, fade = flow.kappa[i], flow.fade if flow.dry[i] != 0.0 else centre
            for m in range(POINTS):
                speed, u, z = nodes[POINTS * (count + i) + m], nodes[horizontal + m], nodes[vertical + m]
                for s in range(n):
                    force[s] = -kappa * rest[i, SINE, m, s]
                if kind == kinds.DAMPING:
                    for s in range(n):
                        force[s] = -2.0 * speed[s]
                elif kind == kinds.QUADRATIC:
                    for s in range(n):
                        force[s] = -abs(speed[s]) * speed[s]
                elif kind == kinds.DRY:
                    for s in range(n):
                        force[s] = -remainder.direction(flow, i, m, nodes[POINTS * i + m, s], speed[s], fade)[0]
                elif kind == kinds.FADE:
                    more = FADED * (abs(flow.fade) + TURNED)
                    for s in range(n):
                        angle = nodes[POINTS * i + m, s]
                        force[s] = remainder.direction(flow, i, m, angle, speed[s], flow.fade)[0]
                        force[s] -= remainder.direction(flow, i, m, angle, speed[s], flow.fade + more)[0]
                        force[s] *= flow.dry[i] / more
                elif kind == kinds.RATIO:
                    for s in range(n):
                        force[s] = force[s] * (flow.gravity + z[s]) - kappa * rest[i, COSINE, m, s] * u[s]
                elif kind == kinds.SWAY:
                    for s in range(n):
                        force[s] = 0.0
                        for j in range(count):
                            force[s] -= kappa * nodes[POINTS * j + m, s]
                elif kind == kinds.HEAVE_SCALE:
                    for s in range(n):
                        force[s] *= recorded[k + s, m] if recorded.shape[0] > 0 else 0.0
                elif kind == kinds.HEAVE_DELAY:
                    for s in range(n):
                        force[s] *= slope[k + s, m] if slope.shape[0] > 0 else 0.0
                elif width > 0.0:
                    for s in range(n):
                        away = abs(begin + (s + NODES[m]) * flow.step - centre) / width
                        force[s] *= (max(0.0, 2.0 - away) ** 3 - 4.0 * max(0.0, 1.0 - away) ** 3) / 6.0
                for r in range(2):
                    for s in range(n):
                        push[f, 2 * i + r, s] += weight[i, r, m, s] * force[s]


@kernel
def drive(flow: Flow, joined: bool, begin: int, n: int, steps: Steps) -> None:
    """What it does to the pendulums that Z and its derivative end elsewhere than the flow leads, into rows `begin` and
    the next of `push`, less what a joined path has of it (`join_ends`). Else a sawtooth would pass for gravity."""
    push, extra, away, factor = steps.push, steps.extra, steps.away, steps.factor
    for i in range(flow.kappa.size):
        for r in range(2):
            at = 2 * i + r
            for s in range(n):
                push[begin, at, s] = push[begin + 1, at, s] = 0.0
            for m in range(POINTS):
                cubic, slope = remainder.cubics(flow.step, m)
                for s in range(n):
                    by = factor[i, 4 * m + 3, r, s]
                    push[begin, at, s] += cubic * by
                    push[begin + 1, at, s] += slope * by
            for s in range(n if joined else 0):
                extra[at, s] -= push[begin, at, s] * away[2, s]
                extra[at, s] -= push[begin + 1, at, s] * away[3, s]


@kernel
def jolt(flow: Flow, n: int, steps: Steps) -> None:
    """What a recorded heave's noise does, into the last of `push`: an impulse a node, which grows with the angle."""
    push, rest, weight = steps.push, steps.rest, steps.weight
    begin = push.shape[0] - POINTS
    for i in range(flow.kappa.size):
        for m in range(POINTS):
            size = flow.kappa[i] * flow.heave_noise / np.sqrt(SHARES[m] * flow.step)
            for r in range(2):
                for s in range(n):
                    push[begin + m, 2 * i + r, s] = size * rest[i, SINE, m, s] * weight[i, r, m, s]


@kernel
def derive_errors(
    readings: Readings, columns: Columns, which: int, node: float, slots: Slots, state: Floats, seen: Floats, j: int
) -> None:
    """What the constants of a trace add to the derivatives of what is seen of a reading of time `node`, s: row j of
    `seen`, which holds what the reading's row makes of `state`, (d, c + 1)."""
    last, trace, time = state.shape[1] - 1, readings.trace[which], node + readings.offset[which]
    speed = 0.0
    for n in range(columns.of_traces.size):
        c = columns.of_traces[n]
        kind = columns.kind[c]
        own = columns.member[c]
        if (own >= 0 and own != trace) or (own < 0 and trace >= readings.combination.shape[0]):
            continue
        if kind == kinds.ZERO:
            seen[j, c] += 1.0
        elif kind == kinds.DRIFT:
            seen[j, c] += (time - columns.centre[c]) / columns.width[c]
        elif kind == kinds.GAIN or kind == kinds.READ_HEAVE_SCALE:
            seen[j, c] += readings.value[which]
        elif kind == kinds.CUBIC:
            seen[j, c] += readings.value[which] ** 3
        elif kind == kinds.CROSS:
            seen[j, c] += readings.others[which]
        elif kind == kinds.STEP and time >= columns.centre[c]:
            seen[j, c] += 1.0
        elif kind in (kinds.DELAY, kinds.READ_HEAVE_DELAY) or (kind == kinds.CLOCK and time >= columns.centre[c]):
            if speed == 0.0:
                for q in range(state.shape[0]):
                    speed += slots.rate[j, q] * state[q, last]
            pace = readings.pace[which] if kind == kinds.DELAY and readings.pace.size else 1.0
            seen[j, c] -= pace * speed * (np.cos(columns.width[c] * time) if columns.width[c] > 0.0 else 1.0)
