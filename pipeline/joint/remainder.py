"""What n steps, the last axis, do beside their linear flow: collocation of the remainder, and its derivatives."""

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import NODES, POINTS, Flow
from synth.kernels.compiled import kernel, making_kernel

MOST_ARC, MOST_ACCELERATION = 0.5, 0.3  # rad; over reference gravity
MOST_TURNED = 1.6  # rad: beyond it the series of sine and cosine end
TURNED = 1e-9  # rad s-1: a pendulum turns at no less
ROUNDS = 4  # of the collocation; each makes what is left a hundredth in a heave of .05 g
LEFT, ANGLE, SPEED, SINE, COSINE, JOINED = range(6)
"""What `Steps.rest` holds of a pendulum at a node: the acceleration left by the linear flow, angle and speed under the
flow, sine and cosine of the angle that it is moved to (linear pendulums: that angle, and 1), and the acceleration left
along the path itself."""
SHARES = 0.5 * np.polynomial.legendre.leggauss(POINTS)[1]


class Steps(NamedTuple):
    """What n steps do; p pendulums, f forcing constants, d states, e rows of `Flow.ends`."""

    nodes: Floats  # (8 p + 8, n) each pendulum's angle at the four nodes, each one's speed, U, Z
    away: Floats  # (e, n) the path's next row less what the linear flow makes of it, see `Flow.ends`
    led: Floats  # (e, n) what it makes of it
    shift: Floats  # (8, n) what U and Z are moved by along the path itself
    rest: Floats  # (p, 6, 4, n) see `LEFT`
    by: Floats  # (p, 4, 4, n) derivative of the remaining acceleration by angle, speed, U and Z, at each node
    weight: Floats  # (p, 2, 4, n) angle and speed at the end to an acceleration at each node, that moves the others too
    factor: Floats  # (p, 16, 2, n) derivatives of angle and speed at the end to those four at each node
    swing: Floats  # (p, 2 n, d) what that adds to their derivatives by the state
    extra: Floats  # (2 p, n) what the steps add to the pendulums beside what the derivatives do
    push: Floats
    """(f + 1 + 2 + 4, 2 p, n) derivatives by the constants that move the pendulums; `extra`; by what drives Z and its
    derivative within the step where it is not recorded, or by impulses of the recording's noise."""
    room: Floats  # (8, n)


def room_for(flow: Flow, forced: int, n: int) -> Steps:
    """Room for n steps."""
    count, size, ends = flow.kappa.size, flow.noise.shape[0], flow.ends.shape[0]
    weight = np.repeat(flow.response[:, POINTS].swapaxes(1, 2)[..., None], n, axis=-1)
    push = np.zeros((forced + 1 + flow.drives, 2 * count, n))
    shapes = (
        (2 * POINTS * (count + 1), n), (ends, n), (ends, n), (2 * POINTS, n), (count, 6, POINTS, n),
        (count, 4, POINTS, n), (count, 4 * POINTS, 2, n), (count, 2 * n, size), (2 * POINTS, n),
    )  # fmt: skip
    nodes, away, led, shift, rest, by, factor, swing, room = map(np.zeros, shapes)
    return Steps(nodes, away, led, shift, rest, by, weight, factor, swing, push[forced], push, room)


@making_kernel
def multiply(one: Floats, other: Floats, product: Floats) -> None:
    """Product of matrices."""
    np.dot(one, other, product)


@kernel
def reach(rows: Floats, state: Floats, nodes: Floats) -> None:
    """Angles, speeds, U and Z at the nodes of one step, from the last column of a state, but no more than a pendulum or
    a ship can do: the flow of a state that runs away with outliers stays close to a linear one, which comes back."""
    angles = (nodes.shape[0] - 2 * POINTS) // 2
    for m in range(nodes.shape[0]):
        total = 0.0
        for q in range(rows.shape[1]):
            total += rows[m, q] * state[q, state.shape[1] - 1]
        most = MOST_ACCELERATION if m >= 2 * angles else (MOST_ARC if m < angles else np.inf)
        nodes[m, 0] = min(max(total, -most), most)


@kernel
def sine_and_cosine(angle: float) -> tuple[float, float]:
    """Both to the last digits; a swing's angles need no reduction."""
    angle = min(max(angle, -MOST_TURNED), MOST_TURNED)
    s = angle * angle
    odd = 1 / 6227020800 - s * (1 / 1307674368000 - s * (1 / 355687428096000 - s / 121645100408832000))
    even = 1 / 479001600 - s * (1 / 87178291200 - s * (1 / 20922789888000 - s / 6402373705728000))
    odd = 1 / 120 - s * (1 / 5040 - s * (1 / 362880 - s * (1 / 39916800 - s * odd)))
    even = 1 / 24 - s * (1 / 720 - s * (1 / 40320 - s * (1 / 3628800 - s * even)))
    return angle - angle * s * (1 / 6 - s * odd), 1.0 - s * (0.5 - s * even)


@kernel
def turned(sine: float, cosine: float, by: float) -> tuple[float, float]:
    """Sine and cosine of an angle a little farther on."""
    return (
        sine + by * (cosine - by * (0.5 * sine + by * cosine * (1 / 6))),
        cosine - by * (sine + by * (0.5 * cosine - by * sine * (1 / 6))),
    )


@kernel
def direction(flow: Flow, i: int, m: int, angle: float, speed: float, fade: float) -> tuple[float, float]:
    """Sign of a speed as knife-edge friction has it, v / sqrt(v^2 + fade^2), and its slope by the speed: mean over a
    node's share of the step, in which the pendulum may turn."""
    within = flow.kappa[i] * abs(angle) * flow.step * 0.5 * SHARES[m] + TURNED
    above, below = np.hypot(speed + within, fade), np.hypot(speed - within, fade)
    return (above - below) / (2.0 * within), ((speed + within) / above - (speed - within) / below) / (2.0 * within)


@kernel
def collocate(flow: Flow, plain: bool, n: int, steps: Steps) -> None:
    """Angles at the nodes under what the linear flow leaves, and that remainder; none where all is `plain`. Sine and
    cosine are taken once a node; collocation moves the angle by 1e-2 rad at most, for which three terms serve."""
    nodes, rest, moved, response = steps.nodes, steps.rest, steps.room, flow.response
    count, gravity = flow.kappa.size, flow.gravity
    horizontal, vertical = 2 * POINTS * count, 2 * POINTS * count + POINTS
    for i in range(count):
        angle, speed = POINTS * i, POINTS * (count + i)
        kappa, quadratic, dry = flow.kappa[i], flow.quadratic[i], flow.dry[i]
        for m in range(POINTS):
            for s in range(n):
                rest[i, ANGLE, m, s] = rest[i, SINE, m, s] = nodes[angle + m, s]
                rest[i, SPEED, m, s], rest[i, COSINE, m, s] = nodes[speed + m, s], 1.0
                moved[m, s] = moved[POINTS + m, s] = 0.0
            if flow.sine:
                for s in range(n):
                    rest[i, SINE, m, s], rest[i, COSINE, m, s] = sine_and_cosine(nodes[angle + m, s])
        for _ in range(0 if plain else ROUNDS):
            for m in range(POINTS):
                for s in range(n):
                    u, z, by = nodes[horizontal + m, s], nodes[vertical + m, s], moved[m, s]
                    at = nodes[angle + m, s] + by
                    if flow.sine:
                        sine, cosine = turned(rest[i, SINE, m, s], rest[i, COSINE, m, s], by)
                        rest[i, LEFT, m, s] = -kappa * ((gravity + z) * sine - gravity * at + u * (cosine - 1.0))
                    else:
                        rest[i, LEFT, m, s] = -kappa * z * at
                if quadratic != 0.0 or dry != 0.0:
                    for s in range(n):
                        at, fast = nodes[angle + m, s] + moved[m, s], nodes[speed + m, s] + moved[POINTS + m, s]
                        rest[i, LEFT, m, s] -= quadratic * abs(fast) * fast
                        if dry != 0.0:
                            rest[i, LEFT, m, s] -= dry * direction(flow, i, m, at, fast, flow.fade)[0]
            for m in range(POINTS):
                for r in range(2):
                    a, b = response[i, m, 0, r], response[i, m, 1, r]
                    c, d = response[i, m, 2, r], response[i, m, 3, r]
                    for s in range(n):
                        moved[r * POINTS + m, s] = a * rest[i, LEFT, 0, s] + b * rest[i, LEFT, 1, s]
                        moved[r * POINTS + m, s] += c * rest[i, LEFT, 2, s] + d * rest[i, LEFT, 3, s]
        for m in range(POINTS):
            for s in range(n):
                nodes[angle + m, s] += moved[m, s]
                nodes[speed + m, s] += moved[POINTS + m, s]
                rest[i, JOINED, m, s] = rest[i, LEFT, m, s]
                sine, cosine = turned(rest[i, SINE, m, s], rest[i, COSINE, m, s], moved[m, s])
                rest[i, SINE, m, s] = sine if flow.sine else nodes[angle + m, s]
                rest[i, COSINE, m, s] = cosine if flow.sine else 1.0


@kernel
def cubics(step: float, m: int) -> tuple[float, float]:
    """At a node, Hermite polynomials of value and derivative at a step's end that vanish at its start."""
    t = NODES[m]
    return t * t * (3.0 - 2.0 * t), step * t * t * (t - 1.0)


@kernel
def join_ends(flow: Flow, n: int, steps: Steps) -> None:
    """Move the remainder in steps to where a path goes that ends at its next row, not where the flow leads: the ship is
    driven within the step too, without which vibration at three times the swing's frequency errs by .02 mGal. The
    distance at the end is spread by Hermite polynomials, which vanish at the start with their first derivatives, of the
    angle the second ones too."""
    nodes, away, shift, rest, room = steps.nodes, steps.away, steps.shift, steps.rest, steps.room
    count, gravity = flow.kappa.size, flow.gravity
    horizontal, vertical = 2 * POINTS * count, 2 * POINTS * count + POINTS
    for m in range(POINTS):
        cubic, slope = cubics(flow.step, m)
        for s in range(n):
            shift[m, s] = cubic * away[0, s] + slope * away[1, s]
            shift[POINTS + m, s] = cubic * away[2, s] + slope * away[3, s]
    for i in range(count):
        kappa, angle = flow.kappa[i], POINTS * i
        for s in range(n):
            off, speed = away[4 + 2 * i, s], away[5 + 2 * i, s]
            for m in range(POINTS):
                off -= flow.response[i, POINTS, m, 0] * rest[i, LEFT, m, s]
                speed -= flow.response[i, POINTS, m, 1] * rest[i, LEFT, m, s]
            room[0, s], room[1, s] = off, flow.step * speed
            room[2, s] = -(flow.step**2) * (kappa * (gravity * off + away[0, s]) + 2.0 * flow.damping[i] * speed)
        for m in range(POINTS):
            t = NODES[m]
            of_angle = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
            of_speed, of_turn = t**3 * (-4.0 + 7.0 * t - 3.0 * t * t), t**3 * (0.5 - t + 0.5 * t * t)
            for s in range(n):
                off = of_angle * room[0, s] + of_speed * room[1, s] + of_turn * room[2, s]
                u, z, at = nodes[horizontal + m, s], nodes[vertical + m, s], nodes[angle + m, s]
                sine, cosine = rest[i, SINE, m, s], rest[i, COSINE, m, s]
                left = (gravity + z) * sine - gravity * at + u * (cosine - 1.0)
                u, z, at = u + shift[m, s], z + shift[POINTS + m, s], at + off
                sine, cosine = turned(sine, cosine, off)
                rest[i, SINE, m, s], rest[i, COSINE, m, s] = sine, cosine
                rest[i, JOINED, m, s] -= kappa * ((gravity + z) * sine - gravity * at + u * (cosine - 1.0) - left)


@kernel
def differentiate(flow: Flow, known: Floats, k: int, n: int, steps: Steps) -> None:
    """Derivatives of what the linear flow leaves in steps from k, and what they add times the state."""
    nodes, shift, rest, room, response = steps.nodes, steps.shift, steps.rest, steps.room, flow.response
    by, weight, extra, factor = steps.by, steps.weight, steps.extra, steps.factor
    count, gravity = flow.kappa.size, flow.gravity
    horizontal, vertical = 2 * POINTS * count, 2 * POINTS * count + POINTS
    for i in range(count):
        kappa, quadratic, dry, fast = flow.kappa[i], flow.quadratic[i], flow.dry[i], POINTS * (count + i)
        for m in range(POINTS):
            for s in range(n):
                u, z = nodes[horizontal + m, s] + shift[m, s], nodes[vertical + m, s] + shift[POINTS + m, s]
                if flow.sine:
                    sine, cosine = rest[i, SINE, m, s], rest[i, COSINE, m, s]
                    by[i, 0, m, s] = -kappa * ((gravity + z) * cosine - gravity - u * sine)
                    by[i, 2, m, s], by[i, 3, m, s] = -kappa * (cosine - 1.0), -kappa * sine
                else:
                    by[i, 0, m, s] = -kappa * z
            if quadratic != 0.0 or dry != 0.0:
                for s in range(n):
                    speed = nodes[fast + m, s]
                    by[i, 1, m, s] = -2.0 * quadratic * abs(speed)
                    by[i, 1, m, s] -= dry * direction(flow, i, m, nodes[POINTS * i + m, s], speed, flow.fade)[1]
        for r in range(2):
            for m in range(POINTS):
                for s in range(n):
                    weight[i, r, m, s] = response[i, POINTS, m, r]
            for _ in range(2):
                for m in range(POINTS):
                    for s in range(n):
                        room[m, s] = weight[i, r, m, s] * by[i, 0, m, s]
                        room[POINTS + m, s] = weight[i, r, m, s] * by[i, 1, m, s]
                for m in range(POINTS):
                    a, b = response[i, 0, m, 0], response[i, 1, m, 0]
                    c, d = response[i, 2, m, 0], response[i, 3, m, 0]
                    own = response[i, POINTS, m, r]
                    for s in range(n):
                        weight[i, r, m, s] = own + a * room[0, s] + b * room[1, s] + c * room[2, s] + d * room[3, s]
                    if quadratic != 0.0 or dry != 0.0:
                        a, b = response[i, 0, m, 1], response[i, 1, m, 1]
                        c, d = response[i, 2, m, 1], response[i, 3, m, 1]
                        for s in range(n):
                            weight[i, r, m, s] += a * room[4, s] + b * room[5, s] + c * room[6, s] + d * room[7, s]
            for s in range(n):
                extra[2 * i + r, s] = 0.0
            for m in range(POINTS):
                own = response[i, POINTS, m, r]
                for s in range(n):
                    beside = known[k + s, m] if known.shape[0] > 0 else 0.0
                    linear = by[i, 0, m, s] * rest[i, ANGLE, m, s] + by[i, 1, m, s] * rest[i, SPEED, m, s]
                    linear += by[i, 2, m, s] * nodes[horizontal + m, s]
                    linear += by[i, 3, m, s] * (nodes[vertical + m, s] - beside)
                    extra[2 * i + r, s] += own * rest[i, JOINED, m, s] - weight[i, r, m, s] * linear
                    for c in range(4):
                        factor[i, 4 * m + c, r, s] = weight[i, r, m, s] * by[i, c, m, s]


@kernel
def lay_known(known: Floats, k: int, n: int, nodes: Floats) -> None:
    """Add the vertical acceleration that is known in the steps from node k."""
    if known.shape[0] > 0:
        for m in range(POINTS):
            for s in range(n):
                nodes[nodes.shape[0] - POINTS + m, s] += known[k + s, m]
