"""A record with an identity fitted to it, and whether what it says of the first trace stands out of its noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import readings
from pipeline.prepared import Prepared
from pipeline.projection.sampling import linear_fit
from pipeline.sensors.departures import DELAY, GAIN, Departures, fit_departures
from pipeline.sensors.models import Fitted, linear, nonlinear

SIGNIFICANT = 4.0  # sigmas
NEGLIGIBLE = 0.01  # mGal
VISIBLE, VISIBLE_AT_MARKS = 1e-5, 1e-4  # of the amplitude: a smaller residual tells of nothing
ABOVE_WHITE = 1.2  # residual over the noise that neighbouring readings leave unexplained
BETWEEN_MARKS = 3e-4  # of the first pendulum's swing as told from readings twice a swing; measured: 1e-4 and less
DRAWS = 3  # of noise that is added to see what noise does
COLOURED = 3.0  # power near the swing over white, from which a residual is not noise


@dataclass(frozen=True)
class State:
    """A record, the identity fitted to it, and what it says of the first trace."""

    prepared: Prepared
    real: bool
    fitted: Fitted
    found: Departures

    @staticmethod
    def of(prepared: Prepared, real: bool | None = None) -> State:
        """By the law given, by that of the record, or by the one that leaves less beside the departures."""
        stated = prepared.observation.restoring
        if real is None and stated is not None:
            real = stated == "sine"
        states = []
        laws = (False, True) if real is None else (real,)
        for law in laws:
            fitted = (nonlinear if law else linear)(prepared, linear_fit(prepared, bridged=law or len(laws) > 1))
            states.append(State(prepared, law, fitted, fit(prepared, fitted, [DELAY, GAIN])))
        return min(states, key=lambda state: state.left)

    @property
    def left(self) -> float:
        """1-sigma residual beside the departures, rad."""
        count = readings(self.fitted.residual)
        return self.fitted.noise * float(np.sqrt(max(1.0 - self.found.explained / count, 1e-30)))


def fit(prepared: Prepared, fitted: Fitted, wanted: list[int]) -> Departures:
    """Departures of a fitted record."""
    seen = prepared.observation
    noise = prepared.noise_theta if np.isfinite(prepared.noise_theta) else (seen.sigma_theta or fitted.noise)
    found = fit_departures(
        fitted.residual,
        fitted.rows,
        wanted,
        (fitted.noise, noise * fitted.places.thinness),
        (fitted.eigenvalue, fitted.places.step, 1.0 - seen.frequency_ratio**-2),
        fitted.places.spread,
    )
    if not fitted.places.between_readings:
        return found
    units = np.array([1.0 / fitted.frequency, 1.0, fitted.frequency])[wanted]
    return found.less_certain(BETWEEN_MARKS * units)


def stands_out(state: State) -> bool:
    """Whether delay or gain is out of the noise and matters."""
    seen, found = state.prepared.observation, state.found
    # an error of n1 - n2 within its stated uncertainty looks like a gain
    apart = max(abs(seen.frequency_ratio - 1.0), 1e-12)
    gain_sigma = np.hypot(found.sigma[GAIN], np.hypot(*seen.period_relative_uncertainty) / apart)
    far = (
        abs(found.value[GAIN]) > SIGNIFICANT * gain_sigma or abs(found.value[DELAY]) > SIGNIFICANT * found.sigma[DELAY]
    )
    return bool(milligal(np.abs(found.effect).sum(), state.prepared) > NEGLIGIBLE and far)


def made_by_noise(state: State) -> bool:
    """Whether what stands out is what the reading noise of the first trace makes of real pendulums.

    It reaches the difference through their nonlinear terms too, which 1 sigma leaves out: how far it moves delay and
    gain is seen by adding as much noise again, some times over.
    """
    prepared = state.prepared
    if not state.real or not prepared.noise_theta > 0.0:
        return False
    draw = np.random.default_rng(0)
    moved = []
    for _ in range(DRAWS):
        noise = draw.normal(0.0, prepared.noise_theta, prepared.whole.size)
        noisier = State.of(replace(prepared, whole=prepared.whole + noise), True)
        moved.append(noisier.found.value - state.found.value)
    scatter = np.sqrt(np.mean(np.square(moved), axis=0))
    return bool(np.all(np.abs(state.found.value) < SIGNIFICANT * scatter))


def milligal(change: float, prepared: Prepared) -> float:
    """Size of a change of n2 (rad s-1) in gravity."""
    return abs(2e5 * prepared.observation.reference_gravity * float(change) / prepared.nominal)


def unexplained(state: State) -> bool:
    """Whether the residual shows more than the readings' noise."""
    prepared, noise = state.prepared, state.fitted.noise
    visible = VISIBLE_AT_MARKS if state.fitted.places.between_readings else VISIBLE
    if noise < visible * float(np.nanmedian(np.abs(prepared.blocks.difference))):
        return False
    white = prepared.noise_difference
    return state.fitted.colour > COLOURED or bool(noise > ABOVE_WHITE * white)
