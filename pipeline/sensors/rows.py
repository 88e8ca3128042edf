"""The difference as an identity makes it of a first trace that is late or mis-scaled: rows of the least squares."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from data_schemas.scratch import by_portions
from pipeline.arrays import Floats
from pipeline.prepared import Prepared
from pipeline.projection.solve import ProjectionFit
from pipeline.projection.uniform import UniformProblem, oscillation
from pipeline.sensors.departures import DAMPING
from pipeline.sensors.places import Places, Response
from pipeline.sensors.shifting import advanced

PROBE_DELAY, PROBE_GAIN, PROBE_DAMPING = 1e-3, 1e-3, 1e-6  # s, 1, s-1: steps of the finite differences
_NUDGE = 1e-7  # of the frequency, for central differences


def read(theta: Floats, step: float, frequency: float, delay: float, gain: float) -> Floats:
    """The first pendulum behind a trace that is late and of wrong gain; its ends and gaps as they were read."""
    moved = advanced(theta, step, delay, frequency)

    def either(late: Floats, known: Floats) -> Floats:
        return np.asarray(np.where(np.isnan(late), known, late) / (1.0 + gain))

    return by_portions(either, moved, theta)


class LinearRows:
    """Rows of the linear identity, from its fit to the record; see `departures.Rows`.

    Nothing is kept but the states from which the responses of each portion follow.
    """

    def __init__(self, prepared: Prepared, fit: ProjectionFit, places: Places) -> None:
        self._prepared, self._fit, self._places = prepared, fit, places
        self.parts: Sequence[slice] = places.parts
        self._apart = prepared.observation.damping_difference
        self._free_damping = prepared.known_damping is None
        n, gamma = fit.frequency, fit.damping_rate
        self._nudge = _NUDGE * n
        self._plain = self._responding(places.theta)
        self._by_frequency = [self._responding(places.theta, n=n + sign * self._nudge) for sign in (1.0, -1.0)]
        signs = (1.0, -1.0) if self._free_damping else ()
        self._by_damping = [self._responding(places.theta, gamma=gamma + sign * self._nudge) for sign in signs]

    def _responding(
        self, theta: Floats, *, n: float | None = None, gamma: float | None = None, apart: float = 0.0
    ) -> Response:
        """The response to a first pendulum, at the fitted parameters or others."""
        seen = self._prepared.observation
        problem = UniformProblem(
            theta, theta, self._places.step, self._prepared.nominal, seen.frequency_ratio, self._apart + apart
        )
        problem.respond(self._fit.frequency if n is None else n, self._fit.damping_rate if gamma is None else gamma)
        return self._places.response(problem)

    @functools.cached_property
    def _late(self) -> Response:
        places = self._places
        return self._responding(read(places.theta, places.step, self._fit.frequency, PROBE_DELAY, 0.0))

    @functools.cached_property
    def _damped(self) -> Response:
        return self._responding(self._places.theta, apart=PROBE_DAMPING)

    def tangents(self, number: int) -> Floats:
        """See `Rows`."""
        time = self._places.time(self.parts[number])
        gamma, coefficient = self._fit.damping_rate, self._fit.coefficient
        turn = np.exp(complex(-gamma, oscillation(self._fit.frequency, gamma)) * time)
        free = complex(coefficient[1], coefficient[0]) * turn  # its imaginary part is the free swing
        up, down = (response(number) for response in self._by_frequency)
        rows = [(up - down) / (2.0 * self._nudge) + time * free.real, turn.real, turn.imag, np.ones(time.size)]
        if self._free_damping:
            up, down = (response(number) for response in self._by_damping)
            rows.append((up - down) / (2.0 * self._nudge) - time * free.imag)
        return np.stack(rows)

    def columns(self, number: int, count: int) -> Floats:
        """See `Rows`."""
        plain = self._plain(number)
        # the response is in proportion to the trace
        columns = [
            (self._late(number) - plain) / PROBE_DELAY,
            plain * ((1.0 / (1.0 + PROBE_GAIN) - 1.0) / PROBE_GAIN),
        ]
        if count > DAMPING:
            columns.append((self._damped(number) - plain) / PROBE_DAMPING)
        return np.stack(columns)
