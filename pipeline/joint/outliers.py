"""Outliers, knocks and steps: prediction errors far off, each weighed by the likelihood of the seconds about it."""

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import apparatus
from pipeline.joint.constants import Constants, is_mode
from pipeline.joint.explanation import BROKEN, OUTLIER, Fitted, Model, attempted, grown, likelier, priced, shifted
from pipeline.joint.problem import Problem
from pipeline.joint.ship import Vibration

COARSE_GATE = 100.0  # deviations, of a pass whose errors' scale is not known yet
MOST_OVER = 0.3  # share of the readings over a gate above which the gate is at fault
MOST_REJECTED = 0.4  # share of the readings: so many are not rejected
STEPPED = 30.0  # in log-likelihood, that a step must be worth
LINKED, LEAST_BURST, BURST_SHARE = 0.5, 3, 0.4  # s between readings that are doubted together; fewer are rejected
MOST_CLUSTERS = 60
BURST = 1.0  # s on either side, at most, in which all are doubted
LONGEST = 20.0  # s of readings that are doubted together
HARDLY = 1e-6  # s before the first reading that shows a step
TURNS = Vibration(0.1, 1e-2)  # a turn or a change of speed, which a rough start does not allow for
LASTING = 8.0  # s on either side that a doubt is decided by
GATE = 7.0  # deviations beyond which a reading is left out
NEIGHBOUR = 0.3  # of its error: those beside a single reading that lies far off
MOST_FITS = 4


def deviation(errors: Floats) -> float:
    """Of errors in their own deviations, from the smaller half of them; at least 1."""
    known = np.abs(errors[np.isfinite(errors)])
    return max(float(np.quantile(known, 0.25)) / 0.3186, 1.0) if known.size else 1.0


def isolated(rough: Fitted) -> bool:
    """Whether single readings lie far off between neighbours that do not: no motion of a ship does that."""
    for own in rough.model.problem.lattice.of_trace:
        errors = np.abs(rough.of.errors[own])
        errors = errors[np.isfinite(errors)] / deviation(errors)
        beside = np.maximum(errors[:-2], errors[2:])
        if np.any((errors[1:-1] > GATE) & (beside < NEIGHBOUR * errors[1:-1])):
            return True
    return False


def smoothed(model: Model, about: Floats, gate: float = COARSE_GATE, most: int = MOST_FITS) -> Fitted:
    """Gauss-Newton on the whole path; breaks and outliers that show on the way are allowed for."""
    for _ in range(most):
        about = grown(about, model.problem.pendulums, model.assumed.ship) if about.size else about
        solution, of, about = model.problem.fit(model.assumed, model.constants, about=about, gate=gate)
        before, gate = model.constants, GATE * deviation(of.errors)
        found = replace(model, constants=solution.constants)
        model = contested(found, about, of.errors, gate) if most > 1 else found
        if model is found and np.all(np.abs(solution.step) < np.sqrt(np.diag(solution.covariance))):
            break
    return Fitted(model, solution, about, of, before)


def contested(model: Model, path: Floats, errors: Floats, gate: float) -> Model:
    """What to make of errors over a gate: rejected, a knock, a step of a zero or of the clock, or nothing. Single
    readings are rejected; of several together the likelihood of the seconds about them decides."""
    problem, assumed, lattice = model.problem, model.assumed, model.problem.lattice
    over = np.abs(errors) > gate
    if not over.any():
        return model
    time = lattice.node * lattice.step
    at = np.flatnonzero(over)
    rejected, lone = problem.left_out.copy(), problem.left_out.copy()
    clusters = np.split(at, np.flatnonzero(np.diff(time[at]) > LINKED) + 1)
    stepped: Constants = ()
    doubtful = sum(cluster.size >= LEAST_BURST for cluster in clusters)
    for cluster in clusters if np.mean(over) < MOST_OVER else clusters[:1]:
        first, last = time[cluster[[0, -1]]]
        alike = np.isin(lattice.trace[cluster[0] : cluster[-1] + 1], lattice.trace[cluster])
        if cluster.size < max(LEAST_BURST, BURST_SHARE * alike.sum()):
            rejected[cluster] = lone[cluster] = True
            continue
        if doubtful > MOST_CLUSTERS:  # many short ones are rejected; else the model is at fault
            rejected[cluster] |= last - first < BURST
            continue
        beside = min(last - first, BURST)
        begin, end = np.searchsorted(time, (first - beside, last + beside))
        doubted = np.arange(begin, end)[np.isin(lattice.trace[begin:end], lattice.trace[cluster])]
        span = stretch(problem, int(lattice.node[cluster[0]]), int(lattice.node[cluster[-1]]))
        left, far = rejected.copy(), rejected.copy()
        left[doubted] = far[cluster] = True
        node = int(lattice.node[cluster[0]])
        members = range(problem.pendulums)
        broken = (*([i] for i in members), members)
        # of a long time only what lies far off: the model may be at fault
        options = [(rejected, assumed, stepped), (left if last - first < LONGEST else far, assumed, stepped)]
        cut = rejected | ((lattice.node == node) & (np.arange(over.size) >= cluster[0]))
        for some, at_node in ((rejected, node), (cut, node + 1)):  # between a node's readings
            broke = (tuple((at_node, i) for i in each) for each in broken)
            options += [(some, replace(assumed, breaks=(*assumed.breaks, *each)), stepped) for each in broke]
        if last - first > LONGEST and TURNS not in assumed.ship:
            options.append((rejected, replace(assumed, ship=(*assumed.ship, TURNS)), stepped))
        begun = float(lattice.time[cluster[0]]) - HARDLY
        steps = [apparatus.step_of_zero(int(j), begun) for j in np.unique(lattice.trace[cluster])]
        options += [(rejected, assumed, (*stepped, each)) for each in (*steps, apparatus.step_of_clock(begun))]
        here = shifted(model.constants, path, span[0])
        worth = []
        for some, each, more in options:
            trial = replace(model, problem=replace(problem, left_out=some), assumed=each, constants=(*here, *more))
            cost = BROKEN * (each is not assumed) + STEPPED * (len(more) - len(stepped))
            worth.append(priced(trial, path, cost - OUTLIER * float(some[doubted].sum()), span).value)
        rejected, assumed, stepped = options[int(np.argmax(worth))]
    if np.mean(rejected) > MOST_REJECTED:
        rejected, assumed = lone, model.assumed
    if not stepped and assumed is model.assumed and np.all(rejected == problem.left_out):
        return model
    constants = (*model.constants, *stepped)
    return replace(model, problem=replace(problem, left_out=rejected), assumed=assumed, constants=constants)


def reconsidered(begun: Fitted, problem: Problem) -> Fitted:
    """What was left out or knocked by what was assumed before, decided anew and fitted; or the fit before."""
    model, path = begun.model, grown(begun.path, problem.pendulums, begun.model.assumed.ship)
    for node in {node for node, _ in model.assumed.breaks}:
        span = stretch(problem, node, node)
        here = replace(model, constants=shifted(model.constants, path, span[0]))
        whole = replace(here.assumed, breaks=tuple(each for each in here.assumed.breaks if each[0] != node))
        values = [priced(replace(here, assumed=each), path, span=span).value for each in (here.assumed, whole)]
        if values[0] < values[1] + BROKEN:
            model = replace(model, assumed=whole)
    model = replace(model, problem=problem)
    for _ in range(MOST_FITS):
        _, of = model.problem.run(model.assumed, model.constants, about=path, gate=GATE)
        before, model = model, contested(model, path, of.errors, GATE * deviation(of.errors))
        if model is before:
            break
    return likelier(begun, attempted(model, begun.path))


def of_the_law(fit: Fitted) -> float:
    """Log-likelihood of the differences beside earlier readings: it tells the law, and hangs little on the sea."""
    of, some = fit.of, np.isin(fit.model.problem.lattice.trace, fit.model.problem.differences)
    rejected = OUTLIER * float(fit.model.problem.left_out[some].sum())
    rejected -= 0.5 * sum((each.value / each.prior) ** 2 for each in fit.solution.constants if is_mode(each))
    rejected -= fit.knocked
    return rejected - float(np.nansum(np.log(of.scale[some]) + 0.5 * of.whitened[some] ** 2, dtype=np.float64))


def stretch(problem: Problem, first: int, last: int) -> tuple[int, int]:
    """Nodes about some of them that a doubt is decided by."""
    beside = int(LASTING / problem.lattice.step)
    return max(first - beside, 0), min(last + beside + 1, problem.lattice.nodes)
