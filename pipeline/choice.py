"""`auto`: the cheapest adequate method, chosen from what the record says and, where it does not say, from residuals.

What the record states of `restoring` is obeyed. Where it states nothing, the linear and the nonlinear identity are both
fitted: the smaller residual decides; where it is not decisively smaller what parts them goes into sigma. Linear
pendulums are left to `projection`. Of real ones `general` is taken where what its formulas neglect is small beside
its sigma, else `shooting`, which neglects nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import portions
from pipeline.gaps import require_bridges
from pipeline.methods import method
from pipeline.methods.phases import passes_zero
from pipeline.methods.projection import residual_colour
from pipeline.prepared import Prepared, slow_variance
from pipeline.projection.sampling import linear_fit

if TYPE_CHECKING:
    from pipeline.inversion.prepare import Inverted
    from pipeline.projection.solve import ProjectionFit

DECISIVE = 5.0  # difference of log likelihood: odds of 150 to 1
NEGLIGIBLE = 0.01  # mGal
NEGLIGIBLE_SHARE = 0.1  # of sigma
FLOOR = 1e-8  # of the difference's amplitude: smaller residuals are rounding
SPARSE_FLOOR = 1e-5  # the same where the separated harmonics take the place of the exact inversion
ARC_LEFT, ACCELERATION_LEFT = 1e-4, 5e-4  # shares of both effects that `general` leaves, measured on simulated records
COLOURED = 3.0  # power of a residual near the swing over white from which it shows what a method lacks
MILLIGAL = 1e-5  # m s-2


@dataclass(frozen=True)
class Choice:
    """The method, the reason in words, and what the choice may be wrong by (1 sigma, rad s-1 of n2)."""

    method: str
    reason: str
    doubt: float = 0.0


def choose(prepared: Prepared) -> Choice:
    """Choose for a record."""
    seen = prepared.observation
    if seen.restoring == "linear":
        return Choice("projection", "the record says restoring = linear: the linear identity is exact")
    require_bridges(prepared.long_gaps, prepared.whole_step)
    from pipeline.inversion.prepare import invert

    try:
        still = invert(prepared, look_for_heave=False)
    except RefusedError:
        return _without_inversion(prepared)
    linear = linear_fit(prepared, bridged=True)
    change = abs(still.frequency - linear.frequency)
    fits = not _coloured(still.noise, still.colour, prepared)
    if _milligal(change, prepared) < NEGLIGIBLE and fits:
        return _negligible(_milligal(change, prepared))
    if seen.restoring == "sine":
        return _real(prepared, "the record says restoring = sine", heaved=not fits and seen.vertical is None)
    likelihood = _common_likelihood(linear, still, prepared)
    if likelihood <= 0.0 or not _coloured(linear.noise, residual_colour(linear, prepared), prepared):
        return _decided(prepared, likelihood, change, heaved=not fits and seen.vertical is None)
    # neither fits: real pendulums in a heave that is not recorded leave such a residual, linear ones nothing;
    # heave that is told from the phase pays for its freedom (Akaike 1974)
    heaved = invert(prepared)
    change = abs(heaved.frequency - linear.frequency)
    return _decided(
        prepared, _common_likelihood(linear, heaved, prepared) + heaved.freedom, change, heaved=heaved.heave is not None
    )


def _negligible(shift: float) -> Choice:
    return Choice(
        "projection",
        f"the finite arc and the support's motion amount to {shift:.4f} mGal only: the linear identity is adequate",
    )


def _decided(prepared: Prepared, likelihood: float, change: float, *, heaved: bool = False) -> Choice:
    """By the log likelihood of linear over real pendulums; `change` of n2 is at stake, rad s-1."""
    told = f"log likelihood ratio {abs(likelihood):.3g}"
    doubt = 0.0 if abs(likelihood) > DECISIVE else change
    hardly = "hardly " if doubt else ""
    if likelihood > 0.0:
        return Choice("projection", f"linear pendulums leave the {hardly}smaller residual ({told})", doubt)
    return _real(prepared, f"real pendulums leave the {hardly}smaller residual ({told})", doubt, heaved=heaved)


def _real(prepared: Prepared, why: str, doubt: float = 0.0, *, heaved: bool = False) -> Choice:
    """`general` where it is adequate, else `shooting`; `heaved`: the residual shows more than arcs and swell."""
    if heaved:
        return Choice("shooting", f"{why}; the phase shows a heave that is not recorded", doubt)
    if passes_zero(np.abs(prepared.blocks.difference)):
        return Choice("shooting", f"{why}; the amplitude passes near zero, where a phase means nothing", doubt)
    left = left_by_general(prepared)
    if left >= NEGLIGIBLE:
        return Choice("shooting", f"{why}; in this motion general may err by {left:.2g} mGal", doubt)
    try:
        general = method("general")(prepared)
    except RefusedError:
        return Choice("shooting", f"{why}; general declines the record", doubt)
    sigma = _milligal(general.sigma, prepared)
    if _coloured(general.noise, general.residual_colour, prepared) and left > NEGLIGIBLE_SHARE * sigma:
        return Choice("shooting", f"{why}; general leaves a residual with structure near the swing", doubt)
    return Choice("general", f"{why}; general errs by less than {max(left, 1e-4):.1g} mGal in this motion", doubt)


def left_by_general(prepared: Prepared) -> float:
    """What `general` may leave of the finite arcs and of the support's acceleration, mGal."""
    envelope, gravity = prepared.blocks, prepared.observation.reference_gravity
    second = envelope.first - envelope.difference
    largest = float(np.nanmax(np.maximum(np.abs(envelope.first), np.abs(second))))
    # an arc's effect on the difference is the larger the smaller the difference is
    share = largest / float(np.nanmedian(np.abs(envelope.difference)))
    arc = gravity * largest**2 / 8.0 * max(share, 1.0)
    browne = 0.5 * gravity * slow_variance(prepared)
    return float(np.hypot(ARC_LEFT * arc, ACCELERATION_LEFT * browne)) / MILLIGAL


def _coloured(noise: float, colour: float, prepared: Prepared) -> bool:
    from pipeline.inversion.prepare import HEAVE_FLOOR

    amplitude = float(np.nanmedian(np.abs(prepared.blocks.difference)))
    return colour > COLOURED and noise > HEAVE_FLOOR * amplitude


def _likelihood(linear: float, real: float, samples: int, floor: float, prepared: Prepared) -> float:
    """Log likelihood of linear pendulums over that of real ones, from the residuals, rad."""
    least = floor * float(np.nanmax(np.abs(prepared.blocks.difference)))
    return samples * float(np.log(np.hypot(real, least) / np.hypot(linear, least)))


def _common_likelihood(linear: ProjectionFit, real: Inverted, prepared: Prepared) -> float:
    """As `_likelihood`, over the readings that both fits used."""
    straight = bent = 0.0
    count = 0
    for part in portions(linear.residual.size, linear.residual, real.residual):
        left, right = linear.residual[part], real.residual[part]
        both = np.isfinite(left) & np.isfinite(right)
        straight, bent = straight + float(np.sum(left[both] ** 2)), bent + float(np.sum(right[both] ** 2))
        count += int(both.sum())
    return _likelihood(float(np.sqrt(straight / count)), float(np.sqrt(bent / count)), count, FLOOR, prepared)


def _without_inversion(prepared: Prepared) -> Choice:
    """Too few readings a swing for the nonlinear identity: the linear one, with and without the arcs' response."""
    from pipeline.arc_response import arc_response

    seen, envelope = prepared.observation, prepared.sliding
    inside = (seen.time >= envelope.time[0]) & (seen.time <= envelope.time[-1])
    shown = np.where(inside, seen.difference, np.nan)
    linear = linear_fit(replace(prepared, observation=replace(seen, difference=shown)))
    arc = linear
    for _ in range(3):  # the arcs' response turns with the frequency that it helps to find
        bent = shown - arc_response(prepared, arc.frequency, arc.damping_rate)
        arc = linear_fit(replace(prepared, observation=replace(seen, difference=bent)))
    change = abs(arc.frequency - linear.frequency)
    browne = 0.5 * seen.reference_gravity * slow_variance(prepared) / MILLIGAL
    shift = float(np.hypot(_milligal(change, prepared), browne))
    if shift < NEGLIGIBLE:
        return _negligible(shift)
    real = "projection" if passes_zero(np.abs(prepared.blocks.difference)) else "general"
    beats = "" if real == "general" else "; the amplitude passes near zero, where only exact forms hold"
    sparse = f"; too few readings a swing for shooting{beats}"
    if seen.restoring == "sine":
        return Choice(real, f"the record says restoring = sine{sparse}")
    likelihood = _likelihood(linear.noise, arc.noise, linear.samples, SPARSE_FLOOR, prepared)
    told = f"log likelihood ratio {abs(likelihood):.3g}"
    doubt = 0.0 if abs(likelihood) > DECISIVE else change
    hardly = "hardly " if doubt else ""
    if likelihood > 0.0:
        return Choice("projection", f"linear pendulums leave the {hardly}smaller residual ({told})", doubt)
    return Choice(real, f"finite arcs leave the {hardly}smaller residual ({told}){sparse}", doubt)


def _milligal(change: float, prepared: Prepared) -> float:
    return 2.0 * prepared.observation.reference_gravity * change / prepared.nominal / MILLIGAL
