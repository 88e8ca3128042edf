"""A motion together with its tangents: the variational equation, carried by the Runge-Kutta formula of order 8.

The tangents are those of the formula itself, to the last bit: Newton's method on what `carried` returns converges
quadratically down to rounding.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from synth.integrators.explicit_tableau import NODES, WEIGHTS
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative, jacobian

_STAGES = 12


def carried(system: Any, start: Floats, duration: float, steps: int) -> tuple[Floats, Floats]:
    """States at evenly spaced instants, and the derivative of the last by the first.

    Parameters
    ----------
    system : NamedTuple
        Registered with derivative and jacobian.
    start : (n,) array
    duration : float
        Of the whole way, in the system's unit of time.
    steps : int
        Even.

    Returns
    -------
    states : (steps + 1, n)
    tangents : (n, n)
        d states[-1]/d start.

    Examples
    --------
    >>> from synth.systems.resistance import VanDerPol
    >>> states, tangents = carried(VanDerPol(0.0), np.array([1.0, 0.0]), 0.5 * np.pi, 20)
    >>> np.round(states[-1], 9) + 0.0, np.round(tangents, 9) + 0.0
    (array([ 0., -1.]), array([[ 0.,  1.],
           [-1.,  0.]]))
    """
    nodes, weights = _formula()
    states = np.empty((steps + 1, start.size))
    rows = np.vstack([start, np.eye(start.size)])
    _march(system, rows, duration / steps, nodes, weights, states)
    return states, rows[1:].T.copy()


@functools.cache
def _formula() -> tuple[Floats, Floats]:
    """Nodes (12,), and weights (13, 12): a row for each stage, the last for the step."""
    weights = np.zeros((_STAGES + 1, _STAGES))
    for row, values in enumerate(WEIGHTS[: _STAGES + 1]):
        weights[row, : len(values)] = values
    weights[0] = 0.0
    return np.array(NODES[:_STAGES]), weights


@kernel
def _march(system: Any, rows: Floats, step: float, nodes: Floats, weights: Floats, states: Floats) -> None:
    """`rows` (1 + n, n): the state, and a row for each tangent; moves on. `states` (steps + 1, n) is filled."""
    count, size = rows.shape
    slopes = np.empty((nodes.size, count, size))
    place = np.empty((count, size))
    matrix = np.zeros((size, size))
    for i in range(size):
        states[0, i] = rows[0, i]
    for index in range(states.shape[0] - 1):
        for stage in range(nodes.size):
            _add(place, rows, step, weights[stage], slopes, stage)
            time = (index + nodes[stage]) * step
            derivative(time, place[0], system, slopes[stage, 0])
            jacobian(time, place[0], system, matrix)
            for j in range(1, count):
                for i in range(size):
                    total = 0.0
                    for k in range(size):
                        total += matrix[i, k] * place[j, k]
                    slopes[stage, j, i] = total
        _add(rows, rows, step, weights[nodes.size], slopes, nodes.size)
        for i in range(size):
            states[index + 1, i] = rows[0, i]


@kernel
def _add(out: Floats, rows: Floats, step: float, weights: Floats, slopes: Floats, stages: int) -> None:
    """Rows and what the slopes of these stages add to them."""
    for j in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            total = 0.0
            for stage in range(stages):
                total += weights[stage] * slopes[stage, j, i]
            out[j, i] = rows[j, i] + step * total
