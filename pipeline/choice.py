"""`auto`: `projection` or `shooting`, chosen from what the record says and, where it does not say, from residuals.

What the record states of `restoring` is obeyed. Where it states nothing, the linear and the nonlinear identity are both
fitted: the smaller residual decides; where it is not decisively smaller what parts them goes into sigma. Linear
pendulums are left to `projection`, real ones to `shooting`: `general` would save a third of its time, and what its
formulas neglect no sigma of its own can say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.scratch import portions
from pipeline.gaps import require_bridges
from pipeline.methods.projection import residual_colour
from pipeline.prepared import Prepared
from pipeline.projection.sampling import linear_fit

if TYPE_CHECKING:
    from pipeline.inversion.prepare import Inverted
    from pipeline.projection.solve import ProjectionFit

DECISIVE = 5.0  # difference of log likelihood: odds of 150 to 1
NEGLIGIBLE = 0.01  # mGal
FLOOR = 1e-8  # of the difference's amplitude: smaller residuals are rounding
COLOURED = 3.0  # power of a residual near the swing over white from which it shows what a method lacks
MILLIGAL = 1e-5  # m s-2


@dataclass(frozen=True)
class Choice:
    """The method, the reason in words, what it may be wrong by (1 sigma, rad s-1 of n2), and whether it is open."""

    method: str
    reason: str
    doubt: float = 0.0
    undecided: bool = False


def choose(prepared: Prepared) -> Choice:
    """Choose for a record."""
    seen = prepared.observation
    if seen.restoring == "linear":
        return Choice("projection", "the record says restoring = linear: the linear identity is exact")
    require_bridges(prepared.long_gaps, prepared.whole_step)
    if seen.restoring == "sine":
        return Choice("shooting", "the record says restoring = sine: the nonlinear identity is exact")
    from pipeline.inversion.prepare import invert

    still = invert(prepared, look_for_heave=False)
    linear = linear_fit(prepared, bridged=True)
    change = abs(still.frequency - linear.frequency)
    fits = not _coloured(still.noise, still.colour, prepared)
    if _milligal(change, prepared) < NEGLIGIBLE and fits:
        told = f"the finite arc and the support's motion amount to {_milligal(change, prepared):.4f} mGal only"
        return Choice("projection", f"{told}: the linear identity is adequate", change)
    likelihood = _likelihood(linear, still, prepared)
    if likelihood <= -DECISIVE or not _coloured(linear.noise, residual_colour(linear, prepared), prepared):
        return _decided(likelihood, change, heaved=not fits and seen.vertical is None)
    # neither fits: real pendulums in a heave that is not recorded leave such a residual, linear ones nothing;
    # heave that is told from the phase pays for its freedom (Akaike 1974)
    heaved = invert(prepared)
    change = abs(heaved.frequency - linear.frequency)
    likelihood = _likelihood(linear, heaved, prepared) + heaved.freedom
    return _decided(likelihood, change, heaved=heaved.heave is not None)


def _decided(likelihood: float, change: float, *, heaved: bool) -> Choice:
    """By the log likelihood of linear over real pendulums; `change` of n2 is at stake, rad s-1.

    `heaved`: the residual shows more than arcs and swell.
    """
    told = f"log likelihood ratio {abs(likelihood):.3g}"
    doubt = 0.0 if abs(likelihood) > DECISIVE else change
    hardly = "hardly " if doubt else ""
    if likelihood > 0.0:
        return Choice("projection", f"linear pendulums leave the {hardly}smaller residual ({told})", doubt, doubt > 0.0)
    heave = "; the phase shows a heave that is not recorded" if heaved else ""
    return Choice("shooting", f"real pendulums leave the {hardly}smaller residual ({told}){heave}", doubt, doubt > 0.0)


def _coloured(noise: float, colour: float, prepared: Prepared) -> bool:
    from pipeline.inversion.prepare import HEAVE_FLOOR

    amplitude = float(np.nanmedian(np.abs(prepared.blocks.difference)))
    return colour > COLOURED and noise > HEAVE_FLOOR * amplitude


def _likelihood(linear: ProjectionFit, real: Inverted, prepared: Prepared) -> float:
    """Log likelihood of linear pendulums over that of real ones, from the readings that both fits used."""
    straight = bent = 0.0
    count = 0
    for part in portions(linear.residual.size, linear.residual, real.residual):
        left, right = linear.residual[part], real.residual[part]
        both = np.isfinite(left) & np.isfinite(right)
        straight, bent = straight + float(np.sum(left[both] ** 2)), bent + float(np.sum(right[both] ** 2))
        count += int(both.sum())
    least = count * (FLOOR * float(np.nanmax(np.abs(prepared.blocks.difference)))) ** 2
    return 0.5 * count * float(np.log((bent + least) / (straight + least)))


def _milligal(change: float, prepared: Prepared) -> float:
    return 2.0 * prepared.observation.reference_gravity * change / prepared.nominal / MILLIGAL
