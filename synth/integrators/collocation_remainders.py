"""Every system's accelerations at the nodes, less its linear part: see `collocation_lanes`.

Two passes over the pendulums: what each does to the support, then what the support does to each.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from synth.integrators.collocation_lanes import at, felt, turned
from synth.integrators.collocation_simd import LANES, load, positive, store, wide
from synth.kernels.collocation_remainder import NODES
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.carried import carried
from synth.systems.dispatch import registered
from synth.systems.elastic_beam import ElasticBeam
from synth.systems.flexible_frame import FlexibleFrame
from synth.systems.metronomes import Metronomes
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.terms import driven

Exact = list[tuple[Fraction, Fraction]]


def linear_part(system: Any) -> Exact:
    """Square and loss of every component at small arcs and with the support held fast, exact: 1/s^2 and 1/s."""
    if isinstance(system, ElasticBeam | FlexibleFrame):
        gravity = Fraction(float(system.gravity))
        clocks = [(gravity / Fraction(float(length)), Fraction(0)) for length in system.length]
        bobs = sum(Fraction(float(mass)) for mass in system.mass)
        if isinstance(system, ElasticBeam):
            total = Fraction(float(system.beam_mass)) + bobs
            return [(Fraction(float(system.stiffness)) / total, Fraction(float(system.damping_rate))), *clocks]
        total = Fraction(float(system.frame_mass)) + bobs
        return [
            (Fraction(float(system.stiffness)) / total, Fraction(float(system.resistance)) / total),
            *clocks,
        ]
    if isinstance(system, ReducedBeam):
        support = (Fraction(4), 2 * Fraction(float(system.beam_damping)))
        return [support, *((1 + Fraction(float(tau)), Fraction(0)) for tau in system.detuning)]
    if isinstance(system, Metronomes):
        return [(Fraction(float(n)) ** 2, Fraction(0)) for n in system.natural_frequency]
    raise TypeError(f"{type(system).__name__} has no collocation")


@registered("remainder", ElasticBeam)
@kernel
def _beam(
    position: Any,
    rate: Any,
    sideways: Any,
    upwards: Any,
    system: ElasticBeam,
    excess: Any,
    room: Any,
    out: Any,
    now: int,
) -> None:
    count, gravity = system.length.size, system.gravity
    whole = system.beam_mass
    for p in range(count):
        whole += system.mass[p]
    stiffness, drag = system.stiffness, whole * system.damping_rate
    for j in range(0, NODES, LANES):
        force, light = wide(0.0), wide(0.0)
        across, along = at(sideways, j), at(upwards, j)
        for p in range(count):
            angle, swing = load(position, (p + 1, j)), load(rate, (p + 1, j))
            sine, cosine, short = turned(angle)
            inverse = 1.0 / system.length[p]
            torque = felt(driven(wide(0.0), p, angle, swing, system.terms), sine, cosine, inverse, across, along)
            pull = gravity * inverse
            free = torque - pull * sine
            force += (system.mass[p] * system.length[p]) * (cosine * (swing * swing) + sine * free)
            light += system.mass[p] * (sine * sine)
            store(room, (0, p, j), inverse * sine)
            store(room, (1, p, j), pull * short + torque + (excess[p + 1, 0] * angle + excess[p + 1, 1] * swing))
        place, speed = load(position, (0, j)), load(rate, (0, j))
        push = carried(force, whole, along)
        beam = (push - stiffness * place - drag * speed) / (whole - light)
        own = (push + light * beam) * (1.0 / whole)
        store(out, (now, 0, j), own + (excess[0, 0] * place + excess[0, 1] * speed))
        for p in range(count):
            store(out, (now, p + 1, j), load(room, (1, p, j)) + load(room, (0, p, j)) * beam)


@registered("remainder", FlexibleFrame)
@kernel
def _frame(
    position: Any,
    rate: Any,
    sideways: Any,
    upwards: Any,
    system: FlexibleFrame,
    excess: Any,
    room: Any,
    out: Any,
    now: int,
) -> None:
    count, gravity = system.length.size, system.gravity
    whole = system.frame_mass
    for p in range(count):
        whole += system.mass[p]
    stiffness, drag = system.stiffness, system.resistance
    for j in range(0, NODES, LANES):
        force, light = wide(0.0), wide(0.0)
        across, along = at(sideways, j), at(upwards, j)
        for p in range(count):
            angle, swing = load(position, (p + 1, j)), load(rate, (p + 1, j))
            sine, cosine, short = turned(angle)
            inverse = 1.0 / system.length[p]
            torque = felt(driven(wide(0.0), p, angle, swing, system.terms), sine, cosine, inverse, across, along)
            pull = gravity * inverse
            free = torque - pull * sine
            force += (system.mass[p] * system.length[p]) * (sine * (swing * swing) - cosine * free)
            light += system.mass[p] * (cosine * cosine)
            store(room, (0, p, j), inverse * cosine)
            store(room, (1, p, j), pull * short + torque + (excess[p + 1, 0] * angle + excess[p + 1, 1] * swing))
        place, speed = load(position, (0, j)), load(rate, (0, j))
        push = carried(force, -whole, across)
        frame = (push - stiffness * place - drag * speed) / (whole - light)
        own = (push + light * frame) * (1.0 / whole)
        store(out, (now, 0, j), own + (excess[0, 0] * place + excess[0, 1] * speed))
        for p in range(count):
            store(out, (now, p + 1, j), load(room, (1, p, j)) - load(room, (0, p, j)) * frame)


@registered("remainder", ReducedBeam)
@kernel
def _reduced(
    position: Any,
    rate: Any,
    sideways: Any,
    upwards: Any,
    system: ReducedBeam,
    excess: Any,
    room: Any,
    out: Any,
    now: int,
) -> None:
    count, drive, coupling = system.detuning.size, system.drive, 2.0 * system.coupling
    drag = 2.0 * system.beam_damping
    for j in range(0, NODES, LANES):
        force, light = wide(0.0), wide(0.0)
        for p in range(count):
            y, swing = load(position, (p + 1, j)), load(rate, (p + 1, j))
            square = y * y
            torque = drive * (1.0 - square) * swing
            force += coupling * (swing * swing + y * torque - (1.0 + system.detuning[p]) * square)
            light += coupling * square
            store(room, (0, p, j), y)
            store(room, (1, p, j), torque + (excess[p + 1, 0] * y + excess[p + 1, 1] * swing))
        place, speed = load(position, (0, j)), load(rate, (0, j))
        beam = (force - drag * speed - 4.0 * place) / positive(1.0 - light)
        own = force + light * beam
        store(out, (now, 0, j), own + (excess[0, 0] * place + excess[0, 1] * speed))
        for p in range(count):
            store(out, (now, p + 1, j), load(room, (1, p, j)) + load(room, (0, p, j)) * beam)


@registered("remainder", Metronomes)
@kernel
def _metronomes(
    position: Any,
    rate: Any,
    sideways: Any,
    upwards: Any,
    system: Metronomes,
    excess: Any,
    room: Any,
    out: Any,
    now: int,
) -> None:
    count, coupling, gravity = system.natural_frequency.size, system.coupling, system.gravity
    for j in range(0, NODES, LANES):
        force, light = wide(0.0), wide(0.0)
        along = at(upwards, j)
        for p in range(count):
            angle, swing = load(position, (p, j)), load(rate, (p, j))
            sine, cosine, short = turned(angle)
            square = system.natural_frequency[p] * system.natural_frequency[p]
            torque = felt(driven(wide(0.0), p, angle, swing, system.terms), sine, cosine, square / gravity, None, along)
            force += cosine * (torque - square * sine) - sine * (swing * swing)
            light += coupling * (cosine * cosine)
            store(room, (0, p, j), cosine)
            store(room, (1, p, j), square * short + torque + (excess[p, 0] * angle + excess[p, 1] * swing))
        board = coupling * force / positive(1.0 - light)
        for p in range(count):
            store(out, (now, p, j), load(room, (1, p, j)) + load(room, (0, p, j)) * board)


def excess_of(parts: Exact, square: Floats, loss: Floats) -> Floats:
    """What a carried linear part has more than the system's own, (components, 2)."""
    return np.array(
        [
            [float(Fraction(float(s)) - own), float(Fraction(float(g)) - lost)]
            for (own, lost), s, g in zip(parts, square, loss, strict=True)
        ]
    )


def mirror_of(system: Any, components: int) -> Floats:
    """(components,) what half a swing does to the remainder: a beam moves twice a swing, all else once."""
    signs = np.full(components, -1.0)
    if isinstance(system, ElasticBeam | ReducedBeam):
        signs[0] = 1.0
    return signs
