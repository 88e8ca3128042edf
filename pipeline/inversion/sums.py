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
    first: int,
    samples: int,
    gram: Floats,
) -> None:
    """Add some blocks to the Gram matrix (6, 6) of (start angle, start rate, n2, gamma2, 1, residual).

    `angle`, `one`, `two`, `three` are the recursion's; `first` is the number of the first sample, of `samples` in the
    record. The tangent by gamma2 is `-t d`, t from -1 to 1 over the record.
    """
    count = difference.size
    unit = 2.0 / (samples - 1)
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        base = (first + start) * unit - 1.0
        d, y = difference[start : start + length], angle[start : start + length]
        a, b, c = one[start : start + length], two[start : start + length], three[start : start + length]
        aa = ab = ac = ag = a1 = ae = bb = bc = bg = b1 = be = 0.0
        cc = cg = c1 = ce = gg = g1 = ge = e1 = ee = 0.0
        for m in range(length):
            e = d[m] - y[m] - offset
            g = -(base + m * unit) * y[m]
            aa += a[m] * a[m]
            ab += a[m] * b[m]
            ac += a[m] * c[m]
            ag += a[m] * g
            a1 += a[m]
            ae += a[m] * e
            bb += b[m] * b[m]
            bc += b[m] * c[m]
            bg += b[m] * g
            b1 += b[m]
            be += b[m] * e
            cc += c[m] * c[m]
            cg += c[m] * g
            c1 += c[m]
            ce += c[m] * e
            gg += g * g
            g1 += g
            ge += g * e
            e1 += e
            ee += e * e
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
        gram[4, 4] += length
        gram[4, 5] += e1
        gram[5, 5] += ee
    for i in range(6):
        for j in range(i):
            gram[i, j] = gram[j, i]


@summing_kernel
def combined(
    one: Floats,
    two: Floats,
    three: Floats,
    weights: Floats,
    about: Floats,
    first: int,
    samples: int,
    influence: Floats,
) -> None:
    """`influence` = sum of weights times (start angle, start rate, n2, gamma2, 1)."""
    unit = 2.0 / (samples - 1)
    angle, rate, frequency, damping, offset = weights
    for k in range(about.size):
        scaled = (first + k) * unit - 1.0
        turned = frequency * three[k] - damping * scaled * about[k]
        influence[k] = (angle * one[k] + rate * two[k]) + turned + offset


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
