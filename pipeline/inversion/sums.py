"""Compiled sums over the recursion's tangents; every array is (n,) unless said otherwise."""

from __future__ import annotations

from pipeline.arrays import Floats
from pipeline.inversion.kernels import BLOCK
from synth.kernels.compiled import summing_kernel

COLUMNS = 6  # start (angle, rate), n2, gamma2, offset, residual


@summing_kernel
def moments(
    difference: Floats,
    angle: Floats,
    one: Floats,
    two: Floats,
    three: Floats,
    offset: float,
    threshold: float,
    first: int,
    samples: int,
    gram: Floats,
) -> int:
    """Add some blocks to the Gram matrix (6, 6) of (start angle, start rate, n2, gamma2, 1, residual).

    `angle`, `one`, `two`, `three` are the recursion's; `first` is the number of the first sample, of `samples` in the
    record. The tangent by gamma2 is `-t d`, t from -1 to 1 over the record. NaN and residuals beyond the threshold have
    no weight; returns how many lie beyond it.
    """
    count = difference.size
    unit = 2.0 / (samples - 1)
    beyond = 0
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        base = (first + start) * unit - 1.0
        d, y = difference[start : start + length], angle[start : start + length]
        a, b, c = one[start : start + length], two[start : start + length], three[start : start + length]
        aa = ab = ac = ag = a1 = ae = bb = bc = bg = b1 = be = 0.0
        cc = cg = c1 = ce = gg = g1 = ge = n1 = e1 = ee = 0.0
        outside = 0
        for m in range(length):
            e = d[m] - y[m] - offset
            use = abs(e) <= threshold
            outside += 1 if abs(e) > threshold else 0
            w = 1.0 if use else 0.0
            e = e if use else 0.0
            g = -(base + m * unit) * y[m]
            wa, wb, wc, wg = w * a[m], w * b[m], w * c[m], w * g
            aa += wa * a[m]
            ab += wa * b[m]
            ac += wa * c[m]
            ag += wa * g
            a1 += wa
            ae += wa * e
            bb += wb * b[m]
            bc += wb * c[m]
            bg += wb * g
            b1 += wb
            be += wb * e
            cc += wc * c[m]
            cg += wc * g
            c1 += wc
            ce += wc * e
            gg += wg * g
            g1 += wg
            ge += wg * e
            n1 += w
            e1 += e
            ee += e * e
        beyond += outside
        row = (aa, ab, ac, ag, a1, ae)
        for j in range(6):
            gram[0, j] += row[j]
        row = (0.0, bb, bc, bg, b1, be)
        for j in range(6):
            gram[1, j] += row[j]
        row = (0.0, 0.0, cc, cg, c1, ce)
        for j in range(6):
            gram[2, j] += row[j]
        gram[3, 3] += gg
        gram[3, 4] += g1
        gram[3, 5] += ge
        gram[4, 4] += n1
        gram[4, 5] += e1
        gram[5, 5] += ee
    for i in range(6):
        for j in range(i):
            gram[i, j] = gram[j, i]
    return beyond


@summing_kernel
def combined(
    one: Floats,
    two: Floats,
    three: Floats,
    weights: Floats,
    about: Floats,
    difference: Floats,
    first: int,
    samples: int,
    influence: Floats,
) -> None:
    """`influence` = sum of weights times (start angle, start rate, n2, gamma2, 1); 0 where nothing was read."""
    unit = 2.0 / (samples - 1)
    angle, rate, frequency, damping, offset = weights
    for k in range(about.size):
        scaled = (first + k) * unit - 1.0
        value = (angle * one[k] + rate * two[k]) + (frequency * three[k] - damping * scaled * about[k]) + offset
        influence[k] = value if difference[k] == difference[k] else 0.0


@summing_kernel
def follow(
    model: Floats,
    one: Floats,
    two: Floats,
    three: Floats,
    angle: float,
    rate: float,
    frequency: float,
    damping: float,
    first: int,
    samples: int,
    about: Floats,
) -> None:
    """`about` = difference with its tangents followed to the improved parameters."""
    unit = 2.0 / (samples - 1)
    for k in range(about.size):
        stay = 1.0 - damping * ((first + k) * unit - 1.0)
        about[k] = model[k] * stay + angle * one[k] + rate * two[k] + frequency * three[k]
