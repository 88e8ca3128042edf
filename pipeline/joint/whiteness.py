"""What the errors of a fit say of the assumed spectrum: where they have more power than white ones, it has too little.

The filter divides each trace by the spectrum that it assumes, the swing itself apart. The power of its errors by
frequency, 1 where they are white, is thus the ratio of what is there to what is assumed: on either side of the swing,
in all of the record, through gaps. Whittle's likelihood of that ratio moves all parameters of the ship without a pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import spectrum
from pipeline.joint.explanation import Fitted
from pipeline.joint.problem import Assumed
from pipeline.joint.ship import Component, Engine, density

LEVEL = {"horizontal": "across", "transverse": "aside"}
"""Axes of motion that push pendulums whatever their angle, and the answer to it."""
LEAST_READINGS = 100
LEAST = 3  # bins from zero frequency, and on either side of the swing, that constants fill
BINS, FINE, BESIDE = 200, 3.0, 10.0  # in all; a line's width over that of a bin about it; widths on either side of it
CALM = 0.5  # of the swing's frequency: below it lines are the sea's
WIDELY, NEARBY = 64.0, 13  # of the least distance from the swing, up to which bins grow with it; bins on either side
CERTAIN = 20.0  # of the power of white errors, which no chance brings about
CLIPPED = 7.0  # of the median error: five deviations of normal ones
ROUGH = 4  # taper of a rough fit, whose errors are far from white
TAPERED = {1: 1.5, ROUGH: 2.63}  # ordinates that count as one, under a taper
SHARP, MOST_SHARP = 3.5, 5  # in the logarithm of a power, above those about it; such ordinates that get finer bins
NOISE_SPREAD = 0.3  # 1 sigma of the logarithm of the reading noise
UNKNOWN, UNKNOWN_SPREAD = 1e-4, 3.0  # rad; the same of one that is not stated
STEP, MOST_STEP = 1e-5, 1.0  # of a logarithm: for its slope; at once
ROUNDS, HALVINGS = 20, 4
ENOUGH = 0.2  # in log-likelihood


def errors_by_frequency(fit: Fitted, trace: int, taper: int = 1) -> tuple[Floats, Floats, np.ndarray]:
    """Power of a trace's whitened errors by frequency, rad s-1, 1 where they are of unit variance; and their samples.

    Empty where they are few. Under a taper, a power of a sine: lines leak without. Kept with the fit.
    """
    if (trace, taper) not in fit.spectra:
        fit.spectra[trace, taper] = _errors_by_frequency(fit, trace, taper)
    return fit.spectra[trace, taper]


def _errors_by_frequency(fit: Fitted, trace: int, taper: int) -> tuple[Floats, Floats, np.ndarray]:
    from scipy.fft import next_fast_len, rfft

    lattice = fit.model.problem.lattice
    used = lattice.of_trace[trace]
    known = np.isfinite(fit.of.whitened[used])
    used = used if known.all() else used[known]
    if used.size < LEAST_READINGS:
        return np.zeros(0), np.zeros(0), used
    time, step = lattice.time[used], lattice.spacing[trace]
    series = np.zeros(next_fast_len(int(lattice.duration / step) + 2, real=True))
    part = np.sin(np.pi * (time - time[0]) / (time[-1] - time[0])) ** taper
    series[np.clip(np.rint(time / step), 0, series.size - 1).astype(np.int64)] = part * clipped(fit.of.whitened[used])
    power = np.abs(rfft(series)) ** 2 / float(part @ part)
    return 2.0 * np.pi * np.arange(power.size) / (series.size * step), power, used


def clipped(errors: Floats) -> Floats:
    """Without what is wild, which has no spectrum."""
    most = CLIPPED * float(np.median(np.abs(errors)))
    return np.asarray(np.clip(errors, -most, most))


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


@dataclass(frozen=True)
class Band:
    """Errors of a trace, in bins of frequency, f of them; m frequencies fall on each where samples are sparse."""

    trace: int
    power: Floats
    weight: Floats  # (f,) mean power of the errors, and number of ordinates
    frequency: Floats  # (m, f) rad s-1, the bin's own in the middle row
    across: Floats
    aside: Floats
    upright: Floats
    """(m, f) square of the trace's answer to U, to U of all but the first pendulum, and to Z on either side of the
    swing."""
    kicked: Floats  # (m, f, p) the same to the kicks of each pendulum
    step: float  # s between samples
    level: float  # The same to the tilt of the case

    @staticmethod
    def of(fit: Fitted, trace: int, lines: tuple[Component, ...], beside: float) -> Band | None:
        """The errors of a trace, but those so near the swing, relative to it; finer bins about some lines."""
        problem = fit.model.problem
        swing = problem.swing
        taper = ROUGH if beside else 1
        frequency, power, _ = errors_by_frequency(fit, trace, taper)
        if frequency.size <= 4 * LEAST:
            return None
        step = float(np.pi / frequency[-1])
        bin_width, centre = frequency[1], spectrum.folded(swing, step)
        near = max(beside * swing, (LEAST + 0.5) * bin_width)
        keep = np.abs(frequency - centre) > near
        if not beside and trace not in problem.differences:
            keep |= power > CERTAIN  # constants fill what lies at the swing, but they add nothing
        keep[:LEAST] = False
        frequency, power = frequency[keep], power[keep]
        # traces answer at the swing as nowhere else
        off = np.append(bin_width * (np.arange(LEAST) + 0.5), near * np.geomspace(1.0, WIDELY, NEARBY))
        edges = [np.geomspace(frequency[0], frequency[-1] * 1.0001, BINS + 1), centre - off, centre + off]
        fast = np.searchsorted(frequency, CALM * swing, side="right")
        narrow = [(peak, 0.0, "horizontal") for peak in _sharp(frequency[fast:], power[fast:], edges[0])]
        narrow += [(each.peak, each.damping, each.axis) for each in lines if isinstance(each, Engine)]
        for peak, width, axis in narrow:
            about = np.arange(-BESIDE, BESIDE, 1.0 / FINE) * max(width, bin_width)
            centres = [peak] if axis in LEVEL else [abs(peak + by) for by in (swing, -swing)]
            edges += [each + about for each in centres]
        begins, count = _binned(frequency, np.concatenate(edges))
        mean, weight = np.add.reduceat(frequency, begins) / count, count / TAPERED[taper]
        folds = int(2.0 * swing * step / np.pi)  # sparse samples show what is faster among the rest
        every = np.abs(mean + 2.0 * np.pi / step * np.arange(-folds, folds + 1)[:, None])
        weights = problem.weights(trace)
        angles = fit.path[:, : 2 * problem.pendulums : 2] @ weights
        upright = spectrum.beside_the_swing(swing, 0.5 * float(np.mean(angles**2)), every)
        across, aside = (spectrum.transfer(problem, trace, every, first) for first in (0, 1))
        kicked = weights**2 * problem.kappa / (problem.kappa - every[..., None] ** 2) ** 2
        return Band(
            trace,
            np.add.reduceat(power, begins) / count,
            weight,
            every,
            across,
            aside,
            upright,
            kicked,
            step,
            float(weights.sum()) ** 2,
        )


@dataclass(frozen=True, eq=False)
class Shown:
    """The errors of all traces beside what a fit assumes; n bins in all bands."""

    bands: tuple[Band, ...]
    assumed: Assumed
    swing: float  # rad s-1
    _answers: dict[tuple[object, ...], Floats] = field(default_factory=dict)

    @staticmethod
    def of(fit: Fitted, lines: tuple[Component, ...] = (), beside: float = 0.0) -> Shown:
        """What a fit shows, also of some lines that it does not assume, but so near the swing, relative to it."""
        problem, assumed = fit.model.problem, fit.model.assumed
        found = [Band.of(fit, trace, (*assumed.ship, *lines), beside) for trace in range(problem.traces + 1)]
        return Shown(tuple(each for each in found if each is not None), assumed, problem.swing)

    def _of_all(self, parts: Iterable[Floats]) -> Floats:
        return np.concatenate([np.zeros(0), *parts])

    @cached_property
    def _every(self) -> dict[str, Floats]:
        """Frequencies of all bands, and the answers to U and Z, (m n,) arrays."""
        names = ("frequency", "across", "aside", "upright")
        return {name: self._of_all(getattr(each, name).ravel() for each in self.bands) for name in names}

    @cached_property
    def _bins(self) -> np.ndarray:
        """Bin that each of them falls upon."""
        sizes = [each.power.size for each in self.bands]
        parts = zip(np.cumsum([0, *sizes[:-1]]), self.bands, strict=True) if sizes else ()
        return np.concatenate([np.arange(0), *(at + np.arange(b.frequency.size) % b.power.size for at, b in parts)])

    def _of(self, component: Component) -> Floats:
        """Density that a component of the ship makes expect in all bands, (n,)."""
        frequency = self._every["frequency"]
        if component.axis in LEVEL:
            every = self._every[LEVEL[component.axis]] * density((component,), frequency, component.axis)
        elif component.axis == "tilt":
            level = self._of_all(np.full(each.frequency.size, each.level) for each in self.bands)
            every = level * density((component,), frequency, "tilt")
        else:
            above, below = (
                density((component,), np.abs(frequency + by), "vertical") for by in (self.swing, -self.swing)
            )
            every = self._every["upright"] * (above + below)
        folded = frequency.size > self.power.size
        return np.asarray(np.bincount(self._bins, every, self.power.size) if folded else every)

    def _answer(self, component: Component) -> Floats:
        """The same, kept for one of unit size."""
        shape = type(component), component.axis, component.peak, getattr(component, "damping", 0.0)
        if shape not in self._answers:
            self._answers[shape] = self._of(replace(component, rms=1.0))
        return np.asarray(component.rms**2 * self._answers[shape])

    def _noisy(self, trace: int, noise: float) -> Floats:
        """Density that the noise of a trace makes expect in all bands, (n,)."""
        parts = (np.full(each.power.size, noise**2 * each.step * (each.trace == trace)) for each in self.bands)
        return self._of_all(parts)

    @cached_property
    def _of_kicks(self) -> Floats:
        """Density that kicks of each pendulum make expect, (n, p)."""
        return np.concatenate(
            [np.zeros((0, self.assumed.kick.size)), *(each.kicked.sum(axis=0) for each in self.bands)]
        )

    def density(self, wanted: Assumed) -> Floats:
        """Density that it makes expect in all bands, (n,)."""
        noise = self._of_all(np.full(each.power.size, wanted.noise[each.trace] ** 2 * each.step) for each in self.bands)
        return np.asarray(sum((self._answer(each) for each in wanted.ship), self._of_kicks @ wanted.kick**2 + noise))

    @cached_property
    def assumed_density(self) -> Floats:
        """Logarithm of what the fit made expect, (n,)."""
        return np.asarray(np.log(self.density(self.assumed)))

    def gain(self, wanted: Assumed) -> float:
        """What the likelihood gains where other things are assumed."""
        return float(self._worth(np.log(self.density(wanted)) - self.assumed_density))

    def _worth(self, more: Floats) -> Floats:
        return np.asarray(-(more + self.power * (np.exp(-more) - 1.0)) @ self.weight)

    @cached_property
    def power(self) -> Floats:
        """Of the errors in all bands, (n,)."""
        return self._of_all(each.power for each in self.bands)

    @cached_property
    def weight(self) -> Floats:
        """Ordinates in each bin of all bands, (n,)."""
        return self._of_all(each.weight for each in self.bands)

    def excess(self, wanted: Assumed) -> float:
        """Frequency above the sea's where the errors exceed most what else would be expected, rad s-1; 0: nowhere."""
        over = np.exp(self.assumed_density) / self.density(wanted) * self.power - 1.0
        at = self._of_all(each.frequency[len(each.frequency) // 2] for each in self.bands)
        over[at < CALM * self.swing] = 0.0
        return float(at[np.argmax(over * np.sqrt(self.weight))]) if over.any() else 0.0

    def joined(self, wanted: Assumed, units: Sequence[Component], sizes: Sequence[float]) -> Assumed:
        """With the one of several components of unit size, and the size, that make the errors likeliest."""
        square, base = np.square(sizes)[:, None], self.density(wanted)
        worth = [self._worth(np.log(base + square * self._answer(each)) - self.assumed_density) for each in units]
        at, size = divmod(int(np.argmax(worth)), len(sizes))
        return replace(wanted, ship=(*wanted.ship, replace(units[at], rms=sizes[size])))

    def likeliest(self, start: Assumed, *, last: bool = False, loose: float = 1.0) -> tuple[Assumed, float]:
        """Ship and noise where the errors are likeliest, and by how much, in log-likelihood.

        Scoring on the logarithms of all parameters, or on those of the last component.

        Parameters
        ----------
        start : Assumed
            They keep to it; a noise that is NaN is sought from nothing.
        loose : float
            By how much less widths and sizes keep to it than they would to a fit.
        """
        ship, count = start.ship, start.noise.size - 2
        places = np.cumsum([0, *(spectrum.parameters((each,)).size for each in ship)])
        own = int(places[-1])
        unknown = ~np.isfinite(start.noise[:count])
        vector = np.append(spectrum.parameters(ship), np.log(np.where(unknown, UNKNOWN, start.noise[:count])))
        spread = np.append(spectrum.spreads(ship, loose), np.where(unknown, UNKNOWN_SPREAD, NOISE_SPREAD))
        free = np.arange(places[-2], own) if last else np.arange(vector.size)
        begin = vector

        def make(vector: Floats) -> Assumed:
            size = np.maximum(np.exp(vector[own:]), spectrum.LEAST_NOISE)
            noise = np.append(size, start.noise[count:])
            return replace(start, ship=spectrum.assemble(ship, vector[:own]), noise=noise)

        def value(vector: Floats) -> tuple[float, Floats]:
            whole = self.density(make(vector))
            worth = float(self._worth(np.log(whole) - self.assumed_density))
            return worth - 0.5 * float(np.sum(((vector - begin) / spread) ** 2)), whole

        def slopes(vector: Floats) -> Iterator[Floats]:
            """Of the density by the free parameters."""
            now = make(vector)
            for k in free.tolist():
                if k >= own:
                    yield 2.0 * self._noisy(k - own, now.noise[k - own])
                    continue
                of = int(np.searchsorted(places, k, side="right")) - 1
                there = self._answer(now.ship[of])
                if k == places[of + 1] - 1:  # a size
                    yield 2.0 * there
                    continue
                moved = vector[places[of] : places[of + 1]].copy()
                moved[k - places[of]] += STEP
                yield (self._of(spectrum.assemble((ship[of],), moved)[0]) - there) / STEP

        top, whole = value(vector)
        for _ in range(ROUNDS):
            rows = np.stack(list(slopes(vector))) / whole
            over = self.power * np.exp(self.assumed_density) / whole - 1.0
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
