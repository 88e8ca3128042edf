"""An apparatus that a ship carries: what its acceleration adds; `None` is not compiled.

In the frame of the ship every mass feels `-m x''` sideways and `-m z''` upwards (z'' up positive). A bob's share along
its swing is `(g + z'') sin phi + x'' cos phi`; the rest acts on what holds the pendulums.
"""

from __future__ import annotations

from synth.systems.choice import taken_in


@taken_in
def weight(sine: float, cosine: float, gravity: float, horizontal: float | None, vertical: float | None) -> float:
    """Pull along the swing per mass, `(g + z'') sine + x'' cosine`, m/s^2.

    Its derivative by the angle is the same of `cosine` and `-sine`.

    Examples
    --------
    >>> weight(0.5, 0.75, 10.0, None, None), weight(0.5, 0.75, 10.0, 4.0, -2.0)
    (5.0, 7.0)
    """
    pull = (gravity if vertical is None else gravity + vertical) * sine
    return pull if horizontal is None else pull + horizontal * cosine


@taken_in
def carried(force: float, mass: float, acceleration: float | None) -> float:
    """Force with `mass x acceleration` added.

    Examples
    --------
    >>> carried(1.0, 2.0, None), carried(1.0, 2.0, 3.0)
    (1.0, 7.0)
    """
    return force if acceleration is None else force + mass * acceleration
