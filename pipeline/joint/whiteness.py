"""What the errors of a fit say of the assumed spectrum: where they have more power than white ones, it has too little.

The filter divides each trace by the spectrum that it assumes, the swing itself apart. The power of its errors by
frequency, 1 where they are white, is thus the ratio of what is there to what is assumed, also through gaps. Whittle's
likelihood of that ratio moves all parameters of the ship without a pass.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, TypeVar, cast, get_args

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.explanation import Fitted
from pipeline.joint.lattice import folded
from pipeline.joint.problem import LEAST_NOISE, Assumed, Problem
from pipeline.joint.ship import Axis, Component, Engine, assemble, parameters, spreads

LEAST_READINGS = 100
LEAST = 3  # bins from zero frequency, and on either side of the swing, that constants fill
BINS, FINE, BESIDE = 200, 3.0, 10.0  # in all; a line's width over that of a bin about it; widths on either side of it
CALM = 0.5  # of the swing's frequency: below it lines are the sea's
WIDELY, NEARBY = 64.0, 13  # of the least distance from the swing, up to which bins grow with it; bins on either side
CERTAIN = 20.0  # of the power of white errors, which no chance brings about
CLIPPED = 7.0  # of the median error: five deviations of normal ones
ROUGH = 4  # taper of a rough fit, whose errors are far from white
SHARED, LEVEL = 0.9, 0.1  # of the readings of the densest trace; of what the ship's motion shows most
STEADY = 2.0  # of the swing's frequency, above which pendulums hardly follow a motion
TAPERED = {1: 1.5, ROUGH: 2.63}  # ordinates that count as one, under a taper
SHARP, MOST_SHARP = 3.5, 5  # in the logarithm of a power, above those about it; such ordinates that get finer bins
NOISE_SPREAD = 0.3  # 1 sigma of the logarithm of the reading noise
UNKNOWN, UNKNOWN_SPREAD = 1e-4, 3.0  # rad; the same of one that is not stated
STEP, MOST_STEP = 1e-5, 1.0  # of a logarithm: for its slope; at once
ROUNDS, HALVINGS = 20, 4
ENOUGH = 0.2  # in log-likelihood
Result = TypeVar("Result")
_RESPONSES = (*get_args(Axis), "heave")
_FIELDS = ("power", "weight", "centre", "trace", "step", "noise", "frequency", "bins", "kicked", *_RESPONSES)


def _kept(function: Callable[..., Result]) -> Callable[..., Result]:
    """A function of a fit whose results are kept with it."""

    @wraps(function)
    def known(fit: Fitted, *arguments: Any, **named: Any) -> Result:
        key = function.__qualname__, arguments, tuple(named.items())
        if key not in fit.spectra:
            fit.spectra[key] = function(fit, *arguments, **named)
        return cast(Result, fit.spectra[key])

    return known


@_kept
def shared(fit: Fitted) -> Floats:
    """Rows, (t + 2, t + 2), that turn whitened errors of traces into those of their common motion and the rest. Where
    several see the ship's motion the filter shares what it tells of it among their errors; so far as its share in a
    step is less than the noise, the common motion's part is known."""
    problem, noise = fit.model.problem, fit.model.assumed.noise
    sizes = np.array([fit.used(j).size for j in range(problem.traces)])
    level = np.where(sizes > SHARED * sizes.max(), problem.lattice.combination.sum(axis=1) / noise[: sizes.size], 0.0)
    rows = np.eye(noise.size)
    if np.count_nonzero(np.abs(level) > LEVEL * np.abs(level).max()) > 1:
        first = int(np.argmax(np.abs(level)))
        across = level / np.linalg.norm(level) * np.sign(level[first])
        across[first] -= 1.0
        rows[: sizes.size, : sizes.size] -= 2.0 * np.outer(across, across) / float(across @ across)
    return rows


def errors_by_frequency(fit: Fitted, trace: int, taper: int = 1, *, joined: bool = False) -> tuple[Floats, Floats]:
    """Power of a trace's whitened errors by frequency, rad s-1, 1 where they are of unit variance, under a power of a
    sine as taper, as lines leak. Empty where they are few. `joined`: of a row of `shared`."""
    apart, power = _power_of_errors(fit, trace, taper, joined=joined)
    return apart * np.arange(power.size), power.astype(np.float64)


@_kept
def _power_of_errors(fit: Fitted, trace: int, taper: int, *, joined: bool) -> tuple[float, Floats]:
    """The same: between frequencies, rad s-1, and of single precision, as it is kept with the fit."""
    from scipy.fft import next_fast_len, rfft

    problem, lattice, used = fit.model.problem, fit.model.problem.lattice, fit.used(trace)
    if used.size < LEAST_READINGS:
        return 0.0, np.zeros(0)
    time, step = lattice.time[used], lattice.spacing[trace]
    series = np.zeros(next_fast_len(int(lattice.duration / step) + 2, real=True))
    row = shared(fit)[trace] if joined else np.eye(1, problem.traces + 2, trace)[0]
    for other in np.flatnonzero(row).tolist():
        own = fit.used(other)
        at = np.clip(np.rint(lattice.time[own] / step), 0, series.size - 1).astype(np.int64)
        part = np.sin(np.pi * np.clip((lattice.time[own] - time[0]) / (time[-1] - time[0]), 0.0, 1.0)) ** taper
        series[at] += row[other] * part * clipped(fit.of.whitened[own])
    power = np.abs(rfft(series)) ** 2 / float(part @ part)
    return 2.0 * np.pi / (series.size * step), power.astype(np.float32)


def clipped(errors: Floats) -> Floats:
    """Errors without outliers, which have no spectrum."""
    most = CLIPPED * float(np.median(np.abs(errors)))
    return np.asarray(np.clip(errors, -most, most))


def transfer(problem: Problem, weights: Floats, frequency: Floats, first: int = 0) -> Floats:
    """Square of the response to U of pendulums from the first on, with their weights in a trace, by frequency."""
    kappa = problem.kappa[first:]
    return np.asarray((kappa / (kappa - frequency[..., None] ** 2) @ weights[first:]) ** 2)


def beside_the_swing(swing: float, angles: Floats, frequency: Floats) -> Floats:
    """Square of a trace's response to Z on either side of the swing by frequency, where it swings by `angles`, (n,)."""
    return np.asarray(0.5 * float(np.mean(angles**2)) * (swing**2 / (swing**2 - frequency**2)) ** 2)


def _binned(frequency: Floats, edges: Floats) -> tuple[np.ndarray, np.ndarray]:
    """First ordinate and number of those in each bin between edges; frequencies increase."""
    begins = np.unique(np.searchsorted(frequency, np.append(-np.inf, edges)))
    begins = begins[begins < frequency.size]
    return begins, np.diff(np.append(begins, frequency.size))


def _sharp(frequency: Floats, power: Floats, edges: Floats) -> Floats:
    """Frequencies of the highest ordinates that stand far above what lies in their bins."""
    if frequency.size <= MOST_SHARP:
        return np.zeros(0)
    height = np.log(np.maximum(power, 1e-30))
    begins, count = _binned(frequency, edges)
    above = height - np.repeat(np.add.reduceat(height, begins) / count, count)
    some = np.argpartition(above, -MOST_SHARP)[-MOST_SHARP:]
    return np.asarray(frequency[some[above[some] > SHARP]])


def _bands(fit: Fitted, lines: tuple[Component, ...], beside: float) -> list[dict[str, Any]]:
    """Fields of `Spectrum` from the errors of each trace; where they share the ship's motion, of what they show
    together, up to where the pendulums no longer follow it: there each shows its own noise."""
    whole, split = fit.model.problem.traces + 2, STEADY * fit.model.problem.swing
    found = []
    for trace in range(whole):
        mixed = shared(fit)[trace, trace] != 1.0
        parts = ((0.0, split), (split, np.inf)) if mixed else ((0.0, np.inf),)
        found += [_band(fit, trace, lines, beside, part, joined=mixed and not part[0]) for part in parts]
    return found


def _band(
    fit: Fitted, trace: int, lines: tuple[Component, ...], beside: float, part: tuple[float, float], *, joined: bool
) -> dict[str, Any]:
    """Of one trace, in a part of all frequencies; bins count from 0; of few readings there are none."""
    problem = fit.model.problem
    swing, taper = problem.swing, ROUGH if beside else 1
    frequency, power = errors_by_frequency(fit, trace, taper, joined=joined)
    none: dict[str, Any] = dict.fromkeys(_FIELDS, np.zeros(0, dtype=np.int64))
    none |= {"kicked": np.zeros((0, problem.pendulums)), "noise": np.zeros((0, problem.traces + 2))}
    if frequency.size <= 4 * LEAST:
        return none
    step = float(np.pi / frequency[-1])
    bin_width, centre = frequency[1], folded(swing, step)
    near = max(beside * swing, (LEAST + 0.5) * bin_width)
    keep = np.abs(frequency - centre) > near
    noise = fit.model.assumed.noise
    row = (shared(fit) if joined else np.eye(noise.size))[trace] * noise[trace] / noise
    weights = row[: problem.traces] @ problem.lattice.combination
    insensitive = trace in problem.differences and row[trace] == 1.0
    if not beside and not insensitive:
        keep |= power > CERTAIN  # constants fill what lies at the swing, but they add nothing
    keep[:LEAST] = False
    keep &= (frequency >= part[0]) & (frequency < part[1])
    if not keep.any():
        return none
    frequency, power = frequency[keep], power[keep]
    # traces respond at the swing as nowhere else
    off = np.append(bin_width * (np.arange(LEAST) + 0.5), near * np.geomspace(1.0, WIDELY, NEARBY))
    edges = [np.geomspace(frequency[0], frequency[-1] * 1.0001, BINS + 1), centre - off, centre + off]
    fast = np.searchsorted(frequency, CALM * swing, side="right")
    narrow = [(peak, 0.0, False) for peak in _sharp(frequency[fast:], power[fast:], edges[0])]
    narrow += [(each.peak, each.damping, each.axis == "vertical") for each in lines if isinstance(each, Engine)]
    for peak, width, upright in narrow:
        about = np.arange(-BESIDE, BESIDE, 1.0 / FINE) * max(width, bin_width)
        edges += [abs(peak + by) + about for by in ((swing, -swing) if upright else (0.0,))]
    begins, count = _binned(frequency, np.concatenate(edges))
    mean = np.add.reduceat(frequency, begins) / count
    folds = int(2.0 * swing * step / np.pi)  # sparse samples show what is faster among the rest
    every = np.abs(mean + 2.0 * np.pi / step * np.arange(-folds, folds + 1)[:, None]).ravel()
    angles = fit.path[:, : 2 * problem.pendulums : 2] @ weights
    kicked = weights**2 * problem.kappa / (problem.kappa - every[:, None] ** 2) ** 2
    return {
        "power": np.add.reduceat(power, begins) / count,
        "weight": count / TAPERED[taper],
        "centre": mean,
        "trace": np.full(mean.size, trace),
        "step": np.full(mean.size, step),
        "noise": np.broadcast_to(row**2 * step, (mean.size, row.size)),
        "frequency": every,
        "bins": np.arange(every.size) % mean.size,
        "horizontal": transfer(problem, weights, every) + (trace == problem.traces),
        "transverse": transfer(problem, weights, every, 1),
        "vertical": beside_the_swing(swing, angles, every),
        "tilt": np.full(every.size, float(weights.sum()) ** 2),
        "heave": np.full(every.size, float(trace > problem.traces)),
        "kicked": kicked.reshape(-1, mean.size, problem.pendulums).sum(axis=0),
    }


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The errors of all traces beside what a fit assumes, in n bins; on one, several of m frequencies may fall."""

    assumed: Assumed
    swing: float  # rad s-1
    power: Floats
    weight: Floats
    centre: Floats
    trace: np.ndarray
    step: Floats
    """(n,) mean power of the errors, number of ordinates, frequency, rad s-1, trace, and s between its samples."""
    noise: Floats  # (n, t + 2) density by the squares of the traces' noises
    frequency: Floats
    bins: np.ndarray  # (m,) frequencies, rad s-1, and the bins that they fall on
    response: dict[str, Floats]
    """(m,) square of the trace's response to motion along each axis, on either side of the swing to the vertical one;
    and of a recorded heave to that."""
    kicked: Floats  # (n, p) the same to the kicks of each pendulum
    _units: dict[tuple[object, ...], Floats] = field(default_factory=dict)

    @staticmethod
    @_kept
    def of(fit: Fitted, lines: tuple[Component, ...] = (), beside: float = 0.0) -> "Spectrum":
        """The errors but those so near the swing, relative to it; finer bins about lines, also of some not assumed."""
        problem, assumed = fit.model.problem, fit.model.assumed
        bands, size = _bands(fit, (*assumed.ship, *lines), beside), 0
        for each in bands:
            each["bins"] = each["bins"] + size
            size += each["power"].size
        whole: dict[str, Any] = {name: np.concatenate([each[name] for each in bands]) for name in _FIELDS}
        response = {name: whole.pop(name) for name in _RESPONSES}
        return Spectrum(assumed, problem.swing, response=response, **whole)

    @cached_property
    def expected(self) -> Floats:
        """Density that the fit made expect, (n,)."""
        return self.density(self.assumed)

    def _of(self, component: Component) -> Floats:
        """Density that a component of the ship makes expect, (n,)."""
        at = self.frequency
        places = (at + self.swing, np.abs(at - self.swing)) if component.axis == "vertical" else (at,)
        every = self.response[component.axis] * sum(component.density(each) for each in places)
        if component.axis == "vertical" and self.response["heave"].any():
            every = every + self.response["heave"] * component.density(at)
        folds = at.size > self.power.size
        return np.asarray(np.bincount(self.bins, every, self.power.size) if folds else every)

    def _scaled(self, component: Component) -> Floats:
        """The same, kept for one of unit size."""
        shape = type(component), component.axis, component.peak, getattr(component, "damping", 0.0)
        if shape not in self._units:
            self._units[shape] = self._of(replace(component, rms=1.0))
        return np.asarray(component.rms**2 * self._units[shape])

    def density(self, assumed: Assumed) -> Floats:
        """Density that assumptions make expect, (n,)."""
        rest = self.kicked @ assumed.kick**2 + self.noise @ assumed.noise**2
        return np.asarray(sum((self._scaled(each) for each in assumed.ship), rest))

    def _likelihood(self, density: Floats) -> Floats:
        """Log-likelihood of the errors under densities, (..., n), over that under what the fit assumes."""
        more = np.log(density / self.expected)
        return np.asarray(-(more + self.power * (np.exp(-more) - 1.0)) @ self.weight)

    def gain(self, assumed: Assumed) -> float:
        """What the likelihood gains where other things are assumed."""
        return float(self._likelihood(self.density(assumed)))

    def excess(self, assumed: Assumed) -> float:
        """Frequency above the sea's where the errors exceed most what else would be expected, rad s-1; 0: nowhere."""
        over = self.expected / self.density(assumed) * self.power - 1.0
        over[(self.centre < CALM * self.swing) | (self.trace == self.assumed.noise.size - 1)] = 0.0  # the last: heave
        return float(self.centre[np.argmax(over * np.sqrt(self.weight))]) if over.any() else 0.0

    def joined(self, assumed: Assumed, units: Sequence[Component], sizes: Sequence[float]) -> Assumed:
        """With the one of several components of unit size, and the size, that make the errors likeliest."""
        square, base = np.square(sizes)[:, None], self.density(assumed)
        worth = [self._likelihood(base + square * self._scaled(each)) for each in units]
        at, size = divmod(int(np.argmax(worth)), len(sizes))
        return replace(assumed, ship=(*assumed.ship, replace(units[at], rms=sizes[size])))

    def likeliest(self, start: Assumed, *, last: bool = False, loose: float = 1.0) -> tuple[Assumed, float]:
        """Ship and noise where the errors are likeliest, and by how much, in log-likelihood: scoring on all parameters'
        logarithms, or the last component's. They keep to the start, widths and sizes `loose` times less than to a fit;
        a noise that is NaN is sought from nothing."""
        ship, count = start.ship, start.noise.size - 2
        places = np.cumsum([0, *(parameters((each,)).size for each in ship)])
        own = int(places[-1])
        unknown = ~np.isfinite(start.noise[:count])
        vector = np.append(parameters(ship), np.log(np.where(unknown, UNKNOWN, start.noise[:count])))
        spread = np.append(spreads(ship, loose), np.where(unknown, UNKNOWN_SPREAD, NOISE_SPREAD))
        free = np.arange(places[-2], own) if last else np.arange(vector.size)
        begin = vector

        def make(vector: Floats) -> Assumed:
            noise = np.append(np.maximum(np.exp(vector[own:]), LEAST_NOISE), start.noise[count:])
            return replace(start, ship=assemble(ship, vector[:own]), noise=noise)

        def value(vector: Floats) -> tuple[float, Floats]:
            whole = self.density(make(vector))
            return float(self._likelihood(whole)) - 0.5 * float(np.sum(((vector - begin) / spread) ** 2)), whole

        def slopes(vector: Floats) -> Iterator[Floats]:
            """Of the density by the free parameters."""
            now = make(vector)
            for k in free.tolist():
                if k >= own:
                    yield 2.0 * now.noise[k - own] ** 2 * self.noise[:, k - own]
                    continue
                of = int(np.searchsorted(places, k, side="right")) - 1
                there = self._scaled(now.ship[of])
                if k == places[of + 1] - 1:  # a size
                    yield 2.0 * there
                    continue
                moved = vector[places[of] : places[of + 1]].copy()
                moved[k - places[of]] += STEP
                yield (self._of(assemble((ship[of],), moved)[0]) - there) / STEP

        top, whole = value(vector)
        for _ in range(ROUNDS):
            rows = np.stack(list(slopes(vector))) / whole
            over = self.power * self.expected / whole - 1.0
            slope = rows @ (self.weight * over) - ((vector - begin) / spread**2)[free]
            step = np.linalg.solve((rows * self.weight) @ rows.T + np.diag(spread[free] ** -2.0), slope)
            by = np.zeros(vector.size)
            by[free] = step * min(1.0, MOST_STEP / max(float(np.abs(step).max()), 1e-12))
            before = top
            for _ in range(HALVINGS):
                trial = value(vector + by)
                if trial[0] > top:
                    vector, (top, whole) = vector + by, trial
                    break
                by *= 0.3
            if top - before < ENOUGH:
                break
        return make(vector), top
