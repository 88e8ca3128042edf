"""The difference as either identity makes it of the first trace, its tangents, and what is left of the readings.

All three lie at the readings of the difference where its times are uneven, else on the grid of the first pendulum, at
marks a finer one than was read, where the residual is missing between the marks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.arrays import Floats
from pipeline.prepared import Prepared
from pipeline.projection.solve import ProjectionFit
from pipeline.projection.uniform import oscillation
from pipeline.sensors.departures import Rows
from pipeline.sensors.places import Places
from pipeline.sensors.rows import LinearRows


@dataclass(frozen=True)
class Fitted:
    """An identity fitted to a record on a uniform grid.

    Attributes
    ----------
    rows : Rows
        What departures of the first trace do, and tangents by n2, the start, the offset and, where it is fitted,
        gamma2; any units but that of n2, rad s-1.
    places : Places
        The grid of the first pendulum and where the rows lie.
    residual : (n,) array
        rad, NaN = missing or wild.
    noise, colour : float
        Its 1 sigma, rad, and its power near the swing over white.
    frequency, damping_rate : float
        n2, rad s-1; gamma2, s-1.
    """

    rows: Rows
    places: Places
    residual: Floats
    noise: float
    colour: float
    frequency: float
    damping_rate: float

    @property
    def eigenvalue(self) -> complex:
        """Of the free swing, s-1."""
        return complex(-self.damping_rate, oscillation(self.frequency, self.damping_rate))


def linear(prepared: Prepared, fit: ProjectionFit) -> Fitted:
    """The linear identity, from its fit to the record."""
    from pipeline.methods.projection import residual_colour

    places = Places.of(prepared)
    return Fitted(
        rows=LinearRows(prepared, fit, places),
        places=places,
        residual=fit.residual,
        noise=fit.noise,
        colour=residual_colour(fit, prepared),
        frequency=fit.frequency,
        damping_rate=fit.damping_rate,
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
    from pipeline.sensors.nonlinear_rows import NonlinearRows

    iteration = begin(prepared, fit)
    found = fit_inversion(iteration, fit_damping=prepared.known_damping is None)
    places = Places.of(prepared)
    residual = whole_residual(prepared, iteration, found.limit)
    shown = replace(fit, frequency=found.frequency, noise=found.noise, samples=found.samples, residual=residual)
    return Fitted(
        rows=NonlinearRows(prepared, fit, places, iteration),
        places=places,
        residual=residual,
        noise=found.noise,
        colour=residual_colour(shown, prepared),
        frequency=found.frequency,
        damping_rate=found.damping_rate,
    )
