"""The harmonic Kalman filter, started from seeds and run over pieces of film in either direction; both combined."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import Lens, Optics
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
    """State of the filter; arrays over traces, changed as it runs.

    Attributes
    ----------
    states, covariances : (traces, 6), (traces, 6, 6) arrays
        See `motion`.
    alive : (traces,) array
        1 where the trace is being followed.
    lamp, quality : (traces,) arrays
        Brightness of late, and share of good rows of late.
    noise : (traces, 3) array
        Growth of the variances a row.
    memory : float
        Share by which one row counts in `quality`.
    """

    states: Floats
    covariances: Floats
    alive: NDArray[np.int64]
    lamp: Floats
    quality: Floats
    noise: Floats
    memory: float

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
    """What the filter made of a piece: arrays (traces, rows), and (rows, traces, ...) of before each reading.

    Readings have an infinite variance where they were not used.
    """

    place: Floats
    variance: Floats
    brightness: Floats
    followed: NDArray[np.uint8]
    states: Floats
    covariances: Floats

    @staticmethod
    def empty(traces: int, rows: int) -> Piece:
        """Room for a piece."""
        place, variance, brightness = np.empty((3, traces, rows))
        states, covariances = np.zeros((rows, traces, STATES)), np.zeros((rows, traces, STATES, STATES))
        return Piece(place, variance, brightness, np.zeros((traces, rows), np.uint8), states, covariances)

    def of(self, trace: int) -> Piece:
        """One trace of the piece."""
        one = slice(trace, trace + 1)
        parts: Any = [*(each[one] for each in self[:4]), self.states[:, one], self.covariances[:, one]]
        return Piece(*parts)


def start(swings: Sequence[Swing], row: float) -> Filter:
    """A filter whose next step leads from `row` to the first row to be read."""
    begun = Filter.idle(len(swings), float(np.median([swing.period for swing in swings])))
    for k, swing in enumerate(swings):
        begun.restart(k, swing.at(row))
    return begun


def run(
    begun: Filter,
    darkness: NDArray[np.float32],
    first: int,
    order: int,
    optics: Optics,
    begins: NDArray[np.int64] | None = None,
    lines: Floats | None = None,
) -> Piece:
    """Follow all traces over a piece of film, along it (order 1) or against it (-1).

    `begins` names rows of the piece from which on traces are followed that are not alive, -1 for none; `lines`
    (traces, rows) are columns where a person says that traces run, NaN elsewhere.
    """
    piece = Piece.empty(begun.alive.size, darkness.shape[0])
    begins = np.full(begun.alive.size, -1) if begins is None else begins
    follow(darkness, first, order, begun, begins, NO_LINES if lines is None else lines, optics.lens(), piece)
    return piece


def run_again(
    begun: Filter, place: Floats, variance: Floats, followed: NDArray[np.uint8], optics: Optics,
    lines: Floats | None = None,
) -> Piece:  # fmt: skip
    """A piece once more from the readings that were kept of it, (traces, rows), without the film."""
    piece = Piece.empty(*place.shape)
    piece.place[:], piece.variance[:], piece.followed[:] = place, variance, followed
    replay(begun, NO_LINES if lines is None else lines, optics.spot, optics.shear, piece)
    return piece


@kernel
def pulled(state: Floats, covariance: Floats, column: float, spot: float, shear: float, work: Floats) -> None:
    """Move a trace to where a person says that it runs, as surely as a hand draws."""
    slope = slope_of(state, shear)
    spread = HAND * HAND * spot * spot * (1.0 + slope * slope)
    correct(state, covariance, column - state[0] - state[3], spread, shear, work)


@kernel
def follow(
    darkness: NDArray[np.float32], first: int, order: int, begun: Filter, begins: NDArray[np.int64], lines: Floats,
    lens: Lens, piece: Piece,
) -> None:  # fmt: skip
    """Read and follow all traces over the rows of a piece, which begins at row `first` of the film (see `run`).

    `begun` is the filter before the first row to be read, and is overwritten by that after the last.
    """
    rows, columns = darkness.shape
    states, covariances, alive, lamp, quality = begun.states, begun.covariances, begun.alive, begun.lamp, begun.quality
    traces, spot, shear = alive.size, lens.spot, lens.shear
    reading, work = work_space(traces, columns), np.empty((2, 6, 6))
    fit = reading.fit
    prior = np.ones((traces, 2))
    gaps, gap_of = np.empty((0, 2)), np.zeros(traces + 1, np.int64)
    for turn in range(rows):
        i = turn if order > 0 else rows - 1 - turn
        for k in range(traces):
            if alive[k] != 0:
                advance(states[k], covariances[k], begun.noise[k], float(order), shear, work)
            elif begins[k] == i:
                alive[k] = 1
            if lines.shape[0] > 0 and alive[k] != 0 and not math.isnan(lines[k, i]):
                pulled(states[k], covariances[k], lines[k, i], spot, shear, work)
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
                correct(states[k], covariances[k], shift, spread, shear, work)
            if visible:
                doubt = math.sqrt(light_variance) / (0.1 * lamp[k])
                lamp[k] = max(0.02, lamp[k] + LAMP_MEMORY / (1.0 + doubt * doubt) * (light - lamp[k]))
            if quality[k] < GIVEN_UP:
                alive[k] = 0


@kernel
def replay(begun: Filter, lines: Floats, spot: float, shear: float, piece: Piece) -> None:
    """Once more along a piece that was followed before, from its readings alone; overwrites what `follow` kept."""
    states, covariances, alive = begun.states, begun.covariances, begun.alive
    work = np.empty((2, 6, 6))
    for i in range(piece.states.shape[0]):
        for k in range(alive.size):
            if piece.followed[k, i] == 0:
                continue
            if alive[k] == 0:
                alive[k] = 1
            else:
                advance(states[k], covariances[k], begun.noise[k], 1.0, shear, work)
            if lines.shape[0] > 0 and not math.isnan(lines[k, i]):
                pulled(states[k], covariances[k], lines[k, i], spot, shear, work)
            piece.states[i, k] = states[k]
            piece.covariances[i, k] = covariances[k]
            if np.isfinite(piece.variance[k, i]):
                shift = piece.place[k, i] - (states[k, 0] + states[k, 3])
                correct(states[k], covariances[k], shift, piece.variance[k, i], shear, work)


class Course(NamedTuple):
    """The states of both directions weighed by their covariances: of all readings but the row's own.

    Attributes
    ----------
    states : (rows, traces, 6) array
    variance, slope_variance, disagreement : (traces, rows) arrays
        Variance of the column and of the slope; by how many sigma the directions differ in the column.
    known : (traces, rows) array
        1 forward only, 2 backward only, 3 both, 0 none.
    """

    states: Floats
    variance: Floats
    slope_variance: Floats
    disagreement: Floats
    known: NDArray[np.uint8]


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
