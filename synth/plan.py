"""What a scene needs (motion, answer of each pendulum, moments), and its evaluation in chunks to be written."""

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError, SceneError
from data_schemas.scene import Scene, felt_gravity, frequency
from data_schemas.scene_motion import HarmonicMotion, NearResonantMotion, SeaMotion, Still
from synth.choice import NAMES, Choice, choose, needs
from synth.disturbances import Kicks, gravity_change, kicks, lifted, mean_change, tilt
from synth.motion.harmonic_sum import HarmonicSum, Sums, add, harmonics, near_resonant, sea
from synth.motion.tabulated import tabulated
from synth.pendulums.linear import Response, respond, start_state
from synth.phase import Floats, Phasors
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator

if TYPE_CHECKING:
    from synth.assembly import Assembly  # it brings numba

CLOSED_FORM_ERROR = 1e-15
WORST_ERROR = 1e-6  # Of the largest angle: what is estimated to be worse is no truth, and the scene is refused


@dataclass(frozen=True)
class Plan:
    """Everything that decides a trajectory."""

    scene: Scene
    gravity: float  # What accelerations compare with, m/s^2
    motion: HarmonicSum
    vertical: HarmonicSum  # Horizontal and vertical acceleration of the ship; an empty sum where it is still
    lift: HarmonicSum
    """The vertical one with what acts like it: a temperature or gravity that changes within the record."""
    frequencies: tuple[float, ...]  # n at infinitesimal arc on a rigid support, rad/s
    responses: tuple[Response, ...]
    """Linear answer of each pendulum; none on a support that yields, or where a pendulum creeps."""
    times: EvenTimes | UnevenTimes  # When
    choice: Choice  # By what, and why
    assembly: "Callable[[], Assembly]"
    """Builds the equations of motion, for general integrators only: it imports the compiler. Once built, they stay."""
    kicks: Kicks | None  # Random impulses, and what is done by hand
    gravity_change: HarmonicSum | None  # What is added to the scene's gravity over time, m/s^2
    mean_change: float  # Its mean over the record, m/s^2
    pitch: HarmonicSum | None  # Tilt of the case in the plane of swing, rad
    planes: "tuple[Plan, ...]" = ()  # Of each pendulum alone, where their planes of swing are not parallel

    @property
    def propagator(self) -> str:
        """Its name in the truth, such as "closed form"."""
        return NAMES[self.choice.propagator]

    @property
    def tolerance(self) -> float | None:
        """Error wanted, of the largest angle; None for the least that can be had."""
        return self.scene.simulation.tolerance

    @property
    def worst_error(self) -> float:
        """Estimated error, of the largest angle, beyond which the scene is refused."""
        return max(WORST_ERROR, self.tolerance or 0.0)

    @property
    def caution(self) -> str | None:
        """What to know of a yielding support's start before believing the motion, or None."""
        if self.scene.support.kind == "fixed":
            return None
        from synth.systems.starts import CAUTION, symmetric

        equations = self.assembly()
        return CAUTION if symmetric(equations.system, equations.start) else None


def plan(scene: Scene, clock: Clock) -> Plan:
    """Choose terms and propagator for a scene; `SceneError`: a faulty or short table, or what no propagator can do."""
    frequencies = [frequency(scene, pendulum) for pendulum in scene.pendulums]
    end, gravity, case = clock.true_end, felt_gravity(scene), scene.case
    motion, transverse, vertical = (
        _motion(scene, frequencies, end, axis) for axis in ("horizontal", "transverse", "vertical")
    )
    pitch = None if case is None or case.pitch is None else tilt(case.pitch, motion, gravity, end)
    change = gravity_change(scene, end)
    lift = lifted(scene, change, transverse, vertical, end)
    impulses = kicks(scene, max(frequencies), clock.times)

    @functools.cache
    def assembly() -> "Assembly":
        from synth.assembly import assemble

        try:
            return assemble(scene, frequencies, motion, lift, impulses, end)
        except RefusedError as refusal:
            raise SceneError(str(refusal)) from None

    def fastest() -> float:
        from synth.systems.starts import fastest_rate  # only here: it brings numba

        equations = assembly()
        return fastest_rate(equations.system, equations.start) * equations.time_scale / max(frequencies)

    responses = _responses(scene, frequencies, motion)
    choice = choose(scene.simulation.propagator, needs(scene), fastest)
    mean = 0.0 if change is None else mean_change(change, end)
    answers = lift, tuple(frequencies), responses, clock.times, choice, assembly, impulses
    whole = Plan(scene, gravity, motion, vertical, *answers, change, mean, pitch)
    if not any(each.plane for each in scene.pendulums):
        return whole
    return replace(whole, planes=tuple(_alone(whole, transverse, place) for place in range(len(scene.pendulums))))


def _alone(whole: Plan, transverse: HarmonicSum, place: int) -> Plan:
    """The plan of one pendulum in its own plane of swing."""
    pendulum, kicked, own = whole.scene.pendulums[place], whole.kicks, whole.frequencies[place]
    shares = ((math.cos(pendulum.plane), whole.motion), (math.sin(pendulum.plane), transverse))
    motion = add(replace(each, acceleration=share * each.acceleration) for share, each in shares)
    if kicked is not None:
        jumps = tuple(replace(each, pendulum=0) for each in kicked.jumps if each.pendulum == place)
        kicked = replace(kicked, sizes=kicked.sizes[[place]], labels=(pendulum.label,), jumps=jumps)
    alone = whole.scene.model_copy(update={"pendulums": (pendulum,)})
    responses = _responses(alone, [own], motion)
    return replace(whole, scene=alone, motion=motion, frequencies=(own,), responses=responses, kicks=kicked)


def _responses(scene: Scene, frequencies: list[float], motion: HarmonicSum) -> tuple[Response, ...]:
    pairs = list(zip(scene.pendulums, frequencies, strict=True))
    if scene.support.kind != "fixed" or any(each.damping_rate >= own for each, own in pairs):
        return ()
    return tuple(respond(own, each.damping_rate, each.start, motion, felt_gravity(scene)) for each, own in pairs)


def _motion(scene: Scene, frequencies: list[float], end: float, axis: str) -> HarmonicSum:
    """All terms of the support's motion along one axis, added."""
    labels = [pendulum.label for pendulum in scene.pendulums]
    terms: list[HarmonicSum] = []
    seas = 0
    for term in scene.motion:
        # numbered over both axes, so that a term's chance does not depend on the others' axes
        seas += isinstance(term, SeaMotion)
        if term.axis != axis:
            continue
        match term:
            case Still():
                pass
            case HarmonicMotion():
                terms.append(harmonics(term))
            case NearResonantMotion():
                beside = labels.index(term.pendulum) if term.pendulum is not None else 0
                terms.append(near_resonant(term, frequencies[beside]))
            case SeaMotion():
                seed, name = (scene.seed, f"sea {seas}") if term.seed is None else (term.seed, "sea")
                terms.append(sea(term, scene.gravity, generator(seed, name)))
            case _:
                terms.append(tabulated(term, end))
    return add(terms)


class SampledMotion(NamedTuple):
    """What happened, at samples."""

    theta: Floats  # (pendulums, samples) angles, rad
    free: Phasors | None
    """(pendulums, samples) free harmonics Z, near-resonant beats included, rad; None for the sine law, which does not
    superpose."""
    slow: Floats | None
    """(pendulums, samples) where `free` is None: what linear pendulums would answer to the support away from their own
    frequency, rad; None too on a support that yields or is still."""
    horizontal_acceleration: Floats
    vertical_acceleration: Floats  # (samples,) m/s^2
    estimated_error: float  # Of theta, relative to the largest angle
    propagator: str  # By what, as the truth calls it
    support_displacement: Floats | None  # (samples,) of a support that yields, m
    gravity_change: Floats | None  # (samples,) what is added to the scene's gravity, m/s^2


def propagate(plan: Plan, clock: Clock) -> Iterator[tuple[Clock, SampledMotion]]:
    """Evaluate a plan at the clock's moments, in order of time, in chunks that are the same for every use of the scene.

    Chunks without a sample are left out. `SceneError` if the motion is so violent that it cannot be known.
    `RefusedError`, with their reasons, if no propagator can do it.
    """
    planes, count = plan.planes or (plan,), len(plan.frequencies)
    in_closed_form = plan.choice.propagator == "closed-form"
    whole = [] if in_closed_form else [_angles(each, clock) for each in planes]
    error = max((each[1] for each in whole), default=CLOSED_FORM_ERROR)
    propagator = whole[0][2] if whole else plan.propagator
    if not error <= plan.worst_error:
        raise SceneError(
            "pendulums: the motion is chaotic or nearly so, its estimated error is"
            f" {error:.1g} of the angle; make the swing or the acceleration smaller, the duration"
            " shorter, or give simulation.tolerance if that will do"
        )
    answers_slowly = bool(plan.responses) and bool(plan.motion.angular_frequency.size or not plan.choice.integrates)
    forced = [
        Sums(each.motion.angular_frequency, np.array([one.forced for one in each.responses]), each.motion.combs)
        for each in planes
        if answers_slowly
    ]
    done = 0
    for part in clock.chunks():
        here, times, kept = slice(done, done + part.times.count), part.times, part.kept
        done = here.stop
        if not part.count:
            continue
        free = slow = None
        if in_closed_form:
            rows = np.vstack([times.elongation(each.responses) for each in planes])
            free = np.array([times.free_harmonic(one)[kept] for each in planes for one in each.responses])
        else:
            rows = np.vstack([angles[:, here] for angles, _, _ in whole])
            slow = np.vstack([times.values(each) for each in forced])[:, kept] if answers_slowly else None
        theta = rows[:count, kept]
        for place, begin, end, angle in plan.kicks.held if plan.kicks is not None else ():
            theta[place, (part.true_seconds >= begin) & (part.true_seconds < end)] = angle
        sideways, upwards = (times.acceleration(each)[kept] for each in (plan.motion, plan.vertical))
        support = rows[count, kept] if len(rows) > count else None
        change = None if plan.gravity_change is None else times.acceleration(plan.gravity_change)[kept]
        yield part, SampledMotion(theta, free, slow, sideways, upwards, error, propagator, support, change)


def _angles(plan: Plan, clock: Clock) -> tuple[Floats, float, str]:
    """At all moments of a clock, by a propagator or, where it refuses or errs too much, by its substitutes.

    Returned are (pendulums, moments) rad, with a yielding support's displacement, m, as the last row; the estimated
    error of the largest angle; the propagator.
    """
    choice = plan.choice
    if choice.propagator == "picard":
        from synth.propagators.picard import PicardPlan  # only here: it brings numba

        rates = np.array([each.damping_rate for each in plan.responses])
        starts, is_linear = np.array([start_state(each) for each in plan.responses]), plan.scene.restoring == "linear"
        motion = plan.motion, plan.lift, plan.gravity
        try:
            # samples of a clock are in order of time, none before the start
            collocation = PicardPlan(
                np.array(plan.frequencies), rates, starts, *motion, plan.times, is_linear, plan.kicks
            )
            theta, error = collocation.elongation()
        except RefusedError:
            if not choice.instead:
                raise
        else:
            if error <= plan.worst_error or not choice.instead:
                return theta, error, plan.propagator
    from synth.assembly import integrated  # only here: it brings numba

    able = [choice.propagator, *choice.instead] if choice.integrates else choice.instead
    seconds = Clock(clock.times, slice(None), clock.scale).true_seconds
    asked = choice.aim if plan.tolerance is None else plan.tolerance
    rows, error, name = integrated(plan.assembly(), able, seconds, asked)
    return rows, error, NAMES[name]
