"""The recipe: from a cold start to the posterior of gravity, the likelihood choosing what is assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.joint import apparatus, choice, explanation, kernels, motion, spectrum
from pipeline.joint.constants import Constant, starts
from pipeline.joint.explanation import grown, shifted
from pipeline.joint.gather import Gathered
from pipeline.joint.problem import NONE2, Assumed, Problem
from pipeline.joint.ship import Component, Sea, Vibration

STAGES = (25.0, 100.0, 400.0)  # s: stretches on which a cold start is followed
EARTH = 0.004  # 1 sigma of gravity over reference gravity in a cold start
DAMPING, DIFFERENCE = 1e-3, 1e-4  # s-1: 1 sigma of an unstated rate, and of its difference between pendulums
SHARE, LEAST_DIFFERENCE = 0.3, 1e-9  # 1 sigma of that difference over the rate, when this is known; s-1
SPARSE = 2.0  # of the swing between readings, rad
WIDE = 2.0  # 1 sigma of a pendulum's start over the largest readings
COARSE = 0.1  # reading noise of a cold start's first stretch, of the swing
COARSE_GATE = 100.0  # deviations, of a pass whose errors' scale is not known yet
MOST_OUTLIERS = 0.1  # share of the readings of a cold start
MOST_OVER = 0.3  # share of the readings over a gate above which the gate is at fault
MOST_WILD = 0.4  # share of the readings: so many are not wild
BROKEN, STEPPED = 200.0, 30.0  # in log-likelihood, that a pendulum which was knocked, and a step, must be worth
LINKED, LEAST_BURST, BURST_SHARE = 0.5, 3, 0.4  # s between readings that are doubted together; fewer are wild
MOST_CLUSTERS = 60
BURST = 1.0  # s on either side, at most, in which all are doubted
LONGEST = 20.0  # s of readings that are doubted together
HARDLY = 1e-6  # s before the first reading that shows a step
LASTING = 8.0  # s on either side that a doubt is decided by
UNSTATED = 1e-4  # rad: reading noise of a cold start where none is stated
ACCELEROMETER = 3e-5  # over reference gravity: noise of a recorded acceleration that is too sparse to be interpolated
GENEROUS = (Sea(0.9, 0.45, 0.03), Vibration(6.0, 1e-3))
"""The ship's motion that a cold start allows for."""
MOST_FITS = 4
ROUGH_KICK, KICK = 1e-5, 3e-6  # rad s-1/2, of pendulums that are followed at first
WILD = float(np.log(0.01 / 0.1))  # of a reading in a hundred, over .1 rad
GATE = 7.0  # deviations beyond which a reading is left out


def first_constants(gathered: Gathered) -> tuple[Constant, ...]:
    """Gravity, damping and the start of the free swing, with their priors."""
    problem = gathered.problem
    frequency = np.sqrt(problem.kappa)
    arc = WIDE * float(np.quantile(np.abs(problem.lattice.value[~problem.left_out]), 0.99))
    found = list(starts(problem.pendulums, frequency, arc=arc))
    found.append(Constant("gravity", kernels.GRAVITY, 0.02, mean=1.0, value=1.0))
    found += apparatus.constants(problem)
    if gathered.constants["damping_rate"] is None:
        found.append(Constant("damping", kernels.DAMPING, DAMPING))
        found += [Constant(f"damping of {i}", kernels.DAMPING, DIFFERENCE, i) for i in range(1, problem.pendulums)]
    elif "damping_rate_uncertainty" in gathered.constants["constants"]:
        spread = np.broadcast_to(gathered.constants["constants"]["damping_rate_uncertainty"], problem.kappa.shape)
        found += [Constant(f"damping of {i}", kernels.DAMPING, float(s), i) for i, s in enumerate(spread) if s > 0.0]
    return tuple(found)


def held(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Gravity and damping held where they are."""
    stiff = (kernels.DAMPING, kernels.GRAVITY)
    return tuple(replace(c, prior=1e-15, mean=c.value) if c.kind in stiff else c for c in constants)


def released(constants: tuple[Constant, ...], like: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Values of the first, priors of the second; what the first has more stays."""
    found = tuple(replace(b, value=a.value) for a, b in zip(constants, like, strict=False))
    return (*found, *constants[len(like) :])


def narrowed(constants: tuple[Constant, ...]) -> tuple[Constant, ...]:
    """Gravity within what the Earth has, damping held where it is."""
    return tuple(replace(c, prior=EARTH) if c.kind == kernels.GRAVITY else held((c,))[0] for c in constants)


def cold_start(problem: Problem, assumed: Assumed, first: tuple[Constant, ...]) -> explanation.Fitted:
    """Follow the swing over longer and longer stretches, each linear enough for the one before it.

    They are read as if they were noisier: the ship's motion would else be made to explain what a wrong gravity leaves.
    """
    constants = first
    step, nodes = problem.lattice.step, problem.lattice.nodes
    size = float(np.std(problem.lattice.value[~problem.left_out]))
    still = replace(assumed, ship=tuple(c for c in assumed.ship if c.axis == "horizontal"))
    # readings that fall on one phase of the swing show the other only after a while
    between = float(np.median(np.diff(np.unique(problem.lattice.node)))) * step * float(np.sqrt(problem.kappa.mean()))
    for number, seconds in enumerate(STAGES if between < SPARSE else STAGES[1:]):
        end = int(min(nodes, np.ceil(seconds / step)))
        rough = replace(still, noise=np.maximum(assumed.noise, size * COARSE / 5.0 ** min(number, 2)))
        if number == 0:
            easy = replace(rough, sine=False, noise=np.maximum(rough.noise, size))
            constants = released(problem.run(easy, held(constants), span=(0, end))[0].constants, first)
        constants, gate = followed(problem, rough, narrowed(constants), end)
        constants = released(constants, first)
        if end == nodes:
            break
    rough = replace(rough, kick=assumed.kick + ROUGH_KICK)
    return smoothed(problem, rough, narrowed(constants), NONE2, gate, most=1)


def again(begun: explanation.Fitted) -> explanation.Fitted:
    """The same about its own path, to the end; what is wild or broken shows on the way."""
    model = begun.model
    gate = GATE * deviation(begun.of.errors)
    return smoothed(model.problem, model.assumed, model.constants, begun.path, gate)


def mirrored(begun: explanation.Fitted) -> list[explanation.Fitted]:
    """The same readings by the swing that even, sparse times show as well; none where that is far from the stated."""
    model, constants = begun.model, begun.model.constants
    gravity = next(each.value for each in constants if each.kind == kernels.GRAVITY)
    own = float(np.sqrt(model.problem.kappa.mean() * gravity))
    between = float(np.median(np.diff(np.unique(model.problem.lattice.time))))
    half_turns = np.rint(own * between / np.pi)
    factor = 2.0 * np.pi / between * half_turns / own - 1.0
    if not half_turns or abs(gravity * factor**2 - 1.0) > CAPTURE:
        return []
    by = {kernels.GRAVITY: factor**2, kernels.START: -factor}
    constants = tuple(
        replace(each, value=each.value * by[each.kind])
        if each.kind == kernels.GRAVITY or (each.kind == kernels.START and each.index % 2)
        else each
        for each in constants
    )
    return [smoothed(model.problem, model.assumed, constants, NONE2)]


def followed(
    problem: Problem, assumed: Assumed, constants: tuple[Constant, ...], end: int
) -> tuple[tuple[Constant, ...], float]:
    """Gauss-Newton on the first nodes, without readings far off as long as they are few; and where these begin."""
    gate = COARSE_GATE
    for _ in range(MOST_FITS):
        solution, of = problem.run(assumed, constants, span=(0, end), gate=gate)
        share = float(of.totals[2] / max(of.totals[1] + of.totals[2], 1.0))
        gate = GATE * deviation(of.errors) if share < MOST_OUTLIERS else 0.0
        constants = solution.constants
        if share < MOST_OUTLIERS and np.all(np.abs(solution.step) < 0.1 * np.sqrt(np.diag(solution.covariance))):
            break
    return constants, 2.0 * GATE * deviation(of.errors)


def deviation(errors: Floats) -> float:
    """Of errors in their own deviations, from the smaller half of them; at least 1."""
    return max(float(np.nanquantile(np.abs(errors), 0.25)) / 0.3186, 1.0)


def smoothed(
    problem: Problem,
    assumed: Assumed,
    constants: tuple[Constant, ...],
    about: Floats,
    first_gate: float = COARSE_GATE,
    most: int = MOST_FITS,
) -> explanation.Fitted:
    """Gauss-Newton on the whole path; breaks and outliers that show on the way are allowed for."""
    gate = first_gate
    for _ in range(most):
        solution, of, about = problem.fit(assumed, constants, about=about, gate=gate)
        before, constants, gate = constants, solution.constants, GATE * deviation(of.errors)
        model = explanation.Model((), assumed, constants, problem, assumed.ship)
        heard = contested(model, about, of.errors, gate) if most > 1 else model
        fit = explanation.Fitted(heard, solution, about, of, before)
        if heard is model and np.all(np.abs(solution.step) < np.sqrt(np.diag(solution.covariance))):
            break
        problem, assumed, constants = heard.problem, heard.assumed, heard.constants
    return fit


def contested(model: explanation.Model, path: Floats, errors: Floats, gate: float) -> explanation.Model:
    """What to make of prediction errors over a gate: wild, a knock, a step of a zero or of the clock, or nothing.

    Single readings are wild; of several together the likelihood of the seconds about them decides.
    """
    problem, assumed, lattice = model.problem, model.assumed, model.problem.lattice
    over = np.abs(errors) > gate
    if not over.any():
        return model
    time = lattice.node * lattice.step
    at = np.flatnonzero(over)
    wild, lone = problem.left_out.copy(), problem.left_out.copy()
    clusters = np.split(at, np.flatnonzero(np.diff(time[at]) > LINKED) + 1)
    stepped: tuple[Constant, ...] = ()
    doubtful = sum(cluster.size >= LEAST_BURST for cluster in clusters)
    for cluster in clusters if np.mean(over) < MOST_OVER else clusters[:1]:
        first, last = time[cluster[[0, -1]]]
        alike = np.isin(lattice.trace[cluster[0] : cluster[-1] + 1], lattice.trace[cluster])
        if cluster.size < max(LEAST_BURST, BURST_SHARE * alike.sum()):
            wild[cluster] = lone[cluster] = True
            continue
        if doubtful > MOST_CLUSTERS:  # many short ones are wild; else the model is at fault
            wild[cluster] |= last - first < BURST
            continue
        about = min(last - first, BURST)
        begin, end = np.searchsorted(time, (first - about, last + about))
        doubted = np.arange(begin, end)[np.isin(lattice.trace[begin:end], lattice.trace[cluster])]
        span = stretch(problem, int(lattice.node[cluster[0]]), int(lattice.node[cluster[-1]]))
        left, far = wild.copy(), wild.copy()
        left[doubted] = far[cluster] = True
        node = int(lattice.node[cluster[0]])
        members = range(problem.pendulums)
        broken = [tuple((node, i) for i in some) for some in (*([i] for i in members), members)]
        # of a long time only what lies far off: the model may be at fault
        options = [(wild, assumed, stepped), (left if last - first < LONGEST else far, assumed, stepped)]
        options += [(wild, replace(assumed, breaks=(*assumed.breaks, *each)), stepped) for each in broken]
        begun = float(lattice.time[cluster[0]]) - HARDLY
        steps = [apparatus.step_of_zero(int(j), begun) for j in np.unique(lattice.trace[cluster])]
        options += [(wild, assumed, (*stepped, each)) for each in (*steps, apparatus.step_of_clock(begun))]
        here = shifted(model.constants, path, span[0])
        worth = []
        for some, each, more in options:
            trial = replace(model, problem=replace(problem, left_out=some), assumed=each, constants=(*here, *more))
            cost = BROKEN * (len(each.breaks) - len(assumed.breaks)) + STEPPED * (len(more) - len(stepped))
            worth.append(explanation.priced(trial, path, cost - WILD * float(some[doubted].sum()), span)[0])
        wild, assumed, stepped = options[int(np.argmax(worth))]
    if np.mean(wild) > MOST_WILD:
        wild, assumed = lone, model.assumed
    if not stepped and assumed is model.assumed and np.all(wild == problem.left_out):
        return model
    constants = (*model.constants, *stepped)
    return replace(model, problem=replace(problem, left_out=wild), assumed=assumed, constants=constants)


@dataclass(frozen=True)
class Outcome:
    """Posterior of gravity, every explanation weighed.

    Attributes
    ----------
    fit : explanation.Fitted
        The best explanation.
    close : list of explanation.Candidate
        Those that stay close to it.
    mean, sigma : float
        Gravity over reference gravity, mean over the record, and its 1 sigma from the readings.
    spread : float
        Factor in `sigma` by which the prediction errors exceed the model; 1: they are white.
    left_out : int
        Readings that were not used.
    """

    fit: explanation.Fitted
    close: list[explanation.Candidate]
    mean: float
    sigma: float
    spread: float
    left_out: int

    @property
    def words(self) -> str:
        """The best explanation, and how close others come."""
        model = self.fit.model
        law = "sine" if model.assumed.sine else "linear"
        faults = apparatus.found(self.fit.solution)
        named = [words for words in model.words if not any(fault.startswith(f"{words}:") for fault in faults)]
        parts = [f"restoring = {law}", *named, *faults]
        near = [
            f"{(other.words or ('nothing else',))[-1]} at {value - self.fit.solution.log_likelihood:+.1f}"
            for value, other, _ in self.close
        ]
        return "; ".join(parts) + (f" (close in log-likelihood: {', '.join(near)})" if near else "")


def reduce(gathered: Gathered) -> Outcome:
    """Fit the stated law, or both where none is stated, and weigh all explanations.

    Raises
    ------
    RefusedError
        No explanation is left of which the readings do not deny the most part, or two that are close disagree.
    """
    try:
        found = fitted(gathered)
        fit, close = choice.settle(found[0])
        if len(found) > 1 and (fit.model.words or of_the_law(found[0]) < of_the_law(found[1]) + DECISIVE):
            reference = float(gathered.constants["reference_gravity"])
            fit, close = weighed([(fit, close), choice.settle(found[1])], reference)
    except motion.UnresolvedError:
        return reduce(gathered.denser())
    except np.linalg.LinAlgError as error:
        raise RefusedError(
            f"elongation: no swing at the stated period can be followed ({error}); check instrument/period and "
            "record/combination"
        ) from None
    mean, sigma = choice.averaged(fit, close)
    sigma = float(np.sqrt(sigma**2 + gathered.heave_doubt**2 + fit.doubt**2))
    spread = choice.unexplained(fit)
    if spread > MOST_SPREAD or sigma * spread > MOST_SIGMA:
        raise RefusedError(
            f"elongation: no explanation follows the readings (errors {spread:.1f} times their noise, sigma of gravity "
            f"{sigma * spread:.1g} of it); "
            "check instrument/period, record/combination and the unit of the elongations (rad)"
        )
    if abs(mean - 1.0) > CAPTURE:
        raise RefusedError(
            f"instrument/period: gravity would be {100.0 * (mean - 1.0):+.1f} % off reference_gravity; "
            "check period, reference_gravity and the time axis"
        )
    return Outcome(fit, close, mean, sigma, spread, int(fit.model.problem.left_out.sum()))


def of_the_law(fit: explanation.Fitted) -> float:
    """Log-likelihood of the differences beside what was read before them: it tells the law.

    That of the other traces hangs on how well the sea's spectrum is met.
    """
    of, some = fit.of, np.isin(fit.model.problem.lattice.trace, fit.model.problem.differences)
    wild = WILD * float(fit.model.problem.left_out[some].sum())
    return wild - float(np.nansum(np.log(of.scale[some]) + 0.5 * of.whitened[some] ** 2))


def weighed(
    laws: list[tuple[explanation.Fitted, list[explanation.Candidate]]], reference: float
) -> tuple[explanation.Fitted, list[explanation.Candidate]]:
    """The likelier of two laws; refused where that says little and much hangs on it.

    Raises
    ------
    RefusedError
        They are close, or neither holds, and they lie more than 10 mGal apart.
    """
    values = [of_the_law(fit) for fit, _ in laws]
    order = [0, 1] if values[0] >= values[1] else [1, 0]
    (fit, close), (other, others) = (laws[k] for k in order)
    ahead = values[order[0]] - values[order[1]]
    apart = abs(choice.averaged(fit, close)[0] - choice.averaged(other, others)[0]) * reference / MGAL
    if apart > MOST_APART and ahead < (DECISIVE if choice.unexplained(fit) > DOUBTFUL else CLOSE):
        first, second = ("sine" if each.model.assumed.sine else "linear" for each in (fit, other))
        raise RefusedError(
            f"instrument attribute restoring: not stated, and the readings do not tell it: '{first}' is ahead of "
            f"'{second}' by {ahead:.1f} in log-likelihood, their gravities lie {apart:.0f} mGal apart; state restoring"
        )
    if ahead < CLOSE:
        moved = fit.solution.log_likelihood - ahead
        close = [*close, (moved, other.model, other.solution)]
    return fit, close


MGAL = 1e-5  # m s-2
MOST_APART = 10.0  # mGal
CLOSE, DECISIVE = 10.0, 100.0  # in log-likelihood, where the likelier law explains the readings, and where it does not
DOUBTFUL = 1.3  # factor by which errors exceed the likelier law's model
MOST_SPREAD = 30.0
MOST_SIGMA = 1e-3  # over gravity: a sigma of a gal says that no swing at the stated period was followed
CAPTURE = 0.02  # of gravity, from the reference


def fitted(gathered: Gathered) -> list[explanation.Fitted]:
    """Fit the stated law, or both where none is stated, the likelier first.

    Cold start, then all readings with the ship's motion by its spectrum. Only where that holds for no law, readings are
    left out, pendulums knocked, and all parameters of the ship sought.
    """
    begun = [Begun.of(gathered, sine=sine) for sine in ([gathered.law != "linear"] if gathered.law else [True, False])]
    fits = [each.plain() for each in begun]
    if fits[0] is None:  # lines near the swing, and noise that is not stated, make linear pendulums of others
        fits = [fit or each.heard() for fit, each in zip(fits, begun, strict=True)]
    found = [fit for fit in fits if fit is not None]
    return sorted((with_difference(fit) for fit in found), key=of_the_law, reverse=True)


def with_difference(fit: explanation.Fitted) -> explanation.Fitted:
    """Where no damping is stated: with the prior of its difference from the common rate, which is known by now."""
    common = next((abs(c.value) for c in fit.model.constants if c.name == "damping"), None)
    if common is None:
        return fit
    width = min(max(SHARE * common, LEAST_DIFFERENCE), DIFFERENCE)
    constants = tuple(replace(c, prior=width) if c.name.startswith("damping of") else c for c in fit.model.constants)
    return explanation.fitted(replace(fit.model, constants=constants), fit.path)


@dataclass(frozen=True)
class Begun:
    """A law with its cold start.

    Attributes
    ----------
    gathered : Gathered
    assumed : Assumed
    first : tuple of Constant
        With their priors.
    rough : explanation.Fitted
    """

    gathered: Gathered
    assumed: Assumed
    first: tuple[Constant, ...]
    rough: explanation.Fitted

    @staticmethod
    def of(gathered: Gathered, *, sine: bool) -> Begun:
        """Follow the swing from a cold start."""
        problem = gathered.problem
        stated = np.where(np.isfinite(gathered.noise), gathered.noise, UNSTATED)
        noise = np.concatenate([np.maximum(stated, spectrum.LEAST_NOISE), [ACCELEROMETER, ACCELEROMETER]])
        ship: tuple[Component, ...] = GENEROUS
        if sine and not problem.recorded.size:
            ship = (*ship, replace(GENEROUS[0], axis="vertical"))
        assumed = Assumed(ship, np.zeros(problem.pendulums), noise, sine, gathered.heave_noise)
        first = first_constants(gathered)
        rough = cold_start(problem, assumed, first)
        others = mirrored(rough)
        if others:
            rough = max([again(rough), *others], key=standing)
        return Begun(gathered, assumed, first, rough)

    def plain(self) -> explanation.Fitted | None:
        """All readings; what the rough start doubts may be the ship's motion. None where one is far off."""
        model = self.rough.model
        constants = released(model.constants, self.first)[: len(self.first)]
        assumed = replace(model.assumed, breaks=())
        model = replace(model, problem=self.gathered.problem, constants=constants, assumed=assumed)
        try:
            fit, best = risen(spectral(model, self.rough, self.gathered), self.rough)
        except np.linalg.LinAlgError:
            return None
        return fit if np.nanmax(np.abs(best.of.whitened)) < GATE else None

    def heard(self) -> explanation.Fitted:
        """Without what is wild, the pendulums knocked where they were."""
        begun = again(self.rough)
        model = spectral(
            replace(begun.model, constants=released(begun.model.constants, self.first)), begun, self.gathered
        )
        sought = model.assumed.sine and not model.problem.recorded.size
        ship = (motion.heaving(begun, model.assumed) if sought else model.assumed).ship
        # pendulums that wander: friction, or gravity that changes, is not to be taken for wild readings
        wandering = replace(model.assumed, ship=ship, kick=self.assumed.kick + KICK)
        path = grown(begun.path, model.problem.pendulums, ship)
        try:
            best = smoothed(model.problem, wandering, model.constants, path)
            best = heard_again(replace(best.model, begun=ship), best, self.gathered.problem)
        except np.linalg.LinAlgError:
            best = begun
        known = best.model if best is not begun else model
        ship = tuple(each for each in known.assumed.ship if each.axis == "horizontal")
        level = replace(known.assumed, kick=self.assumed.kick, ship=ship)
        fit, _ = risen(replace(known, assumed=level, begun=ship), best)
        return motion.reshaped(heard_again(fit.model, fit, self.gathered.problem))


def risen(model: explanation.Model, rough: explanation.Fitted) -> tuple[explanation.Fitted, explanation.Fitted]:
    """Fitted without vertical motion where the differences ask for none; and what follows the readings best.

    Vertical motion is slow, and would explain other things. Kicks stand for friction, a knock, a fault of the
    apparatus: where they do better, what it is, is sought beside the level motion.
    """
    problem, level = model.problem, model.assumed
    swing = rough.path[:, : 2 * problem.pendulums]
    sought = level.sine and not problem.recorded.size

    def risen_by(assumed: Assumed) -> explanation.Fitted:
        risen = replace(model, assumed=assumed, begun=assumed.ship)
        return explanation.fitted(risen, grown(swing, problem.pendulums, assumed.ship))

    try:
        fit = risen_by(level)
    except np.linalg.LinAlgError:  # in heave that is strong, or recorded now and then, no level path is followed
        if not sought:
            raise
        fit = motion.reshaped(risen_by(motion.heaving(rough, level)))
        return fit, fit
    if motion.is_white(fit, problem.differences):
        fit = motion.reshaped(fit)
        return fit, fit
    heaving = fit
    if sought:
        try:
            heaving = max(fit, risen_by(motion.heaving(rough, level)), key=standing)
        except np.linalg.LinAlgError:
            heaving = fit
    kicked = better(replace(model, assumed=motion.kicked(fit)), heaving)
    if kicked is not heaving and (sought or np.nanmax(np.abs(kicked.of.whitened)) < GATE):
        return fit, kicked
    fit = motion.reshaped(heaving)
    return fit, fit


def spectral(model: explanation.Model, rough: explanation.Fitted, gathered: Gathered) -> explanation.Model:
    """With the ship's motion, and the noise that is not stated, that the errors of a rough fit ask for."""
    stated = np.maximum(np.append(gathered.noise, [ACCELEROMETER, ACCELEROMETER]), spectrum.LEAST_NOISE)
    begun = motion.first(rough, stated)
    return replace(model, assumed=replace(begun, breaks=model.assumed.breaks), begun=begun.ship)


def better(model: explanation.Model, fit: explanation.Fitted) -> explanation.Fitted:
    """A model fitted about the path of a fit, or that fit where it stands higher."""
    try:
        about = grown(fit.path, model.problem.pendulums, model.assumed.ship)
        return max(explanation.fitted(model, about), fit, key=standing)
    except np.linalg.LinAlgError:
        return fit


def heard_again(model: explanation.Model, begun: explanation.Fitted, problem: Problem) -> explanation.Fitted:
    """A model fitted, what was left out or knocked by what was assumed before decided anew; or the fit before."""
    path = grown(begun.path, problem.pendulums, model.assumed.ship)
    for node in {node for node, _ in model.assumed.breaks}:
        span = stretch(problem, node, node)
        here = replace(model, constants=shifted(model.constants, path, span[0]))
        whole = replace(here.assumed, breaks=tuple(each for each in here.assumed.breaks if each[0] != node))
        values = [explanation.priced(replace(here, assumed=each), path, span=span)[0] for each in (here.assumed, whole)]
        if values[0] < values[1] + BROKEN:
            model = replace(model, assumed=whole)
    heard = replace(model, problem=problem)
    for _ in range(MOST_FITS):
        _, of = heard.problem.run(heard.assumed, heard.constants, about=path, gate=GATE)
        before, heard = heard, contested(heard, path, of.errors, GATE * deviation(of.errors))
        if heard is before:
            break
    return better(heard, begun)


def stretch(problem: Problem, first: int, last: int) -> tuple[int, int]:
    """Nodes about some of them that a doubt is decided by."""
    beside = int(LASTING / problem.lattice.step)
    return max(first - beside, 0), min(last + beside + 1, problem.lattice.nodes)


def standing(fit: explanation.Fitted) -> float:
    """Log-likelihood of all readings, those left out included: wild ones fall anywhere."""
    return fit.solution.log_likelihood + WILD * float(fit.model.problem.left_out.sum())
