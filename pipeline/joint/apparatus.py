"""Constants of the apparatus: zeros and those of a recorded heave, always sought; others where the likelihood pays."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import Constant, Constants, Solution, is_mode
from pipeline.joint.problem import Problem

ZERO = 0.01  # rad: 1 sigma of a trace's zero, of its drift over the record, and of a step of it
GAIN = 0.01  # of a trace's scale
DELAY = 0.01  # s, of a step of the clock, and at least of one trace against the others
IN_TURN, MOST_DELAY = 0.5, 0.05  # of the interval between readings, where traces are read one after the other; s
KNOCK = 1e-3  # rad s-1: of a step of a pendulum's speed
DAMPING = 0.3  # of a stated rate
CUBIC = 3.0  # rad-2, of the optics: a mirror on a flat film has 4/3
RATIO = 1e-5  # of the square of a frequency against the others
SWAY, YIELDING = "sway of the support", 3e-5  # with the pendulums' angles, over reference gravity
HEAVE_SCALE, HEAVE_DELAY = 0.3, 0.1  # of a recorded heave; s
EXACT = 1e-12  # an uncertainty of zero, in any unit
CERTAIN = 5.0  # deviations
HARMLESS = {kinds.ZERO: 1e-4, kinds.STEP: 1e-5, kinds.DRIFT: 1e-5}  # rad
UNITS = {
    **dict.fromkeys((kinds.ZERO, kinds.STEP, kinds.DRIFT), "rad"),
    **dict.fromkeys((kinds.DELAY, kinds.CLOCK, kinds.HEAVE_DELAY, kinds.READ_HEAVE_DELAY), "s"),
}


def constants(problem: Problem, known: dict[str, Any]) -> Constants:
    """Zeros; scale and delay, or bias, of a recorded heave; what has a stated uncertainty in /instrument (`known`)."""
    stated, gravity, traces = known["constants"], float(known["reference_gravity"]), range(problem.traces)
    across, up = "horizontal_acceleration", "vertical_acceleration"

    def constant(words: str, kind: int, name: str, prior: float, index: int = -1, unit: float = 1.0) -> Constant:
        values = (np.asarray(stated.get(each, 0.0)) / unit for each in (name, f"{name}_uncertainty"))
        mean, sigma = (float(value[index] if value.ndim else value) for value in values)
        given = f"{name}_uncertainty" in stated
        return Constant(words, kind, max(sigma, EXACT) if given else prior, index, mean, mean, stated=given)

    found = [constant(f"zero of trace {j + 1}", kinds.ZERO, "zero", ZERO, j) for j in traces]
    found += [step_of_zero(j, at) for at in problem.paper_steps for j in traces]
    if np.any(problem.lattice.trace == problem.traces):
        words = "bias of the horizontal acceleration"
        found.append(constant(words, kinds.ZERO, f"{across}_bias", ZERO, problem.traces, gravity))
    if problem.heave is not None:
        found.append(constant("scale of the heave", kinds.HEAVE_SCALE, f"{up}_scale", HEAVE_SCALE))
        found.append(constant("delay of the heave", kinds.HEAVE_DELAY, f"{up}_delay", HEAVE_DELAY))
    if np.any(problem.lattice.trace == problem.traces + 1):
        found.append(constant("bias of the heave", kinds.ZERO, f"{up}_bias", ZERO, problem.traces + 1, gravity))
    for name, kind, prior in (("scale", kinds.GAIN, GAIN), ("delay", kinds.DELAY, DELAY)):
        if name in stated or f"{name}_uncertainty" in stated:
            of = [(f"stated {name} of trace {j + 1}", j) for j in traces]
            if name == "scale" and not any(np.ndim(stated.get(each, 0.0)) for each in (name, f"{name}_uncertainty")):
                of = [("stated scale of all angles", -1)]
            some = [constant(called, kind, name, prior, j) for called, j in of]
            if kind == kinds.DELAY:  # of all traces it says nothing: those of others against the first
                own = [each.prior for each in some]
                some = [
                    replace(c, prior=EXACT if not k else np.hypot(p, own[0]))
                    for k, (c, p) in enumerate(zip(some, own, strict=True))
                ]
            found += some
    for i, part in enumerate(np.asarray(known["period_relative_uncertainty"]).tolist()):
        if part > 0.0:  # of n^2
            found.append(Constant(f"stated period of pendulum {i + 1}", kinds.RATIO, 2.0 * part, i, stated=True))
    return tuple(found)


def faults(problem: Problem, own: Constants, *, arcs_tell: bool) -> list[Constant]:
    """What may be wrong all along, beside constants that are sought already; of gains and periods only as many as there
    are differences: one more would be the scale of all, which nothing but the arcs tells."""
    half = 0.5 * problem.lattice.duration
    traces = range(problem.traces)
    found = [Constant(f"drift of trace {j + 1}", kinds.DRIFT, ZERO, j, centre=half, width=half) for j in traces]
    late = float(np.clip(IN_TURN * problem.lattice.interval, DELAY, MOST_DELAY))
    found += [Constant(f"delay of trace {j + 1}", kinds.DELAY, late, j) for j in traces[1:]]
    found.append(Constant("cubic error of the angles", kinds.CUBIC, CUBIC))
    found.append(Constant(SWAY, kinds.SWAY, YIELDING))
    if problem.tells_apart:
        found.append(Constant("cross-talk of the pendulums", kinds.CROSS, GAIN))
    if np.any(problem.lattice.trace == problem.traces + 1):
        found.append(Constant("scale of the heave", kinds.READ_HEAVE_SCALE, HEAVE_SCALE, problem.traces + 1))
        found.append(Constant("delay of the heave", kinds.READ_HEAVE_DELAY, HEAVE_DELAY, problem.traces + 1))
    if arcs_tell and not any(each.kind == kinds.GAIN and each.index < 0 for each in own):
        found.append(Constant("scale of all angles", kinds.GAIN, GAIN))
    if not any(each.kind == kinds.DAMPING for each in own):
        rates = enumerate(np.abs(problem.damping).tolist())
        found += [Constant("other damping than stated", kinds.DAMPING, DAMPING * rate, i) for i, rate in rates if rate]
    taken = [each for each in own if each.kind in (kinds.GAIN, kinds.RATIO) and each.index >= 0 and not each.stated]
    if len(taken) < problem.pendulums - 1:
        found += [Constant(f"gain of trace {j + 1}", kinds.GAIN, GAIN, j) for j in traces]
        members = range(0 if problem.pendulums > 2 else 1, problem.pendulums)
        found += [Constant(f"period of pendulum {i + 1}", kinds.RATIO, RATIO, i) for i in members]
    names = {each.name for each in own}
    return [each for each in found if each.name not in names]


def steps(problem: Problem, times: Floats) -> list[Constant]:
    """Steps of each zero, of the clock and of each pendulum's swing (which, the readings hardly tell) at times, s: any
    change of a swing is that of its speed then and a quarter of a swing later."""
    found = [step_of_zero(j, float(at)) for at in times for j in range(problem.traces)]
    after = (0.0, 0.5 * np.pi / problem.swing)
    for at in times.tolist():
        words = f"knock of a pendulum at {at:.1f} s"
        every = product(range(problem.pendulums), after)
        found += [Constant(words, kinds.KNOCK, KNOCK, i, centre=at, width=later) for i, later in every]
    return [*found, *(step_of_clock(float(at)) for at in times)]


def step_of_clock(at: float) -> Constant:
    """Step of the clock at a time, s."""
    return Constant(f"step of the clock at {at:.1f} s", kinds.CLOCK, DELAY, centre=at)


def step_of_zero(trace: int, at: float) -> Constant:
    """Step of a trace's zero at a time, s."""
    return Constant(f"step of trace {trace + 1} at {at:.1f} s", kinds.STEP, ZERO, trace, centre=at)


def faults_found(solution: Solution) -> list[str]:
    """What is wrong with the apparatus beyond doubt, in words."""
    of_readings = range(kinds.ZERO, kinds.READ_HEAVE_DELAY + 1)
    shown = (kinds.RATIO, kinds.SWAY, kinds.HEAVE_SCALE, kinds.HEAVE_DELAY, *of_readings)
    deviations = np.sqrt(np.diag(solution.covariance))
    bias = {each for each in solution.constants if each.name.startswith("bias")}  # that none states is no fault
    units = {each: "of gravity" if each in bias else UNITS.get(each.kind, "") for each in solution.constants}
    return [
        f"{each.name}: {each.value:.3g} +- {sigma:.1g} {units[each]}".rstrip()
        for each, sigma in zip(solution.constants, deviations, strict=True)
        if each.kind in shown
        and not is_mode(each)
        and (each.stated or each not in bias)
        and abs(each.value - each.mean) > max(CERTAIN * sigma, HARMLESS.get(each.kind, 0.0))
    ]
