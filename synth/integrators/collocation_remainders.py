"""Every system's accelerations at all nodes at once, less the linear part that is carried exactly.

A system that can be collocated registers a kernel `remainder(work, sideways, upwards, system, now)`, from position and
rate of the `Work` of a march into its `known[now]`; sideways and upwards are the ship's acceleration (NODES,) or None.

Two passes over the pendulums: what each does to the support, then what the support does to each.
"""

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from synth.kernels.collocation import turned
from synth.kernels.compiled import kernel
from synth.kernels.lanes import load, positive, store
from synth.phase import Floats
from synth.systems.dispatch import or_none, registered, taken_in
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.terms import driven
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes, lever, pushed

Exact = list[tuple[Fraction, Fraction]]


class Work(NamedTuple):
    """What a march moves on, and its work space."""

    state: Floats  # (components, 4) position and rate, each as leading double and rest
    amplitude: Floats  # (components,) square of the largest size so far
    memory: Floats  # (lag, ORDERS, components, NODES) as for `guess`
    known: Floats  # (2, components, NODES) the remainder, of this turn and of the turn before in either order
    room: Floats  # (2, components, NODES)
    base: Floats  # (components, 2 * NODES)
    position: Floats  # (components, NODES)
    rate: Floats  # (components, NODES)


@or_none
def at(values: Any) -> Any:
    """The ship's acceleration at the nodes; None stays None."""
    return load(values, (0,))


@taken_in
def felt(torque: Any, sine: Any, cosine: Any, share: float, sideways: Any, upwards: Any) -> Any:
    """Torque with what the ship adds to it: `-share (x'' cos + z'' sin)`."""
    across = torque if sideways is None else torque - share * (sideways * cosine)
    return across if upwards is None else across - share * (upwards * sine)


@or_none
def nodes_of(term: Any, room: Floats) -> Any:
    """Work space for a motion, or None if there is none."""
    return room


def linear_part(system: Any) -> Exact:
    """Square and loss of every component at small arcs and with the support held fast, exact: 1/s^2 and 1/s."""
    if isinstance(system, ElasticBeam | FlexibleFrame):
        gravity = Fraction(float(system.gravity))
        clocks = [(gravity / Fraction(float(length)), Fraction(0)) for length in system.length]
        total = Fraction(float(system.own_mass)) + sum(Fraction(float(mass)) for mass in system.mass)
        if isinstance(system, ElasticBeam):
            loss = Fraction(float(system.damping_rate))
        else:
            loss = Fraction(float(system.resistance)) / total
        return [(Fraction(float(system.stiffness)) / total, loss), *clocks]
    if isinstance(system, ReducedBeam):
        support = (Fraction(4), 2 * Fraction(float(system.beam_damping)))
        return [support, *((1 + Fraction(float(tau)), Fraction(0)) for tau in system.detuning)]
    if isinstance(system, Metronomes):
        return [(Fraction(float(n)) ** 2, Fraction(0)) for n in system.natural_frequency]
    raise TypeError(f"{type(system).__name__} has no collocation")


@registered("remainder", FlexibleFrame)
@registered("remainder", ElasticBeam)
@kernel
def _yielding(work: Work, sideways: Any, upwards: Any, system: Any, now: int) -> None:
    position, rate, room = work.position, work.rate, work.room
    count, gravity = system.length.size, system.gravity
    whole = system.own_mass
    for p in range(count):
        whole += system.mass[p]
    force, light = 0.0, 0.0
    across, along = at(sideways), at(upwards)
    for p in range(count):
        angle, swing = load(position, (p + 1, 0)), load(rate, (p + 1, 0))
        sine, cosine, short, _ = turned(angle)
        arm, slope = lever(sine, cosine, system)
        inverse = 1.0 / system.length[p]
        torque = felt(driven(0.0, p, angle, swing, system.terms), sine, cosine, inverse, across, along)
        pull = gravity * inverse
        free = torque - pull * sine
        force += (system.mass[p] * system.length[p]) * (slope * (swing * swing) + arm * free)
        light += system.mass[p] * (arm * arm)
        store(room, (0, p, 0), inverse * arm)
        store(room, (1, p, 0), pull * short + torque)
    place, speed = load(position, (0, 0)), load(rate, (0, 0))
    drag, push = pushed(whole, system, across, along)
    force += push
    yielding = (force - system.stiffness * place - drag * speed) / (whole - light)
    store(work.known, (now, 0, 0), (force + light * yielding) * (1.0 / whole))
    for p in range(count):
        store(work.known, (now, p + 1, 0), load(room, (1, p, 0)) + load(room, (0, p, 0)) * yielding)


@registered("remainder", ReducedBeam)
@kernel
def _reduced(work: Work, sideways: Any, upwards: Any, system: ReducedBeam, now: int) -> None:
    position, rate, room = work.position, work.rate, work.room
    count, drive, coupling = system.detuning.size, system.drive, 2.0 * system.coupling
    drag = 2.0 * system.beam_damping
    force, light = 0.0, 0.0
    for p in range(count):
        y, swing = load(position, (p + 1, 0)), load(rate, (p + 1, 0))
        square = y * y
        torque = drive * (1.0 - square) * swing
        force += coupling * (swing * swing + y * torque - (1.0 + system.detuning[p]) * square)
        light += coupling * square
        store(room, (0, p, 0), y)
        store(room, (1, p, 0), torque)
    place, speed = load(position, (0, 0)), load(rate, (0, 0))
    beam = (force - drag * speed - 4.0 * place) / positive(1.0 - light)
    store(work.known, (now, 0, 0), force + light * beam)
    for p in range(count):
        store(work.known, (now, p + 1, 0), load(room, (1, p, 0)) + load(room, (0, p, 0)) * beam)


@registered("remainder", Metronomes)
@kernel
def _metronomes(work: Work, sideways: Any, upwards: Any, system: Metronomes, now: int) -> None:
    position, rate, room = work.position, work.rate, work.room
    count, coupling, gravity = system.natural_frequency.size, system.coupling, system.gravity
    force, light = 0.0, 0.0
    along = at(upwards)
    for p in range(count):
        angle, swing = load(position, (p, 0)), load(rate, (p, 0))
        sine, cosine, short, _ = turned(angle)
        square = system.natural_frequency[p] * system.natural_frequency[p]
        torque = felt(driven(0.0, p, angle, swing, system.terms), sine, cosine, square / gravity, None, along)
        force += cosine * (torque - square * sine) - sine * (swing * swing)
        light += coupling * (cosine * cosine)
        store(room, (0, p, 0), cosine)
        store(room, (1, p, 0), square * short + torque)
    board = coupling * force / positive(1.0 - light)
    for p in range(count):
        store(work.known, (now, p, 0), load(room, (1, p, 0)) + load(room, (0, p, 0)) * board)


def mirror_of(system: Any, components: int) -> Floats:
    """(components,) what half a swing does to the remainder: a beam moves twice a swing, all else once."""
    signs = np.full(components, -1.0)
    if isinstance(system, ElasticBeam | ReducedBeam):
        signs[0] = 1.0
    return signs
