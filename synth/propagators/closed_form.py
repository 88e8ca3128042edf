"""The closed form at many moments, as small matrix products.

Every moment is a block's centre plus an offset inside the block, t = t_b + tau, and every function splits:

    exp(i w t)                      = exp(i w t_b) exp(i w tau)
    exp(lambda t)                   = exp(lambda t_b) exp(lambda tau)
    (exp(i m t) - exp(lambda t))/mu = exp(i m t_b) D(tau) + exp(lambda tau) D(t_b),   D the same quotient

so that all moments are products (blocks x functions) times (functions x offsets), with sines only for the
edges of the table. Nothing accumulates from block to block, so nothing drifts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats, Phasors
from synth.propagators.products import PORTION, RunningSum, general_halves, harmonic_halves
from synth.propagators.ticks import Blocks


def series(angular_frequency: Floats, coefficients: Phasors, blocks: Blocks) -> Floats:
    """Real parts of sums of harmonics.

    Parameters
    ----------
    angular_frequency : (harmonics,)
        rad/s
    coefficients : (sums, harmonics)
        Complex amplitudes.
    blocks
        When.

    Returns
    -------
    (sums, blocks, moments) float64
    """
    result = np.empty((len(coefficients), *blocks.shape))
    sums = [RunningSum(each) for each in result]
    _add_series(sums, angular_frequency, coefficients, blocks)
    for each in sums:
        each.finish()
    return result


def elongation(responses: Sequence[Response], angular_frequency: Floats, blocks: Blocks) -> Floats:
    """Angles of the pendulums, forced and free.

    Returns
    -------
    (pendulums, blocks, moments) float64
        rad
    """
    result = np.empty((len(responses), *blocks.shape))
    sums = [RunningSum(each) for each in result]
    _add_series(sums, angular_frequency, np.array([each.forced for each in responses]), blocks)
    for total, response in zip(sums, responses, strict=True):
        for weights, after, before in _free_terms(response, angular_frequency, blocks):
            total.add(general_halves(weights, after, before))
        total.finish()
    return result


def free_harmonic(response: Response, angular_frequency: Floats, blocks: Blocks) -> Phasors:
    """Complex free harmonic Z of one pendulum, near-resonant beats included.

    Returns
    -------
    (blocks, moments) complex128
        rad
    """
    result = np.zeros(blocks.shape, dtype=np.complex128)
    reaches = blocks.reaches.count
    for weights, after, before in _free_terms(response, angular_frequency, blocks):
        result[:, reaches:] += weights.T @ after
        result[:, reaches - 1 :: -1] += weights.T @ before
    return result


def _add_series(sums: Sequence[RunningSum], angular_frequency: Floats, coefficients: Phasors, blocks: Blocks) -> None:
    for portion in _portions(angular_frequency.size):
        head, table = blocks.phasors(angular_frequency[portion].tolist())
        for total, each in zip(sums, coefficients[:, portion, None], strict=True):
            total.add(harmonic_halves(each * head, table))


def _free_terms(
    response: Response, angular_frequency: Floats, blocks: Blocks
) -> Iterator[tuple[Phasors, Phasors, Phasors]]:
    """Yield weights and functions after and before the centre, whose products add up to Z."""
    centres, reaches = blocks.seconds
    own_head, own_after = (row[:1] for row in blocks.phasors([response.damped_frequency]))
    own_before = own_after.conj()
    if response.damping_rate:
        own_head = own_head * np.exp(-response.damping_rate * centres)
        own_before = own_before * np.exp(response.damping_rate * reaches)
        own_after = own_after * np.exp(-response.damping_rate * reaches)
    weight = response.start * own_head
    for portion in _portions(response.near.size) if response.near.size else ():
        head, table = blocks.phasors(angular_frequency[response.near[portion]].tolist())
        gain, split = response.gain[portion, None], response.split[portion, None]
        weight = weight + np.sum(gain * beat(split, head, own_head, centres), axis=0)
        after = beat(split, table, own_after, reaches)
        yield gain * head, after, beat(split, table.conj(), own_before, -reaches)
    yield weight, own_after, own_before


def beat(split: Phasors, forced: Phasors, own: Phasors, seconds: Floats) -> Phasors:
    """Return (exp(i m t) - exp(lambda t))/mu without cancellation, also at exact resonance.

    Parameters
    ----------
    split : (beats, 1)
        mu = i m - lambda
    forced : (beats, moments)
        exp(i m t)
    own : (1, moments)
        exp(lambda t)
    seconds : (moments,)
        t

    Notes
    -----
    For |mu t| < 1 it is exp(lambda t) (exp(mu t) - 1)/mu, whose limit at mu = 0 is t exp(lambda t); beyond,
    the plain difference, because there the two exact phases are better than the product mu t.
    """
    turn = split * seconds
    small = np.abs(turn) < 1
    result = np.divide(forced - own, split, out=np.zeros_like(forced), where=~small)
    argument = turn[small]
    growth = np.divide(np.expm1(argument), argument, out=np.ones_like(argument), where=argument != 0)
    result[small] = np.broadcast_to(own * seconds, turn.shape)[small] * growth
    return result


def _portions(count: int) -> Iterator[slice]:
    """Slices of PORTION; one empty slice for none, so that an empty sum is zero."""
    for begin in range(0, max(count, 1), PORTION):
        yield slice(begin, min(begin + PORTION, count))
