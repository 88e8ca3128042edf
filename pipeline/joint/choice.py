"""Competing explanations of a record, weighed by their likelihood: each pays for what it adds.

One pass with the derivatives by every candidate constant prices them all at once; what changes the noise itself (kicks,
components of the ship's motion) costs a pass of its own. The best is taken and the record fitted anew until nothing
pays.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from pipeline.joint import apparatus, kicks, kinds, motion
from pipeline.joint.constants import Constant, Constants, is_mode, solve
from pipeline.joint.course import best_course, is_knot, knots, mean_gravity, prior_root
from pipeline.joint.explanation import PAYS, Candidate, Fitted, attempted, fitted, likelier, priced, shifted
from pipeline.joint.outliers import stretch
from pipeline.joint.unfollowed import unresolved
from pipeline.joint.whiteness import LEAST_READINGS

ROUNDS = 8
STEPS, LEAST_STEP = 12, 0.3  # times tried at once; of the lattice's step
FAULT, STEP_COST = 5.0, 9.0  # in log-likelihood: of what an apparatus seldom has; of a time that may be any
GAP, MOST_GAPS = 5.0, 100  # s without readings, in which a knock would not be seen
SMALL, LIKELIER = 0.1, 2.0  # of a scale's or period's prior; in log-likelihood
FADES = (0.0, 0.05, 0.1, 0.25)  # of the mean speed, below which knife-edge friction fades
SETTLED = 0.3  # of sigma: a step that is none
FAR = 5.0  # 1 sigma of a constant's prior: what is farther explains nothing
MUCH, VERY_MUCH, HARMLESS = 100.0, 1e4, 0.2  # in log-likelihood; of sigma
FEIGNED, LITTLE = 2.0, 0.05  # in log-likelihood; of what explanations gain, by which kicks alone may stay behind
SCALES = (kinds.GAIN, kinds.RATIO)  # of constants that stand for each other
LEAN = (kinds.ZERO, kinds.HEAVE_SCALE, kinds.HEAVE_DELAY, kinds.READ_HEAVE_SCALE, kinds.READ_HEAVE_DELAY)
REPLACED = (*SCALES, kinds.SWAY, kinds.DELAY, kinds.DRIFT, kinds.QUADRATIC, kinds.DAMPING)
"""Of constants: others may explain what they were taken for."""


def candidates(fit: Fitted) -> Iterator[Candidate]:
    """Explanations that add one thing to a fitted one, with their log-likelihoods; what takes long comes last."""
    taken = any(is_knot(each) for each in fit.model.constants)

    def pays(some: list[Candidate]) -> bool:
        return any(each.value > fit.solution.log_likelihood + FEIGNED for each in some)

    found = _added(fit, _possible(fit), () if taken else knots(fit.model.problem.lattice.duration))
    kicked = list(kicks.larger_or_smaller(fit, asked=pays(found)))
    # steps and knocks show as the drift, the friction, the course, the kicks that they resemble, turns as the first of
    # these: what nothing feigns is not there
    steps = _steps(fit) if pays([*found, *kicked]) else []
    yield from (*found, *kicked, *steps, *_knocks_in_gaps(fit))
    yield from motion.components(fit, slow=pays([*found, *steps]))


def _possible(fit: Fitted) -> list[Constant]:
    """Friction that is not viscous, and faults of the apparatus, which a fit does not have."""
    speed, names = _speed(fit), {each.name for each in fit.model.constants}
    laws = (("quadratic friction", kinds.QUADRATIC, 1e-2, (0.0,)), ("knife-edge friction", kinds.DRY, 1e-4, FADES))
    found = [
        Constant(name, kind, prior, i, centre=part * speed)
        for name, kind, prior, parts in laws
        for part in parts
        for i in range(fit.model.problem.pendulums)
        if name not in names
    ]
    assumed = fit.model.assumed
    arcs_tell = assumed.sine and not assumed.heaves
    return [*found, *apparatus.faults(fit.model.problem, fit.model.constants, arcs_tell=arcs_tell)]


def _added(fit: Fitted, extra: list[Constant], course: Constants = (), cost: float = FAULT) -> list[Candidate]:
    """Each of several constants added alone, those of one name and centre together, or a course: all by one pass. What
    is off by a tenth of its prior is less rare; where one scale is off, so is their mean."""
    model, own = fit.model, fit.model.constants
    scaled = any(each.kind == kinds.GAIN and each.index >= 0 and not each.stated for each in own)
    whole = (*own, *extra, *course)
    root = np.diag([each.prior for each in whole])
    root[: len(own), : len(own)] = prior_root(own, model.course)
    _, of = model.problem.run(model.assumed, whole, about=fit.path, root=root)
    first, found = list(range(len(own))), []
    for (name, _), some in groupby(enumerate(extra, len(own)), key=lambda each: (each[1].name, each[1].centre)):
        places, added = zip(*some, strict=True)
        rows, of_one = [*first, *places], added[0].index >= 0
        normal = of.normal[np.ix_([*rows, -1], [*rows, -1])]
        free = added[0].kind == kinds.GAIN and not of_one and scaled
        small = added[0].kind == kinds.CROSS or (added[0].kind in SCALES and of_one)
        for least in (1.0, SMALL) if small else (1.0,):
            prior = root[np.ix_(rows, rows)]
            prior[len(own) :, len(own) :] *= least
            constants = (*own, *(replace(each, prior=least * each.prior) for each in added))
            solution = solve(constants, normal, float(of.totals[0]), float(of.totals[1]), prior)
            trial = model.adding(name, constants=solution.constants)
            price = 0.0 if free else cost - LIKELIER * (least < 1.0)
            if not feeds(solution.constants):
                found.append(Candidate(solution.log_likelihood - price, trial, solution))
    if course:
        rows = [*first, *range(len(whole) - len(course), len(whole))]
        normal = of.normal[np.ix_([*rows, -1], [*rows, -1])]
        track, solution = best_course((*own, *course), normal, of.totals, model.problem.lattice.duration)
        # two more parameters, of the prior
        trial = model.adding("gravity changes", constants=solution.constants, course=track)
        found.append(Candidate(solution.log_likelihood - 2.0, trial, solution))
    least, line = fit.solution.log_likelihood, motion.line_left(fit)
    return [each if each.value > least + PAYS * line else each._replace(value=min(each.value, least)) for each in found]


def _steps(fit: Fitted) -> list[Candidate]:
    """The likeliest step of a zero or of the clock, or knock: on a coarse grid, then finer and finer about the best."""
    lattice = fit.model.problem.lattice
    low, high = 0.0, lattice.duration
    best: list[Candidate] = []
    shown = fit.solution.log_likelihood - STEP_COST + FEIGNED  # what gains nothing on the coarse grid is not there
    while high - low > LEAST_STEP * lattice.step and (not best or best[0].value > shown):
        grid = np.linspace(low, high, STEPS + 2)[1:-1]
        tried = apparatus.steps(fit.model.problem, grid)
        if best:
            last = best[0].model.constants[-1]
            tried = [each for each in tried if (each.kind, each.index) == (last.kind, last.index)]
        found = [*best, *_added(fit, tried, cost=STEP_COST)]
        if not found:  # friction that feeds the swing, with each
            break
        best = [max(found, key=lambda each: each.value)]
        at = best[0].model.constants[-1].centre
        low, high = max(0.0, at - (high - low) / STEPS), min(lattice.duration, at + (high - low) / STEPS)
    return best


def _knocks_in_gaps(fit: Fitted) -> Iterator[Candidate]:
    """The likeliest knock of one pendulum while nothing is read, after which it swings as it will."""
    model, lattice = fit.model, fit.model.problem.lattice
    best, found = STEP_COST, None
    for last in np.flatnonzero(np.diff(lattice.time) > GAP)[:MOST_GAPS]:
        node = int(lattice.node[last]) + 1
        span = stretch(model.problem, node, int(lattice.node[last + 1]))
        here = replace(model, constants=shifted(model.constants, fit.path, span[0]))
        own = priced(here, fit.path, span=span).value
        for i in range(model.problem.pendulums):
            knocked = replace(here.assumed, breaks=(*here.assumed.breaks, (node, i)))
            gain = priced(replace(here, assumed=knocked), fit.path, span=span).value - own
            if gain > best:
                best, found = gain, (knocked, f"knock of pendulum {i + 1} about {lattice.time[last]:.0f} s")
    if found is not None:
        yield priced(model.adding(found[1], assumed=found[0]), fit.path, cost=STEP_COST)


def _with_fade(fit: Fitted) -> Fitted:
    """With the speed below which knife-edge friction fades as a constant, where such friction is taken."""
    own = {each.kind: each for each in fit.model.constants}
    if kinds.DRY not in own or kinds.FADE in own:
        return fit
    fade = Constant("fading of friction", kinds.FADE, max(own[kinds.DRY].centre, FADES[-1] * _speed(fit)))
    fit = replace(fit, model=replace(fit.model, constants=(*fit.model.constants, fade)))
    for _ in range(ROUNDS):
        fit = fitted(fit.model, fit.path)
        if abs(fit.solution.step[-1]) < SETTLED * fit.solution.sigma(fade.name):
            break
    return fit


def _speed(fit: Fitted) -> float:
    """Of the pendulums, root mean square, rad s-1."""
    return float(np.std(fit.path[:, 1 : 2 * fit.model.problem.pendulums : 2]))


def simplified(fit: Fitted) -> Fitted:
    """Without zeros, steps, and scale and delay of a recorded heave, where these do not pay."""
    lean = fit
    for each in fit.model.constants:
        sought = each.kind in (kinds.STEP, kinds.CLOCK) and not is_mode(each)  # a step at a time that none states
        sought = sought and each.centre not in fit.model.problem.paper_steps
        if sought or (each.kind in LEAN and not each.stated):
            lean = max(lean, lean.without(each), key=lambda one: one.solution.log_likelihood)
    kept = {each.name for each in lean.model.constants}
    zeros = [each.value for each in fit.model.constants if each.kind == kinds.ZERO and each.name not in kept]
    # the path holds them still, and stiffens the pendulums by half of their squares
    moved = fit.model.assumed.sine and 0.5 * max(np.square(zeros), default=0.0) > HARMLESS * lean.gravity[1]
    return fitted(lean.model, lean.path) if moved else lean


def without_far_heave(fit: Fitted) -> Fitted | None:
    """Without a recorded heave's scale and delay where friction or a fault may have moved them far; or None."""
    heave = [each for each in fit.model.constants if each.kind in LEAN[1:]]
    if not any(abs(each.value - each.mean) > FAR * each.prior for each in heave):
        return None
    constants = tuple(each for each in fit.model.constants if each not in heave)
    return attempted(replace(fit.model, constants=constants), fit.path, smooth=True)


def settle(fit: Fitted) -> tuple[Fitted, list[Candidate]]:
    """Add what pays, the best first; the last fit, and the explanations that stay close to it. Kicks of one pendulum
    leave errors in which motion, a delay and friction pay: where they paid much, kicks alone are tried."""
    settled = _added_up(fit)
    words = [each for each in settled[0].model.words if not each.startswith("horizontal motion")]
    ahead = settled[0].solution.log_likelihood
    alone = kicks.alone(fit) if words and ahead > fit.solution.log_likelihood + MUCH else None
    feigned = any(each == "kicks" or each.startswith(("vertical motion", "transverse motion")) for each in words)
    behind = max(MUCH, LITTLE * (ahead - fit.solution.log_likelihood)) if feigned else -PAYS
    if alone is not None and alone.solution.log_likelihood > ahead - behind:
        settled = max(settled, _added_up(alone), key=lambda each: each[0].solution.log_likelihood)
    fit, close = _resized(*settled)
    rivals = _rivals(fit)
    best = max(rivals, key=lambda each: each.value, default=fit.candidate())
    likely = best.value > fit.solution.log_likelihood + 0.5 * PAYS  # which is half as far ahead as it is
    other = attempted(best.model, fit.path) if likely else None
    if other is not None and likelier(fit, other) is other:
        return settle(other)
    return fit, [*close, *rivals]


def _added_up(fit: Fitted) -> tuple[Fitted, list[Candidate]]:
    """What pays is added, the best first."""
    trials: list[Trial] = []
    for _ in range(ROUNDS):
        fit = motion.pruned(simplified(fit))
        base = fit.solution.log_likelihood
        trials = [Trial(fit, each) for each in candidates(fit) if each.value > base - PAYS]
        trials = [each for each in trials if each.candidate.value < base + PAYS or each.matters]
        trials.sort(key=lambda each: -each.candidate.value)
        ahead = [each.candidate for each in trials if each.candidate.value > base + PAYS]
        # motion at the swing's own frequency passes for whatever else pays; a support that yields passes for it
        lines = list(motion.with_the_swing(fit)) if ahead or fit.model.words else []
        swayed = [each for each in ahead if apparatus.SWAY in each.model.words[-1:]]
        least = max((each.value for each in swayed), default=base + PAYS)
        others = [each for each in ahead if each not in swayed] + [each for each in lines if each.value > least]
        taken = _taken(fit, sorted(others, key=lambda each: -each.value))
        if taken is None and swayed:
            taken = _taken(fit, sorted([*swayed, *lines], key=lambda each: -each.value))
        if taken is None:
            break
        fit = motion.reshaped(_with_fade(taken))
    return fit, [again for each in trials if (again := each.again) is not None]


def _resized(fit: Fitted, close: list[Candidate]) -> tuple[Fitted, list[Candidate]]:
    """The likeliest of a fit and those that differ from it by a size alone, and the others."""
    alike = [each for each in close if sorted(each.model.words) == sorted(fit.model.words)]
    best = max(alike, key=lambda each: each.value, default=None)
    ahead = best is not None and best.value > fit.solution.log_likelihood
    found = likelier(fit, _fitted(fit, best)) if best is not None and ahead else fit
    return (fit, close) if found is fit else (found, [*(each for each in close if each is not best), fit.candidate()])


def _rivals(fit: Fitted) -> list[Candidate]:
    """Other constants, and kicks, that explain nearly as well; faults, rare by a guess, count as half as far behind."""
    found, least, model = [], fit.solution.log_likelihood - 2.0 * PAYS, fit.model
    replaced = {each.name: each for each in model.constants if each.kind in REPLACED and each.name in model.words}
    leans = [(fit.without(taken), taken.name, taken.kind not in SCALES) for taken in replaced.values()]
    if "kicks" in model.words:
        words = tuple(word for word in model.words if word != "kicks")
        still = replace(model, words=words, assumed=replace(model.assumed, kick=np.zeros_like(model.assumed.kick)))
        unmoved = attempted(still, fit.path)
        leans += [] if unmoved is None else [(unmoved, "kicks", False)]
    for lean, name, kicked in leans:
        if _far(lean.model.constants):  # what is left alone is beyond what can be followed: from where it was
            lean = replace(lean, model=replace(lean.model, constants=lean.about))
        others = [each for each in _possible(lean) if each.name != name]
        for each in (*_added(lean, others, cost=0.0), *(kicks.larger_or_smaller(lean) if kicked else ())):
            other = _fitted(lean, each) if each.value > least - MUCH else None
            if other is not None and other.solution.log_likelihood > least:
                found.append(other.candidate(0.5 * (other.solution.log_likelihood - fit.solution.log_likelihood)))
    return found


@dataclass(eq=False)
class Trial:
    """A candidate beside a fit, fitted for itself; only what that says of gravity is kept, paths are large."""

    fit: Fitted
    candidate: Candidate

    @cached_property
    def after(self) -> tuple[Candidate | None, float]:
        """The candidate once fitted, None where it explains nothing; and what it leaves in doubt of gravity."""
        found = _fitted(self.fit, self.candidate)
        if found is None:
            return None, 0.0
        return _priced_again(self.candidate, found), unresolved(found, found.model.assumed)[1]

    @property
    def matters(self) -> bool:
        """Whether it is more than a line of the sea that leaves gravity and its sigma where they are."""
        fit, candidate = self.fit, self.candidate
        if len(candidate.model.assumed.ship) == len(fit.model.assumed.ship):
            return True
        if candidate.value > fit.solution.log_likelihood + MUCH:
            return True
        found, hidden = self.after
        if found is None:
            return False
        duration = fit.model.problem.lattice.duration
        (value, sigma), (other, wider) = (mean_gravity(each.solution, duration) for each in (fit, found))
        return abs(other - value) > HARMLESS * sigma or float(np.hypot(wider, hidden)) > (1.0 + HARMLESS) * sigma

    @property
    def again(self) -> Candidate | None:
        """A close explanation fitted for itself where it is ahead, or has vertical motion, which acts by its path."""
        more = self.candidate.model.assumed.ship[len(self.fit.model.assumed.ship) :]
        upright = any(each.axis == "vertical" for each in more)
        behind = self.candidate.value < self.fit.solution.log_likelihood
        return self.candidate if behind and not upright else self.after[0]


def _taken(fit: Fitted, ahead: list[Candidate]) -> Fitted | None:
    """The first that still pays when it is fitted; of gains and periods, and where all gain much, the likeliest."""
    base = fit.solution.log_likelihood
    for number, each in enumerate(ahead):
        far_off = each.value > base + VERY_MUCH  # the path that it was priced about
        if far_off:  # the best of each kind
            same = list({other.model.words[-1:]: other for other in reversed(ahead[number:])}.values())[::-1]
        else:
            scales = [other for other in ahead[number:] if other.model.constants[-1].kind in SCALES]
            same = scales if scales[:1] == [each] else [each]
        fits = [(one, found) for one in same if (found := _fitted(fit, one)) is not None]
        if far_off:
            fits = [(one, _with_fade(motion.reshaped(found))) for one, found in fits]
        best = max(fits, key=lambda pair: _priced_again(*pair).value, default=None)
        if best is not None and _priced_again(*best).value > base + PAYS:
            return best[1]
    return None


def _priced_again(candidate: Candidate, found: Fitted) -> Candidate:
    """A candidate that was fitted, at the price that it had."""
    return found.candidate(candidate.solution.log_likelihood - candidate.value)


def _fitted(fit: Fitted, candidate: Candidate) -> Fitted | None:
    """A candidate fitted anew; None where it cannot be, or a constant goes far beyond its prior."""
    model = candidate.model
    found = attempted(model, fit.path)
    if found is None:
        return None
    return None if _far(found.model.constants) or feeds(found.model.constants) else found


def _far(constants: Constants) -> bool:
    """Whether a constant lies far beyond its prior."""
    own = [each for each in constants if not is_knot(each) and not each.stated]
    return any(abs(each.value - each.mean) > FAR * each.prior for each in own)


def feeds(constants: Constants) -> bool:
    """Whether friction that is not viscous would feed the swing: a wrong damping looks so."""
    return any(
        sum(each.value for each in constants if each.kind == kind) < 0.0 for kind in (kinds.QUADRATIC, kinds.DRY)
    )


def averaged(fit: Fitted, close: list[Candidate]) -> tuple[float, float]:
    """Gravity over reference gravity and its 1 sigma, over the explanations that stay close; those that differ by a
    size alone share what is due to one."""
    duration = fit.model.problem.lattice.duration
    parts, alike = [], Counter(model.words for _, model, _ in close)
    for value, model, solution in (fit.candidate(), *close):
        mean, sigma = mean_gravity(solution, duration)
        shared = 0.0 if model is fit.model else float(np.log(alike[model.words]))
        more, doubt = unresolved(fit, model.assumed)
        parts.append((value - shared, mean + more, float(np.hypot(sigma, doubt))))
    logs = np.array([part[0] for part in parts])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    values, sigmas = np.array([part[1] for part in parts]), np.array([part[2] for part in parts])
    mean = float(share @ values)
    return mean, float(np.sqrt(share @ (sigmas**2 + (values - mean) ** 2)))


def unexplained(fit: Fitted) -> float:
    """Factor by which the prediction errors exceed the model by more than chance, in the worst stretch of a tenth of
    the record, or near the swing in a difference; at least 1."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    swing = problem.swing
    worst = 1.0
    for trace in range(problem.traces):
        used = fit.used(trace)
        if used.size < LEAST_READINGS:
            continue
        errors, time = fit.of.whitened[used], lattice.time[used]
        parts = np.array_split(errors, 10)
        worst = max(worst, *(float(np.mean(part**2)) / (1.0 + 5.0 * np.sqrt(2.0 / part.size)) for part in parts))
        if trace not in problem.differences:
            continue  # the ship swings the pendulums at their own frequency too
        turned = [
            np.abs(np.sum(part)) ** 2 / part.size for part in np.array_split(errors * np.exp(-1j * swing * time), 30)
        ]
        worst = max(worst, float(np.mean(turned)) / (1.0 + 5.0 / np.sqrt(30.0)))
    return float(np.sqrt(worst))
