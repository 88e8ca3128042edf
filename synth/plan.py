"""What a scene needs: its motion as one sum of harmonics, the answer of each pendulum, the moments."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from data_schemas.errors import RefusedError, SceneError
from data_schemas.scene import Scene, felt_gravity, frequency
from data_schemas.scene_motion import HarmonicMotion, NearResonantMotion, SeaMotion, Still
from synth.choice import NAMES, Choice, choose, needs
from synth.kicks import Kicks, kicks
from synth.lift import gravity_change, lift_of_roll, mean_change, stiffening, tidal_change, tilt
from synth.motion.harmonic_sum import HarmonicSum, add, harmonics, near_resonant, sea
from synth.motion.tabulated import tabulated
from synth.pendulums.linear import Response, respond
from synth.propagators.times import EvenTimes, UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator

if TYPE_CHECKING:
    from synth.assembly import Assembly  # it brings numba


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
    assembly: Callable[[], Assembly]
    """Builds the equations of motion, for general integrators only: it imports the compiler. Once built, they stay."""
    kicks: Kicks | None  # Random impulses, and what is done by hand
    gravity_change: HarmonicSum | None  # What is added to the scene's gravity over time, m/s^2
    mean_change: float  # Its mean over the record, m/s^2
    pitch: HarmonicSum | None  # Tilt of the case in the plane of swing, rad
    planes: tuple[Plan, ...] = ()  # Of each pendulum alone, where their planes of swing are not parallel

    @property
    def propagator(self) -> str:
        """Its name in the truth, such as "closed form"."""
        return NAMES[self.choice.propagator]

    @property
    def tolerance(self) -> float | None:
        """Error wanted, of the largest angle; None for the least that can be had."""
        return self.scene.simulation.tolerance

    @property
    def caution(self) -> str | None:
        """What to know of a yielding support's start before believing the motion, or None."""
        if self.scene.support.kind == "fixed":
            return None
        from synth.systems.starts import CAUTION, symmetric

        equations = self.assembly()
        return CAUTION if symmetric(equations.system, equations.start) else None


def plan(scene: Scene, clock: Clock) -> Plan:
    """Choose terms and propagator for a scene.

    `SceneError` if a tabulated motion cannot be read or does not cover the record, or no propagator can do what is
    asked.
    """
    frequencies = [frequency(scene, pendulum) for pendulum in scene.pendulums]
    end, gravity, case = clock.true_end, felt_gravity(scene), scene.case
    motion, transverse, vertical = (
        _motion(scene, frequencies, end, axis) for axis in ("horizontal", "transverse", "vertical")
    )
    pitch = None if case is None or case.pitch is None else tilt(case.pitch, motion, gravity, end)
    change = gravity_change(scene, end)
    upright = math.cos(scene.conditions.tilt or 0.0)  # the share that a tilted plane of swing feels
    changes = [each for each in (change, tidal_change(scene, end)) if each is not None]
    lifts = [vertical, stiffening(scene)]
    lifts += [replace(each, acceleration=upright * each.acceleration) for each in changes]
    if case is not None and case.roll is not None:
        roll = tilt(case.roll, transverse, gravity, end)
        lifts.append(lift_of_roll(scene, roll, transverse, vertical, end))
    lift = add(each for each in lifts if each is not None)
    impulses = kicks(scene, max(frequencies), clock.times)

    @functools.cache
    def assembly() -> Assembly:
        from synth.assembly import assemble

        try:
            return assemble(scene, frequencies, motion, lift, impulses, end)
        except RefusedError as refusal:
            raise SceneError(str(refusal)) from None

    def fastest() -> float:
        from synth.systems.starts import fastest_rate  # only here: it brings numba

        equations = assembly()
        return fastest_rate(equations.system, equations.start) * equations.time_scale / max(frequencies)

    whole = Plan(
        scene,
        gravity,
        motion,
        vertical,
        lift,
        tuple(frequencies),
        _responses(scene, frequencies, motion),
        clock.times,
        choose(scene.simulation.propagator, needs(scene), fastest),
        assembly,
        impulses,
        change,
        0.0 if change is None else mean_change(change, end),
        pitch,
    )
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
