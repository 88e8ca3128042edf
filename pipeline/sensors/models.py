"""The difference as either identity makes it of the first trace, its tangents, and what is left of the readings.

All three lie at the readings of the difference where its times are uneven, else on the grid of the first pendulum, at
marks a finer one than was read, where the residual is missing between the marks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.prepared import Prepared
from pipeline.projection.solve import ProjectionFit, UniformProblem, oscillation
from pipeline.sensors.departures import Model
from pipeline.sensors.places import Places
from pipeline.sensors.shifting import advanced

_NUDGE = 1e-7  # of the frequency, for central differences


@dataclass(frozen=True)
class Fitted:
    """An identity fitted to a record on a uniform grid.

    Attributes
    ----------
    model : callable
        See `departures.Model`.
    places : Places
        The grid of the first pendulum and where the rows lie.
    tangents : (p, n) array
        By n2, the start, the offset and, where it is fitted, gamma2; any units but that of n2, rad s-1.
    residual : (n,) array
        rad, NaN = missing or wild.
    noise, colour : float
        Its 1 sigma, rad, and its power near the swing over white.
    frequency, damping_rate : float
        n2, rad s-1; gamma2, s-1.
    """

    model: Model
    places: Places
    tangents: Floats
    residual: Floats
    noise: float
    colour: float
    frequency: float
    damping_rate: float

    @property
    def eigenvalue(self) -> complex:
        """Of the free swing, s-1."""
        return complex(-self.damping_rate, oscillation(self.frequency, self.damping_rate))


def read(theta: Floats, step: float, frequency: float, delay: float, gain: float) -> Floats:
    """The first pendulum behind a trace that is late and of wrong gain; its ends and gaps as they were read."""
    moved = advanced(theta, step, delay, frequency)
    return np.where(np.isnan(moved), theta, moved) / (1.0 + gain)


def linear(prepared: Prepared, fit: ProjectionFit) -> Fitted:
    """The linear identity, from its fit to the record."""
    from pipeline.methods.projection import residual_colour

    seen, places = prepared.observation, Places.of(prepared)
    theta, step, gamma, frequency = places.theta, places.step, fit.damping_rate, fit.frequency

    def response(series: Floats, n: float, apart: float, decay: float = gamma) -> Floats:
        problem = UniformProblem(series, series, step, prepared.nominal, seen.frequency_ratio, apart)
        problem.respond(n, decay)
        return places.at_rows(problem.response)

    def model(delay: float, gain: float, apart: float) -> Floats:
        trace = read(theta, step, frequency, delay, gain)
        return response(trace, frequency, seen.damping_difference + apart)

    time = places.time
    lam = complex(-gamma, oscillation(frequency, gamma))
    turn = np.exp(lam * time)
    free = complex(fit.coefficient[1], fit.coefficient[0]) * turn  # its imaginary part is the free swing
    nudge = _NUDGE * frequency
    up, down = (response(theta, frequency + sign * nudge, seen.damping_difference) for sign in (1.0, -1.0))
    by_frequency = (up - down) / (2.0 * nudge) + time * free.real
    rows = [by_frequency, turn.real, turn.imag, np.ones(time.size)]
    if prepared.known_damping is None:
        up, down = (response(theta, frequency, seen.damping_difference, gamma + sign * nudge) for sign in (1.0, -1.0))
        rows.append((up - down) / (2.0 * nudge) - time * free.imag)
    return Fitted(
        model=model,
        places=places,
        tangents=np.stack(rows),
        residual=fit.residual,
        noise=fit.noise,
        colour=residual_colour(fit, prepared),
        frequency=frequency,
        damping_rate=gamma,
    )


def nonlinear(prepared: Prepared, fit: ProjectionFit) -> Fitted:
    """The nonlinear identity, fitted here; the filters' reach at both ends is missing.

    Raises
    ------
    RefusedError
        Too few samples a swing.
    """
    from pipeline.inversion.prepare import begin, whole_residual
    from pipeline.inversion.solve import fit_inversion
    from pipeline.methods.projection import residual_colour

    iteration = begin(prepared, fit)
    found = fit_inversion(iteration, fit_damping=prepared.known_damping is None)
    inside, apart_now = iteration.motion.inside, prepared.observation.damping_difference
    places = Places.of(prepared)
    columns, plain, frequency = iteration.columns[1:], iteration.about.copy(), iteration.frequency
    tilt = iteration.damping_rate

    def rows_of(inner: Floats) -> Floats:
        whole = np.full(places.theta.size, np.nan)
        whole[inside] = inner
        return places.at_rows(whole)

    def model(delay: float, gain: float, apart: float) -> Floats:
        trace = read(places.theta, places.step, frequency, delay, gain)
        other = begin(prepared, replace(fit, damping_rate=tilt), trace, apart_now + apart)
        other.adopt(iteration)
        other.sweep()
        return rows_of(other.columns[0])

    rows = [columns[2], columns[0], columns[1], np.ones(plain.size)]
    if prepared.known_damping is None:
        rows.append(np.linspace(1.0, -1.0, plain.size) * plain)
    residual = whole_residual(prepared, iteration, found.limit)
    shown = replace(fit, frequency=found.frequency, noise=found.noise, samples=found.samples, residual=residual)
    return Fitted(
        model=model,
        places=places,
        tangents=np.stack([rows_of(row) for row in rows]),
        residual=residual,
        noise=found.noise,
        colour=residual_colour(shown, prepared),
        frequency=found.frequency,
        damping_rate=found.damping_rate,
    )
