"""What the errors of a fit say of the assumed spectrum: where they have more power than white ones, it has too little.

The filter divides each trace by the spectrum that it assumes, the swing itself apart. The power of its errors by
frequency, 1 where they are white, is thus the ratio of what is there to what is assumed: on either side of the swing,
in all of the record, through gaps. Whittle's likelihood of that ratio moves all parameters of the ship without a pass.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import spectrum
from pipeline.joint.explanation import Fitted
from pipeline.joint.problem import Assumed
from pipeline.joint.ship import Component, Engine, density

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
    """Power of a trace's whitened errors by frequency, rad s-1, 1 where they are of unit variance; and which these are.

    Empty where they are few. Under a taper, a power of a sine: lines leak without.
    """
    from scipy.fft import next_fast_len

    lattice = fit.model.problem.lattice
    used = (lattice.trace == trace) & np.isfinite(fit.of.whitened)
    if used.sum() < LEAST_READINGS:
        return np.zeros(0), np.zeros(0), used
    time = lattice.time[used]
    step = max(float(np.median(np.diff(time))), 1e-3)
    series = np.zeros(next_fast_len(int(lattice.duration / step) + 2, real=True))
    part = np.sin(np.pi * (time - time[0]) / (time[-1] - time[0])) ** taper
    series[np.clip(np.rint(time / step), 0, series.size - 1).astype(np.int64)] = part * clipped(fit.of.whitened[used])
    power = np.abs(np.fft.rfft(series)) ** 2 / float(part @ part)
    return 2.0 * np.pi * np.arange(power.size) / (series.size * step), power, used


def clipped(errors: Floats) -> Floats:
    """Without what is wild, which has no spectrum."""
    most = CLIPPED * float(np.median(np.abs(errors)))
    return np.asarray(np.clip(errors, -most, most))


def _sharp(frequency: Floats, power: Floats, edges: Floats) -> Floats:
    """Frequencies of the highest ordinates that stand far above what lies in their bins."""
    at = np.searchsorted(edges, frequency, side="right")
    height = np.log(np.maximum(power, 1e-30))
    above = height - (np.bincount(at, height) / np.maximum(np.bincount(at), 1))[at]
    some = np.argsort(above)[-MOST_SHARP:]
    return np.asarray(frequency[some[above[some] > SHARP]])


@dataclass(frozen=True)
class Band:
    """A trace's errors in bins of frequency.

    Attributes
    ----------
    trace : int
    power, weight : (f,) arrays
        Mean power of the errors, and number of ordinates.
    frequency, across, upright : (m f,) arrays
        rad s-1, with those that fall upon each bin's own where readings are sparse; see `spectrum.Seen`.
    step : float
        s between readings.
    """

    trace: int
    power: Floats
    weight: Floats
    frequency: Floats
    across: Floats
    upright: Floats
    kicked: Floats
    step: float

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
        fast = frequency > CALM * swing
        narrow = [(peak, 0.0, "horizontal") for peak in _sharp(frequency[fast], power[fast], edges[0])]
        narrow += [(each.peak, each.damping, each.axis) for each in lines if isinstance(each, Engine)]
        for peak, width, axis in narrow:
            about = np.arange(-BESIDE, BESIDE, 1.0 / FINE) * max(width, bin_width)
            centres = [peak] if axis == "horizontal" else [abs(peak + by) for by in (swing, -swing)]
            edges += [each + about for each in centres]
        at = np.searchsorted(np.unique(np.concatenate(edges)), frequency, side="right")
        count = np.bincount(at)
        some = count > 0
        mean, weight = np.bincount(at, frequency)[some] / count[some], count[some] / TAPERED[taper]
        folds = int(2.0 * swing * step / np.pi)  # sparse readings show what is faster among the rest
        every = np.abs(mean + 2.0 * np.pi / step * np.arange(-folds, folds + 1)[:, None]).ravel()
        angles = fit.path[:, : 2 * problem.pendulums : 2] @ problem.lattice.combination[trace]
        upright = spectrum.beside_the_swing(swing, 0.5 * float(np.mean(angles**2)), every)
        across = spectrum.transfer(problem, trace, every)
        kicked = problem.lattice.combination[trace] ** 2 * problem.kappa / (problem.kappa - every[:, None] ** 2) ** 2
        return Band(trace, np.bincount(at, power)[some] / count[some], weight, every, across, upright, kicked, step)

    def answer(self, component: Component, swing: float) -> Floats:
        """Density that a component of the ship makes expect, (f,)."""
        if component.axis == "horizontal":
            every = self.across * density((component,), self.frequency, "horizontal")
        else:
            above, below = (density((component,), np.abs(self.frequency + by), "vertical") for by in (swing, -swing))
            every = self.upright * (above + below)
        return np.asarray(every.reshape(-1, self.power.size).sum(axis=0))

    def still(self, noise: Floats, kick: Floats) -> Floats:
        """Density that reading noise and kicks make expect, (f,)."""
        kicked = (self.kicked @ kick**2).reshape(-1, self.power.size).sum(axis=0)
        return np.asarray(kicked + noise[self.trace] ** 2 * self.step)


@dataclass(frozen=True, eq=False)
class Shown:
    """The errors of all traces beside what a fit assumes.

    Attributes
    ----------
    bands : tuple of Band
    assumed : Assumed
    swing : float
        rad s-1.
    """

    bands: tuple[Band, ...]
    assumed: Assumed
    swing: float
    _answers: dict[Component, Floats] = field(default_factory=dict)

    @staticmethod
    def of(fit: Fitted, lines: tuple[Component, ...] = (), beside: float = 0.0) -> Shown:
        """What a fit shows, also of some lines that it does not assume, but so near the swing, relative to it."""
        problem, assumed = fit.model.problem, fit.model.assumed
        found = [Band.of(fit, trace, (*assumed.ship, *lines), beside) for trace in range(problem.traces)]
        swing = problem.swing
        return Shown(tuple(each for each in found if each is not None), assumed, swing)

    def _of_all(self, parts: Iterable[Floats]) -> Floats:
        return np.concatenate([np.zeros(0), *parts])

    def _answer(self, component: Component) -> Floats:
        if component not in self._answers:
            self._answers[component] = self._of_all(each.answer(component, self.swing) for each in self.bands)
        return self._answers[component]

    def expected(self, wanted: Assumed) -> Floats:
        """Logarithm of the density that it makes expect in all bands, (n,)."""
        still = self._of_all(each.still(wanted.noise, wanted.kick) for each in self.bands)
        return np.asarray(np.log(sum((self._answer(each) for each in wanted.ship), still)))

    @cached_property
    def assumed_density(self) -> Floats:
        """Logarithm of what the fit made expect, (n,)."""
        return self.expected(self.assumed)

    def gain(self, wanted: Assumed) -> float:
        """What the likelihood gains where other things are assumed."""
        return self._worth(self.expected(wanted) - self.assumed_density)

    def _worth(self, more: Floats) -> float:
        return -float(np.sum(self.weight * (more + self.power * (np.exp(-more) - 1.0))))

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
        over = np.exp(self.assumed_density - self.expected(wanted)) * self.power - 1.0
        own = [each.frequency.reshape(-1, each.power.size) for each in self.bands]
        at = self._of_all(each[len(each) // 2] for each in own)
        over[at < CALM * self.swing] = 0.0
        return float(at[np.argmax(over * np.sqrt(self.weight))]) if over.any() else 0.0

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
        own = spectrum.parameters(ship).size
        unknown = ~np.isfinite(start.noise[:count])
        vector = np.append(spectrum.parameters(ship), np.log(np.where(unknown, UNKNOWN, start.noise[:count])))
        spread = np.append(spectrum.spreads(ship, loose), np.where(unknown, UNKNOWN_SPREAD, NOISE_SPREAD))
        free = np.arange(vector.size)
        if last:
            free = free[own - spectrum.parameters(ship[-1:]).size : own]
        power, weight, begin = self.power, self.weight, vector

        def make(vector: Floats) -> Assumed:
            size = np.maximum(np.exp(vector[own:]), spectrum.LEAST_NOISE)
            noise = np.append(size, start.noise[count:])
            return replace(start, ship=spectrum.assemble(ship, vector[:own]), noise=noise)

        def value(vector: Floats) -> tuple[float, Floats]:
            more = self.expected(make(vector)) - self.assumed_density
            return self._worth(more) - 0.5 * float(np.sum(((vector - begin) / spread) ** 2)), more

        top, more = value(vector)
        for _ in range(ROUNDS):
            rows = np.stack([(value(vector + STEP * np.eye(vector.size)[k])[1] - more) / STEP for k in free])
            slope = rows @ (weight * (power * np.exp(-more) - 1.0)) - ((vector - begin) / spread**2)[free]
            step = np.linalg.solve((rows * weight) @ rows.T + np.diag(spread[free] ** -2.0), slope)
            by = np.zeros(vector.size)
            by[free] = step * min(1.0, MOST_STEP / max(float(np.abs(step).max()), 1e-12))
            before = top
            for _ in range(HALVINGS):
                trial = value(vector + by)
                if trial[0] > top:
                    vector, (top, more) = vector + by, trial
                    break
                by *= 0.3
            if top - before < ENOUGH:
                break
        return make(vector), top

    def doubt(self, number: int) -> float:
        """1 sigma of the mean square of a component's motion as it is followed, over what is assumed of it."""
        ship, weight, whole = self.assumed.ship, self.weight, np.exp(self.assumed_density)
        rest = (*ship[:number], *ship[number + 1 :])
        own = whole - np.exp(self.expected(replace(self.assumed, ship=rest)))
        share = own / whole  # of what is read at a frequency: so much of the motion there is followed
        lost = 1.0 - float(np.sum(weight * own * share) / np.sum(weight * own))
        ordinates = float(np.sum(weight * share) ** 2 / np.sum(weight * share**2))
        return float(np.hypot(lost, 2.0 * np.sqrt(lost / ordinates)))
