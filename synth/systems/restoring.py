"""How gravity and the support's acceleration pull a pendulum back; one kernel for each combination of types.

    sine     (1 + zeta) sin theta + u cos theta        linear     (1 + zeta) theta + u

with u = x''/g and zeta = z''/g; a motion that the scene leaves out is `None`, and no code is compiled for it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.core import types

from synth.systems.choice import chosen_for


class Sine(NamedTuple):
    """The pendulum itself."""

    power: float = 1.0
    """Unused: a tuple without fields does not compile."""


class SineFromTop(NamedTuple):
    """The same pendulum, its angle counted from the upward vertical.

    Near the top the sine of theta is the small difference of theta and pi, lost in rounding; from there it is exact.
    The support's acceleration is not offered: horizontal and vertical motion of the support must be None.
    """

    power: float = 1.0
    """Unused: a tuple without fields does not compile."""


class Linear(NamedTuple):
    """Its limit of small angles."""

    power: float = 1.0
    """Unused: a tuple without fields does not compile."""


def pull(angle: float, horizontal: float | None, vertical: float | None, restoring: Any) -> float:
    """Angular acceleration towards the vertical, over n^2.

    Parameters
    ----------
    angle : float
        rad.
    horizontal, vertical : float or None
        Acceleration of the support over gravity.
    restoring : Sine or Linear
    """
    if isinstance(restoring, SineFromTop):
        return -math.sin(angle)
    sine = isinstance(restoring, Sine)
    back = math.sin(angle) if sine else angle
    if vertical is not None:
        back = (1.0 + vertical) * back
    if horizontal is not None:
        back = back + (horizontal * math.cos(angle) if sine else horizontal)
    return back


def pull_slope(angle: float, horizontal: float | None, vertical: float | None, restoring: Any) -> float:
    """Derivative of `pull` by the angle."""
    if isinstance(restoring, SineFromTop):
        return -math.cos(angle)
    sine = isinstance(restoring, Sine)
    slope = math.cos(angle) if sine else 1.0
    if vertical is not None:
        slope = (1.0 + vertical) * slope
    if horizontal is not None and sine:
        slope = slope - horizontal * math.sin(angle)
    return slope


def height(angle: float, restoring: Any) -> float:
    """Potential energy over m l^2 n^2; `1 - cos` without its cancellation."""
    if isinstance(restoring, SineFromTop):
        return 2.0 * math.cos(0.5 * angle) ** 2
    half = math.sin(0.5 * angle) if isinstance(restoring, Sine) else 0.5 * angle
    return 2.0 * half * half


def _absent(kind: Any) -> bool:
    return isinstance(kind, types.NoneType)


@chosen_for(pull)
def _pull(angle: Any, horizontal: Any, vertical: Any, restoring: Any) -> Any:
    if restoring.instance_class is SineFromTop:
        return lambda angle, horizontal, vertical, restoring: -math.sin(angle)
    if restoring.instance_class is Sine:
        if _absent(horizontal) and _absent(vertical):
            return lambda angle, horizontal, vertical, restoring: math.sin(angle)
        if _absent(horizontal):
            return lambda angle, horizontal, vertical, restoring: (1.0 + vertical) * math.sin(angle)
        if _absent(vertical):
            return lambda angle, horizontal, vertical, restoring: math.sin(angle) + horizontal * math.cos(angle)
        return lambda angle, horizontal, vertical, restoring: (
            (1.0 + vertical) * math.sin(angle) + horizontal * math.cos(angle)
        )
    if _absent(horizontal) and _absent(vertical):
        return lambda angle, horizontal, vertical, restoring: angle
    if _absent(horizontal):
        return lambda angle, horizontal, vertical, restoring: (1.0 + vertical) * angle
    if _absent(vertical):
        return lambda angle, horizontal, vertical, restoring: angle + horizontal
    return lambda angle, horizontal, vertical, restoring: (1.0 + vertical) * angle + horizontal


@chosen_for(pull_slope)
def _pull_slope(angle: Any, horizontal: Any, vertical: Any, restoring: Any) -> Any:
    if restoring.instance_class is SineFromTop:
        return lambda angle, horizontal, vertical, restoring: -math.cos(angle)
    if restoring.instance_class is Sine:
        if _absent(horizontal) and _absent(vertical):
            return lambda angle, horizontal, vertical, restoring: math.cos(angle)
        if _absent(horizontal):
            return lambda angle, horizontal, vertical, restoring: (1.0 + vertical) * math.cos(angle)
        if _absent(vertical):
            return lambda angle, horizontal, vertical, restoring: math.cos(angle) - horizontal * math.sin(angle)
        return lambda angle, horizontal, vertical, restoring: (
            (1.0 + vertical) * math.cos(angle) - horizontal * math.sin(angle)
        )
    if _absent(vertical):
        return lambda angle, horizontal, vertical, restoring: 1.0
    return lambda angle, horizontal, vertical, restoring: 1.0 + vertical


@chosen_for(height)
def _height(angle: Any, restoring: Any) -> Any:
    if restoring.instance_class is SineFromTop:
        return lambda angle, restoring: 2.0 * math.cos(0.5 * angle) * math.cos(0.5 * angle)
    if restoring.instance_class is Sine:
        return lambda angle, restoring: 2.0 * math.sin(0.5 * angle) * math.sin(0.5 * angle)
    return lambda angle, restoring: 0.5 * angle * angle
