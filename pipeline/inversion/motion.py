"""What is known before the nonlinear fit: what of the first pendulum and of heave enters it."""

from __future__ import annotations

import numpy as np

from data_schemas.scratch import portions, room
from pipeline.arrays import Floats
from pipeline.inversion import kernels
from pipeline.inversion.filters import design


class Motion:
    """What is known before the fit: the first pendulum, its acceleration, heave, of the samples less the ends.

    Parameters
    ----------
    theta : (n,) array
        First pendulum, rad, whole, `step` seconds apart.
    vertical : (n,) array or None
        z'', m/s^2, up positive.
    frequency, ratio, damping_rate : float
        n2 about which the filters are exact, n1/n2, gamma1.
    noise : float
        White reading noise of theta, rad (0 where not known).
    third : (n,) array, optional
        The third harmonic of theta's swing, rad, where it is known better than read: noise there comes back to the
        swing nine times as strong, and more of it than of any other.

    Attributes
    ----------
    parts : list of slice
        Portions of the samples that the filters leave: whole blocks of the kernels' sums.
    """

    def __init__(
        self,
        theta: Floats,
        vertical: Floats | None,
        step: float,
        frequency: float,
        ratio: float,
        damping_rate: float,
        noise: float,
        third: Floats | None = None,
    ) -> None:
        filters = design(frequency * ratio, step, damping_rate, third is not None)
        reach = filters.reach
        count = theta.size - 2 * reach
        self.step, self.inside = step, slice(reach, reach + count)
        self.parts = list(portions(count, unit=kernels.BLOCK))
        self.low, self.curvature = room(count), room(count)
        self.vertical = None if vertical is None else vertical[self.inside]
        self.third, self.small = third is not None, True
        for part in portions(count, *self.arrays, theta, theta if third is None else third, unit=kernels.BLOCK):
            low, bend = self.low[part], self.curvature[part]
            around = theta[part.start : part.stop + 2 * reach]
            kernels.filter_both(around, filters.low, filters.curvature, low, bend)
            if third is not None:
                bend -= (3.0 * frequency * ratio) ** 2 * third[part.start + reach : part.stop + reach]
            bend *= ratio**-2
            self.small &= bool(max(-low.min(), low.max()) < kernels.SMALL)
        # mean of 1/cos and of theta1 w over the noise that the filters let pass
        self.shift = noise**2 * (0.5 * frequency**2 * filters.noise_low + filters.noise_product * ratio**-2)

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """What is read portion by portion."""
        return (self.low, self.curvature) if self.vertical is None else (self.low, self.curvature, self.vertical)

    def pull(self, gravity: float, part: slice = slice(None)) -> Floats:
        """1 + zeta, of some samples."""
        if self.vertical is None:
            return np.ones(self.low[part].size)
        return 1.0 + self.vertical[part] / gravity
