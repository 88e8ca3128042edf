"""The least squares of a record that long gaps of the first pendulum part into pieces.

Whatever the first pendulum did in a gap, the difference answers, once the gap is over, with one free swing: the
amplitude of its free swing takes a step there. What is known of the step beforehand, the error of the bridge laid
across the gap, is its prior: a small one joins the pieces, a large one leaves each its own phase. Frequency, damping
and offset are common to all. The steps make a chain, which is eliminated piece by piece (Kalman's filter, in the form
that keeps information).
"""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.projection.small import ROUNDS, SmallFit, amplitudes, invert

WIDEST = 1e10  # variance of a step over that of what a record tells of an amplitude, which stands for infinity


def solve_pieces(
    gram: Floats, coefficient: Floats, half: float, fit_damping: bool, steps: Floats, noise: float
) -> SmallFit:
    """Solve the least squares that the moments of all pieces stand for; see `small.gauss_newton`.

    Parameters
    ----------
    gram : (pieces, 8, 8) array
        Of `kernels.moments`.
    coefficient : (pieces, 3) array
        (A, B, offset) that the residuals were formed with.
    half : float
        Half the record's length, s.
    fit_damping : bool
        Whether gamma2 is fitted.
    steps : (pieces - 1,) array
        1 sigma of the real and of the imaginary part of each step of (A, B), rad.
    noise : float
        1 sigma of a reading of the difference, rad; 0: the steps are free.

    Raises
    ------
    RefusedError
        Too few readings, or readings that are no numbers.
    """
    free, pieces = 5 if fit_damping else 4, len(gram)
    samples = gram[:, 2, 2].sum()
    if not np.all(np.isfinite(gram)) or samples < 2 * (free + 2 * pieces - 2):
        raise RefusedError("difference: too few readings follow a swing near the nominal period; check the period")
    parameters = np.zeros((pieces, 5))
    parameters[:, :3] = coefficient
    columns = np.zeros((pieces, 7, 5))
    columns[:, [0, 1, 2], [0, 1, 2]] = 1.0
    columns[:, 5, 3] = columns[:, 6, 4] = 1.0 / half
    variances = np.square(steps / noise) if noise > 0.0 else np.full(pieces - 1, np.inf)
    variance = 0.0
    for number in range(ROUNDS + 1):
        _, _, _, speed, decay = parameters.T
        cos, sin = parameters[:, 0], parameters[:, 1]
        columns[:, 3, 0], columns[:, 4, 0], columns[:, 3, 1], columns[:, 4, 1] = -decay, -speed, speed, -decay
        columns[:, 3, 3], columns[:, 4, 3], columns[:, 3, 4], columns[:, 4, 4] = sin, -cos, -cos, -sin
        used = free if number else 3  # no turn is told before there are amplitudes
        chosen = columns[:, :, :used]
        normal = np.einsum("pki,pkl,plj->pij", chosen, gram[:, :7, :7], chosen)
        right = np.einsum("pki,pk->pi", chosen, gram[:, :7, 7] - _product(gram, _change(parameters, coefficient, half)))
        update = -parameters[0, 3]
        parameters[:, :used], variance = _chain(
            normal, right + np.einsum("pij,pj->pi", normal, parameters[:, :used]), variances
        )
        update += parameters[0, 3]
        if number and (abs(update) <= 1e-6 * abs(parameters[0, 3]) or abs(parameters[0, 3]) < 1e-7):
            break
    change = _change(parameters, coefficient, half)
    left = gram[:, 7, 7].sum() + np.vdot(change, _product(gram, change) - 2.0 * gram[:, :7, 7])
    return SmallFit(
        coefficient=parameters[:, :3],
        frequency_change=float(parameters[0, 3] / half),
        damping_change=float(parameters[0, 4] / half),
        noise=float(np.sqrt(max(left, 0.0) / max(samples - free - 2 * (pieces - 1), 1.0))),
        noise_gain=float(np.sqrt(variance) / half),
    )


def _change(parameters: Floats, coefficient: Floats, half: float) -> Floats:
    """Amplitudes (pieces, 7) of the columns, less those that the residuals already hold; see `small.amplitudes`."""
    change = np.empty((len(parameters), 7))
    for own, held, out in zip(parameters, coefficient, change, strict=True):
        amplitudes(own, held, half, out)
    return change


def _product(gram: Floats, change: Floats) -> Floats:
    return np.asarray(np.einsum("pij,pj->pi", gram[:, :7, :7], change))


def _chain(normal: Floats, right: Floats, variances: Floats) -> tuple[Floats, float]:
    """Minimise the sum of the pieces' squares and of the steps' between the first two parameters of each.

    Parameters
    ----------
    normal, right : (pieces, k, k), (pieces, k) arrays
        Normal equations of each piece alone; parameters from the third on are common to all.
    variances : (pieces - 1,) array
        Of the steps, over that of a reading.

    Returns
    -------
    (pieces, k) array
        Parameters.
    float
        Variance of the fourth parameter, per variance of a reading.
    """
    size = right.shape[1]
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("pii->i", normal), 1e-300))
    scale[:2] = scale[:2].min()  # a step has no direction
    normal, right = normal * np.outer(scale, scale), right * scale
    variances = np.minimum(variances / scale[0] ** 2, WIDEST)
    information, vector = normal[0], right[0]
    links = []
    for own, own_right, variance in zip(normal[1:], right[1:], variances, strict=True):
        # before the step u, behind it v = u + step: u is eliminated
        shrink = np.linalg.inv(np.eye(2) + variance * information[:2, :2])
        gain = variance * shrink
        links.append((shrink, gain @ vector[:2], gain @ information[:2, 2:]))
        across = information[:, :2] @ gain
        information, vector = information - across @ information[:2], vector - across @ vector[:2]
        information, vector = 0.5 * (information + information.T) + own, vector + own_right
    inverse = np.empty((size, size))
    invert(information, size, np.zeros((size, size)), inverse)
    found = np.empty_like(right)
    found[:] = inverse @ vector
    for piece in range(len(links) - 1, -1, -1):
        shrink, pull, common = links[piece]
        found[piece, :2] = pull - common @ found[piece, 2:] + shrink @ found[piece + 1, :2]
    return found * scale, float(inverse[3, 3] * scale[3] ** 2) if size > 3 else 0.0
