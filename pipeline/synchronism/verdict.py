"""What two clocks do: locked (at which angle, from when), drifting, or locked by turns; slips; how sure that is.

`psi`, the phase of one less that of the other, is judged on its second half: settled there, or settling, it is locked;
turning on, it drifts. Where it turns on but waits at one angle much longer than elsewhere (Adler's slips near the
edge, or long rests between slips), it is intermittent.
"""

import math
from typing import Any

import numpy as np

from pipeline.arrays import Floats

_LEAST = 8
ANGLE = math.radians(15.0)  # Locked angles nearer than this to 0, pi and +-pi/2 bear these names
STEADY = 0.15  # rad: what psi may move in half a record and count as locked; slower drift cannot be told from settling
RESTING = 0.5  # Length of the mean of e^{i psi} or e^{2i psi} from which slipping clocks count as resting in between
_NEAR = 0.1  # rad about the last angle within which psi counts as arrived
_BLOCKS = 8
_TWO_PI = 2.0 * math.pi


def allan_deviation(time: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """Overlapping Allan deviation of clocks.

    Of phases (clocks, k), rad, unwrapped, at evenly spaced times (k,), s, the longest stretch without a gap in any
    clock is used. Returns averaging times (m,), s, one octave apart, and deviations (clocks, m) of the relative rate.
    """
    part = _longest(np.asarray(np.isfinite(phase).all(axis=0)))
    stretch, spacing = phase[:, part], float(time[1] - time[0])
    size = stretch.shape[1]
    if size < _LEAST:
        return np.empty(0), np.empty((len(phase), 0))
    # a clock's own mean rate is no instability
    ahead = stretch * (spacing * (size - 1)) / (stretch[:, -1:] - stretch[:, :1])  # s: the time each clock shows
    octaves = [step for step in (1 << k for k in range(size.bit_length())) if size - 2 * step > 1]
    seconds = [ahead[:, 2 * step :] - 2.0 * ahead[:, step:-step] + ahead[:, : -2 * step] for step in octaves]
    averaging = spacing * np.array(octaves, dtype=np.float64)
    return averaging, np.sqrt([0.5 * np.mean(each**2, axis=1) for each in seconds]).T / averaging


def _longest(known: np.ndarray) -> slice:
    """The longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]])))
    starts, ends = edges[::2], edges[1::2]
    if starts.size == 0:
        return slice(0, 0)
    best = int(np.argmax(ends - starts))
    return slice(int(starts[best]), int(ends[best]))


def block_slope(time: Floats, values: Floats, blocks: int) -> tuple[float, float]:
    """Slope and its sigma by means of blocks, whose scatter holds for noise of any colour shorter than a block."""
    parts = np.array_split(np.flatnonzero(np.isfinite(values)), blocks)
    x, means = (np.array([series[each].mean() for each in parts]) for series in (time, values))
    x -= x.mean()
    slope = float(x @ means / (x @ x))
    rest = means - means.mean() - slope * x
    return slope, float(np.sqrt(rest @ rest / (blocks - 2) / (x @ x)))


def judge(time: Floats, psi: Floats, sigma: Floats, slips: tuple[float, ...]) -> dict[str, Any]:
    """Judge the phase difference of two clocks, (k,) rad unwrapped with its sigma; NaN = missing, 8 known at least.

    Returns variables of /synchrony: the verdict; its confidence, 0 to 1, the distance to any other verdict in the
    record's own scatter (0.5 is a toss-up); the angle at which they are, or mostly are, locked, in (-pi, pi], with its
    sigma; the time, s from the first instant, from which psi stays. NaN for what there is not.

    Examples
    --------
    >>> t = np.arange(100.0)
    >>> judge(t, np.pi * (1.0 - np.exp(-t / 10.0)), np.full(100, 1e-3), ())["verdict"]
    'antiphase'
    >>> judge(t, 0.1 * t, np.full(100, 1e-3), slip_times(t, 0.1 * t))["verdict"]
    'drifting'
    """
    present = np.isfinite(psi)
    time, psi, sigma = time[present], psi[present], sigma[present]
    later = time >= 0.5 * (time[0] + time[-1])
    # how far psi moves from one end to the other; noise may be slow
    span = float(np.ptp(time[later]))
    moved, moved_sigma = (span * each for each in block_slope(time[later], psi[later], _BLOCKS))
    noise = float(np.median(sigma))
    if abs(moved) <= STEADY and float(np.ptp(psi[later])) <= 2.0 * (STEADY + 4.0 * noise):
        return _locked(time, psi, noise, moved, moved_sigma)
    settling = _settling(time[later], psi[later])
    if settling is not None and abs(moved) < 0.5 * math.pi:
        return _locked(time, psi, noise, settling, moved_sigma)
    return _slipping(psi, moved, moved_sigma, slips)


def slip_times(time: Floats, psi: Floats) -> tuple[float, ...]:
    """Times at which psi has moved by another whole turn, either way, since the start or the slip before."""
    present = np.isfinite(psi)
    time, psi = time[present], psi[present]
    found, base = [], float(psi[0])
    for instant, angle in zip(time.tolist(), psi.tolist(), strict=True):
        while abs(angle - base) >= _TWO_PI:
            base += math.copysign(_TWO_PI, angle - base)
            found.append(instant)
    return tuple(found)


def _settling(time: Floats, psi: Floats) -> float | None:
    """What is left to move if psi slows down as one that settles does, three to one from part to part; else None."""
    parts = [float(each.mean()) for each in np.array_split(psi, 3)]
    first, second = parts[1] - parts[0], parts[2] - parts[1]
    if first * second < 0.0 or abs(second) > abs(first) / 3.0:
        return None
    ratio = second / first if first else 0.0
    return second * ratio / (1.0 - ratio)


def _said(state: str, confidence: float, angle: float, sigma: float, lock_time: float = math.nan) -> dict[str, Any]:
    said = {"verdict": state, "confidence": confidence, "locked_angle": angle, "locked_angle_sigma": sigma}
    return said | {"lock_time": lock_time}


def _locked(time: Floats, psi: Floats, noise: float, moved: float, moved_sigma: float) -> dict[str, Any]:
    last = psi[time >= time[0] + 0.75 * (time[-1] - time[0])]
    angle = float(np.median(last))
    spread = float(np.std(last)) if last.size > 1 else 0.0
    sigma = max(noise / math.sqrt(last.size), spread / math.sqrt(_BLOCKS))
    away = np.flatnonzero(np.abs(psi - angle) > _NEAR + 4.0 * max(noise, spread))
    first = 0 if away.size == 0 else min(int(away[-1]) + 1, time.size - 1)
    folded = math.remainder(angle, _TWO_PI)
    names = {"in phase": 0.0, "antiphase": math.pi, "quadrature": 0.5 * math.pi}
    apart = {name: abs(math.remainder(abs(folded) - place, _TWO_PI)) for name, place in names.items()}
    state = min(apart, key=lambda name: apart[name])
    margin = abs(ANGLE - apart[state])
    if apart[state] > ANGLE:
        state = "other angle"
    certain = min(_sure(margin, sigma), _sure(STEADY - abs(moved), moved_sigma))
    return _said(state, certain, folded, sigma, float(time[first] - time[0]))


def _slipping(psi: Floats, moved: float, moved_sigma: float, slips: tuple[float, ...]) -> dict[str, Any]:
    turns, whole = math.floor(abs(psi[-1] - psi[0]) / _TWO_PI), psi
    if turns:  # from the end back: a part of a turn would look like a rest
        whole = psi[np.flatnonzero(np.abs(psi[-1] - psi) >= turns * _TWO_PI)[-1] :]
    rests = [complex(np.exp(1j * order * whole).mean()) for order in (1, 2)]
    if len(slips) and max(abs(each) for each in rests) >= RESTING:
        order = 1 if abs(rests[0]) >= RESTING else 2
        angle = math.remainder(float(np.angle(rests[order - 1])) / order, _TWO_PI)
        scatter = math.sqrt(max(-2.0 * math.log(abs(rests[order - 1])), 0.0)) / order
        certain = _sure(max(map(abs, rests)) - RESTING, 0.3 / math.sqrt(len(slips)))
        return _said("intermittent", certain, angle, scatter)
    certain = _sure(abs(moved) - STEADY, moved_sigma)
    if slips:
        certain = min(certain, _sure(RESTING - max(map(abs, rests)), 0.3 / math.sqrt(len(slips))))
    return _said("drifting", certain, math.nan, math.nan)


def _sure(margin: float, sigma: float) -> float:
    """Probability that a margin with this sigma is above zero."""
    return 0.5 * (1.0 + math.erf(margin / (math.sqrt(2.0) * max(sigma, 1e-12))))
