"""Errors of the readings that repeat with the swing, as those of a blurred spot or of imperfect optics do.

They hold nothing of the period and stay as they are, while each of their harmonics would pass for motion of the ship.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint.explanation import Fitted, angles, fitted

HARMONICS = range(2, 9)  # of the swing; the first is the swing itself, and gravity's
ALIASED = 0.8  # of half the sampling rate, from which a harmonic may be another one
PAYS = 15.0  # in log-likelihood, of the four constants of a harmonic
MOST = 3e-4  # of the swing; larger ones are left to explanations that move gravity, as optics that are not linear do


def corrected(fit: Fitted, *, tells_law: bool = False) -> Fitted:
    """The fit to readings less the harmonics of each trace's own swing that they show beside the path.

    The size of each harmonic is linear in the amplitude. Rounded readings err in steps, which are met elsewhere.

    Parameters
    ----------
    fit : Fitted
    tells_law : bool
        Whether the law is open: a third harmonic beside which that of the sine's law counts, A^3/192, is left.
    """
    problem, lattice, noise = fit.model.problem, fit.model.problem.lattice, fit.model.assumed.noise
    if problem.steps.any():
        return fit
    value, squares = lattice.value.copy(), np.zeros(problem.traces)
    for trace in range(problem.traces):
        own = np.flatnonzero((lattice.trace == trace) & np.isfinite(fit.of.whitened))
        highest = ALIASED * np.pi / (problem.swing * lattice.spacing[trace])
        harmonics = [k for k in HARMONICS if k < highest]
        if not harmonics or own.size < LEAST:
            continue
        size, turn = _swing(fit, trace, own)
        shown = (abs(np.sum(fit.of.whitened[own] * wave)) ** 2 for wave in _powers(turn, harmonics))
        if max(shown) < PAYS * own.size:
            continue
        rest = lattice.value[own] - angles(fit, lattice.time[own]) @ lattice.combination[trace]
        rest -= rest.mean()
        amplitude = np.sqrt(2.0) * float(np.std(lattice.value[own]))
        for k, wave in zip(harmonics, _powers(turn, harmonics), strict=True):
            parts = np.stack([wave.real, wave.imag, size * wave.real, size * wave.imag], axis=1)
            error = parts @ np.linalg.solve(parts.T @ parts + TINY * np.eye(4), parts.T @ rest)
            square = float(error @ error)
            if tells_law and k == 3 and own.size * (amplitude**3 / 192.0) ** 2 > NOTHING**2 * square:
                continue
            if 2.0 * PAYS * noise[trace] ** 2 < square < own.size * (MOST * amplitude) ** 2:
                value[own] -= error
                rest -= error
                squares[trace] += square / own.size
    if not squares.any():
        return fit
    moved = replace(problem, lattice=replace(lattice, value=value), repeating=np.sqrt(squares))
    return fitted(replace(fit.model, problem=moved), fit.path)


def doubt(fit: Fitted) -> float:
    """1 sigma of gravity over itself, where a third harmonic may be due to optics that are not linear.

    An error `c x^3` of the angle x makes a harmonic `c A^3 / 4` and an amplitude too large by `3 c A^3 / 4`.
    """
    problem = fit.model.problem
    if not problem.repeating.size or not fit.model.assumed.sine:
        return 0.0
    size = np.sqrt(2.0) * float(np.std(fit.path[:, : 2 * problem.pendulums : 2], axis=0).max())
    return float(0.75 * np.sqrt(2.0) * size * problem.repeating.max())


def _swing(fit: Fitted, trace: int, own: np.ndarray) -> tuple[Floats, np.ndarray]:
    """At a trace's readings: its amplitude over the mean, less one, (n,), and the unit phasor of its swing, (n,)."""
    problem, lattice = fit.model.problem, fit.model.problem.lattice
    angle, speed = (fit.path[:, k : 2 * problem.pendulums : 2] @ lattice.combination[trace] for k in (0, 1))
    swing = (angle - 1j * speed / problem.swing)[lattice.node[own]]
    size = np.maximum(np.abs(swing), TINY)
    return size / size.mean() - 1.0, swing / size * np.exp(1j * problem.swing * lattice.offset[own])


def _powers(turn: np.ndarray, harmonics: list[int]) -> Iterator[np.ndarray]:
    wave = turn ** (harmonics[0] - 1)
    for _ in harmonics:
        wave = wave * turn
        yield wave


LEAST = 1000  # readings
NOTHING = 0.03  # of an error
TINY = 1e-12
