"""Errors of a film: of its readings, that repeat with the swing, and of its times, that last for seconds.

The first, of a blurred spot or imperfect optics, hold nothing of the period, while their harmonics would pass for
motion of the ship. White noise of the time marks passes to the times at low frequencies, up to where the paper moves
smoothly: the clock's mean rate is the ledger's; what varies within the record is cosines here, of that noise's
variance.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.constants import Constant, Constants, solve
from pipeline.joint.course import prior_root
from pipeline.joint.explanation import Fitted, angles, fitted

HARMONICS = range(2, 9)  # of the swing; the first is the swing itself, and gravity's
ALIASED = 0.8  # of half the sampling rate, from which a harmonic may be another one
PAYS = 15.0  # in log-likelihood, of the four constants of a harmonic
MOST = 3e-4, 3e-3  # of the swing, of odd and of even harmonics
"""Larger odd ones are left to explanations that move gravity, as optics that are not linear do; even ones are of a slit
that lies askew."""
LEAST = 1000  # readings
NOTHING = 0.03  # of an error
TINY = 1e-12
FIRST, HIGHEST = 2, 32  # half turns of a cosine in the record: one is the mean rate's; slow ones move gravity most
SIZES = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the stated uncertainty, as the likelihood finds it
CORNERS = (0.2, 0.5, 5.0)  # of the highest frequency, from which the paper's smooth motion leaves less


def without_repeating(fit: Fitted, *, tells_law: bool = False) -> Fitted:
    """The fit to readings less the harmonics, linear in the amplitude, of each trace's swing that they show beside the
    path. Rounded readings are met elsewhere. Where the law is open, a third harmonic beside which that of the sine's
    law counts, A^3/192, is left: it tells the law."""
    problem, lattice, noise = fit.model.problem, fit.model.problem.lattice, fit.model.assumed.noise
    if problem.steps.any():
        return fit
    value, squares = lattice.value.copy(), np.zeros(problem.traces)
    for trace in range(problem.traces):
        own = fit.used(trace)
        highest = ALIASED * np.pi / (problem.swing * lattice.spacing[trace])
        harmonics = [k for k in HARMONICS if k < highest]
        if not harmonics or own.size < LEAST:
            continue
        size, turn = swing_of(fit, trace, own)
        if max(abs(fit.of.whitened[own] @ turn**k) ** 2 for k in harmonics) < PAYS * own.size:
            continue
        rest = lattice.value[own] - angles(fit, lattice.time[own], lattice.combination[trace])
        rest -= rest.mean()
        amplitude = np.sqrt(2.0) * float(np.std(lattice.value[own]))
        for k in harmonics:
            wave = turn**k
            parts = np.stack([wave.real, wave.imag, size * wave.real, size * wave.imag], axis=1)
            error = parts @ np.linalg.solve(parts.T @ parts + TINY * np.eye(4), parts.T @ rest)
            square = float(error @ error)
            if tells_law and k == 3 and own.size * (amplitude**3 / 192.0) ** 2 > NOTHING**2 * square:
                continue
            if 2.0 * PAYS * noise[trace] ** 2 < square < own.size * (MOST[k % 2 == 0] * amplitude) ** 2:
                value[own] -= error
                rest -= error
                squares[trace] += square / own.size
    if not squares.any():
        return fit
    moved = replace(problem.reading(value), repeating=np.sqrt(squares))
    return fitted(replace(fit.model, problem=moved), fit.path)


def swing_of(fit: Fitted, trace: int, own: np.ndarray) -> tuple[Floats, np.ndarray]:
    """At a trace's readings: its amplitude over the mean, less one, (n,), and the unit phasor of its swing, (n,)."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    angle, speed = (fit.path[:, k : 2 * problem.pendulums : 2] @ lattice.combination[trace] for k in (0, 1))
    swing = (angle - 1j * speed / problem.swing)[lattice.node[own]]
    size = np.maximum(np.abs(swing), TINY)
    return size / size.mean() - 1.0, swing / size * np.exp(1j * problem.swing * lattice.offset[own])


def doubt_by_optics(fit: Fitted) -> float:
    """1 sigma of gravity over itself, where a third harmonic may be due to optics that are not linear: an error `c x^3`
    of the angle x makes a harmonic `c A^3 / 4` and an amplitude too large by `3 c A^3 / 4`."""
    problem = fit.model.problem
    if not problem.repeating.size or not fit.model.assumed.sine:
        return 0.0
    size = np.sqrt(2.0) * float(np.std(fit.path[:, : 2 * problem.pendulums : 2], axis=0).max())
    return float(0.75 * np.sqrt(2.0) * size * problem.repeating.max())


def with_clock(fit: Fitted) -> Fitted:
    """The fit with the errors of a film's times as unknowns; itself where the record states none."""
    model, problem = fit.model, fit.model.problem
    duration, density = problem.lattice.duration, problem.time_noise**2
    highest = min(HIGHEST, int(duration * problem.time_doubt**2 / density)) if density else 0
    if highest <= FIRST:
        return fit
    prior = float(np.sqrt(2.0 * density / duration))
    turns = [m * np.pi / duration for m in range(FIRST, highest)]
    modes = [Constant(f"time error {m}", kinds.CLOCK, prior, width=each) for m, each in enumerate(turns, FIRST)]
    whole = (*model.constants, *modes)
    _, of = problem.run(model.assumed, whole, about=fit.path, root=prior_root(whole, model.course))

    def weighed(size: float, corner: float) -> Constants:
        """Time errors by so much larger beforehand, and smaller above a corner, rad s-1."""
        priors = (size * each.prior / (1.0 + (each.width / corner) ** 2) for each in modes)
        return (*model.constants, *(replace(each, prior=own) for each, own in zip(modes, priors, strict=True)))

    def likelihood(constants: Constants) -> float:
        root = prior_root(constants, model.course)
        return solve(constants, of.normal, float(of.totals[0]), float(of.totals[1]), root).log_likelihood

    trials = [weighed(size, part * highest * np.pi / duration) for size, part in product(SIZES, CORNERS)]
    return fitted(replace(model, constants=max(trials, key=likelihood)), fit.path)
