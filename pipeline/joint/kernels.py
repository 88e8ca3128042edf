"""Filter and smoother over the lattice: prediction errors and their derivatives, the smoothed path by adjoints.

The state's covariance holds what is random (ship, kicks); whatever is a constant (gravity, damping, zeros, the start of
the free swing) is a column beside it: the prediction's derivative, taken through the same gain. One sweep then gives
the normal matrix of all constants, whose priors can be chosen afterwards (de Jong 1991). With even sampling the gain
settles and is kept; a gap lets it move again.

What runs at each node makes no views of arrays and calls no kernel that takes arrays, `sweep` itself apart: Numba would
count references there, which costs more than the arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import NODES, Flow
from synth.kernels.compiled import kernel, summing_kernel

ANYWHERE = 0.1  # rad
MOST_ARC, MOST_ACCELERATION = 0.5, 0.3  # rad; over reference gravity
TURNED = 1e-9  # rad s-1: a pendulum turns at no less
ROWS = 256  # prediction errors that are multiplied out at once
CHUNK = 64  # nodes whose places on a given path are found at once
UNEVEN = 8  # nodes after which the covariance is made symmetric again
SETTLED = 2e-6  # relative change of a gain from node to node below which it is kept

# kinds of columns
START, GRAVITY, DAMPING, QUADRATIC, DRY, RATIO, HEAVE_SCALE, HEAVE_DELAY = range(8)  # move the pendulums
ZERO, DRIFT, GAIN, DELAY, STEP, CLOCK = range(8, 14)  # are in the reading


class Readings(NamedTuple):
    """What was read, sorted by the lattice's nodes; k nodes, r readings, t traces, p pendulums.

    Attributes
    ----------
    first : (k + 1,) array of int
        First reading of each node.
    trace : (r,) array of int
        Below t: a trace; t: the horizontal acceleration, t + 1: the vertical one.
    offset : (r,) array
        Time after the node, s, of either sign.
    value : (r,) array
        rad, or acceleration over reference gravity.
    variance : (r,) array
        Of the reading; infinite = left out.
    combination : (t, p) array
    """

    first: np.ndarray
    trace: np.ndarray
    offset: Floats
    value: Floats
    variance: Floats
    combination: Floats


class Columns(NamedTuple):
    """The constants; c of them.

    Attributes
    ----------
    kind, member : (c,) arrays of int
        Kind as above; pendulum, trace (-1: all) or state that it belongs to.
    centre, width : (c,) arrays
        s: of GRAVITY a cubic spline's, width 0: the whole record; of DRIFT centre and scale; of STEP and CLOCK their
        time; of DRY the centre is the speed below which it fades, rad s-1.
    """

    kind: np.ndarray
    member: np.ndarray
    centre: Floats
    width: Floats


@kernel
def sine_and_cosine(angle: float) -> tuple[float, float]:
    """Both to the last digits; a swing's angles need no reduction."""
    if abs(angle) > 0.5:
        return np.sin(angle), np.cos(angle)
    s = angle * angle
    odd = s * (1 / 120 - s * (1 / 5040 - s * (1 / 362880 - s * (1 / 39916800 - s * (1 / 6227020800)))))
    even = s * (1 / 24 - s * (1 / 720 - s * (1 / 40320 - s * (1 / 3628800 - s * (1 / 479001600 - s / 87178291200)))))
    return angle - angle * s * (1 / 6 - odd), 1.0 - s * (0.5 - even)


@summing_kernel
def reach_nodes(columns: Floats, path: Floats, at: int, nodes: Floats) -> None:
    """What the linear flow makes of row `at` of a path at the nodes; `columns` (d, n): the flow's rows, transposed."""
    size, count = columns.shape[0], nodes.size
    for m in range(count):
        nodes[m] = 0.0
    whole = size - size % 4
    for q in range(0, whole, 4):
        a, b, c, d = path[at, q], path[at, q + 1], path[at, q + 2], path[at, q + 3]
        for m in range(count):
            nodes[m] += a * columns[q, m] + b * columns[q + 1, m] + c * columns[q + 2, m] + d * columns[q + 3, m]
    for q in range(whole, size):
        a = path[at, q]
        for m in range(count):
            nodes[m] += a * columns[q, m]


@kernel
def reach(columns: Floats, state: Floats, nodes: Floats) -> None:
    """Angles, speeds, U and Z at the nodes of a step, from the state, (1, d).

    A state that runs away with wild readings is taken for no more than a pendulum or a ship can do: the flow stays
    close to a linear one, which comes back.
    """
    reach_nodes(columns, state, 0, nodes)
    for m in range(nodes.size):
        most = MOST_ACCELERATION if m >= nodes.size - 6 else (MOST_ARC if m < (nodes.size - 6) // 2 else np.inf)
        nodes[m] = min(max(nodes[m], -most), most)


@kernel
def ends_of(flow: Flow) -> Floats:
    """What a path is at the end of a step: U, Z and their derivatives, then each pendulum's angle and speed, (d, e)."""
    two, size = 2 * flow.kappa.size, flow.horizontal.shape[1]
    out = np.zeros((size, 4 + two))
    for r in range(two, size):
        for m in range(2):
            out[r, m], out[r, 2 + m] = flow.horizontal[m, r], flow.vertical[m, r]
    for r in range(two):
        out[r, 4 + r] = 1.0
    return out


@kernel
def direction(flow: Flow, i: int, m: int, angle: float, speed: float, fade: float) -> tuple[float, float]:
    """Sign of a speed as knife-edge friction has it, v / sqrt(v^2 + fade^2), and its slope by the speed.

    It is the mean over a node's share of the step, in which the pendulum may turn.
    """
    within = flow.kappa[i] * abs(angle) * flow.step * (2.0 / 9.0 if m == 1 else 5.0 / 36.0) + TURNED
    above, below = np.hypot(speed + within, fade), np.hypot(speed - within, fade)
    return (above - below) / (2.0 * within), ((speed + within) / above - (speed - within) / below) / (2.0 * within)


@kernel
def collocate(flow: Flow, i: int, nodes: Floats, rest: Floats) -> None:
    """Angles of pendulum i at the nodes under what the linear flow leaves, and that remainder.

    Sine and cosine are taken once a node; collocation moves the angle by 1e-5 rad at most, for which two terms serve.

    Parameters
    ----------
    nodes : (6 p + 6,) array, changed
        Angles, speeds, U and Z at the nodes; the angles are moved.
    rest : (p, 3, 4) array, out
        At each node, sine and cosine of the angle before it is moved, the acceleration left by the linear flow, and
        that angle.
    """
    count, kappa, gravity = flow.kappa.size, flow.kappa[i], flow.gravity
    angle, speed, horizontal, vertical = 3 * i, 3 * (count + i), 6 * count, 6 * count + 3
    quadratic, dry = flow.quadratic[i], flow.dry[i]
    for m in range(3):
        rest[i, m, 3] = nodes[angle + m]
        rest[i, m, 0], rest[i, m, 1] = sine_and_cosine(rest[i, m, 3])
    moved0 = moved1 = moved2 = 0.0
    for _ in range(3):
        for m in range(3):
            by = moved0 if m == 0 else (moved1 if m == 1 else moved2)
            u, z, at = nodes[horizontal + m], nodes[vertical + m], nodes[angle + m] + by
            if flow.sine:
                sine, cosine = rest[i, m, 0], rest[i, m, 1]
                s = sine + by * (cosine - 0.5 * by * sine)
                c = cosine - by * (sine + 0.5 * by * cosine)
                rest[i, m, 2] = -kappa * ((gravity + z) * s - gravity * at + u * (c - 1.0))
            else:
                rest[i, m, 2] = -kappa * z * at
            if quadratic != 0.0 or dry != 0.0:
                rest[i, m, 2] -= quadratic * abs(nodes[speed + m]) * nodes[speed + m]
                rest[i, m, 2] -= dry * direction(flow, i, m, at, nodes[speed + m], flow.fade)[0]
        f0, f1, f2 = rest[i, 0, 2], rest[i, 1, 2], rest[i, 2, 2]
        moved0 = flow.response[i, 0, 0, 0] * f0 + flow.response[i, 0, 1, 0] * f1 + flow.response[i, 0, 2, 0] * f2
        moved1 = flow.response[i, 1, 0, 0] * f0 + flow.response[i, 1, 1, 0] * f1 + flow.response[i, 1, 2, 0] * f2
        moved2 = flow.response[i, 2, 0, 0] * f0 + flow.response[i, 2, 1, 0] * f1 + flow.response[i, 2, 2, 0] * f2
    nodes[angle] += moved0
    nodes[angle + 1] += moved1
    nodes[angle + 2] += moved2


@kernel
def join_ends(flow: Flow, away: Floats, k: int, nodes: Floats, rest: Floats) -> None:
    """Move the remainder in a step to where a path goes that ends at its next row, not where the flow leads.

    What drives the ship acts within the step too. The flow alone takes the ship's motion for a fading one, which errs
    by .02 mGal where it vibrates at three times the swing's frequency. The distance at the end is spread over the step
    by Hermite polynomials that vanish at its start with their first derivatives, of the angle the second ones too.

    Parameters
    ----------
    away : (n, 4 + 2 p) array
        In row k, the path's next row less what the linear flow makes of it, see `ends_of`.
    nodes : (6 p + 6,) array
        Angles moved by `collocate`, speeds, U and Z at the nodes, under the flow.
    rest : (p, 3, 4) array, changed
        As `collocate` left it; its remaining acceleration is moved.
    """
    count, gravity = flow.kappa.size, flow.gravity
    u, u_speed, z, z_speed = away[k, 0], away[k, 1], away[k, 2], away[k, 3]
    for i in range(count):
        kappa, angle, speed = flow.kappa[i], away[k, 4 + 2 * i], away[k, 5 + 2 * i]
        for m in range(3):
            angle -= flow.response[i, 3, m, 0] * rest[i, m, 2]
            speed -= flow.response[i, 3, m, 1] * rest[i, m, 2]
        turn = -kappa * (gravity * angle + u) - 2.0 * flow.damping[i] * speed
        for m in range(3):
            t = NODES[m]
            cubic, cubic_speed = t * t * (3.0 - 2.0 * t), flow.step * t * t * (t - 1.0)
            off = t**3 * (
                (10.0 - 15.0 * t + 6.0 * t * t) * angle
                + (-4.0 + 7.0 * t - 3.0 * t * t) * flow.step * speed
                + (0.5 - t + 0.5 * t * t) * flow.step**2 * turn
            )
            across, along = nodes[6 * count + m], nodes[6 * count + 3 + m]
            at, by = nodes[3 * i + m], nodes[3 * i + m] - rest[i, m, 3]
            s = rest[i, m, 0] + by * (rest[i, m, 1] - 0.5 * by * rest[i, m, 0])
            c = rest[i, m, 1] - by * (rest[i, m, 0] + 0.5 * by * rest[i, m, 1])
            left = (gravity + along) * s - gravity * at + across * (c - 1.0)
            across, along = across + cubic * u + cubic_speed * u_speed, along + cubic * z + cubic_speed * z_speed
            moved, turned = s + off * (c - 0.5 * off * s), c - off * (s + 0.5 * off * c)
            rest[i, m, 2] -= kappa * ((gravity + along) * moved - gravity * (at + off) + across * (turned - 1.0) - left)


@summing_kernel
def tilt(flow: Flow, i: int, by: Floats, ahead: Floats, ahead_columns: Floats) -> None:
    """Turn the two rows of pendulum i in the step's derivative, and their transpose.

    Parameters
    ----------
    by : (3, 4) array
        Derivative of the remaining acceleration at each node by angle, speed, U and Z.
    ahead, ahead_columns : (d, d) arrays, changed
    """
    count, size = flow.kappa.size, ahead.shape[0]
    angle, speed, u, z, end = 3 * i, 3 * (count + i), 6 * count, 6 * count + 3, 6 * count + 6 + 2 * i
    a0, a1, a2, s0, s1, s2 = by[0, 0], by[1, 0], by[2, 0], by[0, 1], by[1, 1], by[2, 1]
    u0, u1, u2, z0, z1, z2 = by[0, 2], by[1, 2], by[2, 2], by[0, 3], by[1, 3], by[2, 3]
    p0, p1, p2 = flow.response[i, 3, 0, 0], flow.response[i, 3, 1, 0], flow.response[i, 3, 2, 0]
    v0, v1, v2 = flow.response[i, 3, 0, 1], flow.response[i, 3, 1, 1], flow.response[i, 3, 2, 1]
    for q in range(size):
        f0 = a0 * flow.rows[angle, q] + s0 * flow.rows[speed, q] + u0 * flow.rows[u, q] + z0 * flow.rows[z, q]
        f1 = (
            a1 * flow.rows[angle + 1, q]
            + s1 * flow.rows[speed + 1, q]
            + u1 * flow.rows[u + 1, q]
            + z1 * flow.rows[z + 1, q]
        )
        f2 = (
            a2 * flow.rows[angle + 2, q]
            + s2 * flow.rows[speed + 2, q]
            + u2 * flow.rows[u + 2, q]
            + z2 * flow.rows[z + 2, q]
        )
        ahead[2 * i, q] = flow.rows[end, q] + p0 * f0 + p1 * f1 + p2 * f2
        ahead[2 * i + 1, q] = flow.rows[end + 1, q] + v0 * f0 + v1 * f1 + v2 * f2
        ahead_columns[q, 2 * i], ahead_columns[q, 2 * i + 1] = ahead[2 * i, q], ahead[2 * i + 1, q]


@kernel
def differentiate(
    flow: Flow, i: int, known: Floats, k: int, nodes: Floats, rest: Floats, by: Floats, extra: Floats
) -> None:
    """Derivatives of what the linear flow leaves of pendulum i, and what the step adds to them times the state.

    Parameters
    ----------
    known : (k, 3) array
        Z at the nodes beside the states; may be empty.
    nodes : (6 p + 6,) array
        Angles of the remainder, speeds, U, whole Z.
    rest : (p, 3, 4) array
        At each node, see `collocate`.
    by : (3, 4) array, out
        Derivative of the remaining acceleration at each node by angle, speed, U and Z.
    extra : (2 p,) array, out
    """
    count, gravity, kappa = flow.kappa.size, flow.gravity, flow.kappa[i]
    extra[2 * i] = extra[2 * i + 1] = 0.0
    for m in range(3):
        speed, u, z = nodes[3 * (count + i) + m], nodes[6 * count + m], nodes[6 * count + 3 + m]
        beside = known[k, m] if known.shape[0] > 0 else 0.0
        if flow.sine:
            sine, cosine = rest[i, m, 0], rest[i, m, 1]
            by[m, 0] = -kappa * ((gravity + z) * cosine - gravity - u * sine)
            by[m, 2], by[m, 3] = -kappa * (cosine - 1.0), -kappa * sine
        else:
            by[m, 0], by[m, 2], by[m, 3] = -kappa * z, 0.0, 0.0
        by[m, 1] = -2.0 * flow.quadratic[i] * abs(speed)
        by[m, 1] -= flow.dry[i] * direction(flow, i, m, rest[i, m, 3], speed, flow.fade)[1]
        linear = by[m, 0] * rest[i, m, 3] + by[m, 1] * speed + by[m, 2] * u + by[m, 3] * (z - beside)
        extra[2 * i] += flow.response[i, 3, m, 0] * (rest[i, m, 2] - linear)
        extra[2 * i + 1] += flow.response[i, 3, m, 1] * (rest[i, m, 2] - linear)


@kernel
def force_columns(
    flow: Flow,
    columns: Columns,
    forced: np.ndarray,
    nodes: Floats,
    recorded: Floats,
    slope: Floats,
    k: int,
    push: Floats,
) -> None:
    """What the constants `forced` add to the derivatives of the pendulums during the step from node k, (f, 2 p)."""
    count, time = flow.kappa.size, k * flow.step
    at = (0.5 - np.sqrt(15.0) / 10.0, 0.5, 0.5 + np.sqrt(15.0) / 10.0)
    for n in range(forced.size):
        c = forced[n]
        for r in range(2 * count):
            push[n, r] = 0.0
        kind, width = columns.kind[c], columns.width[c]
        if (
            kind == GRAVITY
            and width > 0.0
            and abs(time + 0.5 * flow.step - columns.centre[c]) > 2.0 * width + flow.step
        ):
            continue
        for i in range(count):
            if columns.member[c] >= 0 and columns.member[c] != i:
                continue
            for m in range(3):
                angle, speed = nodes[3 * i + m], nodes[3 * (count + i) + m]
                if kind == DAMPING:
                    force = -2.0 * speed
                elif kind == QUADRATIC:
                    force = -abs(speed) * speed
                elif kind == DRY:
                    force = -direction(flow, i, m, angle, speed, columns.centre[c])[0]
                else:
                    lever = angle
                    if flow.sine:
                        square = angle * angle
                        lever *= 1.0 - square * (1.0 - square * (1.0 - square * (1 / 42)) * (1 / 20)) * (1 / 6)
                    if kind == RATIO:
                        cosine = 1.0 - 0.5 * angle * angle if flow.sine else 1.0
                        lever = lever * (flow.gravity + nodes[6 * count + 3 + m]) + cosine * nodes[6 * count + m]
                    force = -flow.kappa[i] * lever
                    if kind == HEAVE_SCALE:
                        force *= recorded[k, m] if recorded.shape[0] > 0 else 0.0
                    elif kind == HEAVE_DELAY:
                        force *= slope[k, m] if slope.shape[0] > 0 else 0.0
                    elif width > 0.0:
                        away = abs(time + at[m] * flow.step - columns.centre[c]) / width
                        force *= (max(0.0, 2.0 - away) ** 3 - 4.0 * max(0.0, 1.0 - away) ** 3) / 6.0
                push[n, 2 * i] += flow.response[i, 3, m, 0] * force
                push[n, 2 * i + 1] += flow.response[i, 3, m, 1] * force


@kernel
def derive_errors(
    readings: Readings,
    columns: Columns,
    of_traces: np.ndarray,
    which: int,
    time: float,
    state: Floats,
    seen: Floats,
    j: int,
) -> None:
    """What the constants `of_traces` of a trace add to the derivatives of what is seen of a reading.

    On entry row j of `seen` holds what the reading's row makes of `state`, (d, c + 1).
    """
    last, trace = state.shape[1] - 1, readings.trace[which]
    for n in range(of_traces.size):
        c = of_traces[n]
        kind = columns.kind[c]
        own = columns.member[c]
        if (own >= 0 and own != trace) or (own < 0 and trace >= readings.combination.shape[0]):
            continue
        if kind == ZERO:
            seen[j, c] += 1.0
        elif kind == DRIFT:
            seen[j, c] += (time - columns.centre[c]) / columns.width[c]
        elif kind == GAIN:
            seen[j, c] += seen[j, last]
        elif kind == STEP and time >= columns.centre[c]:
            seen[j, c] += 1.0
        elif kind == DELAY or (kind == CLOCK and time >= columns.centre[c]):
            for i in range(readings.combination.shape[1]):
                seen[j, c] -= readings.combination[trace, i] * state[2 * i + 1, last]


class Pass(NamedTuple):
    """What a sweep works on and leaves behind; see `sweep`.

    Attributes
    ----------
    state : (d, c + 1) array
        Derivatives by the constants, last the state itself; predicted for the first node, then for the next.
    covariance : (d, d) array
    normal : (c + 1, c + 1) array
        Sum of products of whitened prediction errors and their derivatives.
    totals : (3,) array
        Sum of the logarithms of the deviations; readings used; readings over the gate.
    errors : (r,) array
        Prediction errors in their own standard deviations; NaN where there is none.
    whitened, scale : (r,) arrays
        The same, independent of each other, and their deviations; NaN where the reading was left out.
    """

    state: Floats
    covariance: Floats
    normal: Floats
    totals: Floats
    errors: Floats
    whitened: Floats
    scale: Floats


class Kept(NamedTuple):
    """What the smoother needs of a stretch of s nodes and its readings; empty arrays: nothing is kept.

    Attributes
    ----------
    swing : (s, 2 p, d) array
        Derivative's rows of the step that begins at the node.
    push : (s, f + 2, 2 p) array
        What that step adds to the pendulums: derivatives by the constants that move them, what is left, and the
        impulse of a recorded heave's noise.
    row, gain : (r, d) arrays
        Whitened rows of the stretch's readings in the state, and what they move it by; 0 where left out.
    errors : (r, c + 1) array
        Derivatives of the whitened prediction errors, and these; NaN where left out.
    """

    swing: Floats
    push: Floats
    row: Floats
    gain: Floats
    errors: Floats


class Slots(NamedTuple):
    """The readings of a node in their order; u of them at most, kept while the next node's are alike.

    Attributes
    ----------
    reading, trace : (u,) arrays of int
        Reading; its trace.
    offset, variance : (u,) arrays
    row : (u, d) array
        Row of the reading in the state.
    pull : (u, 3) array
        Factors of the remaining accelerations at the step's nodes in a pendulum's angle at the reading's time.
    """

    reading: np.ndarray
    trace: np.ndarray
    offset: Floats
    variance: Floats
    row: Floats
    pull: Floats


@kernel
def row_of(flow: Flow, readings: Readings, which: int, slots: Slots, j: int) -> None:
    """Row of a reading in the state, into slot j: the linear flow to its own time; and the pull of what it leaves."""
    size, traces = slots.row.shape[1], readings.combination.shape[0]
    trace, tau = readings.trace[which], readings.offset[which]
    for q in range(size):
        slots.row[j, q] = 0.0
    for m in range(3):
        slots.pull[j, m] = tau * tau * (flow.pull[m, 0] + tau * (flow.pull[m, 1] + tau * flow.pull[m, 2]))
    power = 1.0
    for e in range(flow.horizontal.shape[0]):
        if trace < traces:
            for i in range(flow.kappa.size):
                factor = power * readings.combination[trace, i]
                for q in range(size):
                    slots.row[j, q] += factor * flow.angles[i, e, q]
        elif trace == traces:
            for q in range(size):
                slots.row[j, q] += power * flow.horizontal[e, q]
        else:
            for q in range(size):
                slots.row[j, q] += power * flow.vertical[e, q]
        power *= tau
        if power == 0.0:
            break


@kernel
def pick(readings: Readings, k: int, slots: Slots, of: Pass) -> int:
    """Put the readings of node k that are used into the slots; how many there are."""
    used = 0
    for which in range(readings.first[k], readings.first[k + 1]):
        if readings.variance[which] < np.inf:
            slots.reading[used] = which
            used += 1
        else:
            of.errors[which] = of.whitened[which] = np.nan
    return used


@kernel
def recognise(readings: Readings, slots: Slots, used: int) -> bool:
    """Whether readings are like those that stood in their slots; notes what the slots hold now."""
    alike = True
    for j in range(used):
        which = slots.reading[j]
        same = slots.trace[j] == readings.trace[which] and slots.offset[j] == readings.offset[which]
        alike = alike and same and slots.variance[j] == readings.variance[which]
        slots.trace[j], slots.offset[j] = readings.trace[which], readings.offset[which]
        slots.variance[j] = readings.variance[which]
    return alike


@kernel
def pull_aside(slots: Slots, used: int, readings: Readings, rest: Floats, seen: Floats) -> None:
    """Add to what is seen of each reading what the linear flow leaves out between node and reading."""
    last = seen.shape[1] - 1
    for j in range(used):
        trace = slots.trace[j]
        if trace < readings.combination.shape[0]:
            for i in range(rest.shape[0]):
                moved = slots.pull[j, 0] * rest[i, 0, 2] + slots.pull[j, 1] * rest[i, 1, 2]
                moved += slots.pull[j, 2] * rest[i, 2, 2]
                seen[j, last] += readings.combination[trace, i] * moved


@summing_kernel
def square_up(slots: Slots, used: int, gain: Floats, square: Floats) -> None:
    """Covariance of the prediction errors of a node."""
    for j in range(used):
        for q in range(j + 1):
            total = 0.0
            for r in range(gain.shape[1]):
                total += gain[j, r] * slots.row[q, r]
            square[j, q] = square[q, j] = total
        square[j, j] += slots.variance[j]


@kernel
def factorise(square: Floats, used: int, root: Floats) -> bool:
    """Lower Cholesky factor; whether it went."""
    for j in range(used):
        total = square[j, j]
        for q in range(j):
            total -= root[j, q] * root[j, q]
        if not total > 0.0:
            return False
        root[j, j] = np.sqrt(total)
        for r in range(j + 1, used):
            total = square[r, j]
            for q in range(j):
                total -= root[r, q] * root[j, q]
            root[r, j] = total / root[j, j]
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
            of.whitened[which] = np.nan
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
    """Take off what the readings move the state by, four readings at a time.

    Parameters
    ----------
    predicted, updated : (d, n) arrays
    gain, seen : (u, d) and (u, n) arrays
        Of zeros up to the next multiple of four.
    """
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
def clear(rows: Floats, used: int) -> None:
    """Zeros behind the rows in use, up to a multiple of four."""
    for j in range(used, used + (-used) % 4):
        for r in range(rows.shape[1]):
            rows[j, r] = 0.0


@kernel
def copy(source: Floats, to: Floats) -> None:
    """Copy a matrix."""
    for r in range(source.shape[0]):
        for q in range(source.shape[1]):
            to[r, q] = source[r, q]


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
    np.dot(about[k : k + count], to_nodes, along[:count])
    away[:last] = np.dot(about[k + 1 : k + 1 + last], ends) - np.dot(about[k : k + last], onward)


@kernel
def lay_known(known: Floats, k: int, nodes: Floats) -> None:
    """Add the vertical acceleration that is known."""
    if known.shape[0] > 0:
        for m in range(3):
            nodes[nodes.size - 3 + m] += known[k, m]


@kernel
def jolt(flow: Flow, nodes: Floats, impulse: Floats) -> None:
    """What the noise of a recorded heave does to the pendulums: an impulse in mid-step, as large as the angle makes it.

    Parameters
    ----------
    impulse : (f + 2, 2 p) array
        Its last row is written.
    """
    at = impulse.shape[0] - 1
    for i in range(flow.kappa.size):
        speed = flow.kappa[i] * np.sin(nodes[3 * i + 1]) * flow.heave_noise * np.sqrt(flow.step)
        impulse[at, 2 * i], impulse[at, 2 * i + 1] = 0.5 * flow.step * speed, speed


@kernel
def sum_up(buffer: Floats, rows: int, normal: Floats) -> None:
    """Add the products of whitened errors and derivatives."""
    normal[:] += np.dot(buffer[:rows].T, buffer[:rows])


@kernel
def keep_step(keep: Kept, s: int, ahead: Floats, push: Floats) -> None:
    """Keep what a step makes of the pendulums."""
    for r in range(push.shape[1]):
        for q in range(ahead.shape[1]):
            keep.swing[s, r, q] = ahead[r, q]
        for n in range(push.shape[0]):
            keep.push[s, n, r] = push[n, r]


@kernel
def keep_readings(keep: Kept, start: int, slots: Slots, used: int, root: Floats, gain: Floats, seen: Floats) -> None:
    """Keep the whitened rows of a node's readings, their gains and errors."""
    for j in range(used):
        at = slots.reading[j] - start
        for r in range(gain.shape[1]):
            total = slots.row[j, r]
            for q in range(j):
                total -= root[j, q] * keep.row[slots.reading[q] - start, r]
            keep.row[at, r] = total / root[j, j]
            keep.gain[at, r] = gain[j, r]
        for c in range(seen.shape[1]):
            keep.errors[at, c] = -seen[j, c]


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
    keeping = keep.swing.shape[0] > 0
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
                for c in range(constants + 1):
                    buffer[rows, c] = seen[j, c]
                rows += 1
                if rows == ROWS:
                    sum_up(buffer, rows, of.normal)
                    rows = 0
            if not 1e-100 < product < 1e100:
                of.totals[0] += np.log(product)
                product = 1.0
            of.totals[1] += used
            if keeping:
                keep_readings(keep, readings.first[begin], slots, used, root, gain, seen)
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
        np.dot(ahead, state_updated, state)
        if moving:
            np.dot(ahead, updated, moved)
            np.dot(moved, ahead_columns, updated)
            add_noise(updated, flow.noise, k % UNEVEN == 0, covariance)
        if forced.size > 0:
            force_columns(flow, columns, forced, nodes, recorded, slope, k, push)
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
