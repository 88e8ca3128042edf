"""Motion of the ship that the errors still show: lines and seas, horizontal or vertical, priced by the likelihood."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import spectrum
from pipeline.joint.climb import Span, grown, of_an_axis, of_sizes, of_the_last, pieces, refined, shifted
from pipeline.joint.explanation import Candidate, Fitted, Model, fitted, priced
from pipeline.joint.ship import Axis, Component, Engine, Sea, Vibration

CALM = 0.5  # of the swing's frequency: below it lines of the sea are left, which cost nothing
WIDTHS = (1, 256)  # bins of a spectrum that are looked at together
SIZES = (1.0, 0.5, 2.0)  # of the size that a peak asks for, tried
BROAD = 0.03  # relative width from which motion is the sea's
COMPONENT = 13.0  # in log-likelihood, of a component's parameters and of its place among all
CHANCE = 1e-3  # that white errors show a peak
LEAST_VERTICAL = 0.3  # rad s-1
OWN = 0.05  # of the swing's frequency: so near it kicks and friction show
SLOW, SLOW_SIZES = (0.01, 0.05), (3e-4, 3e-3)  # s-1; over reference gravity: turns and changes of speed
SAME_LINE = 0.2  # in the logarithm of the frequency
QUIET = 0.3  # of the power that white errors of unit variance have
LEAST_READINGS = 100
LEAST_BAND, BANDS = 8, 12  # bins of the lowest band; bands of a spectrum
MOST_COMPONENTS = 3
FEW_GAPS = 0.98  # share of the nodes with readings
MISSED = 10.0  # in log-likelihood of a stretch, of a component that stays
HOPELESS = 12.0  # in log-likelihood, of a line's first size: the others will not do either


def components(fit: Fitted, *, slow: bool) -> Iterator[Candidate]:
    """Motion of the ship where the whitened errors have more power than white ones; turns where they are asked for."""
    if len(fit.model.assumed.ship) >= len(fit.model.first_ship) + MOST_COMPONENTS:
        return
    model, some = fit.model, pieces(fit.model.problem)

    def of(ship: tuple[Component, ...]) -> Candidate:
        words = f"{ship[-1].axis} motion at {ship[-1].peak / (2.0 * np.pi):.2f} Hz"
        trial = replace(model, words=(*model.words, words), assumed=replace(model.assumed, ship=ship))
        return priced(trial, grown(fit.path, model.problem.pendulums, ship), cost=COMPONENT)

    def of_pieces(ship: tuple[Component, ...]) -> float:
        trial = replace(model, assumed=replace(model.assumed, ship=ship))
        return worth(trial, grown(fit.path, model.problem.pendulums, ship), some)

    found = []
    near = [(each.axis, each.peak) for each in model.assumed.ship[len(model.first_ship) :]]
    turns: list[list[Component]] = [[Vibration(rate, size) for size in SLOW_SIZES] for rate in SLOW if slow]
    for lines in (*_lines(fit), *turns):
        axis, peak = lines[0].axis, lines[0].peak
        if any(axis == other and abs(np.log(peak / at)) < SAME_LINE for other, at in near):
            continue
        near.append((axis, peak))
        ships = [(*model.assumed.ship, line) for line in lines]
        if isinstance(lines[0], Sea):
            best = of(max(ships, key=of_pieces))
        else:  # a line, or a turn, shows in the whole record, if at all
            best = of(ships[0])
            if best[0] < fit.solution.log_likelihood - HOPELESS:
                continue
            best = max(best, *(of(ship) for ship in ships[1:]), key=lambda each: each[0])
        found.append(best)
    if not found:
        return
    yield from found
    likeliest = max(found, key=lambda each: each[0])[1]
    moves = of_the_last(model.problem, likeliest.assumed.ship)
    about = grown(fit.path, model.problem.pendulums, likeliest.assumed.ship)
    ship = refined(model.problem, likeliest.assumed, model.constants, about, some, moves).ship
    if abs(np.log(ship[-1].peak / likeliest.assumed.ship[-1].peak)) < SAME_LINE:  # else it went to better what is there
        yield of(ship)


def resized(fit: Fitted) -> Fitted:
    """With the ship's components anew in size: what stood in for one that was added goes."""
    problem, ship = fit.model.problem, fit.model.assumed.ship
    return _moved(fit, pieces(problem), of_sizes(problem, ship))


def climbed(fit: Fitted) -> Fitted:
    """With the ship's parameters where the readings are likeliest; by the whole record its sway's size, as gains do."""
    problem = fit.model.problem
    fit = _moved(fit, pieces(problem))
    sizes = of_sizes(problem, fit.model.assumed.ship)
    sway = sizes[[each.axis == "horizontal" for each in fit.model.assumed.ship]].sum(axis=0, keepdims=True)
    fit = _moved(fit, [(0, problem.lattice.nodes)], sway)
    return replace(fit, model=replace(fit.model, climbed=True, first_ship=fit.model.assumed.ship))


def upright(fit: Fitted) -> Fitted:
    """With the vertical components, which gravity answers to, where the readings are likeliest."""
    problem, ship = fit.model.problem, fit.model.assumed.ship
    if not any(each.axis == "vertical" for each in ship):
        return fit
    return _moved(fit, pieces(problem), of_an_axis(problem, ship, "vertical"))


def pruned(fit: Fitted) -> Fitted:
    """Without components of the ship that the record is likelier without; a broad vertical one would hide gravity."""
    spans = pieces(fit.model.problem)
    for number in reversed(range(len(fit.model.assumed.ship))):
        model, ship = fit.model, fit.model.assumed.ship
        rest = (*ship[:number], *ship[number + 1 :])
        if not rest:
            break
        sizes = [2 * model.problem.pendulums, *(each.system()[1].size for each in ship)]
        begin = sum(sizes[: number + 1])
        path = np.delete(fit.path, slice(begin, begin + sizes[number + 1]), axis=1)
        first = tuple(each for each in model.first_ship if each != ship[number])
        trial = replace(model, assumed=replace(model.assumed, ship=rest), first_ship=first)
        less = worth(fit.model, fit.path, spans) - worth(trial, path, spans)
        if less < MISSED and priced(trial, path)[0] > fit.solution.log_likelihood:
            fit = fitted(trial, path)
    return fit


def worth(model: Model, path: Floats, spans: list[Span]) -> float:
    """Log-likelihood of some stretches."""
    begun = [replace(model, constants=shifted(model.constants, path, span[0])) for span in spans]
    return sum(priced(each, path, span=span)[0] for each, span in zip(begun, spans, strict=True))


def _moved(fit: Fitted, spans: list[Span], moves: Floats | None = None) -> Fitted:
    """With the ship's parameters and the noise moved, where that is better for the whole record."""
    model = fit.model
    assumed = refined(model.problem, model.assumed, model.constants, fit.path, spans, moves)
    if assumed.ship == model.assumed.ship and np.array_equal(assumed.noise, model.assumed.noise):
        return fit
    try:
        found = fitted(replace(model, assumed=assumed), fit.path)
    except np.linalg.LinAlgError:
        return fit
    return found if found.solution.log_likelihood > fit.solution.log_likelihood else fit


def _lines(fit: Fitted) -> Iterator[list[Component]]:
    """Components for each place where the errors have too much power: of any width, horizontal, or vertical.

    A vertical motion shows on either side of the swing, in all traces: their power is taken together.
    """
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    swing, two = float(np.sqrt(problem.kappa.mean())), 2 * problem.pendulums
    vertical = fit.model.assumed.sine and not problem.recorded.size
    arcs = np.std(fit.path[:, :two:2] @ lattice.combination.T, axis=0)
    every = [_errors_by_frequency(fit, trace) for trace in range(problem.traces)]
    dense = [j for j, each in enumerate(every) if each[0].size and each[0].size == max(each[0].size for each in every)]
    if not dense:
        return
    frequency = every[dense[0]][0]
    beside = np.abs(np.arange(frequency.size) + np.array([[1], [-1]]) * round(swing / frequency[1]))
    there = beside < frequency.size
    beside[~there] = 0
    excess, answer = np.zeros((2, frequency.size)), np.zeros((2, frequency.size))
    for j in dense:
        power, noise = every[j][1:]
        # half of the variance on either side
        acts = 0.5 * there * (arcs[j] * swing**2 / (swing**2 - frequency[beside] ** 2)) ** 2 / noise
        excess, answer = excess + acts * (power[beside] - 1.0), answer + acts**2

    def upright(at: int, width: int) -> list[Component]:
        rows = slice(max(at - width // 2, 0), at + width // 2 + 1)
        square = float(excess[:, rows].sum()) / float(answer[:, at].sum())
        size = np.sqrt(max(square, 1e-20))
        return [_shape(frequency[at], width * frequency[1], float(size), "vertical", f) for f in SIZES]

    for j in dense:
        power, noise = every[j][1:]
        blind = (
            vertical and abs(float(lattice.combination[j].sum())) < 0.5
        )  # a difference hardly sees horizontal motion
        for at, width in _peaks(power):
            if blind:
                yield from (upright(k, width) for k in beside[:, at] if frequency[k] > LEAST_VERTICAL)
                continue
            more = float(power[max(at - width // 2, 0) : at + width // 2 + 1].sum()) - width
            size = np.sqrt(noise * max(more, 1.0) / spectrum.transfer(problem, j, frequency[at : at + 1])[0])
            yield [_shape(frequency[at], width * frequency[1], float(size), "horizontal", f) for f in SIZES]
    if vertical:
        weighed = np.where(answer.sum(axis=0) > 0.0, excess.sum(axis=0) / np.sqrt(answer.sum(axis=0)), 0.0) + 1.0
        weighed[frequency < LEAST_VERTICAL] = 0.0
        yield from (upright(at, width) for at, width in _peaks(weighed))


def hangs_on_the_sea(fit: Fitted) -> bool:
    """Whether gaps are bridged by a spectrum of the sea that the errors deny."""
    problem = fit.model.problem
    read = np.unique(problem.lattice.node[~problem.left_out]).size / problem.lattice.nodes
    return read < FEW_GAPS and not is_white(fit, list(range(problem.traces)), quiet=False)


def is_white(fit: Fitted, traces: list[int], *, quiet: bool = True) -> bool:
    """Whether the errors of some traces have no more power than white ones of their stated size, in any band.

    Nor less, where errors that are too quiet do not serve.
    """
    for trace in traces:
        frequency, power, _ = _spectrum(fit, trace)
        edges = np.unique(np.geomspace(LEAST_BAND, max(frequency.size, LEAST_BAND + 1), BANDS + 1).astype(np.int64))
        for low, high in zip([0, *edges[1:-1]], edges[1:], strict=True):
            ratio = float(np.mean(power[low:high])) if power[low:high].size else 1.0
            if (ratio > 1.0 or not quiet) and (high - low) * (ratio - 1.0 - np.log(ratio)) > COMPONENT:
                return False
    return True


def _spectrum(fit: Fitted, trace: int) -> tuple[Floats, Floats, np.ndarray]:
    """Power of a trace's whitened errors by frequency, rad s-1, 1 where they are of unit variance; and which these are.

    Empty where they are few.
    """
    lattice = fit.model.problem.lattice
    used = (lattice.trace == trace) & np.isfinite(fit.of.whitened)
    if used.sum() < LEAST_READINGS:
        return np.zeros(0), np.zeros(0), used
    step = max(float(np.median(np.diff(lattice.time[used]))), 1e-3)
    series = np.zeros(int(lattice.duration / step) + 2)
    series[np.clip(np.rint(lattice.time[used] / step), 0, series.size - 1).astype(np.int64)] = fit.of.whitened[used]
    power = np.abs(np.fft.rfft(series)) ** 2 / used.sum()
    return 2.0 * np.pi * np.arange(power.size) / (series.size * step), power, used


def _errors_by_frequency(fit: Fitted, trace: int) -> tuple[Floats, Floats, float]:
    """Power of a trace's whitened errors, of mean 1, by frequency, rad s-1; and the variance that a unit stands for."""
    swing = float(np.sqrt(fit.model.problem.kappa.mean()))
    frequency, power, used = _spectrum(fit, trace)
    if not frequency.size or np.pi / frequency[-1] * swing > spectrum.SPARSE:
        return np.zeros(0), np.zeros(0), 0.0
    # errors far below their own scale need no explanation
    power /= max(float(np.median(power)) / np.log(2.0), QUIET)
    power[(frequency < CALM * swing) | (np.abs(frequency / swing - 1.0) < OWN)] = 1.0
    return frequency, power, float(np.nanmedian(fit.of.scale[used])) ** 2 * 2.0 / float(used.sum())


def _peaks(power: Floats) -> Iterator[tuple[int, int]]:
    """Where a spectrum of mean 1 has more power than chance has: its highest place and the width looked at, in bins."""
    from scipy.special import gammainccinv

    for width in WIDTHS:
        summed = np.convolve(power, np.ones(width), "same")
        at = int(np.argmax(summed))
        if summed[at] > gammainccinv(width, CHANCE / power.size):
            yield at, width


def _shape(frequency: float, width: float, size: float, axis: Axis, factor: float) -> Component:
    kind = Engine if width < BROAD * frequency else Sea
    return kind(float(frequency), float(width), factor * size, axis)
