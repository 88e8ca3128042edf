"""Compiled loops of the nonlinear inversion; every array is (n,) unless said otherwise."""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Complexes, Floats
from synth.kernels.compiled import kernel, summing_kernel

BLOCK = 512
LEAST_TURNS = 64
SMALL = 0.5  # rad, up to which the polynomials below are right to rounding


@summing_kernel
def filter_both(theta: Floats, low: Floats, curvature: Floats, out_low: Floats, out_curvature: Floats) -> None:
    """`out[k] = sum_j taps[j] theta[k + j]` by two filters of equal length; theta is longer by the taps less one."""
    taps = low.size
    for start in range(0, out_low.size, BLOCK):
        length = min(BLOCK, out_low.size - start)
        p, q = out_low[start : start + length], out_curvature[start : start + length]
        p[:] = 0.0
        q[:] = 0.0
        whole = taps - taps % 4
        for j in range(0, whole, 4):
            first = start + j
            x0, x1 = theta[first : first + length], theta[first + 1 : first + 1 + length]
            x2, x3 = theta[first + 2 : first + 2 + length], theta[first + 3 : first + 3 + length]
            a0, a1, a2, a3 = low[j], low[j + 1], low[j + 2], low[j + 3]
            b0, b1, b2, b3 = curvature[j], curvature[j + 1], curvature[j + 2], curvature[j + 3]
            for m in range(length):
                p[m] += (a0 * x0[m] + a1 * x1[m]) + (a2 * x2[m] + a3 * x3[m])
                q[m] += (b0 * x0[m] + b1 * x1[m]) + (b2 * x2[m] + b3 * x3[m])
        for j in range(whole, taps):
            x0 = theta[start + j : start + j + length]
            for m in range(length):
                p[m] += low[j] * x0[m]
                q[m] += curvature[j] * x0[m]


@kernel
def turning(
    envelope: Complexes, begin: float, hop: float, rate: float, step: float, out: Floats, first: int = 0
) -> None:
    """`out[k] = Re[envelope(t) exp(i rate t)]`, t = (first + k) step; the envelope (m,) at begin, begin + hop, ...,
    straight between, steady beyond its ends. `first` is a multiple of `LEAST_TURNS`.
    """
    last = envelope.size - 1
    turn = np.exp(1j * rate * step)
    carrier = 1.0 + 0.0j
    for k in range(out.size):
        if k % LEAST_TURNS == 0:  # a product of many factors drifts
            carrier = np.exp(1j * rate * step * (first + k))
        place = min(max(((first + k) * step - begin) / hop, 0.0), float(last))
        before = min(int(place), last - 1)
        share = place - before
        out[k] = (((1.0 - share) * envelope[before] + share * envelope[before + 1]) * carrier).real
        carrier *= turn


@kernel
def sine_over(p: float) -> float:
    """sin(x)/x of p = x^2, |x| < 0.5."""
    even = 1 / 362880 + p * (-1 / 39916800 + p * (1 / 6227020800))
    return 1.0 + p * (-1 / 6 + p * (1 / 120 + p * (-1 / 5040 + p * even)))


@kernel
def cosine_less_one(p: float) -> float:
    """cos(x) - 1 of p = x^2, |x| < 0.5."""
    even = 1 / 40320 + p * (-1 / 3628800 + p * (1 / 479001600 - p * (1 / 87178291200)))
    return p * (-0.5 + p * (1 / 24 + p * (-1 / 720 + p * even)))


@kernel
def _expanded(
    d: float, sine: float, less: float, lever: float, curvature: float, held_square: float
) -> tuple[float, float]:
    """Value and slope at d of `held^2 d - lever sin d - curvature (cos d - 1)`; `less` = cos d - 1."""
    value = held_square * d - lever * sine - curvature * less
    return value, held_square - lever * (1.0 + less) + curvature * sine


@summing_kernel
def expand_small(
    about: Floats,
    theta: Floats,
    curvature: Floats,
    pull: Floats,
    held: float,
    frequency: float,
    shift: float,
    constant: Floats,
    slope: Floats,
    by_frequency: Floats,
) -> None:
    """Right-hand side of `z'' + 2 gamma2 z' + held^2 z` expanded about an angle of the difference.

    It is `constant + slope (d - about)`, with

        held^2 d - n^2 [(1 + zeta) sin d / cos theta1 + w ((cos d - 1) + tan theta1 sin d)],  n^2 w = `curvature`

    `pull` = 1 + zeta; `shift` is what noise of theta1 adds to the factor of sin d on average, taken off;
    `by_frequency` = d(n^2 [...])/dn over sin d.
    """
    held_square, square = held * held, frequency * frequency
    for k in range(about.size):
        d, t = about[k], theta[k]
        dd, tt = d * d, t * t
        secant = 1.0 / (1.0 + cosine_less_one(tt))
        tangent = t * sine_over(tt) * secant
        sine, less = d * sine_over(dd), cosine_less_one(dd)
        stiff = square * (pull[k] * secant)
        constant[k], slope[k] = _expanded(
            d, sine, less, stiff + curvature[k] * tangent - shift, curvature[k], held_square
        )
        by_frequency[k] = 2.0 / frequency * stiff * sine


@kernel
def expand_large(
    about: Floats,
    theta: Floats,
    curvature: Floats,
    pull: Floats,
    held: float,
    frequency: float,
    shift: float,
    constant: Floats,
    slope: Floats,
    by_frequency: Floats,
) -> None:
    """As `expand_small`, for any angles."""
    held_square, square = held * held, frequency * frequency
    for k in range(about.size):
        d, t = about[k], theta[k]
        sine, half = math.sin(d), math.sin(0.5 * d)
        less = -2.0 * half * half
        stiff = square * (pull[k] / math.cos(t))
        lever = stiff + curvature[k] * math.tan(t) - shift
        constant[k], slope[k] = _expanded(d, sine, less, lever, curvature[k], held_square)
        by_frequency[k] = 2.0 / frequency * stiff * sine


@summing_kernel
def interval_integrals(series: Floats, tap_real: Floats, tap_imag: Floats, real: Floats, imag: Floats) -> None:
    """Integrals over the intervals of n samples, (n - 1,), by eight taps; the series has 3 more samples at each end."""
    a0, a1, a2, a3, a4, a5, a6, a7 = tap_real
    b0, b1, b2, b3, b4, b5, b6, b7 = tap_imag
    count = real.size
    t0, t1, t2, t3 = series[:count], series[1 : 1 + count], series[2 : 2 + count], series[3 : 3 + count]
    t4, t5, t6, t7 = series[4 : 4 + count], series[5 : 5 + count], series[6 : 6 + count], series[7 : 7 + count]
    for k in range(count):
        real[k] = (a0 * t0[k] + a1 * t1[k]) + (a2 * t2[k] + a3 * t3[k])
        real[k] += (a4 * t4[k] + a5 * t5[k]) + (a6 * t6[k] + a7 * t7[k])
        imag[k] = (b0 * t0[k] + b1 * t1[k]) + (b2 * t2[k] + b3 * t3[k])
        imag[k] += (b4 * t4[k] + b5 * t5[k]) + (b6 * t6[k] + b7 * t7[k])


@summing_kernel
def recursion(
    integral_real: Floats,
    integral_imag: Floats,
    slope: Floats,
    about: Floats,
    response: Floats,
    by_frequency: Floats,
    turn: complex,
    oscillation: float,
    taps: Floats,
    state: Floats,
    angle: Floats,
    tangent_angle: Floats,
    tangent_rate: Floats,
    tangent_frequency: Floats,
) -> None:
    """Difference and its tangents by start angle, start rate and n2, at adjoining samples.

    A complex state c carries `z = Im(c)/oscillation`, `c <- turn c + integral of the constant part + taps of the part
    that is linear in the unknown`; taps (2, 2): now and one step before, real and imaginary. d = response + z.
    `state` (4, 3) has for each of the four c and the linear part one step before, and is left as the samples behind
    need it; the record's last sample has no integral.
    """
    count = slope.size
    a0, a1 = taps[0]
    b0, b1 = taps[1]
    er, ei = turn.real, turn.imag
    unit = 1.0 / oscillation
    c0, d0, p0 = state[0]
    c1, d1, p1 = state[1]
    c2, d2, p2 = state[2]
    c3, d3, p3 = state[3]
    for k in range(count):
        angle[k] = d0 * unit + response[k]
        tangent_angle[k], tangent_rate[k], tangent_frequency[k] = d1 * unit, d2 * unit, d3 * unit
        if k == integral_real.size:
            break
        # the stiffness now joins the rotation, so that a step waits for two products of the last alone
        q = slope[k]
        pull = q * unit
        turn_real, turn_imag = a0 * pull - ei, b0 * pull + er
        s0, s3 = q * (response[k] - about[k]), -by_frequency[k]
        r0, i0 = a0 * s0 + (a1 * p0 + integral_real[k]), b0 * s0 + (b1 * p0 + integral_imag[k])
        r1, i1, r2, i2 = a1 * p1, b1 * p1, a1 * p2, b1 * p2
        r3, i3 = a0 * s3 + a1 * p3, b0 * s3 + b1 * p3
        p0, p1, p2, p3 = s0 + pull * d0, pull * d1, pull * d2, s3 + pull * d3
        c0, d0 = (turn_real * d0 + r0) + er * c0, (turn_imag * d0 + i0) + ei * c0
        c1, d1 = (turn_real * d1 + r1) + er * c1, (turn_imag * d1 + i1) + ei * c1
        c2, d2 = (turn_real * d2 + r2) + er * c2, (turn_imag * d2 + i2) + ei * c2
        c3, d3 = (turn_real * d3 + r3) + er * c3, (turn_imag * d3 + i3) + ei * c3
    state[0], state[1], state[2], state[3] = (c0, d0, p0), (c1, d1, p1), (c2, d2, p2), (c3, d3, p3)
