"""The problems' equations as heyoka wants them: formulas, in double or in 80-bit arithmetic.

Numbers are given in the arithmetic of the integration, so that a double stays the number it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.benchmarks.problems import Problem, Swell
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.restoring import Sine
from synth.systems.van_der_pol import VanDerPol
from synth.systems.yielding import ElasticBeam

Number = Callable[[Any], Any]
Equations = list[tuple[Any, Any]]


def equations(problem: Problem, number: Number) -> Equations:
    """Pairs (variable, derivative) in the order of the state.

    Parameters
    ----------
    number : callable
        Makes a number of the arithmetic wanted, `float` or `numpy.longdouble`.

    Raises
    ------
    ImportError
        heyoka is not installed.
    """
    system = problem.system
    if isinstance(system, DrivenPendulums):
        return _pendulums(problem, number)
    if isinstance(system, ElasticBeam):
        return _beam(system, number)
    assert isinstance(system, VanDerPol)
    return _van_der_pol(system, number)


def _level(motion: Swell, number: Number) -> Any:
    import heyoka as hy

    terms = [number(a) * hy.cos(number(w) * hy.time + number(p)) for a, w, p in zip(*motion, strict=True) if a]
    return hy.sum(terms) if terms else None


def _pendulums(problem: Problem, number: Number) -> Equations:
    import heyoka as hy

    system = problem.system
    across, along = _level(problem.horizontal, number), _level(problem.vertical, number)
    sine, gravity = isinstance(system.restoring, Sine), number(system.gravity)
    found: Equations = []
    for k, (n, gamma) in enumerate(zip(system.natural_frequency, system.terms.damping_rate, strict=True)):
        x, v = hy.make_vars(f"x{k}", f"v{k}")
        back = hy.sin(x) if sine else x
        if along is not None:
            back = (number(1.0) + along / gravity) * back
        if across is not None:
            back = back + across / gravity * (hy.cos(x) if sine else number(1.0))
        found += [(x, v), (v, -number(2.0) * number(gamma) * v - number(n) * number(n) * back)]
    return found


def _beam(system: ElasticBeam, number: Number) -> Equations:
    """System (1) of Kanunnikov and Lamper, solved for the accelerations."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    gravity, heavy = number(system.gravity), number(system.beam_mass)
    whole, inertia = heavy, heavy
    force: Any = number(0.0)
    swings = []
    for k, (m, length) in enumerate(zip(system.mass, system.length, strict=True)):
        angle, rate = hy.make_vars(f"phi{k}", f"rate{k}")
        sine, cosine = hy.sin(angle), hy.cos(angle)
        free = -(gravity / number(length)) * sine
        if system.terms is not None:
            share = angle / number(system.terms.angle[k])
            free = free + number(system.terms.rate[k]) * (number(1.0) - share * share) * rate
        whole = whole + number(m)
        inertia = inertia + number(m) * cosine * cosine
        force = force + number(m) * number(length) * (cosine * rate * rate + sine * free)
        swings.append((angle, rate, sine, free, number(length)))
    pull = force - number(system.stiffness) * x - whole * number(system.damping_rate) * v
    beam = pull / inertia
    found: Equations = [(x, v), (v, beam)]
    for angle, rate, sine, free, length in swings:
        found += [(angle, rate), (rate, free + sine * beam / length)]
    return found


def _van_der_pol(system: VanDerPol, number: Number) -> Equations:
    import heyoka as hy

    y, v = hy.make_vars("y", "v")
    return [(y, v), (v, number(system.stiffness) * (number(1.0) - y * y) * v - y)]
