"""What a system's remainder is made of: sine and cosine of eight angles at once, and motions that may be absent.

A system that can be collocated registers a kernel under "remainder": all accelerations at the nodes, less the linear
part that is carried exactly,

    remainder(position, rate, sideways, upwards, system, excess, room, out, now)

position, rate, out[now] are (components, NODES); sideways and upwards the ship's acceleration (NODES,) or None;
`excess` (components, 2) what the carried linear part has more than the system's own, 1/s^2 and 1/s, so that `out` is
right to the last bit; room (2, components, NODES) is work space. Arrays are indexed, never cut: each view would count
references.
"""

from __future__ import annotations

from typing import Any

from numba.core import types

from synth.integrators.collocation_simd import load
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.choice import chosen_for

_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds to a whole number
_PI = (3.141592653589793116, 1.2246467991473532072e-16)
_INVERSE_PI = 0.3183098861837906715


@kernel
def turned(angle: Any) -> Any:
    """sin, cos and `angle - sin` of eight angles.

    Reduced to a quarter turn either way, then Taylor series; `angle - sin` has no cancellation at small angles.
    """
    half_turns = (angle * _INVERSE_PI + _ROUNDER) - _ROUNDER
    h = (angle - half_turns * _PI[0]) - half_turns * _PI[1]
    pairs = (half_turns * 0.5 + _ROUNDER) - _ROUNDER
    sign = 1.0 - 2.0 * abs(half_turns - 2.0 * pairs)
    s = h * h
    q = s * s
    low = (1 / 6 + s * (-1 / 120)) + q * (1 / 5040 + s * (-1 / 362880))
    high = (1 / 39916800 + s * (-1 / 6227020800)) + q * (1 / 1307674368000 + s * (-1 / 355687428096000))
    top = 1 / 121645100408832000 + s * (-1 / 51090942171709440000)
    rest = (h * s) * (low + (q * q) * (high + (q * q) * top))
    low = (0.5 + s * (-1 / 24)) + q * (1 / 720 + s * (-1 / 40320))
    high = (1 / 3628800 + s * (-1 / 479001600)) + q * (1 / 87178291200 + s * (-1 / 20922789888000))
    top = 1 / 6402373705728000 + s * (-1 / 2432902008176640000)
    fall = s * (low + (q * q) * (high + (q * q) * top))
    return sign * (h - rest), sign * (1.0 - fall), (angle - sign * h) + sign * rest


def at(values: Any, j: int) -> Any:
    """The ship's acceleration at eight nodes from the j-th on; None stays None."""
    return None if values is None else load(values, (j,))


@chosen_for(at)
def _at(values: Any, j: Any) -> Any:
    if isinstance(values, types.NoneType):
        return lambda values, j: None
    return lambda values, j: load(values, (j,))


def felt(torque: Any, sine: Any, cosine: Any, share: float, sideways: Any, upwards: Any) -> Any:
    """Torque with what the ship adds to it: `-share (x'' cos + z'' sin)`."""
    if sideways is not None:
        torque = torque - share * (sideways * cosine)
    if upwards is not None:
        torque = torque - share * (upwards * sine)
    return torque


@chosen_for(felt)
def _felt(torque: Any, sine: Any, cosine: Any, share: Any, sideways: Any, upwards: Any) -> Any:
    across, along = not isinstance(sideways, types.NoneType), not isinstance(upwards, types.NoneType)
    if across and along:
        return lambda torque, sine, cosine, share, sideways, upwards: (
            torque - share * (sideways * cosine + upwards * sine)
        )
    if across:
        return lambda torque, sine, cosine, share, sideways, upwards: torque - share * (sideways * cosine)
    if along:
        return lambda torque, sine, cosine, share, sideways, upwards: torque - share * (upwards * sine)
    return lambda torque, sine, cosine, share, sideways, upwards: torque


def nodes_of(term: Any, room: Floats) -> Any:
    """Work space for a motion, or None if there is none."""
    return None if term is None else room


@chosen_for(nodes_of)
def _nodes_of(term: Any, room: Any) -> Any:
    if isinstance(term, types.NoneType):
        return lambda term, room: None
    return lambda term, room: room
