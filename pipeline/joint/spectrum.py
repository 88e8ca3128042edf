"""The ship's spectrum: its parameters as numbers, and how a trace answers to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Component, Engine, Sea, Vibration

LEAST_NOISE = 1e-6  # rad: readings are taken for no better
SPARSE = 2.0  # of the swing between readings, rad
FASTEST = 60.0  # s-1, rate of a vibration that the steps of a lattice follow
HEAVES = 7.0  # rad s-1, of the sea: what is faster has no sidebands, or acts as gravity does
NARROWEST, BROADEST, LINE = 0.01, 0.7, 1e-4  # of the frequency, a sea's damping; least of a line's
SWELL = 3.0  # rad s-1: what is narrower than a sea, and slower, is one still


def folded(frequency: float, step: float) -> float:
    """Where readings at that step show a frequency, rad s-1."""
    turns = frequency * step / (2.0 * np.pi)
    return float(abs(turns - np.rint(turns)) * 2.0 * np.pi / step)


def transfer(problem: Problem, trace: int, frequency: Floats, first: int = 0) -> Floats:
    """Square of a trace's answer to U by frequency, of pendulums from the first on; of a recorded acceleration's."""
    if trace >= problem.traces:
        return np.full(frequency.shape, float(first == 0))
    answer = np.zeros(frequency.shape)
    for i in range(first, problem.pendulums):
        kappa = float(problem.kappa[i])
        answer = answer - problem.lattice.combination[trace, i] * kappa / (kappa - frequency**2)
    return np.asarray(answer**2)


def beside_the_swing(swing: float, square: float, frequency: Floats) -> Floats:
    """Square of a trace's answer to Z on either side of the swing, by frequency; `square`: half its mean square."""
    return np.asarray(square * (swing**2 / (swing**2 - frequency**2)) ** 2)


def parameters(components: tuple[Component, ...]) -> Floats:
    """Logarithms of frequency or rate, relative damping and size of all components."""
    out: list[float] = []
    for each in components:
        if isinstance(each, Vibration):
            out += [each.rate, each.rms]
        else:
            out += [each.frequency, each.damping / each.frequency, each.rms]
    return np.log(out)


def spreads(components: tuple[Component, ...], loose: float = 1.0) -> Floats:
    """1 sigma of the logarithms of `parameters` about what a spectrum gives; of widths and sizes so much looser."""
    out: list[float] = []
    for each in components:
        out += [0.3, 2.0 * loose] if isinstance(each, Vibration) else [0.2, 0.7 * loose, 1.0 * loose]
    return np.array(out)


def assemble(like: tuple[Component, ...], vector: Floats) -> tuple[Component, ...]:
    """Components of the same kinds with other numbers; a sea that is too narrow for one becomes a line."""
    values = iter(np.exp(vector).tolist())
    out: list[Component] = []
    for each in like:
        if isinstance(each, Vibration):
            out.append(Vibration(min(next(values), FASTEST), next(values), each.axis))
        else:
            frequency, width, size = next(values), next(values), next(values)
            kind = Engine if isinstance(each, Engine) or (width < NARROWEST and frequency > SWELL) else Sea
            if kind is Sea and each.axis == "vertical":
                frequency = min(frequency, HEAVES)
            width = max(width, NARROWEST if kind is Sea else LINE)
            out.append(kind(frequency, frequency * min(width, BROADEST), size, each.axis))
    return tuple(out)


def between(one: Assumed, other: Assumed, share: float) -> Assumed:
    """Ship and noise some share of the way from one to another of the same kinds, in logarithms."""
    low, high = parameters(one.ship), parameters(other.ship)
    noise = one.noise * (other.noise / one.noise) ** share
    return replace(other, ship=assemble(other.ship, low + share * (high - low)), noise=noise)
