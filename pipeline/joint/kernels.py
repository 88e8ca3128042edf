"""Filter and smoother over the lattice: prediction errors and their derivatives, the smoothed path by adjoints.

The state's covariance holds what is random (ship, kicks); whatever is a constant (gravity, damping, zeros, the start of
the free swing) is a column beside it: the derivative of the prediction, taken through the same gain. One sweep then
gives the normal matrix of all constants, whose priors can be chosen afterwards (de Jong 1991). With even sampling the gain
settles and is kept; a gap lets it move again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.flow import Flow
from synth.kernels.compiled import kernel

ROWS = 256  # prediction errors that are multiplied out at once
SETTLED = 2e-6  # relative change of a gain from node to node below which it is kept

# kinds of columns
START, GRAVITY, DAMPING, QUADRATIC, DRY, HEAVE_SCALE, HEAVE_DELAY, ZERO, DRIFT, GAIN, DELAY, STEP, KNOCK = range(13)


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
    kind, index : (c,) arrays of int
        Kind as above; pendulum (-1: all), trace or state that it belongs to.
    centre, width : (c,) arrays
        s: of GRAVITY a hat's, width 0: the whole record; of DRIFT centre and scale; of STEP and KNOCK its time.
    """

    kind: np.ndarray
    index: np.ndarray
    centre: Floats
    width: Floats


@kernel
def row_of(flow: Flow, readings: Readings, which: int, row: Floats) -> None:
    """Row of a reading in the state: the linear flow to its own time."""
    row[:] = 0.0
    trace, tau = readings.trace[which], readings.offset[which]
    if trace >= readings.combination.shape[0]:
        if trace == readings.combination.shape[0]:
            for q in range(row.size):
                row[q] = flow.rates[0, q] + tau * flow.rates[1, q]
        else:
            for q in range(row.size):
                row[q] = flow.heave[0, q] + tau * flow.heave[1, q]
        return
    for i in range(flow.kappa.size):
        weight = readings.combination[trace, i]
        if weight == 0.0:
            continue
        if tau == 0.0:
            row[2 * i] = weight
            continue
        own2 = flow.kappa[i] * flow.gravity - flow.damping[i] ** 2
        own, fade = np.sqrt(own2), np.exp(-flow.damping[i] * tau)
        moved = fade * np.sin(own * tau) / own
        row[2 * i] = weight * (fade * np.cos(own * tau) + flow.damping[i] * moved)
        row[2 * i + 1] = weight * moved
        forced = -weight * flow.kappa[i] * tau * tau
        zeroth, first, second = forced * (0.5 - own2 * tau * tau / 24.0), forced * tau / 6.0, forced * tau * tau / 24.0
        for q in range(2 * flow.kappa.size, row.size):
            row[q] += zeroth * flow.rates[0, q] + first * flow.rates[1, q] + second * flow.rates[2, q]


@kernel
def bend(flow: Flow, nodes: Floats, known: Floats, extra: Floats, slopes: Floats, scratch: Floats) -> None:
    """What the linear flow leaves: its effect at the end of a step, and its derivative by the rows of `flow.rows`.

    Sine and cosine are taken once a node; collocation moves the angle by 1e-5 rad at most, for which two terms serve.

    Parameters
    ----------
    nodes : (6 p + 6,) array, changed
        Angles, speeds, U and Z at the nodes by the linear flow; angles become those of the remainder, Z the whole.
    known : (3,) array
        Z at the nodes beside the states: recorded heave, change of gravity.
    extra : (2 p,) array, out
    slopes : (2 p, 6 p + 6) array, out
    scratch : (3, 3) array
    """
    count = flow.kappa.size
    horizontal, vertical = 6 * count, 6 * count + 3
    still = True
    for m in range(3):
        nodes[vertical + m] += known[m]
        still = still and nodes[vertical + m] == 0.0
    sine, cosine, force = scratch[0], scratch[1], scratch[2]
    for i in range(count):
        extra[2 * i] = extra[2 * i + 1] = 0.0
        if not flow.sine and still and flow.quadratic[i] == 0.0 and flow.dry[i] == 0.0:
            continue
        kappa, gravity, answer = flow.kappa[i], flow.gravity, flow.response[i]
        angle, speed = 3 * i, 3 * (count + i)
        for m in range(3):
            sine[m], cosine[m] = np.sin(nodes[angle + m]), np.cos(nodes[angle + m])
        moved0 = moved1 = moved2 = 0.0
        for _ in range(3):
            for m in range(3):
                by = moved0 if m == 0 else (moved1 if m == 1 else moved2)
                u, z, at = nodes[horizontal + m], nodes[vertical + m], nodes[angle + m] + by
                if flow.sine:
                    s = sine[m] + by * (cosine[m] - 0.5 * by * sine[m])
                    c = cosine[m] - by * (sine[m] + 0.5 * by * cosine[m])
                    force[m] = -kappa * ((gravity + z) * s - gravity * at + u * (c - 1.0))
                else:
                    force[m] = -kappa * z * at
                force[m] -= flow.quadratic[i] * abs(nodes[speed + m]) * nodes[speed + m]
                force[m] -= flow.dry[i] * np.sign(nodes[speed + m])
            moved0 = answer[0, 0, 0] * force[0] + answer[0, 1, 0] * force[1] + answer[0, 2, 0] * force[2]
            moved1 = answer[1, 0, 0] * force[0] + answer[1, 1, 0] * force[1] + answer[1, 2, 0] * force[2]
            moved2 = answer[2, 0, 0] * force[0] + answer[2, 1, 0] * force[1] + answer[2, 2, 0] * force[2]
        nodes[angle] += moved0
        nodes[angle + 1] += moved1
        nodes[angle + 2] += moved2
        for m in range(3):
            u, z = nodes[horizontal + m], nodes[vertical + m]
            if flow.sine:
                by_angle = -kappa * ((gravity + z) * cosine[m] - gravity - u * sine[m])
                by_u, by_z = -kappa * (cosine[m] - 1.0), -kappa * sine[m]
            else:
                by_angle, by_u, by_z = -kappa * z, 0.0, 0.0
            by_speed = -2.0 * flow.quadratic[i] * abs(nodes[speed + m])
            for r in range(2):
                weight = answer[3, m, r]
                extra[2 * i + r] += weight * force[m]
                slopes[2 * i + r, angle + m] = weight * by_angle
                slopes[2 * i + r, speed + m] = weight * by_speed
                slopes[2 * i + r, horizontal + m] = weight * by_u
                slopes[2 * i + r, vertical + m] = weight * by_z


@kernel
def force_columns(
    flow: Flow, columns: Columns, nodes: Floats, recorded: Floats, slope: Floats, time: float, lead: int, state: Floats
) -> None:
    """What the constants add to the derivatives during a step that began at `time`; they begin at column `lead`."""
    count = flow.kappa.size
    at = (0.5 - np.sqrt(15.0) / 10.0, 0.5, 0.5 + np.sqrt(15.0) / 10.0)
    for c in range(columns.kind.size):
        kind = columns.kind[c]
        if kind == START or kind >= ZERO:
            continue
        width = columns.width[c]
        if kind == GRAVITY and width > 0.0 and abs(time + 0.5 * flow.step - columns.centre[c]) > width + flow.step:
            continue
        for i in range(count):
            if columns.index[c] >= 0 and columns.index[c] != i:
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
                        lever *= 1.0 - square * (1.0 - square * (1.0 - square / 42.0) / 20.0) / 6.0
                    force = -flow.kappa[i] * lever
                    if kind == HEAVE_SCALE:
                        force *= recorded[m]
                    elif kind == HEAVE_DELAY:
                        force *= slope[m]
                    elif width > 0.0:
                        force *= max(0.0, 1.0 - abs(time + at[m] * flow.step - columns.centre[c]) / width)
                state[2 * i, lead + c] += flow.response[i, 3, m, 0] * force
                state[2 * i + 1, lead + c] += flow.response[i, 3, m, 1] * force


@kernel
def derive_errors(
    readings: Readings, columns: Columns, which: int, time: float, lead: int, state: Floats, errors: Floats
) -> None:
    """What the constants of a trace add to the derivatives of a reading's prediction error; last: the error itself.

    On entry `errors` holds what the rows make of the state, (c + 1,), with the sign of the prediction.
    """
    last = errors.size - 1
    for c in range(errors.size):
        errors[c] = -errors[c]
    trace = readings.trace[which]
    for c in range(columns.kind.size):
        kind = columns.kind[c]
        if kind < ZERO or kind == KNOCK or columns.index[c] != trace:
            continue
        if kind == ZERO:
            errors[c] -= 1.0
        elif kind == DRIFT:
            errors[c] -= (time - columns.centre[c]) / columns.width[c]
        elif kind == GAIN:
            errors[c] += errors[last]
        elif kind == STEP and time >= columns.centre[c]:
            errors[c] -= 1.0
        elif kind == DELAY:
            for i in range(readings.combination.shape[1]):
                errors[c] += readings.combination[trace, i] * state[2 * i + 1, lead + last]
    errors[last] += readings.value[which]


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
    whitened : (r,) array
        The same, independent of each other; NaN where the reading was left out.
    """

    state: Floats
    covariance: Floats
    normal: Floats
    totals: Floats
    errors: Floats
    whitened: Floats


class Kept(NamedTuple):
    """What the smoother needs of a stretch of s nodes and its readings; empty arrays: nothing is kept.

    Attributes
    ----------
    state : (s, d) array
        Predicted.
    covariance : (s, d, d) array
        Predicted.
    swing : (s, 2 p, d) array
        Derivative's rows of the step that begins at the node.
    row, gain : (r, d) arrays
        Whitened rows of the stretch's readings in the state, and what they move it by; 0 where left out.
    """

    state: Floats
    covariance: Floats
    swing: Floats
    row: Floats
    gain: Floats


@kernel
def add(to: Floats, what: Floats) -> None:
    """Add in place."""
    for r in range(to.shape[0]):
        for c in range(to.shape[1]):
            to[r, c] += what[r, c]


@kernel
def whiten(square: Floats, used: int, rows: Floats) -> bool:
    """Cholesky factor in place of `square` (lower), and its inverse applied to the rows; whether it went."""
    for j in range(used):
        total = square[j, j]
        for q in range(j):
            total -= square[j, q] * square[j, q]
        if not total > 0.0:
            return False
        square[j, j] = np.sqrt(total)
        for r in range(j + 1, used):
            total = square[r, j]
            for q in range(j):
                total -= square[r, q] * square[j, q]
            square[r, j] = total / square[j, j]
    substitute(square, used, rows)
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
def sweep(
    flow: Flow,
    readings: Readings,
    columns: Columns,
    known: Floats,
    recorded: Floats,
    slope: Floats,
    about: Floats,
    begin: int,
    end: int,
    gate: float,
    of: Pass,
    keep: Kept,
) -> bool:
    """Filter nodes `begin` to `end`, with derivatives by all constants; whether every covariance stayed positive.

    Parameters
    ----------
    known, recorded, slope : (k, 3) arrays
        At the nodes of each step: Z that acts beside the states; recorded heave; its derivative with time. Each may be
        empty where nothing asks for it.
    about : (k, d) array
        Path about which the flow is linearised; empty: the prediction itself.
    gate : float
        Readings whose error is larger than so many deviations are left out; 0: none.
    """
    count, size = flow.kappa.size, of.state.shape[0]
    two, constants = 2 * count, of.state.shape[1] - 1
    before, wide = 6 * count + 6, size + constants + 1
    moving = True
    most = 1
    for k in range(begin, end):
        most = max(most, readings.first[k + 1] - readings.first[k])
    # covariance and derivatives side by side while the gain moves, the latter alone once it has settled
    both, alone = np.empty((size, wide)), np.empty((size, constants + 1))
    both[:, :size], both[:, size:] = of.covariance, of.state
    both_rows, alone_rows = np.empty((before + size, wide)), np.empty((before + size, constants + 1))
    predicted, flat = of.covariance.copy(), np.empty((size, size))
    back, back_rows = np.empty((size, size)), np.empty((size, before))
    to_end, to_rows = np.ascontiguousarray(flow.rows[before:].T), np.ascontiguousarray(flow.rows[:before].T)
    nodes, base_rows, extra = np.zeros(before), np.zeros(before + size), np.zeros(two)
    slopes, back_bent = np.zeros((two, before)), np.empty((size, two))
    bent_wide, bent_alone = np.empty((two, wide)), np.empty((two, constants + 1))
    plain = not flow.sine and not np.any(flow.quadratic) and not np.any(flow.dry) and known.shape[0] == 0
    row, square, root = np.zeros((most, size)), np.zeros((most, most)), np.zeros((most, most))
    gain, old_gain = np.zeros((most, size)), np.zeros((most, size))
    seen_both, seen_alone = np.empty((most, wide)), np.empty((most, constants + 1))
    pulled, moved_both, moved_alone = np.empty((most, wide)), np.empty((size, wide)), np.empty((size, constants + 1))
    errors = np.zeros((most, constants + 1))
    trace, offset, variance = np.full(most, -1), np.zeros(most), np.zeros(most)
    index, slots = np.zeros(most, dtype=np.int64), -1
    sine = np.zeros(count)
    buffer, rows = np.zeros((ROWS, constants + 1)), 0
    nothing, scratch = np.zeros(3), np.empty((3, 3))
    keeping = keep.state.shape[0] > 0
    for k in range(begin, end):
        time = k * flow.step
        start, used, over = readings.first[k], 0, False
        for which in range(start, readings.first[k + 1]):
            of.errors[which] = of.whitened[which] = np.nan
            if readings.variance[which] < np.inf:
                index[used] = which
                used += 1
        alike = slots == used
        for j in range(used):
            which = index[j]
            if not (alike and trace[j] == readings.trace[which] and offset[j] == readings.offset[which]):
                alike = False
                trace[j], offset[j], variance[j] = readings.trace[which], readings.offset[which], 0.0
                row_of(flow, readings, which, row[j])
            if variance[j] != readings.variance[which]:
                alike, variance[j] = False, readings.variance[which]
        slots = used
        if not (alike or moving):
            moving = True
            both[:, :size], both[:, size:] = predicted, alone
        for attempt in range(2):
            x = both if moving else alone
            lead = size if moving else 0
            for c in range(constants):
                if attempt == 0 and columns.kind[c] == KNOCK and columns.centre[c] == k:
                    x[columns.index[c], lead + c] += 1.0
            if keeping:
                keep.state[k - begin] = x[:, lead + constants]
                keep.covariance[k - begin] = both[:, :size] if moving else predicted
            if used == 0:
                break
            seen = seen_both if moving else seen_alone
            np.dot(row[:used], x, seen[:used])
            for j in range(used):
                for c in range(constants + 1):
                    errors[j, c] = seen[j, lead + c]
                derive_errors(readings, columns, index[j], time + offset[j], lead, x, errors[j])
            if moving:
                for j in range(used):
                    for r in range(size):
                        gain[j, r] = seen[j, r]
                    for q in range(j + 1):
                        total = 0.0
                        for r in range(size):
                            total += seen[j, r] * row[q, r]
                        square[j, q] = square[q, j] = total
                    square[j, j] += variance[j]
            over = False
            for j in range(used):
                deviation = np.sqrt(square[j, j])
                of.errors[index[j]] = errors[j, constants] / deviation
                over = over or (gate > 0.0 and abs(errors[j, constants]) > gate * deviation)
            if not over or moving:
                break
            moving = True  # a reading over the gate lets the gain move
            both[:, :size], both[:, size:] = predicted, alone
        kept_used = used
        if over:
            kept_used = 0
            for j in range(used):
                if abs(of.errors[index[j]]) > gate:
                    of.totals[2] += 1.0
                    continue
                to = kept_used
                index[to], errors[to], gain[to], row[to] = index[j], errors[j], gain[j], row[j]
                variance[to] = variance[j]
                kept_used += 1
            for j in range(kept_used):
                for q in range(j + 1):
                    total = 0.0
                    for r in range(size):
                        total += gain[j, r] * row[q, r]
                    square[j, q] = square[q, j] = total
                square[j, j] += variance[j]
            alike, slots = False, -1
        change = 1.0
        x = both if moving else alone
        lead = size if moving else 0
        if kept_used > 0:
            if moving:
                for j in range(kept_used):
                    for q in range(kept_used):
                        root[j, q] = square[j, q]
                if not whiten(root, kept_used, gain[:kept_used]):
                    return False
                change = 0.0
                for r in range(size):
                    least, most_change = 0.0, 0.0
                    for j in range(kept_used):
                        least = max(least, abs(gain[j, r]))
                        most_change = max(most_change, abs(gain[j, r] - old_gain[j, r]))
                        old_gain[j, r] = gain[j, r]
                    spread = least + np.sqrt(max(both[r, r], 0.0))
                    if spread > 0.0:
                        change = max(change, most_change / spread)
            substitute(root, kept_used, errors[:kept_used])
            if moving:
                for j in range(kept_used):
                    for r in range(size):
                        pulled[j, r] = -gain[j, r]
                    for c in range(constants + 1):
                        pulled[j, size + c] = errors[j, c]
                np.dot(gain[:kept_used].T, pulled[:kept_used], moved_both)
                add(both, moved_both)
            else:
                np.dot(gain[:kept_used].T, errors[:kept_used], moved_alone)
                add(alone, moved_alone)
            for j in range(kept_used):
                of.totals[0] += np.log(root[j, j])
                of.whitened[index[j]] = errors[j, constants]
                for c in range(constants + 1):
                    buffer[rows, c] = errors[j, c]
                rows += 1
                if rows == ROWS:
                    of.normal[:] += np.dot(buffer.T, buffer)
                    rows = 0
            of.totals[1] += kept_used
            if keeping:
                whitened = row[:kept_used].copy()
                substitute(root, kept_used, whitened)
                for j in range(kept_used):
                    keep.row[index[j] - readings.first[begin]] = whitened[j]
                    keep.gain[index[j] - readings.first[begin]] = gain[j]
        if k + 1 == readings.first.size - 1:
            break
        # to the next node
        settling = moving and alike and not flow.varying and change < SETTLED and used > 0
        y = both_rows if moving else alone_rows
        np.dot(flow.rows, x, y)
        last = lead + constants
        if about.shape[0] > 0:
            np.dot(flow.rows, about[k], base_rows)
        else:
            for r in range(before):
                base_rows[r] = y[r, last]
        for r in range(before):
            nodes[r] = base_rows[r]
        for r in range(size):
            for c in range(x.shape[1]):
                x[r, c] = y[before + r, c]
        if not plain:
            bend(flow, nodes, known[k] if known.shape[0] > 0 else nothing, extra, slopes, scratch)
            bent = bent_wide if moving else bent_alone
            np.dot(slopes, y[:before], bent)
            if about.shape[0] > 0:
                for r in range(two):
                    total = extra[r]
                    for q in range(before):
                        total -= slopes[r, q] * base_rows[q]
                    bent[r, last] += total
            else:
                for r in range(two):
                    bent[r, last] = extra[r]
            for r in range(two):
                for c in range(x.shape[1]):
                    x[r, c] += bent[r, c]
        if constants > 0:
            force_columns(
                flow,
                columns,
                nodes,
                recorded[k] if recorded.shape[0] > 0 else nothing,
                slope[k] if slope.shape[0] > 0 else nothing,
                time,
                lead,
                x,
            )
        if keeping:
            keep.swing[k - begin] = flow.rows[before : before + two]
            if not plain:
                keep.swing[k - begin] += np.dot(slopes, flow.rows[:before])
        if moving:
            for r in range(size):
                for q in range(size):
                    flat[r, q] = both[r, q]
            np.dot(flat, to_end, back)
            if not plain:
                np.dot(flat, to_rows, back_rows)
                np.dot(back_rows, slopes.T, back_bent)
                for r in range(size):
                    for q in range(two):
                        back[r, q] += back_bent[r, q]
            for r in range(size):
                for q in range(r + 1):
                    mean = 0.5 * (back[r, q] + back[q, r]) + flow.noise[r, q]
                    both[r, q] = both[q, r] = mean
            if flow.heave_noise > 0.0:  # an impulse in mid-step, as large as the angle makes it
                for i in range(count):
                    sine[i] = flow.kappa[i] * np.sin(nodes[3 * i + 1]) * flow.heave_noise * np.sqrt(flow.step)
                for i in range(count):
                    for j in range(count):
                        product = sine[i] * sine[j]
                        both[2 * i, 2 * j] += 0.25 * flow.step**2 * product
                        both[2 * i, 2 * j + 1] += 0.5 * flow.step * product
                        both[2 * i + 1, 2 * j] += 0.5 * flow.step * product
                        both[2 * i + 1, 2 * j + 1] += product
            if settling:
                moving = False
                predicted[:] = both[:, :size]
                alone[:] = both[:, size:]
    of.normal[:] += np.dot(buffer[:rows].T, buffer[:rows])
    of.state[:] = both[:, size:] if moving else alone
    of.covariance[:] = both[:, :size] if moving else predicted
    return True


@kernel
def smooth(
    flow: Flow,
    readings: Readings,
    begin: int,
    end: int,
    whitened: Floats,
    keep: Kept,
    adjoint: Floats,
    path: Floats,
) -> None:
    """Smoothed states of a stretch, by adjoints, backwards (Bryson and Frazier).

    Parameters
    ----------
    whitened : (r,) array
        Prediction errors of the sweep.
    adjoint : (d,) array, changed
        Of the predicted state behind the stretch; of its first node on return.
    path : (k, d) array, out
        Smoothed states; rows `begin` to `end` are written.
    """
    two, size = keep.swing.shape[1], adjoint.size
    ship = np.ascontiguousarray(flow.rows[flow.rows.shape[0] - size + two :].T)
    for k in range(end - 1, begin - 1, -1):
        s = k - begin
        if k + 2 < readings.first.size:
            adjoint[:] = np.dot(ship, adjoint[two:]) + np.dot(adjoint[:two], keep.swing[s])
        change = np.zeros(size)
        for which in range(readings.first[k], readings.first[k + 1]):
            if np.isfinite(whitened[which]):
                j = which - readings.first[begin]
                change += keep.row[j] * (whitened[which] - np.dot(keep.gain[j], adjoint))
        adjoint += change
        path[k] = keep.state[s] + np.dot(keep.covariance[s], adjoint)
