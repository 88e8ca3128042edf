"""What the errors of a fit say of the assumed spectrum: where they have more power than white ones, it has too little.

The filter divides each trace by the spectrum that it assumes, the swing itself apart. The power of its errors by
frequency, 1 where they are white, is thus the ratio of what is there to what is assumed: on either side of the swing,
in all of the record, through gaps. Whittle's likelihood of that ratio moves all parameters of the ship without a pass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import spectrum
from pipeline.joint.explanation import Fitted
from pipeline.joint.problem import Assumed
from pipeline.joint.ship import Component, Engine, density

LEAST_READINGS = 100
LEAST = 3  # bins from zero frequency, and on either side of the swing, that constants fill
BINS, FINE, BESIDE = 200, 3.0, 10.0  # in all; a line's width over that of a bin about it; widths on either side of it
NOISE_SPREAD = 0.3  # 1 sigma of the logarithm of the reading noise
STEP, MOST_STEP = 0.02, 1.0  # of a logarithm: for its slope; at once
ROUNDS, HALVINGS = 20, 4
ENOUGH = 0.2  # in log-likelihood


def errors_by_frequency(fit: Fitted, trace: int) -> tuple[Floats, Floats, np.ndarray]:
    """Power of a trace's whitened errors by frequency, rad s-1, 1 where they are of unit variance; and which these are.

    Empty where they are few.
    """
    from scipy.fft import next_fast_len

    lattice = fit.model.problem.lattice
    used = (lattice.trace == trace) & np.isfinite(fit.of.whitened)
    if used.sum() < LEAST_READINGS:
        return np.zeros(0), np.zeros(0), used
    time = lattice.time[used]
    step = max(float(np.median(np.diff(time))), 1e-3)
    series = np.zeros(next_fast_len(int(lattice.duration / step) + 2, real=True))
    series[np.clip(np.rint(time / step), 0, series.size - 1).astype(np.int64)] = fit.of.whitened[used]
    power = np.abs(np.fft.rfft(series)) ** 2 / used.sum()
    return 2.0 * np.pi * np.arange(power.size) / (series.size * step), power, used


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
    step: float

    @staticmethod
    def of(fit: Fitted, trace: int, lines: tuple[Component, ...]) -> Band | None:
        """The errors of a trace; finer bins about some lines."""
        problem = fit.model.problem
        swing = float(np.sqrt(problem.kappa.mean()))
        frequency, power, _ = errors_by_frequency(fit, trace)
        if frequency.size <= 4 * LEAST:
            return None
        step = float(np.pi / frequency[-1])
        keep = np.abs(frequency - spectrum.folded(swing, step)) > (LEAST + 0.5) * frequency[1]
        keep[:LEAST] = False
        frequency, power = frequency[keep], power[keep]
        edges = [np.geomspace(frequency[0], frequency[-1] * 1.0001, BINS + 1)]
        for line in lines:
            if isinstance(line, Engine):
                wide = max(line.damping, frequency[1] - frequency[0])
                about = np.arange(-BESIDE, BESIDE, 1.0 / FINE) * wide
                centres = [line.peak] if line.axis == "horizontal" else [abs(line.peak + by) for by in (swing, -swing)]
                edges += [each + about for each in centres]
        at = np.searchsorted(np.unique(np.concatenate(edges)), frequency, side="right")
        count = np.bincount(at)
        some = count > 0
        mean, weight = np.bincount(at, frequency)[some] / count[some], count[some].astype(np.float64)
        folds = int(2.0 * swing * step / np.pi)  # sparse readings show what is faster among the rest
        every = np.abs(mean + 2.0 * np.pi / step * np.arange(-folds, folds + 1)[:, None]).ravel()
        angles = fit.path[:, : 2 * problem.pendulums : 2] @ problem.lattice.combination[trace]
        upright = spectrum.beside_the_swing(swing, 0.5 * float(np.mean(angles**2)), every)
        across = spectrum.transfer(problem, trace, every)
        return Band(trace, np.bincount(at, power)[some] / count[some], weight, every, across, upright, step)

    def expected(self, ship: tuple[Component, ...], noise: float, swing: float) -> Floats:
        """Density that a ship and a reading noise make expect, (f,)."""
        beside = sum(density(ship, np.abs(self.frequency + by), "vertical") for by in (swing, -swing))
        total = self.across * density(ship, self.frequency, "horizontal") + self.upright * beside
        return np.asarray(total.reshape(-1, self.power.size).sum(axis=0) + noise**2 * self.step)


@dataclass(frozen=True)
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

    @staticmethod
    def of(fit: Fitted, lines: tuple[Component, ...] = ()) -> Shown:
        """What a fit shows, also of some lines that it does not assume."""
        problem, assumed = fit.model.problem, fit.model.assumed
        found = [Band.of(fit, trace, (*assumed.ship, *lines)) for trace in range(problem.traces)]
        swing = float(np.sqrt(problem.kappa.mean()))
        return Shown(tuple(each for each in found if each is not None), assumed, swing)

    def expected(self, ship: tuple[Component, ...], noise: Floats) -> Floats:
        """Logarithm of the density that a ship and the noise of the traces make expect in all bands, (n,)."""
        parts = [np.log(band.expected(ship, float(noise[band.trace]), self.swing)) for band in self.bands]
        return np.concatenate([np.zeros(0), *parts])

    @property
    def power(self) -> Floats:
        """Of the errors in all bands, (n,)."""
        return np.concatenate([np.zeros(0), *(band.power for band in self.bands)])

    @property
    def weight(self) -> Floats:
        """Ordinates in each bin of all bands, (n,)."""
        return np.concatenate([np.zeros(0), *(band.weight for band in self.bands)])

    def likeliest(self, ship: tuple[Component, ...], *, last: bool = False) -> tuple[Assumed, float]:
        """A ship and a noise where the errors are likeliest, and by how much, in log-likelihood; see `Assumed`.

        Scoring on the logarithms of all parameters, which keep to where they begin; or on those of the last component.
        """
        start, spread = self._begin(ship)
        own, traces = spectrum.parameters(ship).size, self.assumed.noise.size - 2
        free = np.arange(start.size)
        if last:
            free = free[own - spectrum.parameters(ship[-1:]).size : own]
        power, weight, assumed = self.power, self.weight, self.expected(self.assumed.ship, self.assumed.noise)

        def make(vector: Floats) -> tuple[tuple[Component, ...], Floats]:
            size = np.maximum(np.exp(vector[own:]), spectrum.LEAST_NOISE)
            return spectrum.assemble(ship, vector[:own]), np.append(size, self.assumed.noise[traces:])

        def value(vector: Floats) -> tuple[float, Floats]:
            more = self.expected(*make(vector)) - assumed
            cost = float(np.sum(weight * (more + power * np.exp(-more))))
            return -cost - 0.5 * float(np.sum(((vector - start) / spread) ** 2)), more

        best = start
        top, more = value(best)
        for _ in range(ROUNDS):
            rows = np.stack([(value(best + STEP * np.eye(best.size)[k])[1] - more) / STEP for k in free])
            slope = rows @ (weight * (power * np.exp(-more) - 1.0)) - ((best - start) / spread**2)[free]
            step = np.linalg.solve((rows * weight) @ rows.T + np.diag(spread[free] ** -2.0), slope)
            by = np.zeros(best.size)
            by[free] = step * min(1.0, MOST_STEP / max(float(np.abs(step).max()), 1e-12))
            before = top
            for _ in range(HALVINGS):
                trial = value(best + by)
                if trial[0] > top:
                    best, (top, more) = best + by, trial
                    break
                by *= 0.3
            if top - before < ENOUGH:
                break
        found, size = make(best)
        return replace(self.assumed, ship=found, noise=size), top + float(np.sum(weight * power))

    def _begin(self, ship: tuple[Component, ...]) -> tuple[Floats, Floats]:
        """Logarithms of the parameters of a ship and of the traces' noise, and 1 sigma about them."""
        noise = np.log(self.assumed.noise[:-2])
        spread = np.append(spectrum.spreads(ship), np.full(noise.size, NOISE_SPREAD))
        return np.append(spectrum.parameters(ship), noise), spread

    def loss(self, ship: tuple[Component, ...]) -> float:
        """What the likelihood loses with another ship."""
        less = self.expected(ship, self.assumed.noise) - self.expected(self.assumed.ship, self.assumed.noise)
        return float(np.sum(self.weight * (less + self.power * (np.exp(-less) - 1.0))))

    def doubt(self, number: int) -> float:
        """1 sigma of the mean square of a component's motion as it is followed, over what is assumed of it."""
        ship, noise, weight = self.assumed.ship, self.assumed.noise, self.weight
        whole = np.exp(self.expected(ship, noise))
        own = whole - np.exp(self.expected((*ship[:number], *ship[number + 1 :]), noise))
        share = own / whole  # of what is read at a frequency: so much of the motion there is followed
        lost = 1.0 - float(np.sum(weight * own * share) / np.sum(weight * own))
        ordinates = float(np.sum(weight * share) ** 2 / np.sum(weight * share**2))
        return float(np.hypot(lost, 2.0 * np.sqrt(lost / ordinates)))
