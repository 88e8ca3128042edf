"""The march of Radau IIA: steps, their acceptance, their size, their order and the readings on the way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from synth.integrators.radau_dense import differences, evaluate
from synth.integrators.radau_linear import solve
from synth.integrators.radau_newton import collocate, prepare, project
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel
from synth.systems.dispatch import derivative, jacobian

FLOOR = 1e-2
SHARP = 0.1
NEWTON = 0.01
DENSE = 0.1
UP = 0.002
DOWN = 0.8
JAT = 1.0
STAY = 10
PATIENCE = 0
CONV = 0.1
CEXP = 1.0
_S3, _S5, _S7 = (0,) * 3, (0,) * 5, (0,) * 7


@kernel
def _prepare(step, jac, s, size, stack, exchanges):
    if s == 3:
        return prepare(step, jac, _S3, size, stack, exchanges)
    if s == 5:
        return prepare(step, jac, _S5, size, stack, exchanges)
    return prepare(step, jac, _S7, size, stack, exchanges)


@kernel
def _collocate(time, step, state, scale, goal, trust, s, size, z, w, f, point, slope, stack, exchanges, system):
    if s == 3:
        return collocate(time, step, state, scale, goal, trust, 8, _S3, size, z, w, f, point, slope, stack, exchanges, system)
    if s == 5:
        return collocate(time, step, state, scale, goal, trust, 12, _S5, size, z, w, f, point, slope, stack, exchanges, system)
    return collocate(time, step, state, scale, goal, trust, 16, _S7, size, z, w, f, point, slope, stack, exchanges, system)


@kernel
def _read(at, s, size, polynomial, out):
    if s == 3:
        evaluate(at, _S3, size, polynomial, out)
    elif s == 5:
        evaluate(at, _S5, size, polynomial, out)
    else:
        evaluate(at, _S7, size, polynomial, out)


@kernel
def _guess(start, ratio, s, size, old, polynomial, z, w, point):
    """Increments at the nodes of a step that begins at `start` in units of the old step."""
    if old == 0:
        for i in range(s):
            for c in range(len(size)):
                z[i, c] = 0.0
                w[i, c] = 0.0
        return
    nodes = THREE.nodes if s == 3 else FIVE.nodes if s == 5 else SEVEN.nodes
    for i in range(s):
        _read(start + ratio * nodes[i], old, size, polynomial, point)
        for c in range(len(size)):
            z[i, c] = point[c] - (polynomial[0, c] if start > 0.0 else 0.0)
    if s == 3:
        project(_S3, size, z, w)
    elif s == 5:
        project(_S5, size, z, w)
    else:
        project(_S7, size, z, w)


@kernel
def _differences(s, size, z, out):
    if s == 3:
        differences(_S3, size, z, out)
    elif s == 5:
        differences(_S5, size, z, out)
    else:
        differences(_S7, size, z, out)


@kernel
def _error(time, step, state, slope, scale, s, size, retry, z, f, point, other, stack, exchanges, system):
    weights = THREE.error if s == 3 else FIVE.error if s == 5 else SEVEN.error
    rate = (THREE.rates if s == 3 else FIVE.rates if s == 5 else SEVEN.rates)[0].real
    n = len(size)
    gain = rate / step
    for c in range(n):
        total = 0.0
        for i in range(s):
            total += weights[i] * z[i, c]
        f[1, c] = total * gain
        f[0, c] = slope[c] + total * gain
    solve(size, stack, exchanges, f)
    total = 0.0
    for c in range(n):
        part = f[0, c] * scale[c]
        total += part * part
    value = math.sqrt(total / n)
    if retry < value:
        for c in range(n):
            point[c] = state[c] + f[0, c]
        derivative(time, point, system, other)
        for c in range(n):
            f[0, c] = other[c] + f[1, c]
        solve(size, stack, exchanges, f)
        total = 0.0
        for c in range(n):
            part = f[0, c] * scale[c]
            total += part * part
        value = math.sqrt(total / n)
    return value


@kernel
def first_step(time, state, slope, span, size, jac):
    shortest = 1e-2 * span
    n = len(size)
    for c in range(n):
        bend = 0.0
        for j in range(n):
            bend += jac[c, j] * slope[j]
        y, f, b = abs(state[c]), abs(slope[c]), abs(bend)
        if f > 0.0 and b > 0.0:
            shortest = min(shortest, 0.1 * f / b)
        if f > 0.0 and y > 0.0:
            shortest = min(shortest, 0.1 * y / f)
        if b > 0.0 and y > 0.0:
            shortest = min(shortest, 0.1 * math.sqrt(y / b))
    return shortest


@kernel
def march(start, times, tolerance, size, system, out, largest, counts, lo, hi):
    n = len(size)
    k = times.size
    z, w, f = np.zeros((7, n)), np.zeros((7, n)), np.zeros((7, n))
    z2, w2, = np.zeros((7, n)), np.zeros((7, n))
    point, other = np.zeros(n), np.zeros(n)
    stack = np.zeros((7, n, n))
    exchanges = np.zeros((7, n), dtype=np.int64)
    stack2 = np.zeros((7, n, n))
    exchanges2 = np.zeros((7, n), dtype=np.int64)
    polynomial = np.zeros((8, n))
    jac = np.zeros((n, n))
    state = start.copy()
    carry = np.zeros(n)
    slope = np.zeros(n)
    scale = np.zeros(n)
    time = times[0]
    late = 0.0  # what `time` lacks
    end = times[k - 1]
    span = end - time
    for c in range(n):
        largest[c] = abs(state[c])
        out[0, c] = state[c]
    done = 1
    derivative(time, state, system, slope)
    evals = 1
    steps = 0
    rejected = 0
    iters = 0
    jacobian(time, state, system, jac)
    fresh = True
    factored = 0.0
    fstage = 0
    step = first_step(time, state, slope, span, size, jac)
    s = hi
    old = 0
    old_step = 0.0
    trust = 1.0
    first = True
    again = False
    error_before = 0.0
    step_before = 0.0
    since = 0
    failures = 0
    while done < k:
        left = (end - time) - late
        last = step * 1.0001 >= left
        if last:
            step = left
        elif step * 2 > left:
            step = 0.5 * left
        if step < 1e-14 * span and not last:
            return 1
        # sizes
        for c in range(n):
            scale[c] = 1.0 / max(abs(state[c]), FLOOR * largest[c], abs(slope[c]) * step * 1.0 * (largest[c] == 0.0), 1e-300)
        power = (s + 1) / (2.0 * s)
        loose = SHARP * tolerance**power
        tight = tolerance / DENSE
        allowed = loose
        if k - done > 1 and tight < loose:
            ratio = (loose / tight) ** (1.0 / (s + 1))
            crowd = (k - done) / left * step
            if crowd > 1.6 * (ratio - 1.0):
                allowed = tight
        if JAT > 0.0 and old > 0:
            _read(1.0 + JAT * step / old_step, old, size, polynomial, point)
            for c in range(n):
                point[c] += state[c] - polynomial[0, c]
            jacobian(time + JAT * step, point, system, jac)
            factored = 0.0
        elif not fresh and True:
            jacobian(time, state, system, jac)
            fresh = True
            factored = 0.0
        if factored != step or fstage != s:
            if not _prepare(step, jac, s, size, stack, exchanges):
                step *= 0.5
                rejected += 1
                factored = 0.0
                continue
            factored = step
            fstage = s
        _guess(1.0, step / old_step if old > 0 else 0.0, s, size, old, polynomial, z, w, point)
        trust = max(trust, 1e-15) ** 0.75
        good, turns, contraction, trust = _collocate(
            time, step, state, scale, NEWTON * tolerance, trust, s, size, z, w, f, point, other, stack, exchanges, system
        )
        iters += turns
        evals += s * turns
        if not good:
            rejected += 1
            counts[3] += 1
            trust = 1.0
            failures += 1
            step *= 0.5 if contraction < 2 else 0.25
            if s > lo and failures > PATIENCE:
                s -= 2
                since = 0
            if failures > 2:
                old = 0
            again = True
            continue
        # weights with the end of the step
        for c in range(n):
            size_c = max(abs(state[c]), abs(state[c] + z[s - 1, c]), FLOOR * largest[c])
            scale[c] = 1.0 / max(size_c, 1e-300)
        retry = allowed if (first or again) else 1e300
        error = _error(time, step, state, slope, scale, s, size, retry, z, f, point, other, stack, exchanges, system)
        relative = max(error / allowed, 1e-10)
        safe = min(0.9, 0.9 * (2 * 8 + 1) / (2 * 8 + turns))
        factor = safe * relative ** (-1.0 / (s + 1))
        if relative >= 1.0 or not error < 1e300:
            rejected += 1
            counts[4] += 1
            step *= max(0.1, factor) if not first else 0.1
            again = True
            continue
        # accept
        failures = 0
        if step_before > 0.0:
            predicted = factor * (step / step_before) * (max(error_before, 1e-2) / relative) ** (1.0 / (s + 1))
            factor = min(factor, predicted)
        error_before = relative
        step_before = step
        factor = min(8.0, max(0.125, factor))
        new_step = step * factor
        if CONV > 0.0 and contraction > 0.0:
            new_step = min(new_step, step * max(0.5, (CONV / contraction) ** CEXP))
        if again:
            new_step = min(new_step, step)
        _differences(s, size, z, polynomial)
        # readings
        stop = time + (step + late)
        while done < k and (times[done] < stop or last):
            part = (times[done] - time) - late
            if done == k - 1 and last:
                break
            at = part / step
            _read(at, s, size, polynomial, point)
            if error > tight:
                # too coarse: solve the part of the step by itself
                _guess(0.0, at, s, size, s, polynomial, z2, w2, point)
                if _prepare(part, jac, s, size, stack2, exchanges2):
                    ok, turns, q, tr = _collocate(
                        time, part, state, scale, NEWTON * tolerance, 1.0, s, size, z2, w2, f, point, other, stack2, exchanges2, system
                    )
                    evals += s * turns
                    iters += turns
                    for c in range(n):
                        point[c] = z2[s - 1, c]
            for c in range(n):
                out[done, c] = state[c] + (point[c] + carry[c])
                largest[c] = max(largest[c], abs(out[done, c]))
            done += 1
        # state, compensated
        for c in range(n):
            change = z[s - 1, c] + carry[c]
            total = state[c] + change
            carry[c] = change - (total - state[c])
            state[c] = total
            largest[c] = max(largest[c], abs(total))
        total = time + (step + late)
        late = (step + late) - (total - time)
        time = total
        if last:
            for c in range(n):
                out[k - 1, c] = state[c] + carry[c]
            done = k
        steps += 1
        counts[5 + s // 2] += 1
        derivative(time, state, system, slope)
        evals += 1
        old = s
        old_step = step
        first = False
        again = False
        since += 1
        fresh = False
        change = new_step / step
        if since >= STAY:
            if contraction < UP and s < hi:
                s += 2
                since = 0
            elif contraction >= DOWN and s > lo:
                s -= 2
                since = 0
        step = new_step
    counts[0] = steps
    counts[1] = evals
    counts[2] = rejected
    counts[9] = iters
    return 0
