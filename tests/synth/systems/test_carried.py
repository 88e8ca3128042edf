"""Apparatus on a ship: the equations against Lagrange's, differentiated with 40 digits in the frame of the Earth."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from system_examples import LENGTH, MASS, SIDEWAYS, UPWARDS, state_for
from test_equations import slope

from synth.phase import Floats
from synth.systems.terms import carried, motion, weight
from synth.systems.yielding import ElasticBeam, FlexibleFrame

NOW = 0.7
SWAY = [(1.2, 0.7, 0.3), (0.4, 5.1, 1.0)]
HEAVE = [(2.0, 1.1, 0.2)]


def travelled(harmonics: list[tuple[float, float, float]], time: Any) -> Any:
    """Place of the ship, m, whose acceleration is the sum of these harmonics."""
    return mpmath.fsum(-a / mpmath.mpf(w) ** 2 * mpmath.cos(w * time + p) for a, w, p in harmonics)


Place = Callable[[list[Any], Any], tuple[list[tuple[Any, Any, Any]], Any]]


def hanging(across: Any, up: Any, angles: list[Any]) -> list[tuple[Any, Any, Any]]:
    """Bobs below a support at this place."""
    return [
        (mass, across + length * mpmath.sin(phi), up - length * mpmath.cos(phi))
        for mass, length, phi in zip(MASS, LENGTH, angles, strict=True)
    ]


def of_beam(q: list[Any], time: Any) -> tuple[list[tuple[Any, Any, Any]], Any]:
    """Masses with where they are, and the energy of the spring."""
    across, up = travelled(SWAY, time), travelled(HEAVE, time) - q[0]
    bobs = hanging(across, up, q[1:])
    sag = (2 + math.fsum(MASS)) * mpmath.mpf(9.81) / 150
    return [(2, across, up), *bobs], 75 * (q[0] + sag) ** 2


def of_frame(q: list[Any], time: Any) -> tuple[list[tuple[Any, Any, Any]], Any]:
    across, up = travelled(SWAY, time) + q[0], travelled(HEAVE, time)
    bobs = hanging(across, up, q[1:])
    return [(2, across, up), *bobs], 75 * q[0] ** 2


def lagrange(place: Place, state: Floats, acceleration: Floats, index: int) -> float:
    """Generalised force that this acceleration needs: d/dt dL/dq' - dL/dq."""
    q, v, a = ([mpmath.mpf(each) for each in values] for values in (state[0::2], state[1::2], acceleration))

    def lagrangian(at: list[Any], speed: list[Any], time: Any) -> Any:
        masses, spring = place(at, time)
        total = -spring

        def along(tau: Any) -> list[tuple[Any, Any, Any]]:
            return place([each + tau * rate for each, rate in zip(at, speed, strict=True)], time + tau)[0]

        for number, (m, _, height) in enumerate(masses):
            across = mpmath.diff(lambda tau, number=number: along(tau)[number][1], 0)
            upwards = mpmath.diff(lambda tau, number=number: along(tau)[number][2], 0)
            total += m * ((across**2 + upwards**2) / 2 - mpmath.mpf(9.81) * height)
        return total

    def nudged(values: list[Any], by: Any) -> list[Any]:
        return [*values[:index], values[index] + by, *values[index + 1 :]]

    def momentum(tau: Any) -> Any:
        at = [x + tau * y + tau**2 * z / 2 for x, y, z in zip(q, v, a, strict=True)]
        speed = [y + tau * z for y, z in zip(v, a, strict=True)]
        return mpmath.diff(lambda by: lagrangian(at, nudged(speed, by), NOW + tau), 0)

    return float(mpmath.diff(momentum, 0) - mpmath.diff(lambda by: lagrangian(nudged(q, by), v, mpmath.mpf(NOW)), 0))


@pytest.mark.parametrize(
    ("system", "place", "force"),
    [
        (ElasticBeam(2.0, MASS, LENGTH, 150.0, 0.25, 9.81, None, SIDEWAYS, UPWARDS), of_beam, -0.25 * (2 + MASS.sum())),
        (FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.7, 9.81, None, SIDEWAYS, UPWARDS), of_frame, -0.7),
    ],
    ids=["beam", "frame"],
)
def test_ship_motion_follows_from_the_lagrangian(system: Any, place: Place, force: float) -> None:
    state = state_for(system)
    acceleration = slope(system, state, NOW)[1::2]
    with mpmath.workdps(60):  # three nested differences take 40 digits
        needed = [lagrange(place, state, acceleration, index) for index in range(4)]
    expected = [force * state[1], 0.0, 0.0, 0.0]
    np.testing.assert_allclose(needed, expected, atol=1e-13 * 150)  # rounding of the double system


def test_what_nothing_holds_stays_behind() -> None:
    """Without spring and damping the support moves against the ship, and pendulums notice nothing."""
    beam = ElasticBeam(2.0, MASS, LENGTH, 0.0, 0.0, 9.81)
    frame = FlexibleFrame(2.0, MASS, LENGTH, 0.0, 0.0, 9.81)
    carried_along = ((beam, {"vertical": UPWARDS}, 1.0), (frame, {"horizontal": SIDEWAYS}, -1.0))
    for ashore, ship, sign in carried_along:
        state = state_for(ashore)
        gained = slope(ashore._replace(**ship), state, NOW) - slope(ashore, state, NOW)
        np.testing.assert_allclose(gained[1], sign * motion(NOW, next(iter(ship.values()))), rtol=1e-13)
        np.testing.assert_allclose(gained[2:], 0.0, atol=1e-13 * 40)  # of g/l


def test_absent_motion_is_no_motion_and_present_motion_is_added_as_compiled() -> None:
    for sine, cosine in ((0.3, -0.8), (-1.0, 0.0)):
        still = weight(sine, cosine, 9.81, None, None)
        assert weight(sine, cosine, 9.81, None, 0.0) == still == weight(sine, cosine, 9.81, 0.0, None)
    assert (weight(0.5, 0.75, 10.0, None, None), weight(0.5, 0.75, 10.0, 4.0, -2.0)) == (5.0, 7.0)
    assert carried(1.5, 2.0, None) == carried(1.5, 2.0, 0.0) == 1.5
    assert carried(1.0, 2.0, 3.0) == 7.0
