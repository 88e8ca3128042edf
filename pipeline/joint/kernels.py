"""Filter and smoother over the lattice: prediction errors and their derivatives, the smoothed path by adjoints.

The state's covariance holds what is random (ship, kicks); whatever is a constant (gravity, damping, zeros, the start of
the free swing) is a row below it: the derivative of the prediction, taken through the same gain. One sweep then gives
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
ROWS = 256  # prediction errors that are multiplied out at once
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
        s: of GRAVITY a hat's, width 0: the whole record; of DRIFT centre and scale; of STEP and CLOCK their time.
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
def reach(columns: Floats, about: Floats, k: int, whole: Floats, known: Floats, nodes: Floats) -> None:
    """Angles, speeds, U and Z at the nodes of step k, from a path or else from the state, the last row of `whole`.

    A state that runs away with wild readings is taken for no more than a pendulum or a ship can do: the flow stays
    close to a linear one, which comes back.
    """
    if about.shape[0] > 0:
        reach_nodes(columns, about, k, nodes)
    else:
        reach_nodes(columns, whole, whole.shape[0] - 1, nodes)
        for m in range(nodes.size):
            most = MOST_ACCELERATION if m >= nodes.size - 6 else (MOST_ARC if m < (nodes.size - 6) // 2 else np.inf)
            nodes[m] = min(max(nodes[m], -most), most)
    if known.shape[0] > 0:
        for m in range(3):
            nodes[nodes.size - 3 + m] += known[k, m]


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
                rest[i, m, 2] -= quadratic * abs(nodes[speed + m]) * nodes[speed + m] + dry * np.sign(nodes[speed + m])
        f0, f1, f2 = rest[i, 0, 2], rest[i, 1, 2], rest[i, 2, 2]
        moved0 = flow.response[i, 0, 0, 0] * f0 + flow.response[i, 0, 1, 0] * f1 + flow.response[i, 0, 2, 0] * f2
        moved1 = flow.response[i, 1, 0, 0] * f0 + flow.response[i, 1, 1, 0] * f1 + flow.response[i, 1, 2, 0] * f2
        moved2 = flow.response[i, 2, 0, 0] * f0 + flow.response[i, 2, 1, 0] * f1 + flow.response[i, 2, 2, 0] * f2
    nodes[angle] += moved0
    nodes[angle + 1] += moved1
    nodes[angle + 2] += moved2


@kernel
def join_ends(flow: Flow, about: Floats, k: int, nodes: Floats, rest: Floats) -> None:
    """Move the remainder in step k to where a path goes that ends at its next row, not where the flow leads.

    What drives the ship acts within the step too. The flow alone takes the ship's motion for a fading one, which errs
    by .02 mGal where it vibrates at three times the swing's frequency. The distance at the end is spread over the step
    by Hermite polynomials that vanish at its start with their first derivatives, of the angle the second ones too.

    Parameters
    ----------
    about : (k, d) array
    nodes : (6 p + 6,) array
        Angles moved by `collocate`, speeds, U and Z at the nodes, under the flow.
    rest : (p, 3, 4) array, changed
        As `collocate` left it; its remaining acceleration is moved.
    """
    count, size = flow.kappa.size, about.shape[1]
    two, end, gravity = 2 * count, 6 * count + 6, flow.gravity
    u = u_speed = z = z_speed = 0.0
    for r in range(two, size):
        off = about[k + 1, r]
        for q in range(two, size):
            off -= flow.rows[end + r, q] * about[k, q]
        u, u_speed = u + flow.horizontal[0, r] * off, u_speed + flow.horizontal[1, r] * off
        z, z_speed = z + flow.vertical[0, r] * off, z_speed + flow.vertical[1, r] * off
    for i in range(count):
        kappa, angle, speed = flow.kappa[i], about[k + 1, 2 * i], about[k + 1, 2 * i + 1]
        for q in range(size):
            angle -= flow.rows[end + 2 * i, q] * about[k, q]
            speed -= flow.rows[end + 2 * i + 1, q] * about[k, q]
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
    for q in range(size):
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
    state: Floats,
) -> None:
    """What the constants `forced` add to the derivatives during the step from node k, (c + 1, d)."""
    count, time = flow.kappa.size, k * flow.step
    at = (0.5 - np.sqrt(15.0) / 10.0, 0.5, 0.5 + np.sqrt(15.0) / 10.0)
    for n in range(forced.size):
        c = forced[n]
        kind, width = columns.kind[c], columns.width[c]
        if kind == GRAVITY and width > 0.0 and abs(time + 0.5 * flow.step - columns.centre[c]) > width + flow.step:
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
                    force = -np.sign(speed)
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
                        force *= max(0.0, 1.0 - abs(time + at[m] * flow.step - columns.centre[c]) / width)
                state[c, 2 * i] += flow.response[i, 3, m, 0] * force
                state[c, 2 * i + 1] += flow.response[i, 3, m, 1] * force


@kernel
def derive_errors(
    readings: Readings,
    columns: Columns,
    of_traces: np.ndarray,
    which: int,
    time: float,
    state: Floats,
    errors: Floats,
    j: int,
) -> None:
    """What the constants `of_traces` of a trace add to the derivatives of a prediction error.

    On entry row j of `errors`, (u, c + 1), holds what the reading's row makes of the state, with the sign of the
    error; last: the error itself, to which the reading is still to be added.
    """
    last, trace = errors.shape[1] - 1, readings.trace[which]
    for n in range(of_traces.size):
        c = of_traces[n]
        kind = columns.kind[c]
        own = columns.member[c]
        if (own >= 0 and own != trace) or (own < 0 and trace >= readings.combination.shape[0]):
            continue
        if kind == ZERO:
            errors[j, c] -= 1.0
        elif kind == DRIFT:
            errors[j, c] -= (time - columns.centre[c]) / columns.width[c]
        elif kind == GAIN:
            errors[j, c] += errors[j, last]
        elif kind == STEP and time >= columns.centre[c]:
            errors[j, c] -= 1.0
        elif kind == DELAY or (kind == CLOCK and time >= columns.centre[c]):
            for i in range(readings.combination.shape[1]):
                errors[j, c] += readings.combination[trace, i] * state[last, 2 * i + 1]


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
    whole : (s, d + c + 1, d) array
        Predicted covariance, derivatives of the state by the constants, and the state.
    swing : (s, 2 p, d) array
        Derivative's rows of the step that begins at the node.
    row, gain : (r, d) arrays
        Whitened rows of the stretch's readings in the state, and what they move it by; 0 where left out.
    errors : (r, c + 1) array
        Derivatives of the whitened prediction errors, and these; NaN where left out.
    """

    whole: Floats
    swing: Floats
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


@summing_kernel
def look(slots: Slots, used: int, state: Floats, errors: Floats) -> None:
    """What the readings' rows make of the state, (c + 1, d), with the sign of the error."""
    for c in range(errors.shape[1]):
        for j in range(used):
            total = 0.0
            for q in range(state.shape[1]):
                total += slots.row[j, q] * state[c, q]
            errors[j, c] = -total


@kernel
def pull_aside(slots: Slots, used: int, readings: Readings, rest: Floats, errors: Floats) -> None:
    """Take from the prediction errors what the linear flow leaves out between node and reading."""
    last = errors.shape[1] - 1
    for j in range(used):
        trace = slots.trace[j]
        if trace < readings.combination.shape[0]:
            for i in range(rest.shape[0]):
                moved = slots.pull[j, 0] * rest[i, 0, 2] + slots.pull[j, 1] * rest[i, 1, 2]
                moved += slots.pull[j, 2] * rest[i, 2, 2]
                errors[j, last] -= readings.combination[trace, i] * moved


@summing_kernel
def project(slots: Slots, used: int, covariance: Floats, gain: Floats) -> None:
    """Covariance of the readings' predictions with the state, into `gain`."""
    size = gain.shape[1]
    for j in range(used):
        for r in range(size):
            gain[j, r] = slots.row[j, 0] * covariance[0, r]
        for q in range(1, size):
            weight = slots.row[j, q]
            for r in range(size):
                gain[j, r] += weight * covariance[q, r]


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
def set_aside(slots: Slots, used: int, gate: float, of: Pass, errors: Floats, gain: Floats) -> int:
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
        for c in range(errors.shape[1]):
            errors[stay, c] = errors[j, c]
        stay += 1
    return stay


@summing_kernel
def lift(predicted: Floats, pull: Floats, gain: Floats, used: int, first: int, updated: Floats) -> None:
    """Add to rows from `first` on what the readings move them by, two readings at a time.

    Parameters
    ----------
    predicted, updated : (n, d) arrays
    pull : (u, n) array
    gain : (u, d) array
        One row more than readings where these are odd, of zeros in `pull`.
    """
    for r in range(first, predicted.shape[0]):
        a, b = pull[0, r], pull[1, r]
        for q in range(predicted.shape[1]):
            updated[r, q] = predicted[r, q] + a * gain[0, q] + b * gain[1, q]
    for j in range(2, used, 2):
        for r in range(first, predicted.shape[0]):
            a, b = pull[j, r], pull[j + 1, r]
            for q in range(predicted.shape[1]):
                updated[r, q] += a * gain[j, q] + b * gain[j + 1, q]


@kernel
def copy(source: Floats, first: int, to: Floats) -> None:
    """Copy the rows from `first` on."""
    for r in range(first, source.shape[0]):
        for q in range(source.shape[1]):
            to[r, q] = source[r, q]


@kernel
def even_out(moved: Floats, noise: Floats, covariance: Floats) -> None:
    """Covariance at the next node: the moved one, made symmetric, and the process noise."""
    for r in range(noise.shape[0]):
        for q in range(r + 1):
            mean = 0.5 * (moved[r, q] + moved[q, r]) + noise[r, q]
            covariance[r, q] = covariance[q, r] = mean


@kernel
def loosen(flow: Flow, i: int, covariance: Floats) -> None:
    """Let pendulum i be anywhere within its swing."""
    covariance[2 * i, 2 * i] += ANYWHERE**2
    covariance[2 * i + 1, 2 * i + 1] += flow.kappa[i] * ANYWHERE**2


@kernel
def shake(flow: Flow, nodes: Floats, covariance: Floats) -> None:
    """Noise of a recorded heave: an impulse in mid-step, as large as the angle makes it."""
    count, step = flow.kappa.size, flow.step
    for i in range(count):
        one = flow.kappa[i] * np.sin(nodes[3 * i + 1]) * flow.heave_noise * np.sqrt(step)
        for j in range(count):
            product = one * flow.kappa[j] * np.sin(nodes[3 * j + 1]) * flow.heave_noise * np.sqrt(step)
            covariance[2 * i, 2 * j] += 0.25 * step**2 * product
            covariance[2 * i, 2 * j + 1] += 0.5 * step * product
            covariance[2 * i + 1, 2 * j] += 0.5 * step * product
            covariance[2 * i + 1, 2 * j + 1] += product


@kernel
def sum_up(buffer: Floats, rows: int, normal: Floats) -> None:
    """Add the products of whitened errors and derivatives."""
    normal[:] += np.dot(buffer[:rows].T, buffer[:rows])


@kernel
def keep_prediction(keep: Kept, s: int, whole: Floats) -> None:
    """Keep what is predicted for a node; `whole` as in `sweep`."""
    for r in range(whole.shape[0]):
        for q in range(whole.shape[1]):
            keep.whole[s, r, q] = whole[r, q]


@kernel
def keep_readings(keep: Kept, start: int, slots: Slots, used: int, root: Floats, gain: Floats, errors: Floats) -> None:
    """Keep the whitened rows of a node's readings, their gains and errors."""
    size = gain.shape[1]
    for j in range(used):
        at = slots.reading[j] - start
        for r in range(size):
            total = slots.row[j, r]
            for q in range(j):
                total -= root[j, q] * keep.row[slots.reading[q] - start, r]
            keep.row[at, r] = total / root[j, j]
            keep.gain[at, r] = gain[j, r]
        for c in range(errors.shape[1]):
            keep.errors[at, c] = errors[j, c]


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

    Covariance and derivatives stand one upon the other, (d + c + 1, d), each derivative a row: the covariance's rows
    are left alone once the gain has settled.

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
    wide, last = size + constants + 1, size + constants
    most = 2
    for k in range(begin, end):
        most = max(most, readings.first[k + 1] - readings.first[k] + 1)
    predicted, updated, moved = np.empty((wide, size)), np.empty((wide, size)), np.empty((wide, size))
    predicted[:size], predicted[size:] = of.covariance, of.state.T
    covariance, back, squared = predicted[:size], moved[:size], np.empty((size, size))
    state, state_updated = predicted[size:], updated[size:]
    ahead = flow.rows[between:].copy()
    ahead_columns, to_nodes = np.ascontiguousarray(ahead.T), np.ascontiguousarray(flow.rows[:between].T)
    nodes, extra, rest, by = np.zeros(between), np.zeros(two), np.zeros((count, 3, 4)), np.zeros((3, 4))
    slots = Slots(
        np.zeros(most, dtype=np.int64), np.full(most, -1), np.zeros(most), np.zeros(most), np.zeros((most, size)),
        np.zeros((most, 3)),
    )  # fmt: skip
    square, root = np.zeros((most, most)), np.zeros((most, most))
    gain, old_gain = np.zeros((most, size)), np.zeros((most, size))
    errors, pull = np.zeros((most, constants + 1)), np.zeros((most, wide))
    buffer, rows = np.zeros((ROWS, constants + 1)), 0
    forced = np.flatnonzero((columns.kind > START) & (columns.kind < ZERO))
    of_traces = np.flatnonzero(columns.kind >= ZERO)
    plain = not flow.sine and not np.any(flow.quadratic) and not np.any(flow.dry) and known.shape[0] == 0
    keeping = keep.whole.shape[0] > 0
    joined = flow.sine and about.shape[0] > 0
    asked = not plain or forced.size > 0 or flow.heave_noise > 0.0
    moving, before, product, at_break = True, -1, 1.0, 0
    for k in range(begin, end):
        while at_break < breaks.shape[0] and breaks[at_break, 0] <= k:
            if breaks[at_break, 0] == k:
                loosen(flow, breaks[at_break, 1], predicted)
                moving = True
            at_break += 1
        used = pick(readings, k, slots, of)
        alike = recognise(readings, slots, used) and used == before
        if not alike:
            for j in range(used):
                row_of(flow, readings, slots.reading[j], slots, j)
        before, moving = used, moving or not alike
        if keeping:
            keep_prediction(keep, k - begin, predicted)
        if asked:
            reach(to_nodes, about, k, predicted, known, nodes)
        look(slots, used, state, errors)
        if not plain:
            for i in range(count):
                collocate(flow, i, nodes, rest)
            pull_aside(slots, used, readings, rest, errors)
        for j in range(used):
            if of_traces.size > 0:
                derive_errors(
                    readings, columns, of_traces, slots.reading[j], k * flow.step + slots.offset[j], state, errors, j
                )
            errors[j, constants] += readings.value[slots.reading[j]]
        if moving:
            project(slots, used, covariance, gain)
            square_up(slots, used, gain, square)
        over = False
        for j in range(used):
            deviation = np.sqrt(square[j, j])
            of.errors[slots.reading[j]] = errors[j, constants] / deviation
            over = over or (gate > 0.0 and abs(errors[j, constants]) > gate * deviation)
        if over:
            if not moving:  # a reading over the gate lets the gain move
                moving = True
                project(slots, used, covariance, gain)
            used, alike, before = set_aside(slots, used, gate, of, errors, gain), False, -1
            square_up(slots, used, gain, square)
        change, first = 1.0, 0 if moving else size
        if used > 0:
            if moving:
                if not factorise(square, used, root):
                    return False
                substitute(root, used, gain)
                if not flow.varying:
                    change = change_of(gain, used, old_gain, covariance)
                for j in range(used):
                    for r in range(size):
                        pull[j, r] = -gain[j, r]
            substitute(root, used, errors)
            for j in range(used):
                product *= root[j, j]
                of.whitened[slots.reading[j]], of.scale[slots.reading[j]] = errors[j, constants], root[j, j]
                for c in range(constants + 1):
                    pull[j, size + c] = buffer[rows, c] = errors[j, c]
                rows += 1
                if rows == ROWS:
                    sum_up(buffer, rows, of.normal)
                    rows = 0
            if used % 2 > 0:
                for r in range(wide):
                    pull[used, r] = 0.0
            lift(predicted, pull, gain, used, first, updated)
            if not 1e-100 < product < 1e100:
                of.totals[0] += np.log(product)
                product = 1.0
            of.totals[1] += used
            if keeping:
                keep_readings(keep, readings.first[begin], slots, used, root, gain, errors)
        else:
            copy(predicted, first, updated)
        if k + 1 == readings.first.size - 1:
            copy(updated, first, predicted)
            break
        # to the next node
        settling = moving and alike and not flow.varying and change < SETTLED and used > 0
        if asked and about.shape[0] == 0:
            reach(to_nodes, about, k, updated, known, nodes)
            if not plain:
                for i in range(count):
                    collocate(flow, i, nodes, rest)
        if joined:
            join_ends(flow, about, k, nodes, rest)
        if not plain:
            for i in range(count):
                differentiate(flow, i, known, k, nodes, rest, by, extra)
                tilt(flow, i, by, ahead, ahead_columns)
        if moving:
            np.dot(updated, ahead_columns, moved)
            np.dot(ahead, back, squared)
            even_out(squared, flow.noise, covariance)
            if flow.heave_noise > 0.0:
                shake(flow, nodes, covariance)
            copy(moved, size, predicted)
        else:
            np.dot(state_updated, ahead_columns, state)
        for r in range(two):
            predicted[last, r] += extra[r]
        if forced.size > 0:
            force_columns(flow, columns, forced, nodes, recorded, slope, k, state)
        if keeping:
            for r in range(two):
                for q in range(size):
                    keep.swing[k - begin, r, q] = ahead[r, q]
        moving = moving and not settling
    sum_up(buffer, rows, of.normal)
    of.totals[0] += np.log(product)
    of.state[:], of.covariance[:] = state.T, covariance
    return True


@kernel
def smooth(
    flow: Flow,
    readings: Readings,
    begin: int,
    end: int,
    change: Floats,
    whitened: Floats,
    keep: Kept,
    adjoint: Floats,
    path: Floats,
) -> None:
    """Smoothed states of a stretch at changed constants, by adjoints, backwards (Bryson and Frazier).

    Parameters
    ----------
    change : (c + 1,) array
        Of the constants since the sweep; last: 1.
    whitened : (r,) array
        Prediction errors at the changed constants.
    adjoint : (d,) array, changed
        Of the predicted state behind the stretch; of its first node on return.
    path : (k, d) array, out
        Smoothed states; rows `begin` to `end` are written.
    """
    two, size, start = keep.swing.shape[1], adjoint.size, readings.first[begin]
    ship = flow.rows[flow.rows.shape[0] - size + two :].copy()
    later = np.zeros(size)
    for k in range(end - 1, begin - 1, -1):
        s = k - begin
        if k + 2 < readings.first.size:
            for q in range(size):
                later[q], adjoint[q] = adjoint[q], 0.0
            for r in range(two):
                for q in range(size):
                    adjoint[q] += later[r] * keep.swing[s, r, q]
            for r in range(size - two):
                for q in range(two, size):
                    adjoint[q] += later[two + r] * ship[r, q]
        gather_readings(readings, k, start, whitened, keep, adjoint, later)
        weigh(keep.whole, s, adjoint, change, later)
        for q in range(size):
            path[k, q] = later[q]


@summing_kernel
def weigh(whole: Floats, s: int, adjoint: Floats, change: Floats, state: Floats) -> None:
    """The smoothed state of a kept node: prediction at the changed constants, and covariance times adjoint."""
    size = adjoint.size
    for q in range(size):
        state[q] = 0.0
    for r in range(size):
        for q in range(size):
            state[q] += adjoint[r] * whole[s, r, q]
    for c in range(change.size):
        for q in range(size):
            state[q] += change[c] * whole[s, size + c, q]


@kernel
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
