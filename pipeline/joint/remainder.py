"""What a step does beside its linear flow: collocation of the remainder, and its derivatives by all constants."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import NODES, Flow
from pipeline.joint.kinds import (
    CLOCK,
    DAMPING,
    DELAY,
    DRIFT,
    DRY,
    FADE,
    GAIN,
    GRAVITY,
    HEAVE_DELAY,
    HEAVE_SCALE,
    KNOCK,
    QUADRATIC,
    RATIO,
    STEP,
    ZERO,
)
from pipeline.joint.passes import Columns, Readings
from synth.kernels.compiled import kernel, summing_kernel

MOST_ARC, MOST_ACCELERATION = 0.5, 0.3  # rad; over reference gravity
TURNED, FADED = 1e-9, 1e-4  # rad s-1: a pendulum turns at no less; change of a fading speed for its derivative


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
    extra: Floats,
) -> None:
    """What the constants `forced` add to the derivatives of the pendulums during the step from node k, (f, 2 p).

    What a knock in that step moves the pendulums by is added to `extra`, (2 p,).
    """
    count, time = flow.kappa.size, k * flow.step
    at = (0.5 - np.sqrt(15.0) / 10.0, 0.5, 0.5 + np.sqrt(15.0) / 10.0)
    for n in range(forced.size):
        c = forced[n]
        for r in range(2 * count):
            push[n, r] = 0.0
        if columns.kind[c] == KNOCK:
            i, left = columns.member[c], time + flow.step - columns.centre[c]
            if 0.0 < left <= flow.step:
                own = np.sqrt(flow.kappa[i] * flow.gravity)
                push[n, 2 * i], push[n, 2 * i + 1] = np.sin(own * left) / own, np.cos(own * left)
                extra[2 * i] += columns.value[c] * push[n, 2 * i]
                extra[2 * i + 1] += columns.value[c] * push[n, 2 * i + 1]
            continue
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
                    fade = flow.fade if flow.dry[i] != 0.0 else columns.centre[c]
                    force = -direction(flow, i, m, angle, speed, fade)[0]
                elif kind == FADE:
                    more = FADED * (abs(flow.fade) + TURNED)
                    force = direction(flow, i, m, angle, speed, flow.fade)[0]
                    force -= direction(flow, i, m, angle, speed, flow.fade + more)[0]
                    force *= flow.dry[i] / more
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
            seen[j, c] += readings.value[which]
        elif kind == STEP and time >= columns.centre[c]:
            seen[j, c] += 1.0
        elif kind == DELAY or (kind == CLOCK and time >= columns.centre[c]):
            for i in range(readings.combination.shape[1]):
                seen[j, c] -= readings.combination[trace, i] * state[2 * i + 1, last]


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
