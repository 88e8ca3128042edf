"""Crossings, periods, and escapements that kick."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from energies import SineFromTop, energy
from kicked import crossings, integrate_with_events
from pantaleone_board import pantaleone

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.events import escapement
from synth.systems.driven_pendulums import DrivenPendulums, Linear
from synth.systems.resistance import Viscous
from synth.systems.yielding import ElasticBeam, FlexibleFrame
from tests.synth.systems.system_examples import plain


def exact_period(amplitude: float | str) -> float:
    """T/T0 of a plain pendulum, by the complete elliptic integral."""
    with mpmath.workdps(40):
        return float(2 / mpmath.pi * mpmath.ellipk(mpmath.sin(mpmath.mpf(amplitude) / 2) ** 2))


@pytest.mark.compiled
@pytest.mark.parametrize("amplitude", [1e-6, 1e-3, 0.1, 1.0, 2.0, 3.0, 3.1])
def test_period_against_elliptic_integral(amplitude: float) -> None:
    exact, system = exact_period(amplitude), plain(2 * math.pi)
    _, found = integrate_with_events(
        system, [amplitude, 0.0], [0.0, 2.3 * exact], crossings(system, 0.0, -1), tolerance=1e-14
    )
    assert np.diff(found.times) == pytest.approx(exact, rel=1e-12)


def test_period_against_elliptic_integral_uncompiled_too() -> None:
    system = plain(2 * math.pi)
    _, found = integrate_with_events(system, [1.0, 0.0], [0.0, 0.4], crossings(system, 0.0, -1), tolerance=1e-9)
    assert 4.0 * found.times[0] == pytest.approx(exact_period(1.0), rel=1e-9)


@pytest.mark.compiled
def test_printed_periods() -> None:
    """Section 3.2; at 3.14159 rad the angle is counted from the top, where the double of theta has lost it."""
    assert exact_period("3.1") == pytest.approx(3.34849644557, abs=5e-12)
    assert exact_period("3.14159") == pytest.approx(9.49775504494, abs=5e-12)
    with mpmath.workdps(40):
        top = float(mpmath.pi - mpmath.mpf(3.14159))
    upside = DrivenPendulums(np.array([2 * math.pi]), restoring=SineFromTop())
    _, found = integrate_with_events(upside, [top, 0.0], [0.0, 5.0], crossings(upside, math.pi, 1), tolerance=1e-13)
    assert 4.0 * found.times[0] == pytest.approx(exact_period(3.14159), rel=1e-12)
    assert energy(np.array([top, 0.0]), upside) == pytest.approx(8 * math.pi**2, rel=1e-11)


def test_every_kick_adds_its_energy_and_damping_takes_it() -> None:
    """Linear and undamped, E grows by exactly the kick at each crossing."""
    system = DrivenPendulums(np.array([6.0]), restoring=Linear())
    kick = escapement(system, 0, 0.02, 0.03, direction=1)
    path, found = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 4.0, 70), kick, tolerance=1e-9)
    levels = np.array([energy(state, system) for state in path.states])
    count = np.searchsorted(found.times, path.times)
    np.testing.assert_allclose(levels, levels[0] + 0.03 * count, rtol=1e-8)
    assert found.times.size == 4


@pytest.mark.compiled
def test_energy_balance_of_a_clock_at_its_limit_cycle() -> None:
    """Kick energy a cycle = what damping takes: integral of 2 gamma theta'^2, by quadrature of the outputs."""
    gamma = np.array([0.02])
    system = DrivenPendulums(np.array([2 * math.pi]), terms=Viscous(gamma))
    kick = escapement(system, 0, 0.0, 0.05, direction=0)
    path, found = integrate_with_events(system, [0.3, 0.0], [0.0, 600.0], kick, tolerance=1e-11)
    start, end = found.times[-4], found.times[-2]  # two kicks: a full cycle
    times = np.concatenate([[0.0], np.linspace(start, end, 4001)])
    path, again = integrate_with_events(system, [0.3, 0.0], times, kick, tolerance=1e-11)
    rate = path.states[1:, 1]
    middle = int(np.searchsorted(times[1:], found.times[-3]))
    lost = 0.0
    for part in (slice(1, middle), slice(middle, 4000)):  # Simpson's rule on each smooth piece
        piece, grid = rate[part] ** 2, times[1:][part]
        lost += float(np.sum((piece[1:] + piece[:-1]) * np.diff(grid)) / 2)
    assert 2 * gamma[0] * lost == pytest.approx(0.1, rel=2e-3)  # the trapezoid's ends: a step next to each kick
    # another end, another first step: the same instants to rounding
    np.testing.assert_allclose(again.times, found.times[: again.times.size], rtol=0.0, atol=1e-12)


def test_kicks_do_not_depend_on_output_times() -> None:
    system = DrivenPendulums(np.array([6.0]), terms=Viscous(np.array([0.05])))
    kick = escapement(system, 0, 0.01, 0.02)
    _, one = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 3.0, 70), kick, tolerance=1e-8)
    _, two = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 3.0, 101), kick, tolerance=1e-8)
    np.testing.assert_array_equal(one.times, two.times)
    assert np.diff(one.times) == pytest.approx(2 * math.pi / 6.0, rel=0.02)  # one a swing, none double


@pytest.mark.campaign
def test_grazing_crossings_are_counted_as_the_closed_form_says() -> None:
    """Linear, damped: maxima a e^{-gamma t}; a level just under one of them is crossed so often and not once more."""
    gamma, n = 0.02, 6.0
    damped = math.sqrt(n * n - gamma * gamma)
    system = DrivenPendulums(np.array([n]), restoring=Linear(), terms=Viscous(np.array([gamma])))
    times = np.linspace(0.0, 30.0, 100)
    for peak in (3, 7):
        height = 0.1 * math.exp(-gamma * peak * 2 * math.pi / damped)
        for shift, extra in ((-1e-9, 0), (+1e-9, -1)):  # below the top of that swing, and above it
            level = height * (1 + shift)
            _, up = integrate_with_events(system, [0.1, 0.0], times, crossings(system, level, 1), tolerance=1e-13)
            _, both = integrate_with_events(system, [0.1, 0.0], times, crossings(system, level, 0), tolerance=1e-13)
            assert up.times.size == peak + extra
            assert both.times.size == 2 * (peak + extra) + 1  # the way down from the start


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-12])
@pytest.mark.parametrize("offset", [0.0, *(sign * 10.0**-k for k in (6, 7, 8, 9, 12) for sign in (1, -1))])
def test_grazing_is_right_or_refused(offset: float, tolerance: float) -> None:
    """Undamped, a level just under the turn is crossed at every swing, one just above never: no third answer."""
    system = DrivenPendulums(np.array([6.0]), restoring=Linear())
    watch = crossings(system, 0.1 * (1 + offset), 1)
    try:
        path, found = integrate_with_events(system, [0.1, 0.0], [0.0, 2.5], watch, tolerance=tolerance)
    except RefusedError as refusal:
        reason = str(refusal)
    else:
        assert found.times.size == (2 if offset < 0 else 0)
        assert abs(offset) > path.estimated_error
        return
    assert "touches" in reason
    assert abs(offset) < 1e5 * tolerance  # the loose march for the estimate may not decide it


@pytest.mark.compiled
def test_identical_pendulums_are_kicked_together() -> None:
    system = DrivenPendulums(np.array([6.0, 6.0]), terms=Viscous(np.array([0.05, 0.05])))
    kick = escapement(system, [0, 1], 0.01, 0.02)
    path, found = integrate_with_events(system, [0.1, 0, 0.1, 0], np.linspace(0, 20, 101), kick, tolerance=1e-10)
    np.testing.assert_array_equal(found.watches, np.arange(found.times.size) % 2)
    np.testing.assert_array_equal(path.states[:, :2], path.states[:, 2:])


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("system", "start"),
    [
        (
            ElasticBeam(2.0, np.array([0.3, 0.2]), np.array([0.25, 0.24]), 150.0, 0.0, 9.81),
            [0.01, 0, 0.3, 0, -0.2, 0.5],
        ),
        (
            FlexibleFrame(2.0, np.array([0.3, 0.2]), np.array([0.25, 0.24]), 150.0, 0.0, 9.81),
            [0.01, 0, 0.3, 0, -0.2, 0],
        ),
        (
            pantaleone(np.array([0.01, -0.01]), 0.0, 0.4, 0.05),
            [0.6, 0.0, -0.3, 0.1],
        ),
    ],
    ids=["beam", "frame", "metronomes"],
)
def test_kicks_on_yielding_supports_add_their_energy_to_the_whole(system: Any, start: list[float]) -> None:
    kick = escapement(system, [0, 1], [0.05, -0.05], [0.001, 0.002], [0, -1])
    path, found = integrate_with_events(system, start, np.linspace(0, 20, 101), kick, tolerance=1e-11)
    levels = np.array([energy(state, system) for state in path.states])
    added = np.cumsum(np.array([0.0, *np.array([0.001, 0.002])[found.watches]]))[
        np.searchsorted(found.times, path.times)
    ]
    assert found.times.size > 2
    np.testing.assert_allclose(levels, levels[0] + added, atol=1e-10)


@pytest.mark.compiled
def test_ten_thousand_swings_of_kicks_add_up() -> None:
    """Undamped and kicked both ways: 20 000 kicks, each exact; at the end the pendulum swings 1000 times as wide."""
    system = DrivenPendulums(np.array([2 * math.pi]), restoring=Linear())
    kick = escapement(system, 0, 0.01, 1e-3, direction=0)
    path, found = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 1e4, 101), kick, tolerance=1e-10)
    levels = np.array([energy(state, system) for state in path.states])
    count = np.searchsorted(found.times, path.times)
    np.testing.assert_allclose(levels, levels[0] + 1e-3 * count, rtol=1e-10)
    assert abs(found.times.size - 20_000) <= 1


@pytest.mark.campaign
def test_a_clock_keeps_its_swing_for_ten_thousand_swings() -> None:
    """Kicked when rising: the amplitude where damping takes what a kick gives, E = kick/(1 - e^(-2 gamma T))."""
    gamma, n, given = 0.01, 2 * math.pi, 0.02
    system = DrivenPendulums(np.array([n]), restoring=Linear(), terms=Viscous(np.array([gamma])))
    path, found = integrate_with_events(
        system, [0.1, 0.0], np.linspace(0.0, 1e4, 101), escapement(system, 0, 0.0, given), tolerance=1e-10
    )
    period = 2 * math.pi / math.sqrt(n * n - gamma * gamma)
    np.testing.assert_allclose(np.diff(found.times), period, rtol=1e-9)  # kicks at zero angle do not change it
    after = math.sqrt(2 * given / (1 - math.exp(-2 * gamma * period)))  # rate just after a kick
    last = path.times[-1] - found.times[-1]
    wave = math.sqrt(n * n - gamma * gamma)
    expected = after / wave * math.exp(-gamma * last) * math.sin(wave * last)
    assert path.states[-1, 0] == pytest.approx(expected, rel=1e-7)
    assert path.estimated_error < 1e-8


@pytest.mark.campaign
def test_a_clock_that_stops_is_followed_or_refused() -> None:
    """Too weak a kick: the swing falls below the angle of the kick, and from then on only damping is left."""
    gamma, n = 0.05, 6.0
    system = DrivenPendulums(np.array([n]), restoring=Linear(), terms=Viscous(np.array([gamma])))
    kick = escapement(system, 0, 0.05, 1e-4)
    path, found = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 100.0, 201), kick, tolerance=1e-10)
    assert 3 < found.times.size < 20
    quiet = path.times > found.times[-1]
    heights = np.log([energy(state, system) for state in path.states[quiet]])
    slope = np.polyfit(path.times[quiet], heights, 1)[0]
    assert slope == pytest.approx(-2 * gamma, rel=1e-2)
    again, other = integrate_with_events(system, [0.1, 0.0], np.linspace(0.0, 100.0, 201), kick, tolerance=1e-13)
    assert other.times.size == found.times.size
    np.testing.assert_allclose(again.states, path.states, atol=1e-9)


def test_impossible_events_are_refused_at_the_edge() -> None:
    with pytest.raises(UsageError, match="direction"):
        escapement(plain(1.0), 0, 0.0, 0.1, direction=3)
    with pytest.raises(UsageError, match="energy"):
        escapement(plain(1.0), 0, 0.0, -0.1)
