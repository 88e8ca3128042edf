"""How gravity and the support's acceleration pull a pendulum back; one kernel for each combination of types.

    sine     (1 + zeta) sin theta + u cos theta        linear     (1 + zeta) theta + u

with u = x''/g and zeta = z''/g; a motion that the scene leaves out is `None`, and no code is compiled for it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from synth.systems.dispatch import by_type, registered


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


@by_type("restoring")
def pull(angle: float, horizontal: float | None, vertical: float | None, restoring: Any) -> Any:
    """Angular acceleration towards the vertical, over n^2.

    Parameters
    ----------
    angle : float
        rad.
    horizontal, vertical : float or None
        Acceleration of the support over gravity.
    restoring : Sine, SineFromTop or Linear
    """


@by_type("restoring")
def pull_slope(angle: float, horizontal: float | None, vertical: float | None, restoring: Any) -> Any:
    """Derivative of `pull` by the angle."""


@by_type("restoring")
def height(angle: float, restoring: Any) -> Any:
    """Potential energy over m l^2 n^2; `1 - cos` without its cancellation."""


@registered("pull", Sine)
def _pull(angle: float, horizontal: float | None, vertical: float | None, restoring: Sine) -> float:
    back = math.sin(angle) if vertical is None else (1.0 + vertical) * math.sin(angle)
    return back if horizontal is None else back + horizontal * math.cos(angle)


@registered("pull_slope", Sine)
def _pull_slope(angle: float, horizontal: float | None, vertical: float | None, restoring: Sine) -> float:
    slope = math.cos(angle) if vertical is None else (1.0 + vertical) * math.cos(angle)
    return slope if horizontal is None else slope - horizontal * math.sin(angle)


@registered("height", Sine)
def _height(angle: float, restoring: Sine) -> float:
    return 2.0 * math.sin(0.5 * angle) * math.sin(0.5 * angle)


@registered("pull", SineFromTop)
def _pull_at_top(angle: float, horizontal: None, vertical: None, restoring: SineFromTop) -> float:
    return -math.sin(angle)


@registered("pull_slope", SineFromTop)
def _pull_slope_at_top(angle: float, horizontal: None, vertical: None, restoring: SineFromTop) -> float:
    return -math.cos(angle)


@registered("height", SineFromTop)
def _height_at_top(angle: float, restoring: SineFromTop) -> float:
    return 2.0 * math.cos(0.5 * angle) * math.cos(0.5 * angle)


@registered("pull", Linear)
def _pull_linear(angle: float, horizontal: float | None, vertical: float | None, restoring: Linear) -> float:
    back = angle if vertical is None else (1.0 + vertical) * angle
    return back if horizontal is None else back + horizontal


@registered("pull_slope", Linear)
def _pull_slope_linear(angle: float, horizontal: float | None, vertical: float | None, restoring: Linear) -> float:
    return 1.0 if vertical is None else 1.0 + vertical


@registered("height", Linear)
def _height_linear(angle: float, restoring: Linear) -> float:
    return 0.5 * angle * angle
