"""The harmonic Kalman filter, started from seeds and run over pieces of film in either direction; both combined."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import Lens, Optics
from pipeline.film.tracking.motion import STATES, advance, correct, place_variance, slope_of, slope_variance, solve
from pipeline.film.tracking.row_reading import read_row, work_space
from pipeline.film.tracking.seeding import Swing
from synth.kernels.compiled import kernel

GATE = 5.0  # sigma
SLACK = 0.3  # spots, of the line's normal: what the filter may lag behind where ship or paper speed up
BOTH_SLACK = 0.25  # the same of two directions against each other
VISIBLE = 4.0  # sigma of the brightness from which on there is a line
MISFIT = 30.0  # mean square residual from which on something else lies on the line; less makes a reading less sure
LAMP_MEMORY = 0.03  # a row
GIVEN_UP = 0.25  # share of good rows of late under which a trace is lost
SETTLED = 0.08
LEAST_SLOPE_VARIANCE = 1e-8
DEGENERATE = 25.0  # growth of the variance by another trace from which on a row says nothing
# Growth a swing of the variance of the slow part's bend (in amplitudes a swing squared), of the frequency (in radians a
# swing) and of the pair (in amplitudes). The swell of a ship bends the slow part by up to 1.5 A/P^2 within a swing or
# so, and wow of 3 % in 7 s changes the frequency by 0.16 rad/P a swing. A tenth of that is allowed for: both are slow
# against the filter's memory of a third of a swing, so that little of them is left out.
BEND_GROWTH, FREQUENCY_GROWTH, PAIR_GROWTH = 0.01, 1e-3, 1e-6
FIRST_PLACE, FIRST_RATE, FIRST_BEND, FIRST_FREQUENCY = 0.03, 0.3, 0.5, 0.03
QUALITY_SWINGS = 0.5
FORWARD, BACKWARD, BOTH = 1, 2, 3
HAND, SURE = 2.0, 0.8  # spots, 1 sigma of a line drawn by hand; share of good rows where there is one
NO_LINES = np.zeros((0, 0))


class Filter(NamedTuple):
    """State of the filter; arrays over traces, changed as it runs."""

    states: Floats  # (traces, 6), see `motion`
    covariances: Floats  # (traces, 6, 6)
    alive: NDArray[np.int64]  # 1 where the trace is being followed
    lamp: Floats  # recent brightness
    quality: Floats  # share of good rows among the recent ones
    noise: Floats  # (traces, 3), growth of the variances a row
    memory: float  # share by which one row counts in `quality`

    @staticmethod
    def idle(traces: int, period: float) -> Filter:
        """A filter that follows nothing yet."""
        states, noise, memory = np.zeros((traces, STATES)), np.zeros((traces, 3)), 1.0 / (QUALITY_SWINGS * period)
        covariances, alive = np.zeros((traces, STATES, STATES)), np.zeros(traces, np.int64)
        return Filter(states, covariances, alive, np.ones(traces), np.ones(traces), noise, min(0.5, memory))

    def restart(self, trace: int, state: Floats, lamp: float = 1.0, alive: bool = True) -> None:
        """Follow a trace (again) from a state known about as well as a seed is, at once or when its row comes."""
        amplitude, period = np.hypot(state[3], state[4]), 2.0 * np.pi / state[5]
        pair = FIRST_PLACE * amplitude + 1.0
        sigmas = [pair, FIRST_RATE * pair * 6.0 / period, FIRST_BEND * amplitude / period**2, pair, pair]
        self.states[trace] = state
        self.covariances[trace] = np.diag(np.square([*sigmas, FIRST_FREQUENCY * state[5]]))
        self.alive[trace], self.lamp[trace], self.quality[trace] = int(alive), lamp, 0.8
        bend = BEND_GROWTH * amplitude**2 / period**5
        self.noise[trace] = bend, FREQUENCY_GROWTH / period**3, PAIR_GROWTH * amplitude**2 / period


class Piece(NamedTuple):
    """Readings of a piece, (traces, rows), and the states before each reading, (rows, traces, ...)."""

    place: Floats
    variance: Floats  # infinite where the reading was not used
    brightness: Floats
    followed: NDArray[np.uint8]
    states: Floats
    covariances: Floats

    @staticmethod
    def empty(traces: int, rows: int) -> Piece:
        """A piece to be filled."""
        place, variance, brightness = np.empty((3, traces, rows))
        states, covariances = np.zeros((rows, traces, STATES)), np.zeros((rows, traces, STATES, STATES))
        return Piece(place, variance, brightness, np.zeros((traces, rows), np.uint8), states, covariances)


def start(swings: Sequence[Swing], row: float) -> Filter:
    """A filter whose next step leads from `row` to the first row to be read."""
    begun = Filter.idle(len(swings), float(np.median([swing.period for swing in swings])))
    for k, swing in enumerate(swings):
        begun.restart(k, swing.at(row))
    return begun


def run(
    begun: Filter, darkness: NDArray[np.float32], first: int, order: int, optics: Optics,
    begins: NDArray[np.int64] | None = None, lines: Floats = NO_LINES,
) -> Piece:  # fmt: skip
    """Follow all traces over a piece of film, along it (order 1) or against it (-1).

    `begins` names rows of the piece from which on traces are followed that are not alive, -1 for none; `lines`
    (traces, rows) are columns where a person says that traces run, NaN elsewhere.
    """
    piece = Piece.empty(begun.alive.size, darkness.shape[0])
    begins = np.full(begun.alive.size, -1) if begins is None else begins
    _follow(darkness, first, order, begun, begins, lines, optics.lens, piece)
    return piece


def replay(
    begun: Filter, place: Floats, variance: Floats, followed: NDArray[np.uint8], optics: Optics, lines: Floats
) -> Piece:
    """A piece once more from the readings that were kept of it, (traces, rows), without the film."""
    piece = Piece.empty(*place.shape)
    piece.place[:], piece.variance[:], piece.followed[:] = place, variance, followed
    _replay(begun, lines, optics.spot, optics.shear, piece)
    return piece


@kernel
def _pull(state: Floats, covariance: Floats, column: float, spot: float, shear: float) -> None:
    """Move a trace to where a person says that it runs, as surely as a hand draws."""
    slope = slope_of(state, shear)
    spread = HAND * HAND * spot * spot * (1.0 + slope * slope)
    correct(state, covariance, column - state[0] - state[3], spread, shear)


@kernel
def _follow(
    darkness: NDArray[np.float32], first: int, order: int, begun: Filter, begins: NDArray[np.int64], lines: Floats,
    lens: Lens, piece: Piece,
) -> None:  # fmt: skip
    """See `run`; `begun` is the filter before the first row to be read, and is overwritten by that after the last."""
    rows, columns = darkness.shape
    states, covariances, alive, lamp, quality = begun.states, begun.covariances, begun.alive, begun.lamp, begun.quality
    traces, spot, shear = alive.size, lens.spot, lens.shear
    reading = work_space(traces, columns)
    fit = reading.fit
    prior = np.ones((traces, 2))
    gaps, gap_of = np.empty((0, 2)), np.zeros(traces + 1, np.int64)
    for turn in range(rows):
        i = turn if order > 0 else rows - 1 - turn
        for k in range(traces):
            if alive[k] != 0:
                advance(states[k], covariances[k], begun.noise[k], float(order), shear)
            elif begins[k] == i:
                alive[k] = 1
            if lines.shape[0] > 0 and alive[k] != 0 and not math.isnan(lines[k, i]):
                _pull(states[k], covariances[k], lines[k, i], spot, shear)
                quality[k] = max(quality[k], SURE)
            if alive[k] != 0:
                prior[k, 0] = place_variance(states[k], covariances[k], shear)
                prior[k, 1] = max(slope_variance(states[k], covariances[k]), LEAST_SLOPE_VARIANCE)
            piece.states[i, k] = states[k]
            piece.covariances[i, k] = covariances[k]
        read_row(darkness[i], first + i + 0.5, states, alive, lens, lamp, prior, gaps, gap_of, SETTLED, reading)
        for k in range(traces):
            piece.followed[k, i], piece.brightness[k, i] = alive[k], fit[k, 2]
            piece.place[k, i], piece.variance[k, i] = 0.0, np.inf
            if alive[k] == 0:
                continue
            slope = slope_of(states[k], shear)
            stretch = 1.0 + slope * slope
            shift, spread, light, light_variance = fit[k, 0], fit[k, 1], fit[k, 2], fit[k, 3]
            visible = light * light > VISIBLE * VISIBLE * light_variance and fit[k, 4] < MISFIT
            dim = max(0.0, 1.0 - light / lamp[k])
            spread = spread * max(1.0, fit[k, 4]) + spot * spot * stretch * (1e-3 + 2.25 * dim * dim)
            limit = GATE * GATE * (prior[k, 0] + spread + SLACK * SLACK * spot * spot * stretch)
            good = visible and shift * shift <= limit
            if not (fit[k, 1] > DEGENERATE * fit[k, 5] or math.isnan(light)):
                quality[k] += begun.memory * ((1.0 if good else 0.0) - quality[k])
            if good:
                piece.place[k, i], piece.variance[k, i] = states[k, 0] + states[k, 3] + shift, spread
                correct(states[k], covariances[k], shift, spread, shear)
            if visible:
                doubt = math.sqrt(light_variance) / (0.1 * lamp[k])
                lamp[k] = max(0.02, lamp[k] + LAMP_MEMORY / (1.0 + doubt * doubt) * (light - lamp[k]))
            if quality[k] < GIVEN_UP:
                alive[k] = 0


@kernel
def _replay(begun: Filter, lines: Floats, spot: float, shear: float, piece: Piece) -> None:
    """See `replay`; overwrites the states of the piece."""
    states, covariances, alive = begun.states, begun.covariances, begun.alive
    for i in range(piece.states.shape[0]):
        for k in range(alive.size):
            if piece.followed[k, i] == 0:
                continue
            if alive[k] == 0:
                alive[k] = 1
            else:
                advance(states[k], covariances[k], begun.noise[k], 1.0, shear)
            if lines.shape[0] > 0 and not math.isnan(lines[k, i]):
                _pull(states[k], covariances[k], lines[k, i], spot, shear)
            piece.states[i, k] = states[k]
            piece.covariances[i, k] = covariances[k]
            if np.isfinite(piece.variance[k, i]):
                shift = piece.place[k, i] - (states[k, 0] + states[k, 3])
                correct(states[k], covariances[k], shift, piece.variance[k, i], shear)


class Course(NamedTuple):
    """The states of both directions weighted by their covariances: estimated from all readings but the row's own."""

    states: Floats  # (rows, traces, 6)
    variance: Floats  # of the column, (traces, rows)
    slope_variance: Floats
    disagreement: Floats  # of the directions in the column, sigmas
    known: NDArray[np.uint8]  # (traces, rows): 1 forward only, 2 backward only, 3 both, 0 none


@kernel
def combined(forward: Piece, backward: Piece, spot: float, shear: float) -> Course:
    """The course of all traces of a piece that was followed both ways."""
    rows, traces = forward.states.shape[:2]
    states, known = np.empty((rows, traces, STATES)), np.empty((traces, rows), np.uint8)
    variance, slope_spread, disagreement = np.empty((traces, rows)), np.empty((traces, rows)), np.zeros((traces, rows))
    for i in range(rows):
        for k in range(traces):
            known[k, i] = (FORWARD if forward.followed[k, i] else 0) + (BACKWARD if backward.followed[k, i] else 0)
            one, spread = forward.states[i, k], forward.covariances[i, k]
            other, other_spread = backward.states[i, k], backward.covariances[i, k]
            if known[k, i] == BACKWARD:
                one, spread = other, other_spread
            states[i, k] = one
            variance[k, i], slope_spread[k, i] = place_variance(one, spread, shear), slope_variance(one, spread)
            if known[k, i] != BOTH:
                continue
            steep = slope_of(one, shear)
            apart = variance[k, i] + place_variance(other, other_spread, shear)
            apart += BOTH_SLACK * BOTH_SLACK * spot * spot * (1.0 + steep * steep)
            disagreement[k, i] = abs(other[0] + other[3] - one[0] - one[3]) / math.sqrt(apart)
            total, right = spread + other_spread, other - one
            if solve(total, right, STATES):
                gain = spread @ total
                states[i, k] += spread @ right
                change = spread - gain @ spread
                variance[k, i] = place_variance(states[i, k], change, shear)
                slope_spread[k, i] = slope_variance(states[i, k], change)
    return Course(states, variance, slope_spread, disagreement, known)
