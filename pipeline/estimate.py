"""What every method returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.arrays import Floats

COLOUR_SECONDS = 4.0  # length of the blocks in which a residual is compared with a swing


@dataclass(frozen=True)
class Estimate:
    """Frequency of the second pendulum, as one method has it, in the record's own time."""

    frequency: float  # circular, at infinitesimal arc, undamped, rad s-1
    uncorrected: float  # the same from the plain slope of the difference's phase, rad s-1
    sigma: float  # 1 sigma of `frequency` from reading noise, rad s-1
    noise: float  # 1-sigma residual of the difference, rad (equivalent white reading noise)
    damping_rate: float  # gamma2 used or fitted, s-1
    samples: int  # of the difference that were used
    residual_colour: float = 1.0  # power of the residual near the swing over white noise's of the same total
    shifts: Mapping[str, Floats] | None = None
    """Phases that the method took off the difference's, (k,) rad at the envelope's instants, by `correction.PARTS`;
    None: the frequency comes in another way."""
    finite_arc: float = 0.0  # part of the correction that is due to the finite arc, rad s-1
    acceleration_reduced: bool = False  # whether the support's acceleration was reduced as it acts on real pendulums
    of_mean: bool = False
    """Whether it is that of the mean of gravity over the record, and the periods' uncertainty is in `sigma`; else it is
    that of a phase's slope."""
    parts: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    """Entries of the ledger within the correction, by name: value and 1 sigma, mGal, and words."""
    shares: Mapping[str, float] = field(default_factory=lambda: {"reading": 1.0})
    """Of the square of `sigma`, by source; they add up to 1."""
