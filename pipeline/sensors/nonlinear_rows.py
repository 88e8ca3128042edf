"""The same rows of the nonlinear identity: tangents from its own fit, departures by running it on a changed trace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from data_schemas.scratch import by_portions, release
from pipeline.arrays import Floats
from pipeline.inversion.iteration import Iteration
from pipeline.inversion.prepare import begin
from pipeline.prepared import Prepared
from pipeline.projection.solve import ProjectionFit
from pipeline.sensors.places import Places
from pipeline.sensors.rows import PROBE_DAMPING, PROBE_DELAY, PROBE_GAIN, read

_PROBES = ((PROBE_DELAY, 0.0, 0.0), (0.0, PROBE_GAIN, 0.0), (0.0, 0.0, PROBE_DAMPING))
"""Delay, gain and change of gamma1 - gamma2 of each."""


class NonlinearRows:
    """Rows of the nonlinear identity, from its fit to the record; see `departures.Rows`.

    They are NaN within the filters' reach of both ends.
    """

    def __init__(self, prepared: Prepared, fit: ProjectionFit, places: Places, iteration: Iteration) -> None:
        self._prepared, self._fit, self._places, self._iteration = prepared, fit, places, iteration
        self.parts: Sequence[slice] = places.parts
        self._plain: Floats | None = None
        self._slopes: list[Floats] = []  # by delay, gain and damping difference, as far as they were asked for

    def tangents(self, number: int) -> Floats:
        """See `Rows`."""
        iteration = self._iteration
        _, angle, rate, frequency = iteration.columns
        whole: list[Callable[[slice], Floats]] = [
            frequency.__getitem__,
            angle.__getitem__,
            rate.__getitem__,
            lambda part: np.ones(part.stop - part.start),
        ]
        if self._prepared.known_damping is None:
            unit = -2.0 / (iteration.count - 1)
            whole.append(lambda part: (np.arange(part.start, part.stop) * unit + 1.0) * iteration.about[part])
        rows = np.stack([self._at_rows(number, inner) for inner in whole])
        release(iteration.columns)
        return rows

    def columns(self, number: int, count: int) -> Floats:
        """See `Rows`."""
        if self._plain is None:
            self._plain = self._model(0.0, 0.0, 0.0)
        for probe in _PROBES[len(self._slopes) : count]:
            size = sum(probe)
            self._slopes.append(
                by_portions(lambda moved, plain, size=size: (moved - plain) / size, self._model(*probe), self._plain)
            )
        rows = np.stack([self._at_rows(number, slope.__getitem__) for slope in self._slopes[:count]])
        release(*self._slopes)
        return rows

    def _at_rows(self, number: int, inner: Callable[[slice], Floats]) -> Floats:
        """A series, given by slices of what the filters leave of the grid, at one portion of the rows."""
        first, count = self._iteration.motion.inside.start, self._iteration.count

        def padded(part: slice) -> Floats:
            out = np.full(part.stop - part.start, np.nan)
            low, high = max(part.start - first, 0), min(part.stop - first, count)
            if low < high:
                out[low + first - part.start : high + first - part.start] = inner(slice(low, high))
            return out

        return self._places.at_rows(padded, self.parts[number])

    def _model(self, delay: float, gain: float, apart: float) -> Floats:
        """The difference that they make of the first trace, other parameters held."""
        iteration, places = self._iteration, self._places
        trace = read(places.theta, places.step, iteration.frequency, delay, gain)
        held = replace(self._fit, damping_rate=iteration.damping_rate)
        other = begin(self._prepared, held, trace, self._prepared.observation.damping_difference + apart)
        other.adopt(iteration)
        other.sweep()
        return by_portions(np.copy, other.columns[0])  # without all else that the other keeps
