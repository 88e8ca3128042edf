"""The sea's and the vibration's spectrum from a trace: where the search for their likelihood begins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Axis, Component, Engine, Sea, Vibration, density

WINDOWS = (100.0, 50.0, 25.0)  # s: the longest that a record has three of
LEAST_WINDOWS = 3
BINS = 160
LOBE = 3.0  # half width of the taper's main lobe, in turns a window
LINE = 0.06  # least half width about the swing's frequency and its harmonics, relative, that the swing itself fills
FAST, FAST_PEAK, FAST_LINE = 1.8, 6.0, 0.3  # of the swing; deviations of a mean power; of the third harmonic
LEAST_GAP = 0.2  # s: shorter ones are interpolated without harm
LEAST_NOISE = 1e-6  # rad: readings are taken for no better
SPARSE = 2.0  # of the swing between readings, rad
SIDEBANDS = 0.4  # of the swing's frequency
REACH = {Sea: np.array([0.9, 1.6, 7.0]), Vibration: np.array([2.0, 7.0])}
"""How far the logarithms may go from where they began."""
NARROWEST, BROADEST = 0.01, 0.7  # of the frequency, a sea's damping
LOWEST = 1.27  # mean of the lowest quarter of normal deviates, with its sign changed
MORE = 15.0  # in log-likelihood, that a further sea must be worth
MOST_SEAS = 1
MISSED = 1.0  # in log-likelihood
FILLED = 1.5  # s: longest gap that is interpolated for the spectrum's sake


def periodogram(problem: Problem, trace: int, path: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean periodogram of a trace without its own swing; readings that are missing are taken from a path, (k, d).

    Returns
    -------
    frequency, power, weight : (f,) arrays
        rad s-1; two-sided density, rad2 s; number of periodogram ordinates in each bin. Empty where the trace has no
        stretch of three windows.
    """
    from scipy.interpolate import CubicHermiteSpline

    lattice = problem.lattice
    used = lattice.trace == trace
    if problem.left_out.size:
        used &= ~problem.left_out
    time, value = lattice.time[used], lattice.value[used]
    if time.size < 64:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    step = max(float(np.median(np.diff(time))), 1e-3)
    weights = lattice.combination[trace]
    angles, speeds = (path[:, q : 2 * problem.pendulums : 2] @ weights for q in (0, 1))
    followed = CubicHermiteSpline(lattice.step * np.arange(lattice.nodes), angles, speeds)
    rest = value - followed(time)
    swing = float(np.sqrt(problem.kappa.mean()))
    for length in WINDOWS:
        found = _averaged(time, rest, followed, step, length, swing)
        if found is not None:
            return found
    return np.zeros(0), np.zeros(0), np.zeros(0)


def _averaged(
    time: Floats, rest: Floats, followed: Callable[[Floats], Floats], step: float, length: float, swing: float
) -> tuple[Floats, Floats, Floats] | None:
    """Periodogram of windows of that length; None where there are too few without a gap."""
    rows = int(length / step)
    taper = np.hanning(rows + 2)[1:-1] ** 2
    own = np.arange(rows) * step
    design, inverse = _of_the_swing(own, swing, taper)
    total, count = np.zeros(rows // 2 + 1), 0
    for begin in np.arange(time[0], time[-1] - length, 0.5 * length):
        grid = begin + step * np.arange(rows)
        low, high = np.searchsorted(time, (grid[0] - FILLED, grid[-1] + FILLED))
        here, there = time[low:high], rest[low:high]
        if here.size < 8 or here[0] > grid[0] + step or here[-1] < grid[-1] - step:
            continue
        if np.diff(here).max() > max(FILLED, 1.5 * step):
            continue
        series = followed(grid) + np.interp(grid, here, there)
        series = series - design @ (inverse @ series)
        total += np.abs(np.fft.rfft(taper * series)) ** 2
        count += 1
    if count < LEAST_WINDOWS:
        return None
    frequency = 2.0 * np.pi * np.fft.rfftfreq(rows, step)
    power = total * step / (count * float(taper @ taper))
    line = max(LINE, LOBE * 2.0 * np.pi / (length * swing))
    keep = np.ones(frequency.size, dtype=bool)
    keep[:2] = False
    for multiple in (1.0, 3.0):
        keep &= np.abs(frequency - folded(multiple * swing, step)) > line * swing
    keep &= frequency < 0.95 * np.pi / step
    return _binned(frequency[keep], power[keep], 0.5 * count)


def folded(frequency: float, step: float) -> float:
    """Where readings at that step show a frequency, rad s-1."""
    turns = frequency * step / (2.0 * np.pi)
    return float(abs(turns - np.rint(turns)) * 2.0 * np.pi / step)


def _of_the_swing(own: Floats, swing: float, taper: Floats) -> tuple[Floats, Floats]:
    """A line, the swing with an amplitude that changes evenly, its third harmonic; and what fits them under a taper."""
    since = own - own.mean()
    columns = [np.ones(own.size), since]
    for multiple in (1.0, 3.0):
        turn = np.cos(multiple * swing * since), np.sin(multiple * swing * since)
        columns += [*turn, since * turn[0], since * turn[1]] if multiple == 1.0 else turn
    design = np.stack(columns, axis=1)
    left = taper[:, None] * design
    return design, np.linalg.pinv(design.T @ left, hermitian=True) @ left.T


def _binned(frequency: Floats, power: Floats, each: float) -> tuple[Floats, Floats, Floats]:
    edges = np.geomspace(frequency[0], frequency[-1] * 1.0001, BINS + 1)
    at = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, BINS - 1)
    count = np.bincount(at, minlength=BINS)
    some = count > 0
    return (
        np.bincount(at, frequency, BINS)[some] / count[some],
        np.bincount(at, power, BINS)[some] / count[some],
        each * count[some],
    )


def is_calm(time: Floats, series: Floats, swing: float, arc: float) -> bool:
    """Whether readings, (n,), NaN where missing, show no motion much faster than a swing of that arc, rad."""
    from scipy.interpolate import CubicSpline
    from scipy.signal.windows import blackmanharris

    there = np.isfinite(series)
    if there.sum() < 64:
        return True
    at, value = time[there], series[there]
    step = max(float(np.median(np.diff(at))), 1e-3)
    rows = int(WINDOWS[-1] / step)
    turns = 2.0 * np.pi * np.fft.rfftfreq(rows, step) / swing
    fast = turns > FAST
    if not fast.any():
        return True
    filled, taper, found = CubicSpline(at, value), blackmanharris(rows), []
    own = np.arange(rows) * step
    design, inverse = _of_the_swing(own, swing, taper)
    for begin in np.arange(at[0], at[-1] - WINDOWS[-1], WINDOWS[-1]):
        low, high = np.searchsorted(at, (begin, begin + WINDOWS[-1]))
        if high - low > 2 and np.diff(at[low:high]).max() < LEAST_GAP:
            series = filled(begin + own)
            found.append(np.abs(np.fft.rfft(taper * (series - design @ (inverse @ series)))[fast]) ** 2)
    if not found:
        return False
    power = np.mean(found, axis=0) / float(taper @ taper)
    allowed = (1.0 + FAST_PEAK / np.sqrt(len(found))) * max(float(np.median(power)), LEAST_NOISE**2)
    # the swing's own third harmonic, whose amplitude the ship changes
    third = float(taper.sum()) ** 2 / float(taper @ taper) * (arc**3 / 192.0) ** 2
    return bool(np.all(power < allowed + third * (np.abs(turns[fast] - 3.0) < FAST_LINE)))


def noise_floor(problem: Problem, trace: int, path: Floats) -> float:
    """White reading noise of a trace from the quietest part of its spectrum, rad."""
    frequency, power, weight = periodogram(problem, trace, path)
    if not frequency.size:
        return float("nan")
    order = np.argsort(power)
    part = order[: max(4, order.size // 4)]
    used = problem.lattice.trace == trace
    step = max(float(np.median(np.diff(problem.lattice.time[used]))), 1e-3)
    lower = max(1.0 - LOWEST / np.sqrt(float(np.median(weight[part]))), 0.3)  # the lowest of many are low by chance
    return float(np.sqrt(np.average(power[part], weights=weight[part]) / (lower * step)))


def transfer(problem: Problem, trace: int, frequency: Floats) -> Floats:
    """Square of a trace's answer to U, by frequency."""
    answer = np.zeros(frequency.size)
    for i in range(problem.pendulums):
        kappa = float(problem.kappa[i])
        answer = answer - problem.lattice.combination[trace, i] * kappa / (kappa - frequency**2)
    return np.asarray(answer**2)


def beside_the_swing(swing: float, square: float, frequency: Floats) -> Floats:
    """Square of a trace's answer to Z on either side of the swing, by frequency; `square`: half its mean square."""
    return np.asarray(square * (swing**2 / (swing**2 - frequency**2)) ** 2)


@dataclass(frozen=True)
class Seen:
    """What a trace shows of the ship.

    Attributes
    ----------
    frequency, power, weight : (f,) arrays
        See `periodogram`.
    across, upright : (f,) arrays
        What the trace makes of the density of the horizontal acceleration, and of that of the vertical one at either
        side of the swing.
    white : float
        Density of the reading noise.
    swing : float
        rad s-1.
    """

    frequency: Floats
    power: Floats
    weight: Floats
    across: Floats
    upright: Floats
    white: float
    swing: float

    def model(self, ship: tuple[Component, ...]) -> Floats:
        """Density that a ship makes expect."""
        beside = sum(density(ship, np.abs(self.frequency + by), "vertical") for by in (self.swing, -self.swing))
        return self.across * density(ship, self.frequency, "horizontal") + self.upright * beside + self.white

    def cost(self, ship: tuple[Component, ...]) -> float:
        """Minus Whittle's log-likelihood."""
        model = self.model(ship)
        return float(np.sum(self.weight * (np.log(model) + self.power / model)))

    def climbed(self, own: tuple[Component, ...], beside: tuple[Component, ...]) -> tuple[Component, ...]:
        """Components of the greatest likelihood beside others, within reach of where they begin."""
        from scipy.optimize import minimize

        start = parameters(own)
        reach = np.concatenate([REACH[type(each)] for each in own])

        def cost(vector: Floats) -> float:
            outside = np.sum(np.maximum(0.0, np.abs(vector - start) - reach) ** 2)
            vector = np.clip(vector, start - 2.0 * reach, start + 2.0 * reach)
            return self.cost((*beside, *assemble(own, vector))) + 1e3 * float(outside)

        simplex = np.vstack([start, *(start + 0.5 * row for row in np.eye(start.size))])
        found = minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": 150 * start.size, "xatol": 0.02, "fatol": 0.1},
        )
        return assemble(own, found.x)

    def extended(self, ship: tuple[Component, ...], axis: Axis) -> tuple[Component, ...]:
        """More of the sea of that axis where the power exceeds what is expected, while it pays."""
        for _ in range(MOST_SEAS):
            expected = self.model(ship)
            over = self.power / expected - 1.0
            at = int(np.argmax(over * np.sqrt(self.weight)))
            answer, rate = (self.across, 0.0) if axis == "horizontal" else (self.upright, self.swing)
            tried = []
            for peak in {abs(float(self.frequency[at]) + by) for by in (rate, -rate)}:
                size = float(np.sqrt(max(over[at], 1e-6) * expected[at] / answer[at] * 0.1 * peak))
                tried.append((*ship, *self.climbed((Sea(peak, 0.1 * peak, max(size, 1e-9), axis),), ship)))
            best = min(tried, key=self.cost)
            if self.cost(best) > self.cost(ship) - MORE:
                break
            ship = best
        return ship

    def needed(self, ship: tuple[Component, ...]) -> tuple[Component, ...]:
        """Without horizontal components, but the first, that the spectrum does not miss."""
        for each in ship[1:]:
            rest = tuple(other for other in ship if other is not each)
            if each.axis == "horizontal" and self.cost(rest) < self.cost(ship) + MISSED:
                ship = rest
        return ship


def seen(problem: Problem, trace: int, path: Floats, noise: float, *, sidebands: bool) -> Seen:
    """Spectrum of a trace and how it answers to the ship; without the sidebands of the swing where these are known."""
    frequency, power, weight = periodogram(problem, trace, path)
    swing = float(np.sqrt(problem.kappa.mean()))
    used = problem.lattice.trace == trace
    step = max(float(np.median(np.diff(problem.lattice.time[used]))), 1e-3)
    if not sidebands:
        keep = np.abs(frequency / swing - 1.0) > SIDEBANDS
        frequency, power, weight = frequency[keep], power[keep], weight[keep]
    # a quarter of the square of the arc: half of the mean square
    arc = 0.5 * float(np.mean((problem.lattice.combination[trace] @ path[:, : 2 * problem.pendulums : 2].T) ** 2))
    upright = beside_the_swing(swing, arc, frequency)
    return Seen(frequency, power, weight, transfer(problem, trace, frequency), upright, noise**2 * step, swing)


def begin(problem: Problem, path: Floats, noise: Floats, *, sine: bool, heave: bool) -> tuple[Component, ...]:
    """Swell and vibration that the traces' spectra ask for, by Whittle's likelihood; and the heave, where it is sought.

    Heave puts sidebands of the swing about its line (law `sine`): a difference, which hardly sees horizontal motion,
    tells of it, and where it shows none there is none; they are left out where it is recorded.
    """
    sums = np.abs(problem.lattice.combination.sum(axis=1))
    base, difference = int(np.argmax(sums)), int(np.argmin(sums))
    swing = float(np.sqrt(problem.kappa.mean()))
    used = problem.lattice.trace == base
    sparse = float(np.median(np.diff(problem.lattice.time[used]))) * swing > SPARSE  # sidebands lie upon each other
    of = seen(problem, base, path, float(noise[base]), sidebands=sparse or not sine or heave)
    upright: tuple[Component, ...] = ()
    untold = heave
    if heave and not sparse and sums[difference] < 0.5 and of.frequency.size:
        by = seen(problem, difference, path, float(noise[difference]), sidebands=True)
        untold = not by.frequency.size
        if not untold:
            level = 0.1 * float(np.sqrt(np.median(by.power / by.upright) * swing))
            starts = [(Sea(f, 0.3 * f, level, "vertical"),) for f in np.geomspace(0.05, 2.5, 8) * swing]
            likeliest = min((by.climbed(each, ()) for each in starts), key=by.cost)
            if by.cost(likeliest) < by.cost(()) - MORE:
                upright = by.extended(likeliest, "vertical")
    first: tuple[Component, ...] = (Sea(0.7, 0.12, 1e-2), Vibration(6.0, 1e-3))
    motion = np.maximum(of.power - of.white, 1e-6 * of.power) / of.across
    slow = of.frequency < 0.6 * swing
    if slow.sum() > 8:
        peak = float(of.frequency[slow][np.argmax((motion * of.frequency)[slow])])
        size = float(np.sqrt(np.trapezoid(motion[slow], of.frequency[slow]) / np.pi))
        fast = motion[of.frequency > (1.0 + SIDEBANDS) * swing]
        rate = 6.0
        level = float(np.sqrt(max(np.median(fast), 1e-30) * rate * 3.0 / 16.0)) if fast.size else 0.1 * size
        first = (Sea(peak, 0.15 * peak, max(size, 1e-9)), Vibration(rate, max(level, 1e-9)))
    if untold:
        own = first[0]
        assert isinstance(own, Sea)
        first = (*first, replace(own, axis="vertical", rms=0.05 * own.rms))
    if not of.frequency.size:
        return first
    return of.needed(of.extended((*of.climbed(first, upright), *upright), "horizontal"))


def parameters(components: tuple[Component, ...]) -> Floats:
    """Logarithms of frequency or rate, relative damping and size of all components."""
    out: list[float] = []
    for each in components:
        if isinstance(each, Vibration):
            out += [each.rate, each.rms]
        else:
            out += [each.frequency, each.damping / each.frequency, each.rms]
    return np.log(out)


def spreads(components: tuple[Component, ...]) -> Floats:
    """1 sigma of the logarithms of `parameters` about what a spectrum gives."""
    out: list[float] = []
    for each in components:
        out += [0.3, 2.0] if isinstance(each, Vibration) else [0.2, 0.7, 1.0]
    return np.array(out)


def assemble(like: tuple[Component, ...], vector: Floats) -> tuple[Component, ...]:
    """Components of the same kinds with other numbers; a sea that is too narrow for one becomes a line."""
    values = iter(np.exp(vector).tolist())
    out: list[Component] = []
    for each in like:
        if isinstance(each, Vibration):
            out.append(replace(each, rate=next(values), rms=next(values)))
        else:
            frequency, width, size = next(values), next(values), next(values)
            kind = Engine if isinstance(each, Engine) or width < NARROWEST else Sea
            out.append(kind(frequency, frequency * min(width, BROADEST), size, each.axis))
    return tuple(out)


def between(one: Assumed, other: Assumed, share: float) -> Assumed:
    """Ship and noise some share of the way from one to another of the same kinds, in logarithms."""
    low, high = parameters(one.ship), parameters(other.ship)
    noise = one.noise * (other.noise / one.noise) ** share
    return replace(other, ship=assemble(other.ship, low + share * (high - low)), noise=noise)
