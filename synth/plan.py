"""What a scene needs: its motion as one sum of harmonics, the answer of each pendulum, the moments."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from data_schemas.scene_motion import HarmonicMotion, NearResonantMotion, SeaMotion, Still
from synth.motion.harmonic_sum import HarmonicSum, add
from synth.motion.harmonics import harmonics
from synth.motion.near_resonant import near_resonant
from synth.motion.sea import sea
from synth.motion.tabulated import tabulated
from synth.pendulums.linear import Response, respond
from synth.propagators.even import EvenTimes
from synth.propagators.uneven import UnevenTimes
from synth.recording.clock import Clock
from synth.seeds import generator


@dataclass(frozen=True)
class Plan:
    """Everything that the march needs, and nothing of the scene's words.

    Attributes
    ----------
    gravity : float
        m/s^2
    motion, vertical : HarmonicSum
        Horizontal and vertical acceleration of the support; an empty sum where it is still.
    responses : tuple of Response
        Linear answer of each pendulum.
    times : EvenTimes or UnevenTimes
        When.
    propagator : str
        "closed form", or "Picard collocation" for the sine law.
    """

    gravity: float
    motion: HarmonicSum
    vertical: HarmonicSum
    responses: tuple[Response, ...]
    times: EvenTimes | UnevenTimes
    propagator: Literal["closed form", "Picard collocation"]


def plan(scene: Scene, clock: Clock) -> Plan:
    """Choose terms and propagator for a scene.

    Raises
    ------
    SceneError
        If a tabulated motion cannot be read or does not cover the record, or a pendulum would not swing.
    """
    frequencies = [
        2 * math.pi / pendulum.period * math.sqrt(scene.gravity / scene.reference_gravity)
        for pendulum in scene.pendulums
    ]
    motion, vertical = (_motion(scene, frequencies, clock, axis) for axis in ("horizontal", "vertical"))
    responses = []
    for pendulum, frequency in zip(scene.pendulums, frequencies, strict=True):
        if pendulum.damping_rate >= frequency / 2:
            raise SceneError(
                f"pendulums: {pendulum.label!r} has damping_rate = {pendulum.damping_rate:g} 1/s and hardly"
                f" swings at {frequency:g} rad/s; make the rate less than half the frequency"
            )
        responses.append(respond(frequency, pendulum.damping_rate, pendulum.start, motion, scene.gravity))
    linear = scene.restoring == "linear"
    return Plan(
        scene.gravity,
        motion,
        vertical,
        tuple(responses),
        clock.times,
        "closed form" if linear else "Picard collocation",
    )


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
                terms.append(tabulated(term, float(np.max(clock.true_seconds, initial=0.0))))
    return add(terms)
