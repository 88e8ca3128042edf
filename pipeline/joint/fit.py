"""The recipe: from a cold start to the posterior of gravity, the likelihood choosing what is assumed."""

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.joint import apparatus, choice, explanation, motion
from pipeline.joint.course import mean_row
from pipeline.joint.film_errors import doubt_by_optics, with_clock, without_repeating
from pipeline.joint.gather import Gathered
from pipeline.joint.lattice import LONG_GAP
from pipeline.joint.outliers import of_the_law, reconsidered
from pipeline.joint.problem import LEVEL
from pipeline.joint.start import CAPTURE, CLOSE, MGAL, MOST_APART, first_fits
from pipeline.joint.unfollowed import (
    change_by_rounding,
    change_in_gaps,
    doubt_by_delay,
    doubt_by_repeating,
    doubt_by_scale,
    short_waves,
    stiffened,
)

MUCH_AHEAD = 1e4  # in log-likelihood, of a law that leaves nothing but noise without other explanations
DECISIVE = 100.0  # in log-likelihood, where the likelier law does not explain the readings; `CLOSE`: where it does
MOTION = "motion"  # in the words of a component of the ship
DOUBTFUL = 1.3  # factor by which errors exceed the likelier law's model
MOST_SPREAD = 30.0
REPLACED = 0.3  # of a swing, by kicks within the record
SELDOM, UNLIKELY, FAR = 6.0, 0.1, 50.0  # in log-likelihood, that a case tilts unsaid; share that is left out; any
SLOWER, TILTS, HELPS = 0.4, 10.0, 0.02  # of the swing's frequency, up to which a case tilts; in log-likelihood; of it
SUSPECT, AGAIN = 0.02, 2  # share of readings left out that is considered again, so many times at most
ROUNDED = 0.3  # of the change by rounding, to which it is known
MOST_SIGMA = 1e-3  # over gravity: a sigma of a gal says that no swing at the stated period was followed
OPEN = 2e-4  # the same, of one pendulum on which something else acts


@dataclass(frozen=True)
class Outcome:
    """Posterior of gravity, every explanation weighed."""

    fit: explanation.Fitted  # The best explanation
    close: list[explanation.Candidate]  # Those that stay close to it
    mean: float
    sigma: float  # Gravity over reference gravity, mean over the record, and its 1 sigma from the readings
    spread: float  # Factor in `sigma` by which the prediction errors exceed the model; 1: they are white
    still: tuple[str, ...]  # See `gather.Gathered`.

    @property
    def words(self) -> str:
        """The best explanation, and how close others come."""
        model = self.fit.model
        faults = apparatus.faults_found(self.fit.solution)
        named = [words for words in model.words if not any(fault.startswith(f"{words}:") for fault in faults)]
        repeating = model.problem.repeating
        errors = f"errors repeating with the swing: {repeating.max():.2g} rad" if repeating.size else ""
        parts = [f"restoring = {law(model)}", *([errors] if errors else []), *named, *faults, *self.still]
        others: dict[str, float] = {}  # the likeliest of each kind
        for value, other, _ in self.close:
            another, ahead = other.assumed.sine != model.assumed.sine, value - self.fit.solution.log_likelihood
            words = f"restoring = {law(other)}" if another else (other.words or ("nothing else",))[-1]
            others[words] = max(others.get(words, ahead), ahead)
        near = [f"{words} at {ahead:+.1f}" for words, ahead in others.items()]
        return "; ".join(parts) + (f" (close in log-likelihood: {', '.join(near)})" if near else "")


def reduce(gathered: Gathered) -> Outcome:
    """Fit the stated law, or both where none is stated, and weigh all explanations; RefusedError where the readings
    deny the most part of each that is left, or two that are close disagree."""
    reference = float(gathered.constants["reference_gravity"])
    try:
        found = first_fits(gathered)
        if gathered.film:  # of other records the harmonics tell friction and optics that are not linear
            found = [with_clock(without_repeating(each, tells_law=len(found) > 1)) for each in found]
            found.sort(key=of_the_law, reverse=True)
        fit, close = settled(found[0], gathered)
        lean = choice.without_far_heave(found[0])
        if lean is not None:
            fit, close = max((fit, close), settled(lean, gathered), key=lambda each: each[0].solution.log_likelihood)
        mean, sigma = choice.averaged(fit, close)
        lead = of_the_law(found[0]) - of_the_law(found[1]) if len(found) > 1 else np.inf
        decided = lead > MUCH_AHEAD and choice.unexplained(found[0]) <= 1.0
        if len(found) > 1 and not decided and (strained(fit) or lead < DECISIVE):
            fit, close, mean, sigma = weighed([(fit, close), settled(found[1], gathered)], reference)
    except motion.UnresolvedError:
        return reduce(gathered.denser())
    except np.linalg.LinAlgError as error:
        raise RefusedError(
            f"elongation: no swing at the stated period can be followed ({error}); check instrument/period, "
            "record/combination and the units (rad, s)"
        ) from None
    if strained(fit):
        refuse_reversed_traces(gathered, fit, reference)
    tilt, tilt_doubt = (0.0, 0.0) if gathered.tilts else of_a_tilting_case(found[0], fit, reference)
    mean += tilt
    if not fit.model.assumed.sine:
        fit = explanation.fitted(fit.model, fit.path, smooth=True)
    row = mean_row(fit.solution, fit.model.problem.lattice.duration)
    rounding = change_by_rounding(fit, row) if gathered.problem.steps.any() else 0.0
    hidden, doubt = change_in_gaps(fit, row)
    lifted, waves = short_waves(fit)
    mean += hidden + lifted - rounding
    repeating = doubt_by_repeating(fit, row) if gathered.film else 0.0
    stated = gathered.constants["constants"]
    scale = doubt_by_scale(fit, stated.get("scale_uncertainty", 0.0))
    late = doubt_by_delay(fit, stated.get("delay_uncertainty", 0.0))
    # what one pendulum feels alone near its own frequency acts as gravity does: half of what that made of it
    planes = 0.5 * abs(fit.gravity[0] - found[0].gravity[0]) if _sways_apart(fit) else 0.0
    others = (planes, waves, doubt_by_optics(fit), repeating, scale, late)
    doubts = (gathered.heave_doubt, fit.doubt, ROUNDED * rounding, doubt, tilt_doubt, *others)
    sigma = float(np.sqrt(sigma**2 + np.sum(np.square(doubts))))
    spread = choice.unexplained(fit)
    if spread > MOST_SPREAD:
        raise RefusedError(
            f"elongation: no explanation follows the readings, whose errors are {spread:.0f} times their noise; check "
            "instrument/period, record/combination and the unit of the elongations (rad)"
        )
    if sigma * spread > MOST_SIGMA:
        raise RefusedError(
            f"elongation: all that explains the readings leaves gravity open by {sigma * spread:.1g} of it (1 sigma); "
            "give a longer record with fewer gaps, or check instrument/period, record/combination and the unit of the "
            "elongations (rad)"
        )
    arc = float(np.sqrt(2.0) * np.std(fit.path[:, : 2 * fit.model.problem.pendulums : 2], axis=0).min())
    kicks = float(fit.model.assumed.kick.max())
    if kicks * np.sqrt(fit.model.problem.lattice.duration) > REPLACED * arc:
        raise RefusedError(
            f"elongation: random kicks of {kicks:.1g} rad s-1/2 would replace a swing of {arc:.2g} rad within the "
            "record; something else acts on one pendulum alone: check instrument/plane_angle and record/combination"
        )
    if sigma > OPEN and _sways_apart(fit):
        raise RefusedError(
            f"elongation: something acts on one pendulum alone and leaves gravity open by {sigma:.1g} of it; check "
            "instrument/plane_angle, record/combination and the sign of record/vertical_acceleration"
        )
    if abs(mean - 1.0) > CAPTURE:
        raise RefusedError(
            f"instrument/period: gravity would be {100.0 * (mean - 1.0):+.1f} % off reference_gravity; "
            "check period, reference_gravity and the time axis"
        )
    return Outcome(fit, close, mean, sigma, spread, gathered.still)


def settled(fit: explanation.Fitted, gathered: Gathered) -> tuple[explanation.Fitted, list[explanation.Candidate]]:
    """As `choice.settle`; what many readings were left out for may have been found by then, and they are taken back."""
    fit, close = choice.settle(fit)
    for _ in range(AGAIN):
        before = fit.model.problem.left_out
        if before.mean() - gathered.problem.left_out.mean() < SUSPECT and not fit.model.assumed.breaks:
            break
        again = reconsidered(fit, gathered.problem)
        if again is fit or again.model.problem.left_out.sum() >= before.sum():
            break
        fit, close = choice.settle(motion.reshaped(again))
    return fit, close


def strained(fit: explanation.Fitted) -> bool:
    """Whether a fit needs more than motion that all pendulums feel, and may do so to make up for a wrong law."""
    level = all(MOTION in words and not words.startswith("transverse") for words in fit.model.words)
    return not level or choice.unexplained(fit) > 1.0


def refuse_reversed_traces(gathered: Gathered, fit: explanation.Fitted, reference: float) -> None:
    """Refuse where another sign of a difference explains beyond doubt what a fit takes for faults and kicks: such a
    trace and a pendulum make up a second one that swings at two periods. `reference`: gravity of the periods, m s-2."""
    lattice = gathered.problem.lattice
    level = np.abs(lattice.combination.sum(axis=1)) > LEVEL
    for j in np.flatnonzero(~level) if level.any() else ():
        signs = np.where(np.arange(level.size) == j, -1.0, 1.0)[:, None]
        turned = replace(lattice, combination=signs * lattice.combination)
        try:
            other = first_fits(replace(gathered, problem=replace(gathered.problem, lattice=turned)))[0]
        except np.linalg.LinAlgError:
            continue
        ahead = other.solution.log_likelihood - fit.solution.log_likelihood
        much = abs(fit.gravity[0] - other.gravity[0]) * reference > MOST_APART * MGAL
        if ahead > CLOSE and much and motion.is_white(other, other.model.problem.differences):
            raise RefusedError(
                f"record/combination: the readings are likelier by {ahead:.0f} in log-likelihood with the sign of "
                f"trace {j + 1}, a difference, reversed; say which pendulum it takes off from which"
            )


def _sways_apart(fit: explanation.Fitted) -> bool:
    """Whether planes of swing were found not to be parallel."""
    return any(words.startswith("transverse") for words in fit.model.words)


def of_a_tilting_case(plain: explanation.Fitted, fit: explanation.Fitted, reference: float) -> tuple[float, float]:
    """What it adds to gravity, over itself, and to its 1 sigma, that some of what sways may be the case, and does not
    stiffen the pendulums by half of its square. One pass about their free swing tells it, unless a fit needs more than
    the plain one. RefusedError where it is so beyond doubt, by 10 mGal and more at the `reference` gravity, m s-2."""
    model, two, lattice = plain.model, 2 * plain.model.problem.pendulums, plain.model.problem.lattice
    slow = SLOWER * model.problem.swing
    ship = tuple(
        replace(each, axis="tilt", rms=each.rms / (1.0 - (each.peak / model.problem.swing) ** 2))
        if each.axis == "horizontal" and each.peak < slow
        else each
        for each in model.assumed.ship
    )
    if ship == model.assumed.ship or not model.assumed.sine:
        return 0.0, 0.0
    level = np.abs(np.append(lattice.combination.sum(axis=1), [0.0, 0.0]))[lattice.trace] > LEVEL
    gap = float(np.diff(lattice.time[level], prepend=0.0, append=lattice.duration).max())
    if gap > LONG_GAP or model.problem.sparse:
        return 0.0, 0.0  # what sways in gaps, or between sparse samples, is not known
    about, swings = plain.path.copy(), np.fft.rfft(plain.path[:, :two], axis=0)
    swings[2.0 * np.pi * np.fft.rfftfreq(lattice.nodes, lattice.step) < slow] = 0.0
    about[:, :two] = np.fft.irfft(swings, lattice.nodes, axis=0)
    trial = replace(model, assumed=replace(model.assumed, ship=ship), begun=ship)
    tilted = explanation.attempted(trial, about, most=3 if fit.model.words else 1)
    if tilted is None:
        return 0.0, 0.0
    tilted = motion.reshaped(tilted) if fit.model.words else tilted
    swayed = stiffened(tilted)
    rivals = [fit, *([] if swayed is None else [swayed])]
    # a spectrum that meets the other traces better helps the differences a little too
    better = tilted.solution.log_likelihood - max(each.solution.log_likelihood for each in rivals)
    told, least = of_the_law(tilted), TILTS + HELPS * max(better, 0.0)
    others = max(of_the_law(each) for each in rivals)
    apart = tilted.gravity[0] - fit.gravity[0]
    # kicks follow the differences wherever they go: what they make of all traces is compared
    against = better > TILTS if "kicks" in fit.model.words else told > others + least
    much = abs(apart) * reference > MOST_APART * MGAL
    against &= told > of_the_law(plain) + least and better > 0.0  # what helps these alone is no tilt
    if much and against and motion.is_white(tilted, model.problem.differences):
        raise RefusedError(
            "record/elongation: the slow motion acts on the differences as the tilt of a case does from which all is "
            "measured; give record/case_tilt, or attribute reference = 'case' and record/horizontal_acceleration in "
            "the earth's frame"
        )
    ahead = min(told - others, better)
    share = 1.0 / (1.0 + np.exp(np.clip((0.0 if fit.model.words else SELDOM) - ahead, -FAR, FAR)))
    if share < UNLIKELY:
        return 0.0, 0.0
    return 0.5 * share * apart, abs(apart) * float(np.sqrt(share / 3.0 - 0.25 * share**2))


def weighed(
    laws: list[tuple[explanation.Fitted, list[explanation.Candidate]]], reference: float
) -> tuple[explanation.Fitted, list[explanation.Candidate], float, float]:
    """The likelier of two laws, with gravity over reference gravity and its 1 sigma over both as far as they are close.
    The plain fit is likelier under the first: where the other overtakes it by what it adds, which may make up for a
    wrong law, only a decisive lead tells. RefusedError: close, or neither holds, and more than 10 mGal apart."""
    values = [of_the_law(fit) for fit, _ in laws]
    order = [0, 1] if values[0] >= values[1] else [1, 0]
    (fit, close), (other, others) = (laws[k] for k in order)
    ahead = values[order[0]] - values[order[1]]
    (mean, sigma), (second, wide) = choice.averaged(fit, close), choice.averaged(other, others)
    apart = abs(mean - second) * reference / MGAL
    if apart > MOST_APART and ahead < (DECISIVE if choice.unexplained(fit) > DOUBTFUL else CLOSE):
        raise RefusedError(
            f"instrument attribute restoring: not stated, and the readings do not tell it: '{law(fit.model)}' is ahead "
            f"of '{law(other.model)}' by {ahead:.1f} in log-likelihood, their gravities lie {apart:.0f} mGal apart; "
            "state restoring"
        )
    overtaken = order[0] == 1 and ahead < DECISIVE
    if ahead < CLOSE or overtaken:
        close = [*close, other.candidate()._replace(value=fit.solution.log_likelihood - ahead)]
        share = 0.5 if overtaken else 1.0 / (1.0 + np.exp(ahead))
        variance = (1.0 - share) * sigma**2 + share * wide**2 + share * (1.0 - share) * (mean - second) ** 2
        mean, sigma = mean + share * (second - mean), float(np.sqrt(variance))
    return fit, close, mean, sigma


def law(model: explanation.Model) -> str:
    """The law of restoring in a word."""
    return "sine" if model.assumed.sine else "linear"
