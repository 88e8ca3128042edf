"""Polynomials through the nodes of an interval: their values elsewhere, and their Legendre coefficients."""

from __future__ import annotations

import functools

import numpy as np

from synth.kernels.collocation_remainder import NODES
from synth.phase import Floats, Integers

FINE = 1 << 40
"""Nodes are multiples of 1/FINE of half an interval: their phases are exact in fixed point."""


@functools.cache
def gauss_nodes() -> Integers:
    """Gauss-Legendre nodes in units of 1/FINE, on (-FINE, FINE), increasing and even about zero."""
    after = np.rint(np.polynomial.legendre.leggauss(NODES)[0][(NODES + 1) // 2 :] * FINE).astype(np.int64)
    middle = np.zeros(NODES % 2, dtype=np.int64)
    return np.concatenate([-after[::-1], middle, after])


@functools.cache
def barycentric() -> tuple[Floats, Floats]:
    """Start, nodes and end of an interval on [-1, 1], (POINTS,), and their barycentric shares."""
    points = np.concatenate([[-1.0], gauss_nodes() / FINE, [1.0]])
    apart = points[:, None] - points
    np.fill_diagonal(apart, 1.0)
    return points, 1.0 / np.prod(2.0 * apart, axis=1)


def interpolation(place: Floats) -> Floats:
    """Rows that give y anywhere in an interval from its start, its nodes and its end.

    Parameters
    ----------
    place : (moments,)
        In [0, 1], in intervals.

    Returns
    -------
    (moments, POINTS) float64
        Barycentric weights of the polynomial through all of them.
    """
    points, share = barycentric()
    distance = (2.0 * np.asarray(place) - 1.0)[:, None] - points
    exact = distance == 0.0
    distance[exact] = 1.0
    result = share / distance
    hit = exact.any(axis=1)
    result[hit] = exact[hit]
    result /= result.sum(axis=1, keepdims=True)
    return np.ascontiguousarray(result)


@functools.cache
def legendre_tail() -> Floats:
    """Rows that give the last four Legendre coefficients of r from its nodes, flat (4 * NODES,)."""
    return np.ascontiguousarray(_projection()[-4:]).ravel()


def _projection() -> Floats:
    """(degree, node): Legendre coefficients of a polynomial from its values."""
    values = np.polynomial.legendre.legvander(gauss_nodes() / FINE, NODES - 1)
    return np.asarray(np.linalg.inv(values), dtype=np.float64)


@functools.cache
def continuation() -> Floats:
    """(node, node): r at the nodes of the next interval, from its polynomial in this one; good to five digits."""
    beyond = np.polynomial.legendre.legvander(gauss_nodes() / FINE + 2.0, NODES - 1)
    result: Floats = beyond @ _projection()
    return result
