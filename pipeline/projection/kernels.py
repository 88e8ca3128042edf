"""Compiled sweeps of the projection: the response to the recorded pendulum, and the moments of the fit.

Everything runs in blocks with tables of in-block phasors, so that no sample costs a sine and phases do not drift;
arrays are indexed forward only, because a negative offset keeps LLVM from using vector instructions.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel, summing_kernel

BLOCK = 256
COLUMNS = 8  # cos, sin, 1, t cos, t sin, slope by frequency, slope by damping, residual


@kernel
def interval_integrals(theta: Floats, tap_real: Floats, tap_imag: Floats, out_real: Floats, out_imag: Floats) -> None:
    """`out[k] = sum_j taps[p, j] theta[s + j]`, the integral over [k, k+1]; one-sided stencils at the two ends.

    theta (n,), taps (7, 8), out (n - 1,); n >= 8.
    """
    count = theta.size
    a0, a1, a2, a3, a4, a5, a6, a7 = tap_real[3]
    b0, b1, b2, b3, b4, b5, b6, b7 = tap_imag[3]
    length = count - 7
    t0, t1, t2, t3 = theta[:length], theta[1 : 1 + length], theta[2 : 2 + length], theta[3 : 3 + length]
    t4, t5, t6, t7 = theta[4 : 4 + length], theta[5 : 5 + length], theta[6 : 6 + length], theta[7 : 7 + length]
    inner_real, inner_imag = out_real[3 : 3 + length], out_imag[3 : 3 + length]
    for k in range(length):
        inner_real[k] = (
            (a0 * t0[k] + a1 * t1[k])
            + (a2 * t2[k] + a3 * t3[k])
            + (a4 * t4[k] + a5 * t5[k])
            + (a6 * t6[k] + a7 * t7[k])
        )
        inner_imag[k] = (
            (b0 * t0[k] + b1 * t1[k])
            + (b2 * t2[k] + b3 * t3[k])
            + (b4 * t4[k] + b5 * t5[k])
            + (b6 * t6[k] + b7 * t7[k])
        )
    for edge in range(3):
        left_real = left_imag = right_real = right_imag = 0.0
        for j in range(8):
            left_real += tap_real[edge, j] * theta[j]
            left_imag += tap_imag[edge, j] * theta[j]
            right_real += tap_real[4 + edge, j] * theta[count - 8 + j]
            right_imag += tap_imag[4 + edge, j] * theta[count - 8 + j]
        out_real[edge], out_imag[edge] = left_real, left_imag
        out_real[count - 4 + edge], out_imag[count - 4 + edge] = right_real, right_imag


@kernel
def forced_response(
    theta: Floats,
    integral_real: Floats,
    integral_imag: Floats,
    step: float,
    decay: float,
    frequency: float,
    direct: float,
    gain: complex,
    gain_slope: complex,
    gain_slope_damping: complex,
    response: Floats,
    slope: Floats,
    slope_damping: Floats,
) -> None:
    """Response of the difference pendulum to theta, and its derivatives with respect to frequency and damping.

    `c(t) = int_0^t exp(lam (t-s)) theta(s) ds`, lam = -decay + i frequency;
    `response = direct theta + Im(gain c)`, `slope = Im(gain_slope c + i gain dc/dlam)`,
    `slope_damping = Im(gain_slope_damping c - gain dc/dlam)`, where dc/dlam weighs each interval by its age.
    All arrays (n,), the integrals (n - 1,).
    """
    count = theta.size
    steps = np.arange(1, BLOCK + 1)
    forward = np.exp((-decay + 1j * frequency) * step * steps)
    backward = 1.0 / forward
    fore_real, fore_imag = forward.real.copy(), forward.imag.copy()
    back_real, back_imag = backward.real.copy(), backward.imag.copy()
    wr, wi, sr, si, ar, ai = np.empty((6, BLOCK))
    gain_real, gain_imag = gain.real, gain.imag
    slope_real, slope_imag = gain_slope.real, gain_slope.imag
    damping_real, damping_imag = gain_slope_damping.real, gain_slope_damping.imag
    c = 0.0 + 0.0j
    age = 0.0 + 0.0j
    response[0] = direct * theta[0]
    slope[0] = 0.0
    slope_damping[0] = 0.0
    start = 0
    while start < count - 1:
        length = min(BLOCK, count - 1 - start)
        # in the block: c_{m+1} = F_{m+1} (c_0 + S_m),  S_m = sum_{i<=m} v_i / F_{i+1}; the sums run alone, so that the
        # rest of the work is free of their chain
        vr = integral_real[start : start + length]
        vi = integral_imag[start : start + length]
        for m in range(length):
            wr[m] = vr[m] * back_real[m] - vi[m] * back_imag[m]
            wi[m] = vr[m] * back_imag[m] + vi[m] * back_real[m]
        sum_real, sum_imag = c.real, c.imag
        old_real, old_imag = age.real, age.imag
        for m in range(length):
            # an interval's content is on average half a step old at its end
            old_real += step * (sum_real + 0.5 * wr[m])
            old_imag += step * (sum_imag + 0.5 * wi[m])
            sum_real += wr[m]
            sum_imag += wi[m]
            sr[m], si[m] = sum_real, sum_imag
            ar[m], ai[m] = old_real, old_imag
        th = theta[start + 1 : start + 1 + length]
        resp = response[start + 1 : start + 1 + length]
        slo = slope[start + 1 : start + 1 + length]
        dam = slope_damping[start + 1 : start + 1 + length]
        for m in range(length):
            cr = fore_real[m] * sr[m] - fore_imag[m] * si[m]
            ci = fore_real[m] * si[m] + fore_imag[m] * sr[m]
            gr = fore_real[m] * ar[m] - fore_imag[m] * ai[m]
            gi = fore_real[m] * ai[m] + fore_imag[m] * ar[m]
            resp[m] = direct * th[m] + gain_real * ci + gain_imag * cr
            slo[m] = slope_real * ci + slope_imag * cr + gain_real * gr - gain_imag * gi
            dam[m] = damping_real * ci + damping_imag * cr - gain_real * gi - gain_imag * gr
        last = complex(fore_real[length - 1], fore_imag[length - 1])
        c = last * complex(sum_real, sum_imag)
        age = last * complex(old_real, old_imag)
        start += length


@summing_kernel
def moments(
    difference: Floats,
    response: Floats,
    slope: Floats,
    slope_damping: Floats,
    step: float,
    decay: float,
    frequency: float,
    coefficient: Floats,
    threshold: float,
    gram: Floats,
) -> int:
    """Accumulate the Gram matrix of (cos, sin, 1, t cos, t sin, slope, slope_damping, e).

    cos and sin carry the decay; t runs from -1 to 1 over the record; e is the residual `difference - response - A cos
    - B sin - offset`, coefficient = (A, B, offset). Samples that are NaN, or where e exceeds `threshold`, have no
    weight. gram (8, 8) gets its upper triangle only. Returns the number of samples beyond the threshold.
    """
    count = difference.size
    forward_real, forward_imag = np.empty(BLOCK), np.empty(BLOCK)
    for m in range(BLOCK):
        size = np.exp(-decay * step * m)
        forward_real[m] = size * np.cos(frequency * step * m)
        forward_imag[m] = size * np.sin(frequency * step * m)
    unit = 2.0 / (count - 1)
    amplitude_cos, amplitude_sin, offset = coefficient
    gram[:] = 0.0
    beyond = 0
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        origin = np.exp((-decay + 1j * frequency) * (start * step))
        base = start * unit - 1.0
        d = difference[start : start + length]
        f = response[start : start + length]
        g = slope[start : start + length]
        h = slope_damping[start : start + length]
        cc = cs = ss = c1 = s1 = n1 = 0.0
        tcc = tcs = tss = tc1 = ts1 = ttcc = ttcs = ttss = 0.0
        gc = gs = g1 = gtc = gts = gg = ge = 0.0
        hc = hs = h1 = htc = hts = hg = hh = he = 0.0
        ec = es = e1 = etc = ets = ee = 0.0
        out = 0
        for m in range(length):
            cos = origin.real * forward_real[m] - origin.imag * forward_imag[m]
            sin = origin.real * forward_imag[m] + origin.imag * forward_real[m]
            e = d[m] - f[m] - amplitude_cos * cos - amplitude_sin * sin - offset
            use = abs(e) <= threshold
            out += 1 if abs(e) > threshold else 0
            w = 1.0 if use else 0.0
            e = e if use else 0.0
            t = base + m * unit
            wc, ws, wg, wh = w * cos, w * sin, w * g[m], w * h[m]
            tc, ts = t * wc, t * ws
            cc += wc * cos
            cs += wc * sin
            ss += ws * sin
            c1 += wc
            s1 += ws
            n1 += w
            tcc += tc * cos
            tcs += tc * sin
            tss += ts * sin
            tc1 += tc
            ts1 += ts
            ttcc += tc * t * cos
            ttcs += tc * t * sin
            ttss += ts * t * sin
            gc += wg * cos
            gs += wg * sin
            g1 += wg
            gtc += wg * t * cos
            gts += wg * t * sin
            gg += wg * g[m]
            ge += wg * e
            hc += wh * cos
            hs += wh * sin
            h1 += wh
            htc += wh * t * cos
            hts += wh * t * sin
            hg += wh * g[m]
            hh += wh * h[m]
            he += wh * e
            ec += e * cos
            es += e * sin
            e1 += e
            etc += e * t * cos
            ets += e * t * sin
            ee += e * e
        beyond += out
        gram[0, 0] += cc
        gram[0, 1] += cs
        gram[0, 2] += c1
        gram[0, 3] += tcc
        gram[0, 4] += tcs
        gram[0, 5] += gc
        gram[0, 6] += hc
        gram[0, 7] += ec
        gram[1, 1] += ss
        gram[1, 2] += s1
        gram[1, 3] += tcs
        gram[1, 4] += tss
        gram[1, 5] += gs
        gram[1, 6] += hs
        gram[1, 7] += es
        gram[2, 2] += n1
        gram[2, 3] += tc1
        gram[2, 4] += ts1
        gram[2, 5] += g1
        gram[2, 6] += h1
        gram[2, 7] += e1
        gram[3, 3] += ttcc
        gram[3, 4] += ttcs
        gram[3, 5] += gtc
        gram[3, 6] += htc
        gram[3, 7] += etc
        gram[4, 4] += ttss
        gram[4, 5] += gts
        gram[4, 6] += hts
        gram[4, 7] += ets
        gram[5, 5] += gg
        gram[5, 6] += hg
        gram[5, 7] += ge
        gram[6, 6] += hh
        gram[6, 7] += he
        gram[7, 7] += ee
    return beyond


@kernel
def residuals(
    difference: Floats,
    response: Floats,
    step: float,
    decay: float,
    frequency: float,
    coefficient: Floats,
    threshold: float,
    out: Floats,
) -> None:
    """Difference less the model of `moments`; NaN where missing or beyond the threshold. All (n,)."""
    count = difference.size
    forward = np.exp((-decay + 1j * frequency) * step * np.arange(BLOCK))
    amplitude_cos, amplitude_sin, offset = coefficient
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        origin = np.exp((-decay + 1j * frequency) * (start * step))
        # Re[(A - iB) origin F] for the whole block
        free = (amplitude_cos - 1j * amplitude_sin) * origin
        d = difference[start : start + length]
        f = response[start : start + length]
        r = out[start : start + length]
        for m in range(length):
            value = d[m] - f[m] - offset - (free.real * forward[m].real - free.imag * forward[m].imag)
            r[m] = value if abs(value) <= threshold else np.nan
