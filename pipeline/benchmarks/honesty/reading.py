"""What instrument and reading make of elongations: each fault a few lines, in the order of nature."""

from __future__ import annotations

import numpy as np

from pipeline.benchmarks.honesty.kinds import Case
from pipeline.benchmarks.honesty.plain import Floats

_BURST = 2.0  # s
_BAD = 3e-3  # rad: outliers and bursts
_ROLL = 8.0  # s
_ROUND = 120.0  # s


def sample_times(case: Case, random: np.random.Generator) -> Floats:
    """Times of the samples, s: even, jittered or with samples missing."""
    index = np.arange(int(case.duration * case.rate) + 1)
    times = (index + case.jitter * random.uniform(-0.5, 0.5, index.size)) / case.rate
    times -= times[0]
    kept = random.random(index.size) >= case.lost
    kept[[0, -1]] = True
    return times[kept]


def read(traces: Floats, tilt: Floats, times: Floats, case: Case, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Traces as they are read, NaN where nothing is; and the tilt of the case, rad.

    Parameters
    ----------
    traces : (traces, samples) float64
        The first pendulum's elongation and the differences, rad.
    tilt : (samples,) float64
        Of the case, beside its roll, rad.
    times : (samples,) float64
        s.
    """
    out, roll = _scaled(traces + case.cubic * traces**3, times, case, random)
    tilt = tilt + roll
    out[0] -= tilt
    out += case.noise * random.normal(size=out.shape)
    _spoil(out, times, case, random)
    largest = np.max(np.abs(out), axis=1, keepdims=True)
    if case.clip < 1.0:
        out = np.clip(out, -case.clip * largest, case.clip * largest)
    if case.quantisation:
        out = np.round(out / case.quantisation) * case.quantisation
    _lose(out, times, case, random)
    return out, tilt


def _scaled(traces: Floats, times: Floats, case: Case, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Gains and zeros; and the case's roll, which drops out of differences."""
    out: Floats = traces * (1.0 + case.gain_all * random.choice([-1, 1]))
    later = times > case.duration * random.uniform(0.3, 0.7)
    out[0] *= 1.0 + case.gain_first * random.choice([-1, 1])
    out[0] += random.choice([-1, 1]) * (case.zero_first + case.zero_drift * (times / case.duration - 0.5))
    out[0] += random.choice([-1, 1]) * case.zero_step_first * later
    out[1] += random.choice([-1, 1]) * case.zero_step_difference * later
    if case.zero_steps:
        steps = [size * (times > case.duration * random.random()) for size in random.normal(size=6)]
        out[0] += case.zero_steps * np.sum(steps, axis=0)
    roll = 2.0 * np.pi * times / (_ROLL * random.uniform(0.9, 1.1)) + random.uniform(0.0, 2.0 * np.pi)
    return out, np.radians(case.tilt) * np.cos(roll)


def _spoil(out: Floats, times: Floats, case: Case, random: np.random.Generator) -> None:
    """Outliers, bursts, and traces that are not what they are called."""
    wrong = random.random(out.shape) < case.outliers
    out[wrong] += _BAD * random.standard_t(3.0, size=int(wrong.sum()))
    for begin in random.uniform(0.0, case.duration, case.bursts):
        during = (times >= begin) & (times < begin + _BURST)
        out[:, during] += _BAD * random.normal(size=(out.shape[0], int(during.sum())))
    if case.copied:
        during = times <= case.copied * case.duration
        out[-1, during] = out[0, during]
    if case.dead:
        during = times >= (1.0 - case.dead) * case.duration
        out[-1, during] = case.noise * random.normal(size=int(during.sum()))


def _lose(out: Floats, times: Floats, case: Case, random: np.random.Generator) -> None:
    """Gaps, never so near the ends that nothing is left outside."""
    for k in range(case.gaps if case.gap else 0):
        room = (0.9 * case.duration) / case.gaps
        begin = 0.05 * case.duration + room * k + random.uniform(0.0, max(room - case.gap, 0.0))
        out[:, (times >= begin) & (times < begin + case.gap)] = np.nan
    begin = random.uniform(0.1, 0.6) * case.duration
    out[0, (times >= begin) & (times < begin + case.first_gap)] = np.nan
    out[:, times % _ROUND >= _ROUND - case.lost_of_two_minutes] = np.nan
