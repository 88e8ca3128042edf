"""Which trace is the pendulum and which the difference: told by the swell, which a difference hardly shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scratch import by_portions
from pipeline.observation import Observation, span
from pipeline.prepared import Prepared

LEAST_SLOW = 1e-4  # rad, of slow motion, from which it tells
LEAST_SHARE = 0.05  # of the swing: beats leak as much into it
ABOVE_NOISE = 4.0
SWAPPED = 10.0  # slow motion of the difference over that of the first pendulum
NO_DIFFERENCE = 0.25  # from which it is that of a pendulum, or of a sum


def slow_share(prepared: Prepared) -> float:
    """Slow motion of the difference over that of the first pendulum; NaN where neither shows any."""
    envelope = prepared.blocks
    noise = np.nan_to_num(np.array([prepared.noise_theta, prepared.noise_difference]))
    slow, least = [], LEAST_SLOW
    for row, swing, white in zip(envelope.slow, (envelope.first, envelope.difference), noise, strict=True):
        known = np.isfinite(row) & np.isfinite(swing)
        if known.sum() < 4:
            return float("nan")
        slow.append(float(np.std(row[known])))
        mean = float(np.median(np.abs(swing[known])))
        least = max(least, LEAST_SHARE * mean, ABOVE_NOISE * white * float(np.sqrt(0.5 * envelope.noise_gain)))
    return slow[1] / max(slow[0], 1e-12) if max(slow) > least else float("nan")


def in_their_places(prepared: Prepared) -> tuple[Observation, bool]:
    """The observation with its traces in their places, and whether they had to be exchanged.

    Raises
    ------
    RefusedError
        Both traces show the swell alike: neither is a difference.
    """
    seen, share = prepared.observation, slow_share(prepared)
    if share > SWAPPED:
        return exchanged(seen), True
    if share > NO_DIFFERENCE:
        raise RefusedError(
            f"record/combination: the difference follows the swell {share:.2g} times as far as the first pendulum "
            "does, so it is no difference; check the traces' names, signs and scales"
        )
    return seen, False


def exchanged(seen: Observation) -> Observation:
    """The observation whose traces were taken for each other."""
    return trimmed(
        replace(
            seen,
            theta=seen.difference,
            difference=seen.theta,
            sigma_theta=seen.sigma_difference,
            sigma_difference=seen.sigma_theta,
        )
    )


def trimmed(seen: Observation) -> Observation:
    """The observation from the first to the last reading of its first pendulum, which is not extrapolated."""
    within = span(seen.theta)
    begin = float(seen.time[within.start])
    return replace(
        seen,
        start=seen.start + begin,
        time=by_portions(lambda part: part - begin, seen.time[within]),
        theta=seen.theta[within],
        difference=seen.difference[within],
        vertical=None if seen.vertical is None else seen.vertical[within],
    )
