"""From a cold start to a first fit: a swing followed over longer and longer stretches, then all of the record."""

from dataclasses import replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.joint import apparatus, kinds, motion, outliers
from pipeline.joint.constants import Constant, Constants, starts
from pipeline.joint.explanation import Fitted, Model, attempted, fitted, likelier
from pipeline.joint.gather import Gathered
from pipeline.joint.outliers import GATE, deviation, isolated, of_the_law, reconsidered, smoothed
from pipeline.joint.problem import LEAST_NOISE, NO_PATH, SPARSE, Assumed, Problem
from pipeline.joint.ship import Component, Sea, Vibration
from pipeline.joint.unfollowed import gaps

STAGES = (25.0, 100.0, 400.0)  # s: stretches on which a cold start is followed
EARTH, EXACT = 0.004, 1e-15  # 1 sigma of gravity over reference gravity in a cold start; of what is held
DAMPING, DIFFERENCE = 1e-3, 1e-4  # s-1: 1 sigma of an unstated rate, and of its difference between pendulums
SHARE, LEAST_DIFFERENCE = 0.3, 1e-9  # 1 sigma of that difference over the rate, when this is known; s-1
WIDE = 2.0  # 1 sigma of a pendulum's start over the largest readings
COARSE = 0.1  # reading noise of a cold start's first stretch, of the swing
MOST_OUTLIERS = 0.1  # share of the readings of a cold start
UNSTATED = 1e-4  # rad: reading noise of a cold start where none is stated
GENEROUS = (Sea(0.9, 0.45, 0.03), Vibration(6.0, 1e-3))  # The ship's motion that a cold start allows for
CAPTURE = 0.02  # of gravity, from the reference
MGAL = 1e-5  # m s-2
CLOSE, MOST_APART = 10.0, 10.0  # in log-likelihood, of two that explain the readings; mGal by which they may disagree
SURELY = 5.0  # sigmas of the period that a film shows
HOPELESS = 1000.0  # in log-likelihood, of a law in a cold start
AGAIN = 3  # times at most that outliers are sought
ROUGH_KICK, KICK = 1e-5, 3e-6  # rad s-1/2, of pendulums that are followed at first


def cold_starts(gathered: Gathered, *, sine: bool) -> list[Fitted]:
    """Follow the swing under a law from a cold start; and the one that even, sparse times show as well."""
    problem = gathered.problem
    stated = np.where(np.isfinite(gathered.noise), gathered.noise, UNSTATED)
    ship: tuple[Component, ...] = GENEROUS
    if problem.leaves_heave_open(sine):
        ship = (*ship, replace(GENEROUS[0], axis="vertical"))
    if gathered.tilts:
        ship = (*ship, replace(GENEROUS[0], axis="tilt"))
    noise = np.maximum(stated, LEAST_NOISE)
    assumed = Assumed(ship, np.zeros(problem.pendulums), noise, sine, gathered.heave_noise)
    rough = _cold_start(problem, assumed, _first_constants(gathered))
    others = _mirrored(rough)
    if not others:
        return [rough]
    found, (period, sigma) = [_again(rough), *others], gathered.shown
    off = [abs(_period(each) - period) for each in found]
    # which of the two it is, a film shows between its marks
    return [found[int(np.argmin(off))]] if abs(off[0] - off[1]) > SURELY * sigma else found


def first_fits(gathered: Gathered) -> list[Fitted]:
    """Fit the stated law, or both where none is stated, without other explanations; the likelier first. LinAlgError
    where none follows the readings. Only where the ship's motion by its spectrum holds for no law, readings are left
    out, pendulums knocked, and all parameters of the ship sought. A law far behind from the cold start on is given up
    where the other leaves nothing but noise."""
    stated, reference = gathered.constants["restoring"], float(gathered.constants["reference_gravity"])
    laws = [stated != "linear"] if stated else [True, False]
    rough = [cold_starts(gathered, sine=sine) for sine in laws]
    ahead = [max(map(of_the_law, own)) for own in rough]
    fits: list[Fitted | None] = [None for _ in laws]
    for attempt in (_plain, _robust):
        for k in sorted(range(len(laws)), key=lambda k: -ahead[k]):
            fits[k] = fit = fits[k] or _one_of([attempt(gathered, each) for each in rough[k]], reference)
            hopeless = ahead[k] - min(ahead) > HOPELESS and not gathered.film
            if hopeless and fit is not None and motion.is_white(fit, fit.model.problem.differences):
                return [motion.polished(_with_difference(fit))]
        if fits[0] is not None:  # lines near the swing, and noise that is not stated, make linear pendulums of others
            break
    found = [motion.polished(_with_difference(fit)) for fit in fits if fit is not None]
    if not found:
        raise np.linalg.LinAlgError("neither level nor heaving motion of the ship can be followed")
    return sorted(found, key=of_the_law, reverse=True)


def _period(fit: Fitted) -> float:
    """The swing's period, s, that a fit makes of the readings."""
    gravity = next(each.value for each in fit.model.constants if each.kind == kinds.GRAVITY)
    return float(2.0 * np.pi / np.sqrt(fit.model.problem.kappa.mean() * gravity))


def _one_of(fits: list[Fitted | None], reference: float) -> Fitted | None:
    """The likelier of two that see the same readings as another swing; RefusedError where they are as likely."""
    there = sorted((fit for fit in fits if fit is not None), key=lambda fit: -fit.standing)
    if len(there) > 1 and there[0].standing - there[1].standing < CLOSE:
        apart = abs(there[0].gravity[0] - there[1].gravity[0]) * reference / MGAL
        if apart > MOST_APART:
            raise RefusedError(
                f"time: readings at these times show a swing of {_period(there[0]):.6f} s and one of "
                f"{_period(there[1]):.6f} s alike, their gravities lie {apart:.0f} mGal apart; give readings between"
            )
    return there[0] if there else None


def _with_difference(fit: Fitted) -> Fitted:
    """Where no damping is stated: with the prior of its difference from the common rate, which is known by now."""
    common = next((abs(c.value) for c in fit.model.constants if c.name == "damping"), None)
    if common is None:
        return fit
    width = min(max(SHARE * common, LEAST_DIFFERENCE), DIFFERENCE)
    constants = tuple(replace(c, prior=width) if c.name.startswith("damping of") else c for c in fit.model.constants)
    return fitted(replace(fit.model, constants=constants), fit.path)


def _first_constants(gathered: Gathered) -> Constants:
    """Gravity, damping and the start of the free swing, with their priors."""
    problem, stated = gathered.problem, gathered.constants
    arc = WIDE * float(np.quantile(np.abs(problem.lattice.value[~problem.left_out]), 0.99))
    found = list(starts(problem.pendulums, np.sqrt(problem.kappa), arc=arc))
    found.append(Constant("gravity", kinds.GRAVITY, 0.02, mean=1.0, value=1.0))
    found += apparatus.constants(problem, stated)
    if stated["damping_rate"] is None:
        found.append(Constant("damping", kinds.DAMPING, DAMPING))
        found += [Constant(f"damping of {i}", kinds.DAMPING, DIFFERENCE, i) for i in range(1, problem.pendulums)]
    elif "damping_rate_uncertainty" in stated["constants"]:
        spread = np.broadcast_to(stated["constants"]["damping_rate_uncertainty"], problem.kappa.shape).tolist()
        some = [(i, each) for i, each in enumerate(spread) if each > 0.0]
        found += [Constant(f"damping of {i}", kinds.DAMPING, each, i, stated=True) for i, each in some]
    return tuple(found)


def _held(constants: Constants, gravity: float = EXACT) -> Constants:
    """Damping and delays held where they are, gravity within some 1 sigma of its prior."""
    held = (replace(c, prior=EXACT, mean=c.value) if c.kind in (kinds.DAMPING, kinds.DELAY) else c for c in constants)
    return tuple(replace(c, prior=gravity) if c.kind == kinds.GRAVITY else c for c in held)


def _freed(constants: Constants, like: Constants) -> Constants:
    """Values of the first, priors of the second; what the first has more stays."""
    found = tuple(replace(b, value=a.value) for a, b in zip(constants, like, strict=False))
    return (*found, *constants[len(like) :])


def _cold_start(problem: Problem, assumed: Assumed, first: Constants) -> Fitted:
    """Follow the swing over longer and longer stretches, each linear enough for the one before it, read as if noisier:
    the ship's motion would else be made to explain what a wrong gravity leaves."""
    constants = first
    step, nodes = problem.lattice.step, problem.lattice.nodes
    size = float(np.std(problem.lattice.value[~problem.left_out]))
    still = replace(assumed, ship=tuple(c for c in assumed.ship if c.axis != "vertical"))
    # readings that fall on one phase of the swing show the other only after a while
    between = float(np.median(np.diff(np.unique(problem.lattice.node)))) * step * problem.swing
    for number, seconds in enumerate(STAGES if between < SPARSE else STAGES[1:]):
        end = int(min(nodes, np.ceil(seconds / step)))
        rough = replace(still, noise=np.maximum(assumed.noise, size * COARSE / 5.0 ** min(number, 2)))
        if number == 0:
            easy = replace(rough, sine=False, noise=np.maximum(rough.noise, size))
            constants = _freed(problem.run(easy, _held(constants), span=(0, end))[0].constants, first)
        constants, errors = _followed(problem, rough, _held(constants, EARTH), end)
        constants = _freed(constants, first)
        if end == nodes:
            break
    # what shakes one trace all along is no outlier
    scatter = [deviation(errors[own]) for own in problem.lattice.of_trace]
    rough = replace(rough, kick=assumed.kick + ROUGH_KICK, noise=rough.noise * scatter)
    return smoothed(Model((), rough, _held(constants, EARTH), problem, rough.ship), NO_PATH, 2.0 * GATE, most=1)


def _followed(problem: Problem, assumed: Assumed, constants: Constants, end: int) -> tuple[Constants, Floats]:
    """Gauss-Newton on the first nodes without readings far off as long as they are few; and all errors, (r,)."""
    gate = outliers.COARSE_GATE
    for _ in range(outliers.MOST_FITS):
        solution, of = problem.run(assumed, constants, span=(0, end), gate=gate)
        share = float(of.totals[2] / max(of.totals[1] + of.totals[2], 1.0))
        gate = GATE * deviation(of.errors) if share < MOST_OUTLIERS else np.inf
        constants = solution.constants
        if share < MOST_OUTLIERS and np.all(np.abs(solution.step) < 0.1 * np.sqrt(np.diag(solution.covariance))):
            break
    return constants, of.errors


def _again(rough: Fitted) -> Fitted:
    """The same about its own path, to the end; outliers and breaks show on the way."""
    return smoothed(rough.model, rough.path, GATE * deviation(rough.of.errors))


def _mirrored(rough: Fitted) -> list[Fitted]:
    """The same readings by the swing that even, sparse times show as well; none where that is far from the stated."""
    model, constants = rough.model, rough.model.constants
    gravity = next(each.value for each in constants if each.kind == kinds.GRAVITY)
    own = float(np.sqrt(model.problem.kappa.mean() * gravity))
    between = float(np.median(np.diff(np.unique(model.problem.lattice.time))))
    half_turns = np.rint(own * between / np.pi)
    factor = 2.0 * np.pi / between * half_turns / own - 1.0
    if not half_turns or abs(gravity * factor**2 - 1.0) > CAPTURE:
        return []
    speeds = [each.kind == kinds.START and each.index % 2 for each in constants]
    by = [
        factor**2 if c.kind == kinds.GRAVITY else -factor if s else 1.0 for c, s in zip(constants, speeds, strict=True)
    ]
    constants = tuple(replace(c, value=c.value * each) for c, each in zip(constants, by, strict=True))
    return [smoothed(replace(model, constants=constants), NO_PATH)]


def _plain(gathered: Gathered, rough: Fitted) -> Fitted | None:
    """All readings; what the rough start doubts may be the ship's motion. None where one is far off."""
    if isolated(rough):
        return None
    model, first = rough.model, _first_constants(gathered)
    constants, assumed = _freed(model.constants, first)[: len(first)], replace(model.assumed, breaks=())
    model = replace(model, problem=gathered.problem, constants=constants, assumed=assumed)
    fits = _level_or_heaving(_spectral(model, rough, gathered), rough)
    return fits[0] if fits is not None and np.nanmax(np.abs(fits[1].of.whitened)) < GATE else None


def _robust(gathered: Gathered, rough: Fitted) -> Fitted | None:
    """Without outliers, the pendulums knocked where they were. None where that cannot be followed."""
    rough, problem, none = _again(rough), gathered.problem, np.zeros(gathered.problem.pendulums)
    model = replace(rough.model, constants=_freed(rough.model.constants, _first_constants(gathered)))
    model = _spectral(model, rough, gathered)
    open_heave = model.problem.leaves_heave_open(model.assumed.sine)
    ship = (motion.heaving(rough, model.assumed) if open_heave else model.assumed).ship
    # pendulums that wander: friction, or gravity that changes, is not to be taken for outliers
    wandering = replace(model.assumed, ship=ship, kick=none + KICK)
    try:
        best = reconsidered(smoothed(replace(model, assumed=wandering), rough.path), problem)
        model = best.model
    except np.linalg.LinAlgError:
        best = rough
    ship = tuple(each for each in model.assumed.ship if each.axis != "vertical")
    level = replace(model.assumed, kick=none, ship=ship)
    fits = _level_or_heaving(replace(model, assumed=level, begun=ship), best)
    if fits is None:
        return None
    fit = fits[0]
    for _ in range(AGAIN):  # less noise shows more that lies far off
        fit = motion.reshaped(reconsidered(fit, problem))
        if np.nanmax(np.abs(fit.of.whitened)) < GATE:
            break
    return fit


def _level_or_heaving(model: Model, rough: Fitted) -> tuple[Fitted, Fitted] | None:
    """Fitted without vertical motion, which is slow and would explain other things, where the differences ask for none;
    and what follows the readings best. Kicks stand for friction, a knock, a fault: where they do better, what it is, is
    sought beside the level motion. None where nothing can be followed."""
    problem, level = model.problem, model.assumed
    path = rough.path[:, : 2 * problem.pendulums]
    open_heave = problem.leaves_heave_open(level.sine)
    fit = attempted(replace(model, begun=level.ship), path, smooth=True, most=1)
    if fit is not None:
        level_fit = motion.reshaped(fit)
        if any(motion.is_white(each, problem.differences) for each in (fit, level_fit)):
            return level_fit, level_fit
    heaving = None
    if open_heave:
        assumed = motion.heaving(rough, level)
        heaving = attempted(replace(model, assumed=assumed, begun=assumed.ship), path, smooth=True, most=1)
    best = heaving if fit is None else likelier(fit, heaving)
    if best is None:
        return None
    if fit is not None and not (best is not fit and motion.is_white(best, problem.differences)):
        kicked = likelier(best, attempted(replace(model, assumed=motion.kicked(fit)), best.path))
        if kicked is not best and (open_heave or np.nanmax(np.abs(kicked.of.whitened)) < GATE):
            return fit, kicked
    best = motion.reshaped(best)
    return best, best


def _spectral(model: Model, rough: Fitted, gathered: Gathered) -> Model:
    """With the ship's motion, and the noise that is not stated, that the errors of a rough fit ask for."""
    begun = motion.first(rough, np.maximum(gathered.noise, LEAST_NOISE))
    constants = (*model.constants, *gaps(rough))
    return replace(model, assumed=replace(begun, breaks=model.assumed.breaks), begun=begun.ship, constants=constants)
