"""A ship in a random sea and the pendulums aboard: what happens, before anybody reads it.

theta'' + 2 gamma theta' + q |theta'| theta' + f tanh(theta'/1e-4) = -n^2 [(1 + z''/g) sin theta + x''/g cos theta]

Integrated by Gauss's collocation of three stages at steps of 10 ms; shares no code with the product. What each fault
does draws from a random stream of its own, so that a fault more or less changes nothing else.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Spec = dict[str, Any]
"""What a record is made with, by name; s, rad, m/s^2."""
Floats = NDArray[np.float64]
Random = np.random.Generator
Course = Callable[[Floats], Floats]
"""Of time in s from the record's begin."""

G = 9.81
"""m/s^2, of the waves."""
MGAL = 1e-5
DAY = 86400.0
STEP = 0.01
"""s, of the integration."""
AHEAD = 2.0
"""s of the integration before the record, and after."""
_ROOT = np.sqrt(15.0)
_NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * _ROOT / 10.0
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
_STAGES = np.array(
    [
        [5 / 36, 2 / 9 - _ROOT / 15, 5 / 36 - _ROOT / 30],
        [5 / 36 + _ROOT / 24, 2 / 9, 5 / 36 - _ROOT / 24],
        [5 / 36 + _ROOT / 30, 2 / 9 + _ROOT / 15, 5 / 36],
    ]
)
_TWICE, _ENDS = _STAGES @ _STAGES, _STAGES.T @ _WEIGHTS
_AT_ZERO = np.array([np.prod([other / (other - node) for other in _NODES if other != node]) for node in _NODES])
"""Of the values at the nodes, at the step's begin."""
_SWEEPS = 6  # over the stages; each gains three digits


@dataclass
class Draft:
    """A record in the making."""

    spec: Spec
    known: dict[str, Any] = field(default_factory=dict)
    """What each fault did, for the truth."""
    instrument: dict[str, tuple[tuple[str, ...], Any]] = field(default_factory=dict)
    """Statements: dimensions and values."""
    series: dict[str, Floats | Course] = field(default_factory=dict)
    """To be recorded beside the elongations."""
    gaps: list[tuple[float, float]] = field(default_factory=list)
    """Begin and length, s."""

    def random(self, name: str) -> Random:
        """The stream of that name."""
        return np.random.default_rng([79, self.spec["seed"], zlib.crc32(name.encode())])

    def fault(self, name: str) -> Random | None:
        """The stream of a fault that the record has."""
        return self.random(name) if name in self.spec["faults"] else None

    @property
    def duration(self) -> float:
        return float(self.spec["minutes"] * 60)


def log_uniform(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def signed(random: Random, low: float, high: float) -> float:
    """As `log_uniform`, of either sign."""
    return log_uniform(random, low, high) * float(random.choice([-1, 1]))


class Tones(NamedTuple):
    """A sum of cosines."""

    amplitudes: Floats
    rates: Floats
    phases: Floats

    def at(self, times: Floats) -> Floats:
        return _cosines(times, *self)


@njit()
def _cosines(times: Floats, amplitudes: Floats, rates: Floats, phases: Floats) -> Floats:
    out = np.zeros(times.size)
    for i in range(times.size):
        for k in range(amplitudes.size):
            out[i] += amplitudes[k] * np.cos(rates[k] * times[i] + phases[k])
    return out


def _joined(parts: list[Tones]) -> Tones:
    return Tones(*(np.concatenate([np.zeros(0), *(part[k] for part in parts)]) for k in range(3)))


def waves(random: Random, rms: float, period: float, count: int, depth: float = 0.0) -> Tones:
    """Accelerations under a JONSWAP spectrum, `depth` m below the surface, of so much root mean square."""
    peak = 1 / period
    edges = np.geomspace(0.55 * peak, 0.5 if depth else 5 * peak, count + 1)
    frequency = edges[:-1] + random.uniform(0, 1, count) * np.diff(edges)
    width = np.where(frequency < peak, 0.07, 0.09)
    spectrum = frequency**-5 * np.exp(-1.25 * (peak / frequency) ** 4)
    spectrum *= 3.3 ** np.exp(-((frequency - peak) ** 2) / (2 * width**2 * peak**2))
    rates = 2 * np.pi * frequency
    amplitudes = rates**2 * np.sqrt(spectrum * np.diff(edges)) * np.exp(-(rates**2) / G * depth)
    amplitudes *= rms / np.sqrt((amplitudes**2).sum() / 2)
    return Tones(amplitudes, rates, random.uniform(0, 2 * np.pi, count))


def narrow(random: Random, amplitude: float, frequency: float, bandwidth: float, count: int = 12) -> Tones:
    """A line of so many tones; bandwidth relative to its frequency."""
    frequencies = frequency * (1 + bandwidth * random.normal(size=count))
    amplitudes = np.abs(random.normal(size=count))
    amplitudes *= amplitude / np.sqrt((amplitudes**2).sum())
    return Tones(amplitudes, 2 * np.pi * frequencies, random.uniform(0, 2 * np.pi, count))


@dataclass(frozen=True)
class Ship:
    """Accelerations of the support, m/s^2, at times in s from the record's begin."""

    spec: Spec
    duration: float
    chance: Floats
    """Of the sea's envelope."""
    swaying: Tones
    heaving: Tones
    across: Tones
    hull_sways: Tones
    """By the hull and the engine: not under the envelope."""
    hull_heaves: Tones
    knocks: list[list[float]]
    """Time, both accelerations, length."""

    def envelope(self, times: Floats) -> Floats:
        share, chance, kind = times / self.duration, self.chance, self.spec["envelope"]
        if kind == "squall":
            return np.asarray(0.6 + 1.4 * np.exp(-(((share - chance[0]) / (0.05 + 0.1 * chance[1])) ** 2)))
        if kind == "ramp":
            rise, share = 0.9 + 0.6 * chance[0], np.clip(share, 0, 1)
            return 0.3 + rise * share if chance[1] < 0.5 else 1.4 - 1.1 * share
        if kind == "groups":
            return np.asarray(1 + 0.6 * np.sin(2 * np.pi * times / (60 + 200 * chance[0]) + 6 * chance[1]))
        return np.ones_like(times)

    def _knocked(self, times: Floats, axis: int) -> Floats:
        out = np.zeros_like(times)
        for middle, *accelerations, length in self.knocks:
            place = (times - middle) / length
            near = np.abs(place) < 8
            out[near] -= accelerations[axis] * place[near] * np.exp(0.5 - place[near] ** 2 / 2)
        return out

    def sway(self, times: Floats) -> Floats:
        out = self.envelope(times) * self.swaying.at(times) + self.hull_sways.at(times) + self._knocked(times, 0)
        if self.spec["turn"]:
            place, length, change, ramp = self.spec["turn"]
            away = times - place * self.duration
            out += change / length * 0.5 * (np.tanh((away + length / 2) / ramp) - np.tanh((away - length / 2) / ramp))
        return out

    def heave(self, times: Floats, engine: bool = True) -> Floats:
        out = self.envelope(times) * self.heaving.at(times) + self._knocked(times, 1)
        return out + self.hull_heaves.at(times) if engine else out


def ship_of(draft: Draft) -> Ship:
    """Draw the waves and what else moves the support."""
    spec, random = draft.spec, draft.random("sea")
    depth, swell = spec["depth"], np.sqrt(1 - spec["wind"] ** 2)
    sways = [waves(random, spec["sway"] * swell, spec["swell_period"], 110, depth)]
    heaves = [waves(random, spec["heave"] * swell, spec["swell_period"], 110, depth)]
    across = waves(random, spec["sway"], spec["swell_period"], 80, depth)
    if spec["wind"]:
        sways.append(waves(random, spec["sway"] * spec["wind"], spec["wind_period"], 60))
        heaves.append(waves(random, spec["heave"] * spec["wind"], spec["wind_period"], 60))
    hull = [narrow(random, part * G, frequency, 1e-4, 3) for part, frequency in spec["hull"]]
    engine = []
    if spec["engine"]:
        part, frequency = spec["engine"]
        hull.append(narrow(random, part * G * random.uniform(0.2, 1), frequency, 2e-3))
        engine.append(narrow(random, part * G, frequency, 2e-3))
    chance, knocks = draft.random("env").uniform(0, 1, 8), []
    if knock := draft.fault("knocks"):
        for _ in range(knock.integers(1, 7)):
            begin, size = knock.uniform(0.05, 0.95) * draft.duration, signed(knock, 0.02, 1.0)
            knocks.append([begin, size, knock.uniform(-0.5, 0.5), knock.uniform(0.03, 0.12)])
        draft.known["knocks"] = knocks
    tones = (_joined(sways), _joined(heaves), across, _joined(hull), _joined(engine))
    return Ship(spec, draft.duration, chance, *tones, knocks)


def gravity_of(draft: Draft, times: Floats) -> Floats:
    """Gravity that the pendulums feel; its mean over a record is that of the truth, or its value at rest."""
    spec, duration = draft.spec, draft.duration
    share, gravity = np.clip(times / duration, 0, 1), np.full(times.size, spec["gravity"])
    if random := draft.fault("gcourse"):
        size, kind = log_uniform(random, 0.5, 30), int(random.choice([1, 2]))
        gravity += size * MGAL * (share - 0.5 if kind == 1 else np.sin(2 * np.pi * share) * 0.5)
        draft.known["gcourse"] = [size, kind]
    if random := draft.fault("gturn"):
        knots, latitude, first = random.uniform(3, 14), random.uniform(-60, 60), random.uniform(0, 360)
        change, middle = random.uniform(30, 180) * random.choice([-1, 1]), random.uniform(0.3, 0.7) * duration

        def course(times: Floats) -> Floats:
            return np.asarray(first + change * 0.5 * (1 + np.tanh((times - middle) / 40.0)))

        east = np.sin(np.radians(course(np.clip(times, 0, duration))))
        gravity -= (7.503 * knots * np.cos(np.radians(latitude)) * east + 0.00415 * knots**2) * MGAL
        draft.instrument["latitude"] = ((), latitude)
        draft.series |= {"course": course, "speed": lambda times: np.full(times.size, knots * 0.514444)}
        draft.known["gturn"] = [knots, latitude, first, change]
    return gravity


def squares_of(draft: Draft, times: Floats, gravity: Floats) -> Floats:
    """n^2 of each pendulum, in its air and at its temperature; what is stated of these goes to the instrument."""
    spec, random, stated, instrument = draft.spec, draft.random("cond"), draft.random("meta"), draft.instrument
    periods, count = np.array(spec["periods"]), len(spec["periods"])
    added = np.zeros((count, 1))
    if spec["temperature"]:
        added = added + _temperature(draft, random, stated, np.clip(times / draft.duration, 0, 1))
    if spec["air"]:
        slopes, density = 770e-7 * random.uniform(0.8, 1.2, count) * periods, random.uniform(1.0, 1.25)
        doubt, reference = 0.005 * slopes, 1.2
        added = added + (slopes * density / reference)[:, None]
        instrument["air_density"] = ((), density * (1 + 0.002 * stated.normal()))
        instrument["air_density_uncertainty"] = ((), 0.002 * density)
        instrument["air_density_reference"] = ((), reference)
        instrument["density_coefficient"] = (("pendulum",), slopes + doubt * stated.normal(size=count))
        instrument["density_coefficient_uncertainty"] = (("pendulum",), doubt)
    scale = 1.0
    if spec["tilt"]:
        scale -= spec["tilt"] / 2
        instrument["tilt_mean_square"] = ((), spec["tilt"])
        instrument["tilt_mean_square_uncertainty"] = ((), spec["tilt"] * 0.1)
    _state_periods(draft, periods)
    if spec["states_damping"]:
        damping, doubt = np.array(spec["damping"]), 0.03 * np.array(spec["damping"])
        instrument["damping_rate"] = (("pendulum",), np.maximum(damping + doubt * stated.normal(size=count), 0))
        instrument["damping_rate_uncertainty"] = (("pendulum",), doubt)
    aboard = periods[:, None] * np.sqrt(spec["reference_gravity"] / gravity) + added
    return np.asarray((2 * np.pi / aboard) ** 2 * scale)


def _temperature(draft: Draft, random: Random, stated: Random, share: Floats) -> Floats:
    """What temperature adds to the periods, at shares of the record."""
    instrument, count, reference = draft.instrument, len(draft.spec["periods"]), 293.15
    drifts = "tempdrift" in draft.spec["faults"]
    mean, drift = reference + random.uniform(-3, 3), random.uniform(-2, 2) if drifts else 0.0
    invar, brass = (0.25e-6, 0.75e-6), (93e-7 * 0.9, 93e-7 * 1.1)  # s/K
    slopes = np.array([random.uniform(*(brass if random.random() < 0.5 else invar)) for _ in range(count)])
    doubt = 0.01 * slopes
    instrument["temperature_reference"] = ((), reference)
    instrument["temperature_coefficient"] = (("pendulum",), slopes + doubt * stated.normal(size=count))
    instrument["temperature_coefficient_uncertainty"] = (("pendulum",), doubt)
    instrument["temperature_uncertainty"] = ((), 0.02)
    off = 0.02 * stated.normal()
    if drifts:
        draft.series["temperature"] = lambda times: mean + drift * (times / draft.duration - 0.5) + off
    else:
        instrument["temperature"] = ((), mean + off)
    draft.known["temperature"] = [mean - reference, drift, slopes.tolist()]
    return slopes[:, None] * (mean - reference + drift * (share - 0.5))


def _state_periods(draft: Draft, periods: Floats) -> None:
    """State the periods at the reference gravity, or what base stations say of them."""
    count, instrument, stated = periods.size, draft.instrument, periods
    if random := draft.fault("perioderr"):
        sigma = log_uniform(random, 1e-8, 2e-7)
        stated = periods + sigma * random.normal(size=count)
        instrument["period_uncertainty"] = (("pendulum",), np.full(count, sigma))
        draft.known["perioderr"] = [sigma, ((stated - periods) / sigma).tolist()]
    if random := draft.fault("baseties"):
        own = random.normal(size=count) * 3e-7
        change = own * 0.1 + 3e-7 * random.normal()
        times = np.array([-DAY * random.uniform(0.3, 3), DAY * random.uniform(0.3, 3)])
        share = (times - draft.duration / 2) / (times[1] - times[0])
        ties = periods + share[:, None] * change + 3e-8 * random.normal(size=(2, count))
        instrument["base_time"] = (("base",), times + draft.spec["start"])
        instrument["base_gravity"] = (("base",), np.full(2, draft.spec["reference_gravity"]))
        instrument["base_gravity_uncertainty"] = (("base",), np.full(2, 2e-7))
        instrument["base_period"] = (("base", "pendulum"), ties)
        instrument["base_period_uncertainty"] = (("base", "pendulum"), np.full((2, count), 3e-8))
        stated, draft.known["baseties"] = ties[0], [change.tolist(), times.tolist()]
    instrument["period"] = (("pendulum",), stated)
    instrument["reference_gravity"] = ((), draft.spec["reference_gravity"])


class Forces(NamedTuple):
    """Of pendulums at the nodes of the steps; accelerations over g."""

    squares: Floats
    """(pendulums, nodes)."""
    sways: Floats
    """(pendulums, nodes)."""
    heave: Floats
    damping: Floats
    drag: Floats
    """Quadratic."""
    friction: Floats
    coupling: float
    """Of the support's sway to the sum of elongations."""
    kicks: Floats
    """rad/s at each step, (pendulums, steps + 1)."""
    linear: bool


@njit()
def _pull(forces: Forces, i: int, node: int, angle: float, rate: float, support: float) -> float:
    """Acceleration of pendulum i."""
    lost = 2 * forces.damping[i] * rate + forces.drag[i] * abs(rate) * rate + forces.friction[i] * np.tanh(rate / 1e-4)
    sway = forces.sways[i, node] - support
    if forces.linear:
        return float(-lost - forces.squares[i, node] * (angle + sway))
    return float(-lost - forces.squares[i, node] * ((1 + forces.heave[node]) * np.sin(angle) + sway * np.cos(angle)))


@njit()
def _propagate(forces: Forces, angle: Floats, rate: Floats, events: Floats) -> Floats:
    """Angles, rates and accelerations at each step, (3, pendulums, steps + 1).

    Events are rows of step, pendulum, angle, rate, 1; or of a rate that is added: step, pendulum, 0, rate, 0.
    """
    count, steps, done = angle.size, forces.kicks.shape[1] - 1, 0
    out, pulls = np.empty((3, count, steps + 1)), np.zeros((count, 3))
    angles, rates = np.zeros((count, 3)), np.zeros((count, 3))
    for step in range(steps + 1):
        while done < len(events) and int(events[done, 0]) == step:
            i = int(events[done, 1])
            angle[i] = events[done, 2] if events[done, 4] else angle[i]
            rate[i] = events[done, 3] + (0.0 if events[done, 4] else rate[i])
            done += 1
        rate += forces.kicks[:, step]
        out[0, :, step], out[1, :, step] = angle, rate
        if step == steps:
            out[2, :, step] = 2 * out[2, :, step - 1] - out[2, :, step - 2]
            break
        for _ in range(_SWEEPS):
            for i in range(count):
                for j in range(3):
                    angles[i, j], rates[i, j] = angle[i] + _NODES[j] * STEP * rate[i], rate[i]
                    for m in range(3):
                        angles[i, j] += STEP * STEP * _TWICE[j, m] * pulls[i, m]
                        rates[i, j] += STEP * _STAGES[j, m] * pulls[i, m]
            for j in range(3):
                support = forces.coupling * angles[:, j].sum()
                for i in range(count):
                    pulls[i, j] = _pull(forces, i, 3 * step + j, angles[i, j], rates[i, j], support)
        for i in range(count):
            out[2, i, step] = (_AT_ZERO * pulls[i]).sum()
            angle[i] += STEP * rate[i] + STEP * STEP * (_ENDS * pulls[i]).sum()
            rate[i] += STEP * (_WEIGHTS * pulls[i]).sum()
    return out


class Swing(NamedTuple):
    """Pendulums in motion."""

    steps: Floats
    """As `_propagate` gives them."""
    sway: float
    """Root mean square of x''/g."""
    heave: float

    def at(self, pendulum: int, times: Floats) -> Floats:
        """Elongation, by the polynomial of degree 5 between two steps."""
        place = (times + AHEAD) / STEP
        left = np.clip(np.floor(place).astype(int), 0, self.steps.shape[2] - 2)
        x = place - left
        scaled = self.steps[:, pendulum] * np.array([1.0, STEP, STEP * STEP])[:, None]
        (p0, v0, a0), (p1, v1, a1) = scaled[:, left], scaled[:, left + 1]
        third = 10 * (p1 - p0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
        fourth = -15 * (p1 - p0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
        fifth = 6 * (p1 - p0) - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
        return np.asarray(p0 + x * (v0 + x * (0.5 * a0 + x * (third + x * (fourth + x * fifth)))))


def swing(draft: Draft, ship: Ship) -> Swing:
    """Let the pendulums swing from `AHEAD` before the record to `AHEAD` after it."""
    spec, count = draft.spec, len(draft.spec["periods"])
    steps = int((draft.duration * 1.0002 + 2 * AHEAD) / STEP) + 2
    times = -AHEAD + STEP * np.repeat(np.arange(steps), 3) + STEP * np.tile(_NODES, steps)
    gravity = gravity_of(draft, times)
    squares, sway, heave = squares_of(draft, times, gravity), ship.sway(times) / gravity, ship.heave(times) / gravity
    drag, friction, planes, coupling, kicks = np.zeros(count), np.zeros(count), np.zeros(count), 0.0, 0.0
    if random := draft.fault("quadratic"):
        drag = log_uniform(random, 1e-4, 1e-2) * (1 + 0.1 * random.normal(size=count))
    if random := draft.fault("friction"):
        friction = log_uniform(random, 1e-7, 3e-6) * (1 + 0.1 * random.normal(size=count))
    sways = np.tile(sway, (count, 1))
    if random := draft.fault("planes"):
        planes = random.normal(size=count) * log_uniform(random, 0.003, 0.03)
        sways += planes[:, None] * (ship.envelope(times) * ship.across.at(times) / gravity)
    if random := draft.fault("sway"):
        coupling = log_uniform(random, 1e-6, 3e-5)
    rates, impulses = np.sqrt(squares[:, 0]), np.zeros((count, steps + 1))
    if random := draft.fault("selfkick"):
        kicks = log_uniform(random, 3e-8, 3e-6)
        impulses = kicks * np.sqrt(squares[:, :1]) * np.sqrt(STEP) * random.normal(size=(count, steps + 1))
        impulses[:, 0] = 0.0
    said = {"quadratic": drag, "friction": friction, "planes": planes, "sway": coupling, "selfkick": kicks}
    draft.known |= {name: value for name, value in said.items() if name in spec["faults"]}
    forces = Forces(
        squares, sways, heave, np.array(spec["damping"]), drag, friction, coupling, impulses, spec["linear"]
    )
    amplitudes, phases = np.array(spec["amplitudes"]), np.array(spec["phases"])
    start = amplitudes * np.cos(phases), -amplitudes * rates * np.sin(phases)
    result = _propagate(forces, *start, _events(draft, rates))
    return Swing(result, float(np.sqrt(np.mean(sway**2))), float(np.sqrt(np.mean(heave**2))))


def _events(draft: Draft, rates: Floats) -> Floats:
    """Kicks of single pendulums, and pendulums that are touched and started again, which leaves a gap."""
    count, duration = rates.size, draft.duration
    rows: list[list[float]] = []
    if random := draft.fault("owkick"):
        for _ in range(random.integers(1, 5)):
            step, which = int((random.uniform(0.05, 0.95) * duration + AHEAD) / STEP), int(random.integers(count))
            rows.append([step, which, 0, signed(random, 1e-4, 2e-2), 0])
        draft.known["owkick"] = [[row[0] * STEP - AHEAD, row[1], row[3]] for row in rows]
    draft.gaps = [(place * duration, length) for place, length in draft.spec["gaps"]]
    if random := draft.fault("touched"):
        begin, length = random.uniform(0.15, 0.8) * duration, log_uniform(random, 10, min(150, duration * 0.15))
        draft.gaps.append((begin, length))
        touched = [int(random.integers(count))] if random.random() < 0.5 else list(range(count))
        for which in touched:
            size, phase = log_uniform(random, 0.005, 0.05), random.uniform(0, 6.28)
            step, rate = int((begin + length * 0.6 + AHEAD) / STEP), -size * rates[which] * np.sin(phase)
            rows.append([step, which, size * np.cos(phase), rate, 1])
        draft.known["touched"] = [begin, length, touched]
    return np.array(sorted(rows), dtype=float).reshape(-1, 5)
