"""What of the first pendulum and of heave enters the nonlinear identity; it does not change while that is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.scratch import portions, room
from pipeline.arrays import Floats
from pipeline.harmonics.envelope import Envelope, fill
from pipeline.inversion.filters import design


@dataclass(frozen=True)
class Motion:
    """The first pendulum and heave, of the samples less the ends that the filters lose.

    Attributes
    ----------
    inside : slice
        These samples, in the record.
    low, bend : (m,) arrays
        theta1 free of the noise above three times the swing, rad; `n2^2 w = (theta1'' + 2 gamma1 theta1') / ratio^2`,
        s-2.
    vertical : (m,) array or None
        z'', m s-2, up positive.
    shift : float
        What the noise of theta1 that the filters let pass adds to the factor of sin d on average, s-2.
    third : bool
        Whether the third harmonic was computed from the swing instead of read.
    """

    inside: slice
    low: Floats
    bend: Floats
    vertical: Floats | None
    shift: float
    third: bool

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """What is read portion by portion."""
        return (self.low, self.bend) if self.vertical is None else (self.low, self.bend, self.vertical)

    def pull(self, gravity: float, part: slice = slice(None)) -> Floats:
        """1 + zeta, of some samples."""
        if self.vertical is None:
            return np.ones(self.low[part].size)
        return np.asarray(1.0 + self.vertical[part] / gravity)


def motion(
    theta: Floats,
    vertical: Floats | None,
    step: float,
    frequency: float,
    ratio: float,
    damping_rate: float,
    noise: float,
    envelope: Envelope | None = None,
) -> Motion:
    """Filter the first pendulum.

    Parameters
    ----------
    theta : (n,) array
        First pendulum, rad, all samples, `step` seconds apart.
    vertical : (n,) array or None
        z'', m s-2.
    frequency, ratio, damping_rate : float
        n2 about which the filters are exact, rad s-1; n1/n2; gamma1, s-1.
    noise : float
        White reading noise of theta, rad (0 where not known).
    envelope : Envelope, optional
        Where it is given the swing's third harmonic is computed from it and not read: noise there comes back to the
        swing nine times as strong, and more of it than of any other.
    """
    filters = design(frequency * ratio, step, damping_rate, envelope is not None)
    reach = filters.reach
    count = theta.size - 2 * reach
    low, bend = room(count), room(count)
    for part in portions(count, low, bend, theta):
        around = theta[part.start : part.stop + 2 * reach]
        low[part] = np.correlate(around, filters.low, "valid")
        curved = np.correlate(around, filters.curvature, "valid")
        if envelope is not None:
            time = step * np.arange(part.start + reach, part.stop + reach)
            curved -= (3.0 * frequency * ratio) ** 2 * third_harmonic(envelope, time)
        bend[part] = curved * ratio**-2
    inside = slice(reach, reach + count)
    return Motion(
        inside=inside,
        low=low,
        bend=bend,
        vertical=None if vertical is None else vertical[inside],
        # mean of 1/cos theta1 and of theta1 w
        shift=noise**2 * (0.5 * frequency**2 * filters.noise_low + filters.noise_product * ratio**-2),
        third=envelope is not None,
    )


def third_harmonic(envelope: Envelope, time: Floats) -> Floats:
    """`-(A^3/192) cos 3 phi` of the first pendulum's swing, a real pendulum's own, at given times; rad."""
    cube = fill(envelope.first) ** 3 / -192.0
    slow = np.interp(time, envelope.time, cube.real) + 1j * np.interp(time, envelope.time, cube.imag)
    return np.asarray((slow * np.exp(3j * envelope.carrier * time)).real)
