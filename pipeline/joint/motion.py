"""Motion of the ship that the errors still show: lines and seas, horizontal or vertical, priced by the likelihood."""

from collections.abc import Iterator
from dataclasses import replace
from typing import get_args

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.explanation import PAYS, STRAIGHT, Candidate, Fitted, attempted, likelier, path_on, priced
from pipeline.joint.problem import LEVEL, SPARSE, Assumed
from pipeline.joint.ship import Axis, Component, Engine, Sea, Vibration, assemble, parameters
from pipeline.joint.whiteness import CALM, UNKNOWN, Spectrum, clipped, errors_by_frequency, shared, transfer

WIDTHS = (1, 256)  # bins of a spectrum that are looked at together
BROAD = 0.03  # relative width from which motion is the sea's
COMPONENT = 13.0  # in log-likelihood, of a component's parameters and of its place among all
CHANCE = 1e-3  # that white errors show a peak
OWN = 0.002  # of the swing's frequency: so near it kicks and friction show
LEAST_VERTICAL = 0.3  # rad s-1
SLOW = (Vibration(0.01, 1e-3), Vibration(0.05, 1e-3))  # turns and changes of speed
SAME_LINE = 0.2  # in the logarithm of the frequency
QUIET = 0.3  # of the power that white errors of unit variance have
LEAST_BAND, BANDS = 8, 12  # bins of the lowest band; bands of a spectrum
MOST_COMPONENTS = 6
NEAR, NEAR_SIZES, TWICE_SIZES = np.array([1.0, 10.0]), (1e-6, 1e-5), (1e-6, 1e-5, 1e-4)
"""Of motion at the swing's own frequency, and twice it: widths over what the record tells apart; over gravity."""
ASKEW = 100.0  # in log-likelihood, of planes of swing that are not parallel, beside motion that is always there
CHOP = Sea(5.0, 2.0, 5e-4, "vertical")  # waves of a second, of any kind
LIKE_KICKS = 0.02  # of its frequency, a width
ASIDE = 1e-5  # over reference gravity, from which a sea across is sought
TURN, MOST_TURN = 1.5, 6.0  # rad of a motion in a step of the lattice that is followed; of one that is still priced
STEADY = 2.5  # of the swing's frequency, above which errors are readings less a smooth motion
MISSED = 10.0  # in log-likelihood, of a component that stays
ENOUGH, NOTICED = 10.0, 0.1  # in log-likelihood; of sigma
LINED, AROUND = 3000.0, 32  # of the power about it, and of white errors; bins about it
KICKS = np.array([1e-8, 1e-7, 1e-6, 1e-5])  # rad s-1/2, tried where none is assumed
PEAKS, HEAVES = np.geomspace(0.3, 4.0, 8), np.geomspace(0.05, 1.0, 7)  # of a first sea, rad s-1; of heave, in swings
SIZES = (1e-4, 1e-3, 1e-2, 1e-1)  # over reference gravity
GROUND = 3e-6  # over reference gravity, of vibration that a first fit allows for
SIDEBANDS, LINE = 0.4, 0.06  # of the swing's frequency: what heave, and the swing itself in a rough fit, fill
NARROW = 1e-3  # of its frequency, a line
LOOSE = 3.0  # a sea that a rough fit shows keeps so much less to where it began
MOST_SEAS, MORE, MUCH_MORE = 2, 15.0, 100.0  # of an axis at first; in log-likelihood, of a sea, of what is faster
ROUNDS, SHARES = 4, (1.0, 0.3)  # of a step that the errors' spectrum asks for
SWAYED = 30.0  # of a difference's noise, by motion at the swing's frequency
TWINS, TWIN_WIDTH, TWIN = (0.5, 0.7, 1.0, 1.4), 0.3, 0.3  # rad s-1; of a frequency; size of the faster sea
SWEEPS, FIRST_STEP, TEN, GROWS, SHRINKS = 6, 0.3, 2.3, 1.5, 0.4  # rounds; of a logarithm, and what trials make of it


class UnresolvedError(Exception):
    """The lattice's steps are too long for motion that the errors show."""


def first(rough: Fitted, noise: Floats) -> Assumed:
    """What the errors of a rough fit make of sea, vibration and noise, (t + 2,), NaN = sought; without kicks, and
    without sidebands of the swing where heave may be and is not followed."""
    problem, assumed = rough.model.problem, rough.model.assumed
    heaves = problem.leaves_heave_open(assumed.sine) and all(each.axis != "vertical" for each in assumed.ship)
    shown = Spectrum.of(rough, beside=SIDEBANDS if heaves and not problem.sparse else LINE)
    still = replace(assumed, kick=np.zeros(problem.pendulums), breaks=())
    tilts = tuple(each for each in assumed.ship if each.axis == "tilt")
    return _rougher(shown, replace(still, ship=(Vibration(6.0, 1e-4), *tilts), noise=noise), "horizontal")


def heaving(rough: Fitted, level: Assumed) -> Assumed:
    """With the vertical seas that the errors of a rough fit ask for."""
    return _rougher(Spectrum.of(rough, beside=LINE), level, "vertical")


def kicked(fit: Fitted) -> Assumed:
    """With the kicks of one pendulum, or of all, that the errors ask for."""
    some = [*np.eye(fit.model.problem.pendulums), np.ones(fit.model.problem.pendulums)]
    tried = (replace(fit.model.assumed, kick=size * each) for size in KICKS for each in some)
    return max(tried, key=Spectrum.of(fit).gain)


def _rougher(shown: Spectrum, start: Assumed, axis: Axis) -> Assumed:
    """With the likeliest seas of an axis while they pay, and with what is horizontal and faster than a sea."""
    level, best, slow = axis == "horizontal", start, 0
    top = -np.inf if level else shown.gain(start)
    for _ in range(MOST_SEAS + level):
        fast = shown.excess(best) if level else 0.0
        peaks = [fast] * (fast > 0.0) + list(HEAVES * shown.swing if axis == "vertical" else PEAKS) * (slow < MOST_SEAS)
        shapes = [(Sea, peak, 0.2) for peak in peaks] + [(Engine, fast, NARROW)] * (fast > 0.0)
        if not shapes:
            break
        noise = np.where(np.isfinite(best.noise), best.noise, UNKNOWN)
        units = [kind(peak, width * peak, 1.0, axis) for kind, peak, width in shapes]
        joined = replace(shown.joined(replace(best, noise=noise), units, SIZES), noise=best.noise)
        found, gain = shown.likeliest(joined, loose=LOOSE)
        if gain < top + (MORE if not level or found.ship[-1].peak < CALM * shown.swing else MUCH_MORE):
            break
        best, top, slow = found, gain, slow + (found.ship[-1].peak < CALM * shown.swing or not level)
    for each in best.ship[:-1]:
        rest = replace(best, ship=tuple(other for other in best.ship if other is not each))
        if not isinstance(each, Vibration) and shown.gain(rest) > shown.gain(best) - 1.0:
            best = rest
    # what is unseen beside the swing may be at it
    ground = (replace(each, rms=max(each.rms, GROUND)) if isinstance(each, Vibration) else each for each in best.ship)
    return replace(best, ship=tuple(ground))


def components(fit: Fitted, *, slow: bool) -> Iterator[Candidate]:
    """Motion of the ship where the whitened errors have more power than white ones; turns where they are asked for.
    Raises UnresolvedError where one that pays is faster than the lattice's steps show, and the readings are denser."""
    model, ship = fit.model, fit.model.assumed.ship
    if len(ship) >= len(model.begun) + MOST_COMPONENTS:
        return

    def of(assumed: Assumed) -> Candidate:
        found = assumed.ship[-1]
        words = f"{found.axis} motion at {found.peak / (2.0 * np.pi):.2f} Hz"
        trial = model.adding(words, assumed=assumed)
        candidate = priced(trial, fit.path, cost=COMPONENT + ASKEW * (found.axis == "transverse"))
        turn = 0.0 if model.problem.lattice.dense else found.peak * model.problem.lattice.step
        if turn > MOST_TURN or (turn > TURN and candidate.value > fit.solution.log_likelihood + PAYS):
            raise UnresolvedError
        return candidate

    near, lines = list(ship[len(model.begun) :]), []
    # waves that sway the ship lift it too, and sway planes of swing that are not parallel to the first's
    upright = model.problem.leaves_heave_open(model.assumed.sine)
    level = [each for each in ship if not isinstance(each, Vibration) and each.axis == "horizontal"]
    seas: list[Component] = [replace(each, rms=ASIDE, axis="transverse") for each in level]
    if upright:
        seas += [*(replace(each, rms=ASIDE, axis="vertical") for each in level), CHOP]
    for line in (*_lines(fit), *seas, *(SLOW if slow else ())):
        if not any(line.axis == each.axis and abs(np.log(line.peak / each.peak)) < SAME_LINE for each in near):
            near.append(line)
            lines.append(line)
    steady = _steady(fit) if upright and not model.problem.steps.any() else None
    known = [each for each in ship[len(model.begun) :] if isinstance(each, Engine)]
    if steady and not any(abs(steady.peak - each.peak) < 2.0 * each.damping for each in known):
        yield of(replace(model.assumed, ship=(*ship, steady)))
    shown = Spectrum.of(fit, tuple(lines))
    for line in lines:
        assumed, gain = shown.likeliest(replace(model.assumed, ship=(*ship, line)), last=True)
        if gain > COMPONENT and not _like_kicks(assumed.ship[-1], model.problem.swing):
            yield of(assumed)


def with_the_swing(fit: Fitted) -> Iterator[Candidate]:
    """Motion that the path follows, so that no peak of the errors shows it: horizontal at the swing's own frequency,
    and unrecorded vertical at twice it, which acts as a change of gravity and of damping."""
    model, swing = fit.model, fit.model.problem.swing
    units: list[tuple[float, Axis, tuple[float, ...]]] = [(swing, "horizontal", NEAR_SIZES)]
    if model.problem.leaves_heave_open(model.assumed.sine):
        units += [(2.0 * swing, "vertical", TWICE_SIZES)]
    for frequency, axis, sizes in units:
        for width in NEAR / model.problem.lattice.duration:
            for size in sizes:
                line = Engine(frequency, width, size, axis)
                assumed = replace(model.assumed, ship=(*model.assumed.ship, line))
                trial = model.adding(f"{axis} motion at {frequency / (2.0 * np.pi):.2f} Hz", assumed=assumed)
                yield priced(trial, fit.path, cost=COMPONENT)


def _like_kicks(line: Component, swing: float) -> bool:
    """Whether what pushes all pendulums but the first is broad and at their own frequency, as random kicks are."""
    near = line.axis == "transverse" and abs(line.peak / swing - 1.0) < SIDEBANDS
    return near and getattr(line, "damping", line.peak) > LIKE_KICKS * line.peak


def reshaped(fit: Fitted) -> Fitted:
    """With the ship's parameters and the noise as the errors' spectrum asks, while the readings get likelier."""
    fit = pruned(fit)
    for _ in range(ROUNDS):
        now = fit.model.assumed
        shown, begun = Spectrum.of(fit), fit.model.begun
        # what was not known before may have led it astray
        starts = dict.fromkeys((now.ship, (*begun, *now.ship[len(begun) :]), _heaving_as_it_sways(now.ship)))
        wanted, gain = max((shown.likeliest(replace(now, ship=each)) for each in starts), key=lambda pair: pair[1])
        if gain < ENOUGH:
            break
        low, ratio = parameters(now.ship), wanted.noise / now.noise  # some share of the way, in logarithms
        vectors = ((share, low + share * (parameters(wanted.ship) - low)) for share in SHARES)
        between = (replace(wanted, ship=assemble(now.ship, v), noise=now.noise * ratio**share) for share, v in vectors)
        trials = (replace(fit.model, assumed=each) for each in between)
        fits = (attempted(each, path_on(fit, each.assumed.ship), most=1) for each in trials)
        found = next((each for each in fits if likelier(fit, each) is not fit), None)
        if found is None:
            break
        more = found.solution.log_likelihood - fit.solution.log_likelihood
        fit = found
        if more < ENOUGH:
            break
    return fit if fit.bent < STRAIGHT else attempted(fit.model, fit.path) or fit


def polished(fit: Fitted) -> Fitted:
    """With the ship's parameters where the readings themselves are likeliest, by trial, where the errors' spectra tell
    them badly: where the ship's motion shows in several traces, the filter turns errors of one into those of another.
    Of one such trace a trial without so much motion at the swing tells first whether there is much to gain."""
    if fit.model.problem.sparse:
        fit = _swaying_twice(fit)
    ship, noise = fit.model.assumed.ship, fit.model.assumed.noise
    ends, least = np.cumsum([parameters((each,)).size for each in ship]), MUCH_MORE
    if not np.any(shared(fit) != np.eye(noise.size)):
        if not _sways_differences(fit):
            return fit
        swing = np.array([fit.model.problem.swing])
        loudest = int(np.argmax([float(each.density(swing)[0]) * (each.axis == "horizontal") for each in ship]))
        flat = isinstance(ship[loudest], Vibration)
        less = _moved(fit, int(ends[loudest]) - 2 + flat, -TEN if flat else -FIRST_STEP)
        if less.solution.log_likelihood - fit.solution.log_likelihood < MUCH_MORE or not _tells(fit, less):
            return fit
        fit = less
        least = MORE
    by = np.full(int(ends[-1]), FIRST_STEP)
    for _ in range(SWEEPS):
        before = fit
        for k in range(by.size):
            start = fit
            for side in (by[k], -by[k]):
                fit = _moved(start, k, side)
                if fit is not start:
                    break
            by[k] *= SHRINKS if fit is start else GROWS
        if fit.solution.log_likelihood - before.solution.log_likelihood < least or not _tells(before, fit):
            break
        least = MORE
    return fit


def _tells(fit: Fitted, other: Fitted) -> bool:
    """Whether gravity or its 1 sigma differ noticeably between two fits."""
    (mean, sigma), (moved, wide) = fit.gravity, other.gravity
    return abs(moved - mean) > NOTICED * sigma or abs(np.log(wide / sigma)) > NOTICED


def _swaying_twice(fit: Fitted) -> Fitted:
    """With two seas where there is one, or slow vibration, if the readings are likelier so: the spectra of errors do
    not tell it where the readings are sparse. What the ship does at the swing depends on how steeply a sea falls."""
    ship, begun = fit.model.assumed.ship, fit
    for peak in TWINS:
        pairs: list[Component] = []
        for axis in get_args(Axis):
            size = float(np.sqrt(sum(each.rms**2 for each in ship if each.axis == axis)))
            one = Sea(peak, TWIN_WIDTH * peak, size, axis)
            pairs += [one, replace(one, frequency=2.0 * peak, rms=TWIN * size)] if size else []
        model = replace(fit.model, assumed=replace(fit.model.assumed, ship=tuple(pairs)), begun=tuple(pairs))
        trial = attempted(model, path_on(begun, model.assumed.ship), smooth=True, most=1)
        fit = fit if trial is None else likelier(fit, reshaped(trial))
    return fit


def _moved(fit: Fitted, k: int, by: float) -> Fitted:
    """With the logarithm of one of the ship's parameters changed, if the readings are likelier so."""
    vector = parameters(fit.model.assumed.ship)
    vector[k] += by
    assumed = replace(fit.model.assumed, ship=assemble(fit.model.assumed.ship, vector))
    return likelier(fit, attempted(replace(fit.model, assumed=assumed), fit.path, most=1))


def _sways_differences(fit: Fitted) -> bool:
    """Whether motion at the swing's frequency, as it is assumed, exceeds the noise of differences by far."""
    shown, problem = Spectrum.of(fit), fit.model.problem
    near = np.isin(shown.trace, problem.differences) & (np.abs(shown.centre / shown.swing - 1.0) < LINE)
    return bool(np.any(shown.expected[near] > SWAYED * (shown.noise[near] @ fit.model.assumed.noise**2)))


def _heaving_as_it_sways(ship: tuple[Component, ...]) -> tuple[Component, ...]:
    """With vertical seas at the frequencies of the horizontal ones, as far as there are such."""
    level = iter([each for each in ship if not isinstance(each, Vibration) and each.axis == "horizontal"])
    found: list[Component] = []
    for each in ship:
        like = next(level, None) if isinstance(each, Sea) and each.axis == "vertical" else None
        found.append(each if like is None else Sea(like.frequency, like.damping, each.rms, "vertical"))
    return tuple(found)


def pruned(fit: Fitted) -> Fitted:
    """Without components of the ship that the record is likelier without; a broad vertical one would hide gravity."""
    for number in reversed(range(len(fit.model.assumed.ship))):
        model, ship = fit.model, fit.model.assumed.ship
        rest = (*ship[:number], *ship[number + 1 :])
        if not rest:
            break
        if Spectrum.of(fit).gain(replace(model.assumed, ship=rest)) < -MISSED:
            continue
        sizes = [2 * model.problem.pendulums, *(each.system()[1].size for each in ship)]
        begin = sum(sizes[: number + 1])
        path = np.delete(fit.path, slice(begin, begin + sizes[number + 1]), axis=1)
        begun = (*model.begun[:number], *model.begun[number + 1 :])
        trial = replace(model, assumed=replace(model.assumed, ship=rest), begun=begun)
        fit = likelier(fit, attempted(trial, path, most=1))
    return fit


def _lines(fit: Fitted) -> Iterator[Component]:
    """Components for each place where the errors have too much power: of any width, horizontal, or vertical, which
    shows on either side of the swing in all traces: their power is taken together."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    swing, two = problem.swing, 2 * problem.pendulums
    vertical = problem.leaves_heave_open(fit.model.assumed.sine) and not problem.steps.any()
    arcs = np.std(fit.path[:, :two:2] @ lattice.combination.T, axis=0)
    every = [_scaled_errors(fit, trace) for trace in range(problem.traces)]
    dense = [j for j, each in enumerate(every) if each[0].size and each[0].size == max(each[0].size for each in every)]
    if not dense:
        return
    frequency = every[dense[0]][0]
    beside = np.abs(np.arange(frequency.size) + np.array([[1], [-1]]) * round(swing / frequency[1]))
    there = beside < frequency.size
    beside[~there] = 0
    excess, response = np.zeros((2, frequency.size)), np.zeros((2, frequency.size))
    for j in dense:
        power, noise = every[j][1:]
        # half of the variance on either side
        acts = 0.5 * there * (arcs[j] * swing**2 / (swing**2 - frequency[beside] ** 2)) ** 2 / noise
        excess, response = excess + acts * (power[beside] - 1.0), response + acts**2

    def line(at: int, width: int, square: float, axis: Axis) -> Component:
        kind = Engine if width * frequency[1] < BROAD * frequency[at] else Sea
        return kind(float(frequency[at]), float(width * frequency[1]), float(np.sqrt(square)), axis)

    def upright(at: int, width: int) -> Component:
        square = float(excess[:, max(at - width // 2, 0) : at + width // 2 + 1].sum()) / float(response[:, at].sum())
        return line(at, width, max(square, 1e-20), "vertical")

    for j in dense:
        power, noise = every[j][1:]
        weights = lattice.combination[j]
        insensitive = abs(float(weights.sum())) < LEVEL
        for at, width in _peaks(power):
            more = float(power[max(at - width // 2, 0) : at + width // 2 + 1].sum()) - width
            across, aside = (float(transfer(problem, weights, frequency[at : at + 1], first)[0]) for first in (0, 1))
            square = noise * max(more, 1.0)
            if insensitive and aside > 0.0:  # in planes that are not parallel
                yield line(at, width, square / aside, "transverse")
            if insensitive and vertical:
                yield from (upright(k, width) for k in beside[:, at] if frequency[k] > LEAST_VERTICAL)
            else:
                yield line(at, width, square / across, "horizontal")
    if vertical:
        weighed = np.where(response.sum(axis=0) > 0.0, excess.sum(axis=0) / np.sqrt(response.sum(axis=0)), 0.0) + 1.0
        weighed[frequency < LEAST_VERTICAL] = 0.0
        yield from (upright(at, width) for at, width in _peaks(weighed))


def _steady(fit: Fitted) -> Engine | None:
    """The vertical motion of constant amplitude that the errors show best; None where it does not pay. Its two
    sidebands about each trace's swing hang together in phase, which tells weaker ones from chance than power does."""
    from scipy.fft import fft, next_fast_len

    problem, lattice, path = fit.model.problem, fit.model.problem.lattice, fit.path
    swing, two = problem.swing, 2 * problem.pendulums
    step = max(lattice.interval, 1e-3)
    size = next_fast_len(2 * (int(lattice.duration / step) + 2))  # finer than a line is wide
    frequency = 2.0 * np.pi * np.arange(size) / (size * step)
    some = (frequency > STEADY * swing) & (frequency < np.pi / step)
    if not some.any():
        return None
    frequency = frequency[some]
    above, below = (0.5 * swing**2 / ((frequency + by) ** 2 - swing**2) for by in (swing, -swing))
    turning = path[:, :two:2] - 1j / swing * path[:, 1:two:2]
    product, square = np.zeros(frequency.size, dtype=np.complex128), np.zeros(frequency.size)
    for trace in range(problem.traces):
        used = fit.used(trace)
        if not used.size:
            continue
        errors, scale = clipped(fit.of.whitened[used]), float(np.nanmedian(fit.of.scale[used]))
        own = turning[lattice.node[used]] @ lattice.combination[trace] * np.exp(1j * swing * lattice.offset[used])
        place = np.clip(np.rint(lattice.time[used] / step), 0, size - 1).astype(np.int64)
        for response, factor in ((above, own.conj()), (below, own)):
            series = np.zeros(size, dtype=np.complex128)
            series[place] = errors * factor
            product += response / scale * fft(series)[some]
            square += response**2 / scale**2 * float(np.sum(np.abs(own) ** 2))
    gain = np.abs(product) ** 2 / square
    at = int(np.argmax(gain))
    if gain[at] < COMPONENT:
        return None
    return Engine(float(frequency[at]), 1.0 / lattice.duration, float(np.sqrt(2.0 * gain[at] / square[at])), "vertical")


def line_left(fit: Fitted) -> float:
    """Power of the strongest line of the ship in the errors of traces that see it, over that of white ones: so much
    does the likelihood overrate what follows it, such a trace's clock or scale. 0 where none stands out as over hours,
    errors of differences are not white, or arcs tell."""
    problem, most = fit.model.problem, 0.0
    if fit.model.assumed.sine:
        return most
    for trace in set(range(problem.traces)).difference(problem.differences):
        frequency, power = errors_by_frequency(fit, trace)
        power = np.where(np.abs(frequency / problem.swing - 1.0) < LINE, 1.0, power)
        bands = power[AROUND : power.size // AROUND * AROUND].reshape(-1, AROUND)  # what drifts is below the first
        sharp = bands.max(axis=1, initial=0.0) > LINED * np.median(bands, axis=1)
        most = max(most, float(bands[sharp].max(initial=0.0)))
    return most if most > LINED and is_white(fit, problem.differences) else 0.0


def is_white(fit: Fitted, traces: list[int]) -> bool:
    """Whether the errors of some traces have no more power than white ones of their stated size, in any band."""
    for trace in traces:
        frequency, power = errors_by_frequency(fit, trace)
        edges = np.unique(np.geomspace(LEAST_BAND, max(frequency.size, LEAST_BAND + 1), BANDS + 1).astype(np.int64))
        for low, high in zip([0, *edges[1:-1]], edges[1:], strict=True):
            ratio = float(np.mean(power[low:high])) if power[low:high].size else 1.0
            if ratio > 1.0 and (high - low) * (ratio - 1.0 - np.log(ratio)) > COMPONENT:
                return False
    return True


def _scaled_errors(fit: Fitted, trace: int) -> tuple[Floats, Floats, float]:
    """Power of a trace's whitened errors, of mean 1, by frequency, rad s-1; and the variance that a unit stands for."""
    swing = fit.model.problem.swing
    frequency, power = errors_by_frequency(fit, trace)
    if not frequency.size or np.pi / frequency[-1] * swing > SPARSE:
        return np.zeros(0), np.zeros(0), 0.0
    # errors far below their own scale need no explanation
    power = power / max(float(np.median(power)) / np.log(2.0), QUIET)
    power[(frequency < CALM * swing) | (np.abs(frequency / swing - 1.0) < OWN)] = 1.0
    used = fit.used(trace)
    return frequency, power, float(np.nanmedian(fit.of.scale[used])) ** 2 * 2.0 / used.size


def _peaks(power: Floats) -> Iterator[tuple[int, int]]:
    """Where a spectrum of mean 1 has more power than chance has: its highest place and the width looked at, in bins."""
    from scipy.special import gammainccinv

    for width in WIDTHS:
        summed = np.convolve(power, np.ones(width), "same")
        at = int(np.argmax(summed))
        if summed[at] > gammainccinv(width, CHANCE / power.size):
            yield at, width
