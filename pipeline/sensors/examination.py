"""The first trace examined against the difference, and put right where the record tells how.

A delay or a gain is corrected where it stands four sigmas out, moves gravity by more than a hundredth of a milligal
and leaves nothing else unexplained. A wrong sign leaves far more than the right one; periods that were stated for the
wrong pendulums look the same. Where no damping is stated, a delay and an unequal damping of the pendulums look alike
unless the swell tells them apart: pendulums that decay are told their difference first (`damping.py`); of others the
correction of the one serves the other, and the flag says so. A heave that is told from the phase leaves nothing to
tell a delay by: such records are not corrected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import by_portions, portions
from pipeline.arrays import readings
from pipeline.flags import DAMPING_ASSUMED
from pipeline.observation import Observation
from pipeline.prepared import Prepared, prepare
from pipeline.sensors.damping import with_damping_told
from pipeline.sensors.departures import DAMPING, DELAY, GAIN
from pipeline.sensors.places import Places
from pipeline.sensors.roles import in_their_places, trimmed
from pipeline.sensors.shifting import advanced
from pipeline.sensors.state import (
    NEGLIGIBLE,
    SIGNIFICANT,
    State,
    fit,
    made_by_noise,
    milligal,
    stands_out,
    unexplained,
)

SIGN_TELLS, SIGN_ALONE_TELLS = 0.7, 0.5  # residual with the other sign over that with the one given
ROUNDS = 6
STARTS = (0.0, 0.1, -0.1, 0.2, -0.2)  # s, tried in turn until one leads to what explains the record
SETTLED = 0.1  # sigma, of the last round's change
LEAST_APART = 1e-9  # relative difference of the frequencies
MOST_DELAY, MOST_GAIN = 0.4, 0.5  # s, 1; farther a swing cannot be told from the next one
WORDS = {
    "delay": "traces-time-offset",
    "gain": "traces-gain",
    "sign": "traces-sign",
    "exchanged": "traces-exchanged",
    "undecided": "traces-time-offset-or-damping",
}


@dataclass(frozen=True)
class Examination:
    """What was found and put right.

    Attributes
    ----------
    prepared : Prepared
        The record to reduce, corrected.
    delay, gain : float
        By how much the first trace was late, s, and too large, 1; 0 where nothing was found.
    delay_sigma, gain_sigma : float
        1 sigma of both as the record tells them; NaN where it was not examined.
    doubt : float
        1 sigma of n2, rad s-1, from what was corrected or could have been.
    flags : tuple of str
        Names from `pipeline.flags.MEANINGS`.
    """

    prepared: Prepared
    delay: float = 0.0
    gain: float = 0.0
    delay_sigma: float = float("nan")
    gain_sigma: float = float("nan")
    doubt: float = 0.0
    flags: tuple[str, ...] = ()

    @property
    def attributes(self) -> dict[str, float]:
        """What was corrected, and how well the record tells it, as attributes of a result."""
        return {
            "first_trace_delay_s": self.delay,
            "first_trace_delay_sigma_s": self.delay_sigma,
            "first_trace_gain_error": self.gain,
            "first_trace_gain_error_sigma": self.gain_sigma,
        }


def examine(seen: Observation) -> Examination:
    """Prepare an observation, its first trace examined and put right.

    Raises
    ------
    RefusedError
        The record cannot be prepared, or its difference is none.
    """
    prepared = prepare(seen)
    placed, swapped = in_their_places(prepared)
    if swapped:
        prepared = prepare(placed)
    flags = (WORDS["exchanged"],) if swapped else ()
    try:
        if abs(prepared.observation.frequency_ratio - 1.0) < LEAST_APART and prepared.observation.restoring == "linear":
            return Examination(prepared, flags=flags)  # the difference does not feel the first pendulum
        state, doubt = with_damping_told(State.of(prepared))
        found = _departed(state)
        if found.prepared is not state.prepared and prepared.known_damping is None:
            state, doubt = with_damping_told(State.of(found.prepared, state.real))
            found = replace(found, prepared=state.prepared)
    except RefusedError:  # whoever asks for a method hears why from it
        return Examination(prepared, flags=flags)
    unknown = (DAMPING_ASSUMED,) if doubt else ()
    return replace(found, doubt=float(np.hypot(found.doubt, doubt)), flags=(*flags, *unknown, *found.flags))


def _departed(state: State) -> Examination:
    """Delay, gain and sign of the first trace."""
    prepared = state.prepared
    seen = prepared.observation
    plain = Examination(
        prepared, delay_sigma=float(state.found.sigma[DELAY]), gain_sigma=float(state.found.sigma[GAIN])
    )
    strange, sign = unexplained(state), 1.0
    if not strange and (not stands_out(state) or made_by_noise(state)):
        return plain
    if strange:  # not the readings' noise: nothing is known of either
        plain = Examination(prepared)
    done = _put_right(prepared, state, sign)
    if done is None:
        other = State.of(prepare(replace(seen, theta=by_portions(np.negative, seen.theta))))
        if other.fitted.noise < SIGN_TELLS * state.fitted.noise:
            sign, done = -1.0, _put_right(prepared, other, -1.0)
        if done is None and other.fitted.noise < SIGN_ALONE_TELLS * state.fitted.noise:
            return Examination(other.prepared, flags=(WORDS["sign"],))  # heave, say, hides the rest
    if done is None:
        return plain  # something else is the matter as well, and may be all of it
    delay, gain, wanted, state = done
    name = "delay"
    if DELAY in wanted and prepared.known_damping is None:
        # a delay turns what the first trace does to the difference as an unequal damping would
        third = fit(state.prepared, state.fitted, [DELAY, GAIN, DAMPING])
        if abs(delay) < SIGNIFICANT * third.sigma[DELAY]:
            name = "undecided"
    wrong = {"sign": sign < 0.0, name: DELAY in wanted, "gain": GAIN in wanted}
    return Examination(
        state.prepared,
        delay=delay,
        gain=gain,
        delay_sigma=float(state.found.sigma[DELAY]),
        gain_sigma=float(state.found.sigma[GAIN]),
        doubt=fit(state.prepared, state.fitted, wanted).effect_sigma if wanted else 0.0,
        flags=tuple(WORDS[each] for each, is_wrong in wrong.items() if is_wrong),
    )


def _put_right(prepared: Prepared, state: State, sign: float) -> tuple[float, float, list[int], State] | None:
    """Delay and gain that explain the record, and which of them stand out; None where none do."""
    if not stands_out(state):
        return None if unexplained(state) else (0.0, 0.0, [], state)
    for start in STARTS:
        done = _followed(prepared, state.real, sign, start)
        if not unexplained(done[3]) and (done[2] or sign < 0.0):
            return done
    return None


def _followed(prepared: Prepared, real: bool, sign: float, start: float) -> tuple[float, float, list[int], State]:
    """Delay and gain by Gauss-Newton, which of them stand out, and the corrected record."""
    seen, wanted = prepared.observation, [DELAY, GAIN]
    delay, gain = start, 0.0
    state = State.of(prepare(corrected(seen, prepared, delay, sign)), real)
    for _ in range(ROUNDS):
        found = fit(state.prepared, state.fitted, wanted)
        step = dict(zip(wanted, found.value, strict=True))
        # what a swing is multiplied by: right beyond the first order, so that large delays are reached
        frequency = state.fitted.frequency
        factor = complex(1.0 - step.get(GAIN, 0.0), frequency * step.get(DELAY, 0.0))
        delay += float(np.angle(factor)) / frequency
        if GAIN in wanted:
            gain = (1.0 + gain) / abs(factor) - 1.0
        if abs(delay) > MOST_DELAY or abs(gain) > MOST_GAIN:
            return 0.0, 0.0, [], State.of(prepare(corrected(seen, prepared, 0.0, sign)), real)
        state = State.of(prepare(corrected(seen, prepared, delay, sign * (1.0 + gain))), state.real)
        # the fit before had the misfit for noise
        total = {DELAY: delay, GAIN: gain}
        sigma, by_unit = state.found.sigma, state.found.by_unit
        far = [
            which
            for which in wanted
            if abs(total[which]) > SIGNIFICANT * sigma[which]
            and milligal(total[which] * by_unit[which], state.prepared) > NEGLIGIBLE
        ]
        if len(far) < len(wanted):
            wanted = far
            delay, gain = (delay if DELAY in far else 0.0), (gain if GAIN in far else 0.0)
            state = State.of(prepare(corrected(seen, prepared, delay, sign * (1.0 + gain))), state.real)
            if not wanted:
                break
            continue  # what is left was found beside what is not
        rest = fit(state.prepared, state.fitted, wanted)
        if np.all(np.abs(rest.value) < SETTLED * rest.sigma):
            break
    return delay, gain, wanted, state


def corrected(seen: Observation, prepared: Prepared, delay: float, gain: float) -> Observation:
    """The observation with its first trace advanced by the delay and divided by the gain (with its sign)."""
    own = prepared.observation.theta
    if not delay:
        return trimmed(replace(seen, theta=by_portions(lambda part: part / gain, own)))
    places = Places.of(prepared)
    theta = places.at_readings(advanced(places.theta, places.step, delay, prepared.nominal))
    broken = readings(own) < own.size
    for part in portions(theta.size, theta, own, seen.time):
        here = theta[part]
        here /= gain
        if broken:
            # a reading comes from about `delay` later
            later = seen.time[part] + delay - 0.5 * places.step
            here[np.isnan(own[np.searchsorted(seen.time, later).clip(0, theta.size - 1)])] = np.nan
    return trimmed(replace(seen, theta=theta))
