"""How the pendulums of `ship_motion` are read: clock, optics, noise, damage, and what is recorded beside them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from tests.pipeline.ship_motion import DAY, Course, Draft, Floats, Random, Ship, Swing, log_uniform, narrow, signed

_EXPOSURES = 8
"""Instants over which an exposure is averaged."""


@dataclass
class Readings:
    """Elongations as they are read."""

    stamps: Floats
    """s from the record's begin, as the record states them."""
    times: Floats
    """s, when they were read."""
    clock: float
    """True s in a day of the chronometer, less a day."""
    angles: Floats
    """rad, (traces, samples)."""
    doubt: np.ndarray[Any, np.dtype[np.uint16]] | None = None
    """Quality of each sample."""
    beside: dict[str, Floats] = field(default_factory=dict)
    """What else is recorded, by name."""


def read(draft: Draft, ship: Ship, swing: Swing) -> Readings:
    """Read the pendulums, and record what the draft wants beside them."""
    stamps, times, clock = _clock(draft)
    case, random = _case(draft), draft.random("noise")
    readings = Readings(stamps, times, clock, _seen(draft, swing, times, case))
    share = stamps / draft.duration
    _optics(draft, readings, share)
    _add_noise(draft, readings, share, random)
    _limit(draft, readings)
    _damage(draft, readings)
    stated = stamps * (1 + clock / DAY)
    if draft.spec["records_heave"]:
        draft.series["vertical_acceleration"] = _heave(draft, ship, stated, share, random)
    if draft.spec["records_sway"]:
        draft.series["horizontal_acceleration"] = ship.sway(stated) + 1e-4 * random.normal(size=stated.size)
    if fault := draft.fault("casetilt_rec"):
        draft.series["case_tilt"] = case(stated) + log_uniform(fault, 1e-5, 3e-4) * fault.normal(size=stated.size)
    readings.beside = {name: value(stated) if callable(value) else value for name, value in draft.series.items()}
    return readings


def _clock(draft: Draft) -> tuple[Floats, Floats, float]:
    """Stamps, the times at which is read, and the rate of the chronometer, s/day."""
    rate, instrument = draft.spec["chronometer_rate"] or 0.0, draft.instrument
    random = draft.fault("rateerr")
    if random or draft.spec["chronometer_rate"] is not None:
        sigma = log_uniform(random, 0.05, 2.0) if random else 0.05
        error = sigma * draft.random("rateerr2").normal()
        if draft.spec["chronometer_rate"] is None:
            rate, stated = error, 0.0
            draft.known["rateerr"] = [sigma, rate]
        else:
            stated = rate + error
        instrument |= {"chronometer_rate": ((), stated), "chronometer_rate_uncertainty": ((), sigma)}
    step, count = 1 / draft.spec["rate"], int(draft.duration * draft.spec["rate"]) + 1
    stamps = np.arange(count) / draft.spec["rate"]
    times = stamps * (1 + rate / DAY)
    if random := draft.fault("jump"):
        place, size = random.uniform(0.2, 0.8) * draft.duration, signed(random, 2e-4, 5e-2)
        times, draft.known["jump"] = times + np.where(stamps > place, size, 0), [place, size]
    if random := draft.fault("jitter"):
        sigma = log_uniform(random, 2e-5, 3e-3)
        times = times + sigma * np.clip(random.normal(size=count), -3, 3)
        stated = bool(random.random() < 0.5)
        draft.known["jitter"] = {"sigma": sigma, "stated": stated}
        draft.series |= {"time_uncertainty": np.full(count, sigma)} if stated else {}
    if random := draft.fault("roundtime"):
        unit = min(float(random.choice([1e-3, 5e-3])), 0.2 * step)
        stamps = stamps + 0.3 * step * random.uniform(0, 1, count)
        times, draft.known["roundtime"] = stamps * (1 + rate / DAY), unit
        stamps = np.round(stamps / unit) * unit
    return stamps, times, rate


def combinations_of(layout: list[str], count: int) -> Floats:
    """Factors of the pendulums, (traces, pendulums), of traces called "1" or "1-2"."""
    out = np.zeros((len(layout), count))
    for row, name in zip(out, layout, strict=True):
        for label, sign in zip(name.split("-"), (1.0, -1.0), strict=False):
            row[int(label) - 1] += sign
    return out


def _case(draft: Draft) -> Course:
    """Tilt of the case."""
    if not (draft.fault("casetilt") or draft.fault("casetilt_rec")):
        return np.zeros_like
    random = draft.random("casetilt")
    size, period = np.radians(log_uniform(random, 0.03, 1.0)), random.uniform(5, 14)
    tones = narrow(random, size, 1 / period, 0.1, 20)
    rest = size * 0.2 * random.normal()
    draft.known["casetilt"] = [size, period, rest]
    return lambda times: tones.at(times) + rest


def _seen(draft: Draft, swing: Swing, times: Floats, case: Course) -> Floats:
    """Elongations of the traces before optics and noise."""
    layout, count = draft.spec["layout"], len(draft.spec["periods"])
    combinations = combinations_of(layout, count)
    seen, late, instants = combinations, np.zeros(len(layout)), np.zeros(1)
    if random := draft.fault("crosstalk"):
        size = log_uniform(random, 1e-4, 2e-2)
        mixture = np.eye(count) + size * (1 - np.eye(count)) * random.normal(size=(count, count))
        seen, draft.known["crosstalk"] = combinations @ mixture, mixture.tolist()
    if random := draft.fault("tracedelay"):
        delay = signed(random, 2e-4, 2e-2)
        late[random.integers(len(layout))] = delay
        draft.known["tracedelay"] = late.tolist()
    if random := draft.fault("exposure"):
        exposure = log_uniform(random, 0.005, min(0.1, 0.8 / draft.spec["rate"]))
        instants = exposure * ((np.arange(_EXPOSURES) + 0.5) / _EXPOSURES - 0.5)
        draft.known["exposure"] = exposure
    out = np.zeros((len(layout), times.size))
    for row, factors, tilted, delay in zip(out, seen, combinations.sum(axis=1), late, strict=True):
        for instant in instants:
            at = times - delay + instant
            row += sum(factor * swing.at(k, at) for k, factor in enumerate(factors) if factor) - tilted * case(at)
    return out / instants.size


def _optics(draft: Draft, readings: Readings, share: Floats) -> None:
    """Scales and zeros of the traces."""
    angles, known = readings.angles, draft.known
    count = len(angles)
    if random := draft.fault("optics"):
        if random.random() < 0.5:
            angles, known["optics"] = np.tan(2 * angles) / 2, "tangent"
        else:
            known["optics"] = log_uniform(random, 0.1, 3)
            angles = angles + known["optics"] * angles**3
    if random := draft.fault("gain"):
        which = random.integers(count)
        gains = np.ones(count)
        gains[which] += signed(random, 1e-3, 3e-2)
        angles, known["gain"] = angles * gains[:, None], gains.tolist()
    if random := draft.fault("scalecommon"):
        sigma = log_uniform(random, 2e-3, 2e-2)
        scale = 1 + sigma * random.normal()
        angles, known["scalecommon"] = angles * scale, [sigma, scale]
        draft.instrument["scale_uncertainty"] = ((), sigma)
    if random := draft.fault("gaindrift"):
        slopes = log_uniform(random, 1e-3, 2e-2) * random.normal(size=count)
        angles, known["gaindrift"] = angles * (1 + slopes[:, None] * share), slopes.tolist()
    if random := draft.fault("zero"):
        zeros = log_uniform(random, 3e-4, 1e-2) * random.normal(size=count)
        angles, known["zero"] = angles + zeros[:, None], zeros.tolist()
    if random := draft.fault("zerodrift"):
        sizes, kind = log_uniform(random, 3e-4, 6e-3) * random.normal(size=count), int(random.integers(3))
        course = (share, 1 - np.exp(-4 * share), np.sin(2 * np.pi * (share + 0.13) * 1.3))[kind]
        angles, known["zerodrift"] = angles + sizes[:, None] * course, [sizes.tolist(), kind]
    readings.angles = angles


def _add_noise(draft: Draft, readings: Readings, share: Floats, random: Random) -> None:
    """Noise of the readings, white and otherwise."""
    sigma, known, shape = draft.spec["noise"], draft.known, readings.angles.shape
    noise = sigma * random.normal(size=shape)
    if fault := draft.fault("noisier"):
        place, factor = fault.uniform(0.2, 0.7), log_uniform(fault, 2, 8)
        noise = noise * np.where((share > place) & (share < place + 0.25), factor, 1.0)
        known["noisier"] = [place, factor]
    readings.angles = readings.angles + noise
    if fault := draft.fault("coloured"):
        memory, size = log_uniform(fault, 0.2, 200), sigma * log_uniform(fault, 0.3, 5)
        kept = np.exp(-1 / draft.spec["rate"] / memory)
        filtered = lfilter([np.sqrt(1 - kept**2)], [1, -kept], fault.normal(size=shape), axis=1)
        readings.angles, known["coloured"] = readings.angles + size * filtered, [memory, size]
    if fault := draft.fault("hum"):
        size, frequency = sigma * log_uniform(fault, 0.3, 5), fault.uniform(1.5, 60)
        phases = fault.uniform(0, 6, size=(shape[0], 1))
        readings.angles = readings.angles + size * np.cos(2 * np.pi * frequency * readings.times + phases)
        known["hum"] = [frequency, size]


def _limit(draft: Draft, readings: Readings) -> None:
    """What is not read beyond a limit, sticks, comes in units, or is hit by bursts."""
    angles, rate = readings.angles, draft.spec["rate"]
    traces, count = angles.shape
    if draft.fault("clip") or draft.fault("offedge"):
        fault = draft.random("clip")
        limits, which = fault.uniform(0.6, 0.95) * np.abs(angles).max(axis=1), int(fault.integers(traces))
        limit, own = limits[which], angles[which]
        angles[which] = (
            np.clip(own, -limit, limit) if draft.fault("clip") else np.where(np.abs(own) > limit, np.nan, own)
        )
        draft.known["clip"] = [which, float(limit)]
    if random := draft.fault("stick"):
        for _ in range(random.integers(1, 25)):
            which, first = int(random.integers(traces)), int(random.integers(count))
            length = random.integers(2, max(3, int(3 * rate)))
            angles[which, first : first + length] = angles[which, first]
    if random := draft.fault("quant"):
        unit = draft.known["quant"] = log_uniform(random, 1e-5, 5e-4)
        angles[:] = np.round(angles / unit) * unit
    if random := draft.fault("bursts"):
        for _ in range(random.integers(1, 12)):
            which, first = int(random.integers(traces)), int(random.integers(count))
            hit = angles[which, first : first + random.integers(1, max(2, int(2 * rate)))]
            hit += log_uniform(random, 1e-3, 0.05) * random.normal(size=hit.size) * (random.random(hit.size) < 0.8)


def _damage(draft: Draft, readings: Readings) -> None:
    """Traces that die, are turned or exchanged; gaps, and gaps that somebody filled."""
    angles, known = readings.angles, draft.known
    traces, count = angles.shape
    if random := draft.fault("dies"):
        which, first, kind = (
            int(random.integers(traces)),
            int(count * random.uniform(0.3, 0.8)),
            int(random.integers(3)),
        )
        rest = 3 * draft.spec["noise"] * random.normal(size=count - first) if kind == 2 else angles[which, first]
        angles[which, first:] = np.nan if kind == 0 else rest
        known["dies"] = [which, first / count, kind]
    if random := draft.fault("flip"):
        which = known["flip"] = int(random.integers(traces))
        angles[which] *= -1
    if draft.fault("swapped"):
        angles[[0, 1]] = angles[[1, 0]]
    for begin, length in draft.gaps if draft.spec["gap_kind"] != "rows" else ():
        gap = (readings.stamps >= begin) & (readings.stamps < begin + length)
        angles[:, gap] = np.nan
        if draft.spec["gap_kind"] == "qc":
            readings.doubt = np.zeros(angles.shape, np.uint16) if readings.doubt is None else readings.doubt
            readings.doubt[:, gap] |= 1
    if random := draft.fault("filled"):
        for _ in range(3):
            first = int(random.integers(int(0.1 * count), int(0.9 * count)))
            last = min(first + int(log_uniform(random, 0.5, 20) * draft.spec["rate"]) + 2, count - 1)
            which = int(random.integers(traces))
            angles[which, first:last] = np.linspace(angles[which, first], angles[which, last], last - first)


def _heave(draft: Draft, ship: Ship, times: Floats, share: Floats, random: Random) -> Floats:
    """The vertical acceleration as an accelerometer has it, with its faults."""
    spec, known = draft.spec, draft.known
    late = 0.0
    if fault := draft.fault("acc_delay"):
        late = known["acc_delay"] = log_uniform(fault, 0.01, 0.8)
    fast_enough = spec["engine"] is None or spec["rate"] > 4 * spec["engine"][1]
    out = ship.heave(times - late, fast_enough) + 1e-4 * random.normal(size=times.size)
    if fault := draft.fault("acc_scale"):
        scale = known["acc_scale"] = 1 + 0.1 * fault.normal()
        out *= scale
    if draft.fault("acc_sign"):
        out *= -1
    if fault := draft.fault("acc_cross"):
        part = known["acc_cross"] = 0.05 * fault.normal()
        out += part * ship.sway(times)
    if fault := draft.fault("acc_noise"):
        sigma = known["acc_noise"] = log_uniform(fault, 1e-3, 3e-2)
        out += sigma * draft.random("acc_noise2").normal(size=times.size)
    if fault := draft.fault("acc_bias"):
        bias = signed(fault, 1e-4, 3e-2)
        drift = bias * fault.normal() * 0.3
        out += bias + drift * share
        known["acc_bias"] = [bias, drift]
    if fault := draft.fault("acc_gap"):
        for _ in range(fault.integers(1, 4)):
            begin, length = fault.uniform(0, 0.9), log_uniform(fault, 0.01, 0.3)
            out[(share > begin) & (share < begin + length)] = np.nan
    return out
