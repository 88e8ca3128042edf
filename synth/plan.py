"""What a scene needs: its motion as one sum of harmonics, the answer of each pendulum, the moments."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from data_schemas.errors import RefusedError, SceneError
from data_schemas.scene import Scene
from data_schemas.scene_conditions import felt_gravity, frequency
from data_schemas.scene_motion import HarmonicMotion, NearResonantMotion, SeaMotion, Still
from synth.case import lift_of_roll, tilt
from synth.choice import NAMES, Choice, chosen_at_sight, chosen_by_rates, needs
from synth.conditions import stiffening
from synth.gravity_course import gravity_change, mean_change, tidal_change
from synth.kicks import Kicks, held, kicks
from synth.motion.harmonic_sum import HarmonicSum, add, harmonics, near_resonant
from synth.motion.sea import sea
from synth.motion.tabulated import tabulated
from synth.pendulums.linear import Response, respond
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator

if TYPE_CHECKING:
    from synth.assembly import Assembly  # it brings numba


@dataclass(frozen=True)
class Plan:
    """Everything that the march needs, and nothing of the scene's words."""

    gravity: float
    """What accelerations compare with, m/s^2."""
    motion: HarmonicSum
    vertical: HarmonicSum
    """Horizontal and vertical acceleration of the ship; an empty sum where it is still."""
    lift: HarmonicSum
    """The vertical one with what acts like it: a temperature or gravity that changes within the record."""
    frequencies: tuple[float, ...]
    damping_rates: tuple[float, ...]
    """n in rad/s at infinitesimal arc on a rigid support, gamma in 1/s."""
    responses: tuple[Response, ...]
    """Linear answer of each pendulum; none on a support that yields, or where a pendulum creeps."""
    times: EvenTimes | UnevenTimes
    """When."""
    choice: Choice
    """By what, and why."""
    tolerance: float | None
    """Error wanted, of the largest angle; None for the least that can be had."""
    assembly: Callable[[], Assembly]
    """Builds the equations of motion, for general integrators only: it imports the compiler. Once built, they stay."""
    yields: bool
    """Whether the support moves with the pendulums."""
    linear: bool
    """Whether the law is linear."""
    kicks: Kicks | None
    """Random impulses."""
    gravity_change: HarmonicSum | None
    """What is added to the scene's gravity over time, m/s^2."""
    mean_change: float
    """Its mean over the record, m/s^2."""
    pitch: HarmonicSum | None = None
    """Tilt of the case in the plane of swing, rad."""
    planes: tuple[Plan, ...] = ()
    """Of each pendulum alone, where their planes of swing are not parallel."""
    held: Sequence[tuple[int, float, float, float]] = ()
    """See `kicks.held`."""

    @property
    def propagator(self) -> str:
        """Its name in the truth, such as "closed form"."""
        return NAMES[self.choice.propagator]

    @property
    def caution(self) -> str | None:
        """What to know of a yielding support's start before believing the motion, or None."""
        if not self.yields:
            return None
        from synth.huygens.clocks import CAUTION, symmetric

        made = self.assembly()
        return CAUTION if symmetric(made.system, made.start) else None


def plan(scene: Scene, clock: Clock) -> Plan:
    """Choose terms and propagator for a scene.

    `SceneError` if a tabulated motion cannot be read or does not cover the record, or no propagator can do what is
    asked.
    """
    frequencies = [frequency(scene, pendulum) for pendulum in scene.pendulums]
    axes = ("horizontal", "transverse", "vertical")
    motion, transverse, vertical = (_motion(scene, frequencies, clock, axis) for axis in axes)
    change, end, gravity = gravity_change(scene, clock.true_end), clock.true_end, felt_gravity(scene)
    case, pitch, rolled = scene.case, None, None
    if case is not None and case.pitch is not None:
        pitch = tilt(case.pitch, motion, gravity, end)
    if case is not None and case.roll is not None:
        rolled = lift_of_roll(scene, tilt(case.roll, transverse, gravity, end), transverse, vertical, end)
    tidal = tidal_change(scene, end)
    acting = (stiffening(scene), _in_swing_plane(scene, change), _in_swing_plane(scene, tidal), rolled)
    like_heave = [each for each in acting if each is not None]
    lift = add([vertical, *like_heave]) if like_heave else vertical
    impulses = kicks(scene, max(frequencies), clock.times)

    @functools.cache
    def assembly() -> Assembly:
        from synth.assembly import assemble

        try:
            return assemble(scene, frequencies, motion, lift, impulses, clock.true_end)
        except RefusedError as refusal:
            raise SceneError(str(refusal)) from None

    made = Plan(
        gravity,
        motion,
        vertical,
        lift,
        tuple(frequencies),
        tuple(pendulum.damping_rate for pendulum in scene.pendulums),
        _responses(scene, frequencies, motion),
        clock.times,
        _choice(scene, assembly, max(frequencies)),
        scene.simulation.tolerance,
        assembly,
        scene.support.kind != "fixed",
        scene.restoring == "linear",
        impulses,
        change,
        0.0 if change is None else mean_change(change, end),
        pitch,
        held=[] if impulses is None else held(scene, impulses.step),
    )
    if not any(each.plane for each in scene.pendulums):
        return made
    return replace(made, planes=tuple(_alone(scene, made, transverse, place) for place in range(len(scene.pendulums))))


def _alone(scene: Scene, whole: Plan, transverse: HarmonicSum, place: int) -> Plan:
    """The plan of one pendulum in its own plane of swing."""
    pendulum, kicked = scene.pendulums[place], whole.kicks
    turned = [
        replace(each, acceleration=share * each.acceleration)
        for share, each in ((math.cos(pendulum.plane), whole.motion), (math.sin(pendulum.plane), transverse))
    ]
    motion, own = add(turned), whole.frequencies[place]
    if kicked is not None:
        jumps = tuple(replace(each, pendulum=0) for each in kicked.jumps if each.pendulum == place)
        kicked = replace(kicked, sizes=kicked.sizes[[place]], labels=(pendulum.label,), jumps=jumps)
    alone = scene.model_copy(update={"pendulums": (pendulum,)})
    return replace(
        whole,
        motion=motion,
        frequencies=(own,),
        damping_rates=(pendulum.damping_rate,),
        responses=_responses(alone, [own], motion),
        kicks=kicked,
    )


def _in_swing_plane(scene: Scene, change: HarmonicSum | None) -> HarmonicSum | None:
    """The share of a vertical acceleration that a tilted plane of swing feels."""
    tilt = scene.conditions.tilt or 0.0
    return None if change is None else replace(change, acceleration=change.acceleration * math.cos(tilt))


def _responses(scene: Scene, frequencies: list[float], motion: HarmonicSum) -> tuple[Response, ...]:
    pairs = list(zip(scene.pendulums, frequencies, strict=True))
    if scene.support.kind != "fixed" or any(each.damping_rate >= own for each, own in pairs):
        return ()
    return tuple(respond(own, each.damping_rate, each.start, motion, felt_gravity(scene)) for each, own in pairs)


def _choice(scene: Scene, assembly: Callable[[], Assembly], fastest_swing: float) -> Choice:
    asked = needs(scene)
    choice = chosen_at_sight(scene.simulation.propagator, asked)
    if choice is not None:
        return choice
    from synth.systems.rates import fastest_rate  # only here: it brings numba

    made = assembly()
    return chosen_by_rates(asked, fastest_rate(made.system, made.start) * made.time_scale, fastest_swing)


def _motion(scene: Scene, frequencies: list[float], clock: Clock, axis: str) -> HarmonicSum:
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
                continue
            case HarmonicMotion():
                terms.append(harmonics(term))
            case NearResonantMotion():
                beside = labels.index(term.pendulum) if term.pendulum is not None else 0
                terms.append(near_resonant(term, frequencies[beside]))
            case SeaMotion():
                seed, name = (scene.seed, f"sea {seas}") if term.seed is None else (term.seed, "sea")
                terms.append(sea(term, scene.gravity, generator(seed, name)))
            case _:
                terms.append(tabulated(term, clock.true_end))
    return add(terms)
