"""Laws that any linear pendulum obeys, and the paper's near-resonant beat."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_schemas.scene_pendulum import FreeStart, StateStart
from synth.motion.harmonic_sum import HarmonicSum, add
from synth.pendulums.linear import Response, respond
from synth.propagators.times import EvenTimes

GRAVITY = 9.81
N = 2 * math.pi / 1.01
TIMES = EvenTimes(Fraction(1, 16), 640)
T = np.arange(640) / 16
AT_REST = StateStart(angle=0.0, angular_velocity=0.0)


def _motion(*terms: tuple[float, float, float]) -> HarmonicSum:
    rates, sizes, phases = (np.array(column) for column in zip(*terms, strict=True))
    return HarmonicSum(rates, sizes * np.exp(1j * phases))


STILL = HarmonicSum(np.empty(0), np.empty(0, dtype=complex))
SWELL = _motion((0.6, 0.1, 0.3), (1.1, 0.05, 2.0))
VIBRATION = _motion((N - 0.05, 8e-4, 1.0), (N, 2e-4, 0.5))


def _theta(response: Response, motion: HarmonicSum) -> np.ndarray:
    return TIMES.elongation([response])[0]


def _run(motion: HarmonicSum, start: FreeStart | StateStart, damping_rate: float = 1e-3) -> np.ndarray:
    return _theta(respond(N, damping_rate, start, motion, GRAVITY), motion)


def test_response_to_a_sum_is_the_sum_of_responses() -> None:
    both = _run(add([SWELL, VIBRATION]), AT_REST)
    np.testing.assert_allclose(both, _run(SWELL, AT_REST) + _run(VIBRATION, AT_REST), rtol=0, atol=1e-16)


@settings(deadline=None, max_examples=30)
@given(st.floats(-50, 50), st.floats(0, 0.05))
def test_response_is_proportional_to_motion(factor: float, damping_rate: float) -> None:
    motion = add([SWELL, VIBRATION])
    larger = HarmonicSum(motion.angular_frequency, factor * motion.acceleration)
    once, more = _run(motion, AT_REST, damping_rate), _run(larger, AT_REST, damping_rate)
    np.testing.assert_allclose(more, factor * once, rtol=0, atol=2e-16 * max(1, abs(factor)))


def test_free_decay() -> None:
    start = FreeStart(amplitude=0.02, phase=0.7)
    damped = math.sqrt(N**2 - 1e-6)
    expected = 0.02 * np.exp(-1e-3 * T) * np.cos(damped * T + 0.7)
    # the plain phase on this side, up to 250 rad, is only right to 6e-14
    np.testing.assert_allclose(_run(STILL, start), expected, rtol=0, atol=2e-15)


def test_energy_stays_without_damping_and_motion() -> None:
    response = respond(N, 0.0, StateStart(angle=0.02, angular_velocity=0.05), STILL, GRAVITY)
    free = TIMES.free_harmonic(response)
    # theta^2 + (theta'/n)^2 is the squared modulus of Z
    np.testing.assert_allclose(np.abs(free) ** 2, 0.02**2 + (0.05 / N) ** 2, rtol=1e-15)


@pytest.mark.parametrize("damping_rate", [0.0, 0.02])
@pytest.mark.parametrize("motion", [STILL, SWELL, VIBRATION, add([SWELL, VIBRATION])])
def test_state_at_the_start_is_honoured(motion: HarmonicSum, damping_rate: float) -> None:
    response = respond(N, damping_rate, StateStart(angle=0.03, angular_velocity=-0.04), motion, GRAVITY)
    fine = EvenTimes(Fraction(1, 2**14), 3).elongation([response])[0]
    assert fine[0] == pytest.approx(0.03, abs=5e-17)  # ten roundings of terms of 0.01
    h = 2.0**-14
    velocity = (-3 * fine[0] + 4 * fine[1] - fine[2]) / (2 * h)
    # one-sided difference: h^2/3 of the third derivative (n^3 * 0.03), and rounding 1e-17/h
    assert velocity == pytest.approx(-0.04, abs=h**2 * N**3 * 0.03 + 1e-12)


def test_a_later_start_is_the_same_motion() -> None:
    """Shift the motion by 8 s and start from the state that the pendulum has then."""
    motion = add([SWELL, VIBRATION])
    whole = respond(N, 1e-3, StateStart(angle=0.01, angular_velocity=0.02), motion, GRAVITY)
    theta = _theta(whole, motion)
    late = HarmonicSum(motion.angular_frequency, motion.acceleration * np.exp(8j * motion.angular_frequency))
    # The state at 8 s from the solution's own parts: psi and Z, each differentiated exactly.
    w = motion.angular_frequency
    push = whole.forced * np.exp(8j * w)
    free = complex(TIMES.free_harmonic(whole)[128])
    m = w[whole.near]
    own = complex(-1e-3, float(whole.damped_frequency))
    speed = np.sum((1j * w * push).real) + (own * free + np.sum(whole.gain * np.exp(8j * m))).real
    state = StateStart(angle=float(theta[128]), angular_velocity=float(speed))
    np.testing.assert_allclose(_run(late, state)[:512], theta[128:], rtol=0, atol=1e-15)


def test_difference_of_identical_pendulums_knows_nothing_of_the_motion() -> None:
    """(P 27) at n1 = n2: the difference swings freely whatever the support does."""
    motion = add([SWELL, VIBRATION])
    starts = FreeStart(amplitude=0.006, phase=0.4), FreeStart(amplitude=0.012, phase=2.2)
    moved = [_run(motion, start) for start in starts]
    still = [_run(STILL, start) for start in starts]
    np.testing.assert_allclose(moved[0] - moved[1], still[0] - still[1], rtol=0, atol=1e-16)


class TestBeat:
    """(P 30), (P 31): free swing plus beta sin(nu t) sin((n - nu) t + delta)."""

    NU = math.pi / 120
    ALPHA, DELTA = 8e-4, 0.6

    def _beat(self, sign: float) -> np.ndarray:
        m = N - 2 * self.NU
        beta = sign * N**2 / (N + m) * (self.ALPHA / GRAVITY) / self.NU
        return beta * np.sin(self.NU * T) * np.sin((N - self.NU) * T + self.DELTA)

    def _simulated(self) -> np.ndarray:
        start = FreeStart(amplitude=0.006, phase=0.4)
        free = 0.006 * np.cos(N * T + 0.4)
        return _run(_motion((N - 2 * self.NU, self.ALPHA, self.DELTA)), start, 0.0) - free

    def test_corrected_sign_holds(self) -> None:
        np.testing.assert_allclose(self._simulated(), self._beat(-1.0), rtol=0, atol=1e-15)

    def test_printed_sign_fails(self) -> None:
        assert np.max(np.abs(self._simulated() - self._beat(+1.0))) > 0.01

    def test_two_minute_beat_of_ten_milliradians(self) -> None:
        """8e-4 m/s^2 gives the paper's beat of two minutes and 10 mrad."""
        long = EvenTimes(Fraction(1, 4), 480)
        motion = _motion((N - 2 * self.NU, self.ALPHA, self.DELTA))
        response = respond(N, 0.0, FreeStart(amplitude=0.0, phase=0.0), motion, GRAVITY)
        envelope = np.abs(long.free_harmonic(response))
        assert np.max(envelope) == pytest.approx(0.010, rel=0.05)
        assert envelope[-1] < 0.03 * np.max(envelope)  # a sample before two minutes it has all but vanished

    def test_exact_resonance_grows_in_proportion_to_time(self) -> None:
        response = respond(N, 0.0, FreeStart(amplitude=0.0, phase=0.0), _motion((N, self.ALPHA, 0.0)), GRAVITY)
        free = TIMES.free_harmonic(response)
        np.testing.assert_allclose(np.abs(free), N * self.ALPHA / GRAVITY / 2 * T, rtol=0, atol=1e-16)


def test_forced_solution_far_from_resonance_follows_the_plumb_line() -> None:
    """A very slow acceleration tilts the vertical by -x''/g."""
    motion = _motion((1e-4, 0.1, 0.0))
    theta = _run(motion, FreeStart(amplitude=0.0, phase=0.0))
    np.testing.assert_allclose(theta, -0.1 / GRAVITY * np.cos(1e-4 * T), rtol=1e-6)
