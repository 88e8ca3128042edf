"""Compiled sweeps of the projection: the response to the recorded pendulum, and the moments of the fit.

Everything runs in blocks with tables of in-block phasors, so that no sample costs a sine and phases do not drift;
arrays are indexed forward only, because a negative offset keeps LLVM from using vector instructions.

Within a block every column of the fit is a combination of {cos, sin, 1, m cos, m sin}, m the sample's number in it:
samples are summed against these five alone, and a block without gaps has the same products of the five as any other.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from synth.kernels.compiled import kernel, summing_kernel

MOST, LEAST = 512, 16  # samples a block
BLOCKS = 64  # at least, in a record: the slopes' share that bends within a block is the square of that smaller
LOCAL = 5
COLUMNS = 8  # cos, sin, 1, t cos, t sin, slope by frequency, slope by damping, residual


def block_length(count: int) -> int:
    """Samples a block, for a record of so many."""
    return min(max(count // BLOCKS, LEAST), MOST)


@summing_kernel
def phasors(exponent: complex, real: Floats, imag: Floats) -> None:
    """`exp(exponent m)`, m = 0, 1, ...: products of two, so that few are worked out; sizes are multiples of `LEAST`."""
    few = np.exp(exponent * np.arange(LEAST))
    few_real, few_imag = few.real.copy(), few.imag.copy()
    for start in range(0, real.size, LEAST):
        turn = np.exp(exponent * start)
        cos, sin = turn.real, turn.imag
        for m in range(LEAST):
            real[start + m] = cos * few_real[m] - sin * few_imag[m]
            imag[start + m] = cos * few_imag[m] + sin * few_real[m]


@summing_kernel
def forced_response(
    theta: Floats,
    before: Floats,
    after: Floats,
    tap_real: Floats,
    tap_imag: Floats,
    step: float,
    block: int,
    eigenvalue: complex,
    direct: float,
    gain: complex,
    first: int,
    response: Floats,
    state: Complexes,
) -> None:
    """Response of the difference pendulum to theta, in some adjoining blocks from number `first` on.

    `c(t) = int_0^t exp(lam (t-s)) theta(s) ds` and `response = direct theta + Im(gain c)`. `before` and `after` (3,)
    continue theta (n,) away from its start and its end, where the taps (8,) of an interval reach over. `state`
    (blocks + 1, 2) gets c and dc/dlam, where each interval is weighed by its age, at the blocks' starts and at the end
    of the last; those at the start of the first are given. `response` goes from the first sample of the first block,
    which is given, to the first behind the last one.
    """
    count = theta.size
    turn = np.exp(eigenvalue * step)
    table = np.empty((8, MOST))  # rows by index: unpacked ones are not known to be contiguous
    fore_real, fore_imag, back_real, back_imag = table[0], table[1], table[2], table[3]
    gain_real, gain_imag, wr, wi = table[4], table[5], table[6], table[7]
    phasors(eigenvalue * step, fore_real, fore_imag)
    phasors(-eigenvalue * step, back_real, back_imag)
    for m in range(MOST):
        gain_real[m] = gain.real * fore_real[m] - gain.imag * fore_imag[m]
        gain_imag[m] = gain.real * fore_imag[m] + gain.imag * fore_real[m]
    a0, a1, a2, a3, a4, a5, a6, a7 = tap_real
    b0, b1, b2, b3, b4, b5, b6, b7 = tap_imag
    near = np.zeros(MOST + 10)
    t0, t1, t2, t3, t4, t5, t6, t7 = near, near[1:], near[2:], near[3:], near[4:], near[5:], near[6:], near[7:]
    c, age = state[0, 0], state[0, 1]
    for which in range(state.shape[0] - 1):
        start = (first + which) * block
        length = min(block, count - 1 - start)
        state[which] = c, age
        low, high = max(start - 3, 0), min(start + block + 4, count)
        near[low - start + 3 : high - start + 3] = theta[low:high]
        if start == 0:
            near[2], near[1], near[0] = before
        if high == count:
            near[high - start + 3 : high - start + 6] = after
        # in the block: c_{m+1} = F_m (F_1 c_0 + S_m),  S_m = sum_{i<=m} v_i / F_i, v the integrals over intervals; the
        # sums run alone, so that the rest of the work is free of their chain
        young_real = young_imag = 0.0
        for m in range(length):
            vr = (a0 * t0[m] + a1 * t1[m]) + (a2 * t2[m] + a3 * t3[m])
            vr += (a4 * t4[m] + a5 * t5[m]) + (a6 * t6[m] + a7 * t7[m])
            vi = (b0 * t0[m] + b1 * t1[m]) + (b2 * t2[m] + b3 * t3[m])
            vi += (b4 * t4[m] + b5 * t5[m]) + (b6 * t6[m] + b7 * t7[m])
            real = vr * back_real[m] - vi * back_imag[m]
            imag = vr * back_imag[m] + vi * back_real[m]
            wr[m], wi[m] = real, imag
            # an interval's content is on average half a step old at its end
            share = length - 0.5 - m
            young_real += share * real
            young_imag += share * imag
        age = turn * (age + step * length * c) + step * complex(young_real, young_imag)
        c *= turn
        sum_real, sum_imag = c.real, c.imag
        for m in range(length):
            sum_real += wr[m]
            sum_imag += wi[m]
            wr[m], wi[m] = sum_real, sum_imag
        begin = which * block + 1
        out = response[begin : begin + length]
        for m in range(length):
            out[m] = direct * t4[m] + gain_real[m] * wi[m] + gain_imag[m] * wr[m]
        if length > 0:
            last = complex(fore_real[length - 1], fore_imag[length - 1])
            c, age = last * complex(sum_real, sum_imag), last * age
    state[-1] = c, age


@summing_kernel
def moments(
    difference: Floats,
    response: Floats,
    slopes: Complexes,
    step: float,
    block: int,
    eigenvalue: complex,
    amounts: Floats,
    first: int,
    samples: int,
    residual: Floats,
    gram: Floats,
) -> None:
    """Add some adjoining blocks to the Gram matrix of (cos, sin, 1, t cos, t sin, slope, slope_damping, e).

    `first` is the number of the first block, `samples` that of all samples of the record; the other arrays are those of
    the blocks. cos and sin carry the decay; t runs from -1 to 1 over the record; the slopes are the imaginary part of
    the complex `slopes` (blocks + 1, 2), which turn with cos and sin and are straight between blocks; e is the residual
    `difference - response - amounts of the other seven columns`.
    """
    count = difference.size
    table = np.ones((2, MOST))  # rows by index: unpacked ones are not known to be contiguous
    cos, sin = table[0], table[1]
    phasors(eigenvalue * step, cos, sin)
    number = np.arange(MOST) * 1.0
    complete, local = np.empty((LOCAL, LOCAL)), np.empty((LOCAL, LOCAL))
    local_gram(block, cos, sin, complete)
    part, turned = np.zeros((LOCAL, COLUMNS - 1)), np.empty((LOCAL, COLUMNS - 1))
    part[2, 2] = 1.0
    sums = np.empty(LOCAL)
    unit = 2.0 / (samples - 1)
    for which in range(slopes.shape[0] - 1):
        start, whole_start = which * block, (first + which) * block
        length = min(block, count - start)
        origin = np.exp(eigenvalue * (step * whole_start))
        _columns(origin, whole_start * unit - 1.0, unit, part)
        span = min(length, samples - 1 - whole_start)
        back = np.exp(-eigenvalue * (step * span))
        for column in range(2):
            now, then = slopes[which, column], slopes[which + 1, column] * back
            growth = (then - now) / max(span, 1)
            part[0, 5 + column], part[1, 5 + column] = now.imag, now.real
            part[3, 5 + column], part[4, 5 + column] = growth.imag, growth.real
        y0 = y1 = y2 = y3 = y4 = 0.0
        for k in range(COLUMNS - 1):
            y0 += part[0, k] * amounts[k]
            y1 += part[1, k] * amounts[k]
            y2 += part[2, k] * amounts[k]
            y3 += part[3, k] * amounts[k]
            y4 += part[4, k] * amounts[k]
        d, f, r = difference[start : start + length], response[start : start + length], residual[start : start + length]
        products = complete
        s0 = s1 = s2 = s3 = s4 = squares = 0.0
        if length < block:
            products = local
            local_gram(length, cos, sin, local)
        for m in range(length):
            e = d[m] - f[m] - (y0 + y3 * number[m]) * cos[m] - (y1 + y4 * number[m]) * sin[m] - y2
            r[m] = e
            ec, es = e * cos[m], e * sin[m]
            s0 += ec
            s1 += es
            s2 += e
            s3 += ec * number[m]
            s4 += es * number[m]
            squares += e * e
        sums[0], sums[1], sums[2], sums[3], sums[4] = s0, s1, s2, s3, s4
        gram[7, 7] += squares
        for k in range(COLUMNS - 1):
            for i in range(LOCAL):
                total = 0.0
                for j in range(LOCAL):
                    total += products[i, j] * part[j, k]
                turned[i, k] = total
                gram[k, 7] += part[i, k] * sums[i]
        for k in range(COLUMNS - 1):
            for n in range(k, COLUMNS - 1):
                total = 0.0
                for i in range(LOCAL):
                    total += part[i, k] * turned[i, n]
                gram[k, n] += total
    for k in range(COLUMNS):
        for n in range(k):
            gram[k, n] = gram[n, k]


@kernel
def _columns(origin: complex, base: float, unit: float, part: Floats) -> None:
    """cos, sin, t cos and t sin of the record in terms of the block's five functions."""
    real, imag = origin.real, origin.imag
    part[0, 0], part[1, 0] = real, -imag
    part[0, 1], part[1, 1] = imag, real
    for k in range(2):
        part[0, 3 + k], part[1, 3 + k] = base * part[0, k], base * part[1, k]
        part[3, 3 + k], part[4, 3 + k] = unit * part[0, k], unit * part[1, k]


@summing_kernel
def local_gram(size: int, cos: Floats, sin: Floats, out: Floats) -> None:
    """Products (5, 5) of a block's five functions."""
    out[:] = 0.0
    cc = cs = ss = c1 = s1 = n1 = 0.0
    mcc = mcs = mss = mc1 = ms1 = mmcc = mmcs = mmss = 0.0
    for m in range(size):
        c, s, x = cos[m], sin[m], float(m)
        cc += c * c
        cs += c * s
        ss += s * s
        c1 += c
        s1 += s
        n1 += 1.0
        mcc += x * c * c
        mcs += x * c * s
        mss += x * s * s
        mc1 += x * c
        ms1 += x * s
        mmcc += x * x * c * c
        mmcs += x * x * c * s
        mmss += x * x * s * s
    out[0, 0], out[0, 1], out[0, 2], out[0, 3], out[0, 4] = cc, cs, c1, mcc, mcs
    out[1, 1], out[1, 2], out[1, 3], out[1, 4] = ss, s1, mcs, mss
    out[2, 2], out[2, 3], out[2, 4] = n1, mc1, ms1
    out[3, 3], out[3, 4], out[4, 4] = mmcc, mmcs, mmss
    for i in range(LOCAL):
        for j in range(i):
            out[i, j] = out[j, i]
