"""A record of the suite by kind, strength and seed alone, with the gravity that it should give: first what instrument
and reading make of elongations, each fault a few lines, in the order of nature."""

import copy
import hashlib
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from xarray import Dataset, DataTree

from data_schemas.contents import identifier
from data_schemas.layouts import root_attributes
from data_schemas.variables import attributes, dataset
from pipeline.arrays import Floats
from pipeline.benchmarks import plain
from pipeline.benchmarks.kinds import MIXABLE, Case, case_of

_BURST = 2.0  # s
_BAD = 3e-3  # rad: outliers and bursts
_ROLL = 8.0  # s
_ROUND = 120.0  # s
REFERENCE = 9.81  # m/s^2, at which the periods are stated
_MGAL = 1e-5  # m/s^2
_SLOW = 10.0  # s, of an acceleration that planes of swing follow
_WAY = 5.0  # m/s, of a ship that turns
Random = np.random.Generator


def read(traces: Floats, tilt: Floats, times: Floats, case: Case, random: Random) -> tuple[Floats, Floats]:
    """Traces (traces, samples) as they are read, rad, NaN where nothing is; and the case's tilt with its roll, rad."""
    # gains and zeros
    out = (traces + case.cubic * traces**3) * (1.0 + case.gain_all * random.choice([-1, 1]))
    later = times > case.duration * random.uniform(0.3, 0.7)
    out[0] *= 1.0 + case.gain_first * random.choice([-1, 1])
    out[0] += random.choice([-1, 1]) * (case.zero_first + case.zero_drift * (times / case.duration - 0.5))
    out[0] += random.choice([-1, 1]) * case.zero_step_first * later
    out[1] += random.choice([-1, 1]) * case.zero_step_difference * later
    if case.zero_steps:
        steps = [size * (times > case.duration * random.random()) for size in random.normal(size=6)]
        out[0] += case.zero_steps * np.sum(steps, axis=0)
    # the case's roll, which drops out of differences, and noise
    roll = 2.0 * np.pi * times / (_ROLL * random.uniform(0.9, 1.1)) + random.uniform(0.0, 2.0 * np.pi)
    tilt = tilt + np.radians(case.tilt) * np.cos(roll)
    out[0] -= tilt
    out += case.noise * random.normal(size=out.shape)
    # outliers, bursts, and traces that are not what they are called
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
    if case.clip < 1.0:
        largest = np.max(np.abs(out), axis=1, keepdims=True)
        out = np.clip(out, -case.clip * largest, case.clip * largest)
    if case.quantisation:
        out = np.round(out / case.quantisation) * case.quantisation
    # gaps, never so near the ends that nothing is left outside
    for k in range(case.gaps if case.gap else 0):
        room = (0.9 * case.duration) / case.gaps
        begin = 0.05 * case.duration + room * k + random.uniform(0.0, max(room - case.gap, 0.0))
        out[:, (times >= begin) & (times < begin + case.gap)] = np.nan
    begin = random.uniform(0.1, 0.6) * case.duration
    out[0, (times >= begin) & (times < begin + case.first_gap)] = np.nan
    out[:, times % _ROUND >= _ROUND - case.lost_of_two_minutes] = np.nan
    return out, tilt


class Made(NamedTuple):
    """A record and the truth that a reduction must not see."""

    tree: DataTree  # Layout "isochrony-record"
    gravity: float  # mean over the record, m/s^2
    law: Floats  # of gravity in time, see `plain.gravity_at`


def record(kind: str, strength: str, seed: int, *, duration: float | None = None) -> Made:
    """The record of that kind, strength and number, always the same; of another duration, s, if one is given."""
    digest = hashlib.sha256(f"{kind}/{strength}/{seed}".encode()).digest()
    random = np.random.default_rng(np.frombuffer(digest, dtype="<u4"))
    case = case_of(kind, strength)
    if kind == "mixture":
        for name in random.choice(MIXABLE, 3, replace=False):
            case = case_of(str(name), strength, case)
    return of_case(case if duration is None else replace(case, duration=duration), random, f"{kind}-{strength}-{seed}")


def of_case(case: Case, random: Random, label: str) -> Made:
    """Make a record of a case; what the case leaves open is drawn."""
    period = random.uniform(0.95, 1.05)
    splits = [case.split or random.choice([-1, 1]) * 10.0 ** random.uniform(-4.3, -3.3) for _ in range(2)]
    frequency = 2.0 * np.pi / period / np.array([1.0, *(1.0 + split for split in splits)])[: case.pendulums]
    damping = case.damping + case.damping_difference * np.array([0.5, -0.5, 0.2])[: case.pendulums]
    motion = _motion(case, frequency[0] / (2.0 * np.pi), random)
    slope, wave = case.gravity_change * _MGAL / case.duration, case.gravity_wave * _MGAL
    value, phase = random.uniform(9.78, 9.83), random.uniform(0.0, 2.0 * np.pi)
    law = np.array([value, slope * random.choice([-1, 1]), 0.5 * case.duration, wave, 2.0 * np.pi / 1200.0, phase])
    support = plain.Support(*motion, _pulses(case, random), law)
    every = np.ones(case.pendulums)
    own = plain.Pendulums(REFERENCE / frequency**2, damping, case.quadratic * every, case.friction * every, case.linear)
    index = np.arange(int(case.duration * case.rate) + 1)
    times = (index + case.jitter * random.uniform(-0.5, 0.5, index.size)) / case.rate
    times -= times[0]
    kept = random.random(index.size) >= case.lost
    kept[[0, -1]] = True
    times = times[kept]
    prompt = times + case.delay  # the world begins before the record, by what a trace may come late
    late = prompt - random.choice([-1, 1]) * case.delay
    both = np.unique(np.concatenate([[0.0], prompt, late]))
    if case.rocking:
        support = _rocking(support, case, float(own.length.mean()))
    if case.plane:
        chance, phases = random.spawn(1)[0], random.uniform(0.0, 2.0 * np.pi, support.across.size)
        # a plane at an angle to the first feels some of a sea across, whose phases are its own
        across = np.cos(case.plane) * support.across + np.sin(case.plane) * support.across * np.exp(1j * phases)
        planes = [support, support._replace(across=across)]
        rows = [_swing(both, own, each, case, frequency, copy.deepcopy(chance))[k] for k, each in enumerate(planes)]
        angles = np.array(rows)
    else:
        angles = _swing(both, own, support, case, frequency, random)
    first, shifted = angles[0, np.searchsorted(both, prompt)], angles[:, np.searchsorted(both, late)]
    sway = plain.at(prompt, motion.rate, motion.across)
    leans = -case.follows * sway / REFERENCE
    traces, tilt = read(np.vstack([first, shifted[:-1] - shifted[1:]]), leans, times, case, random)
    heave = plain.at(prompt - case.heave_delay, motion.rate, motion.along) * case.heave_scale
    heave += case.heave_bias * _MGAL * random.choice([-1, 1]) + case.heave_noise * random.normal(size=times.size)
    if case.heave_lost:
        heave[(times / case.duration * 10.0) % 1.0 < case.heave_lost] = np.nan
    states = {"vertical_acceleration": heave} if case.states_heave else {}
    tilts = case.tilt or case.follows
    if tilts and case.states_tilt == "tilt":
        states["case_tilt"] = tilt + case.tilt_noise * random.normal(size=times.size)
    elif tilts and case.states_tilt:
        states["horizontal_acceleration"] = sway + case.heave_noise * random.normal(size=times.size)
    # the clock that is wrong is the record's; a step back never makes time run backwards at these rates
    stamped = times + case.clock_step * random.choice([-1, 1]) * (times > 0.5 * case.duration)
    if case.wow:
        stamped = stamped + case.wow * np.sin(2.0 * np.pi * times / 60.0 + random.uniform(0.0, 2.0 * np.pi))
    dense = np.linspace(0.0, case.duration, 4001)
    gravity = float(np.mean([plain.gravity_at(time, law) for time in 0.5 * (dense[1:] + dense[:-1])]))
    return Made(_tree(label, stamped, traces, states, frequency, damping, case, random), gravity, law)


def _motion(case: Case, swing: float, random: Random) -> plain.Motion:
    parts = [plain.sea(random, case.swell_period, *case.swell), plain.sea(random, case.wind_period, *case.wind_sea)]
    beat = random.choice([-1, 1]) / random.uniform(60.0, 300.0)
    parts.append(plain.line(random, swing + beat, case.resonant, 0.0))
    if case.vibration:
        parts.append(plain.line(random, case.vibration_frequency, case.vibration, 0.0))
    parts.append(plain.line(random, case.engine_frequency or 2.0 * swing + beat, 0.0, case.engine))
    rate, across, along = (np.concatenate(column) for column in zip(*parts, strict=True))
    felt = (across != 0.0) | (along != 0.0)
    return plain.Motion(rate[felt], across[felt], along[felt])


def _rocking(support: plain.Support, case: Case, length: float) -> plain.Support:
    """With planes of swing that follow y'': apparent gravity is larger by y''^2/2g, and by l b'^2 of b = y''/g."""
    rate = 2.0 * np.pi / _SLOW
    gravity = float(support.gravity[0])
    apparent, turning = 0.25 * case.rocking**2 / gravity, 0.5 * length * (case.rocking * rate / gravity) ** 2
    return support._replace(
        rate=np.append(support.rate, 2.0 * rate),
        across=np.append(support.across, 0.0),
        along=np.append(support.along, apparent - turning),
        gravity=np.append(support.gravity[0] + apparent + turning, support.gravity[1:]),
    )


def _pulses(case: Case, random: Random) -> Floats:
    """Slow accelerations: a turn, across the ship; a change of speed, along it."""
    rows = []
    turn = _WAY * math.radians(case.turn), 90.0 / (case.turn or math.inf)
    for size, span in (turn, (case.speed_change / 60.0, 60.0)):
        if size:
            begin = random.uniform(0.1, 0.6) * case.duration
            rows.append([begin, begin + span, size * random.choice([-1, 1])])
    return np.array(rows).reshape(-1, 3)


def _swing(
    times: Floats, own: plain.Pendulums, support: plain.Support, case: Case, frequency: Floats, random: Random
) -> Floats:
    """Elongations, (pendulums, samples), with the knocks and restarts that part the record in two."""
    # phases that keep the difference from vanishing, as an observer releases them
    phase = random.uniform(0.0, 2.0 * np.pi) + np.array([0.0, np.pi, 0.0]) + random.uniform(-1.0, 1.0, 3)
    count = frequency.size
    sizes = np.array([*case.amplitudes, case.amplitudes[0]])[:count] * random.uniform(0.9, 1.1)

    def free(size: Floats, angle: Floats) -> Floats:
        return np.stack([size * np.cos(angle), -frequency * size * np.sin(angle)], axis=1)

    first = min(int(np.searchsorted(times, case.released)), times.size // 4)  # before anything else happens
    state: Floats = plain.forced(own, support) + free(sizes, phase[:count])
    if first:
        state = np.stack([sizes * np.cos(phase[:count]), np.zeros(count)], axis=1)
    strength = np.array([*case.kicks, case.kicks[0]])[:count] * frequency
    kicks = strength[:, None] * random.normal(size=(count, times.size))
    change = free(sizes * case.restart, random.uniform(0.0, 2.0 * np.pi, count))
    change[:, 1] += frequency * np.array([*case.knocks, 0.0])[:count] * random.choice([-1, 1])
    cut = int(np.searchsorted(times, case.duration * random.uniform(0.3, 0.7)))
    held = np.repeat(state[:, :1], first, axis=1)
    before, state = plain.integrate(times[first : cut + 1], state, own, support, kicks[:, first : cut + 1])
    after, _ = plain.integrate(times[cut:], state + change, own, support, kicks[:, cut:])
    return np.concatenate([held, before[:, :-1], after], axis=1)


def _tree(
    label: str, times: Floats, traces: Floats, states: dict[str, Floats], frequency: Floats, damping: Floats,
    case: Case, random: Random,
) -> DataTree:  # fmt: skip
    """The record in its layout, with what it states."""
    count = frequency.size
    labels = {"pendulum": [str(k + 1) for k in range(count)]}
    traces_of = {"trace": ["1", *(f"{k}-{k + 1}" for k in range(1, count))]}
    rows = np.vstack([np.eye(count)[:1], np.eye(count)[:-1] - np.eye(count)[1:]])
    period = 2.0 * np.pi / frequency
    period[1:] *= 1.0 + case.ratio_error * random.choice([-1, 1])
    angles = {"combination": rows, "elongation": traces, **states}
    if case.noise and case.states_noise:
        angles["elongation_uncertainty"] = np.full(count, case.noise)
    instrument: dict[str, Any] = {"period": period, "reference_gravity": REFERENCE}
    if case.states_damping:
        instrument["damping_rate"] = damping * (1.0 + case.damping_error)
    if case.rocking:
        mean_square = 0.5 * case.rocking**2
        instrument["transverse_acceleration_mean_square"] = mean_square
        instrument["rocking_rate_mean_square"] = mean_square * (2.0 * np.pi / _SLOW / REFERENCE) ** 2
    if case.states_scale:
        instrument["scale_uncertainty"] = case.states_scale
    law = {"restoring": "linear" if case.linear else "sine"} if case.states_law else {}
    reference = {"reference": "case"} if (case.tilt or case.follows) and case.states_tilt else {}
    root = root_attributes("record", identifier(label), title=f"benchmark record {label}", history="", source="model")
    groups = {
        "/": Dataset(coords={"time": ("time", times, attributes("time"))}, attrs=root),
        "/record": dataset("record", angles, traces_of | labels).assign_attrs(reference),
        "/instrument": dataset("instrument", instrument, labels).assign_attrs(law),
    }
    return DataTree.from_dict(groups)
