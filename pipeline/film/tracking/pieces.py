"""The harmonic Kalman filter, run over pieces and sections of film in either direction; both combined."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion import Floats32, Lens, Optics
from pipeline.film.tracking.motion import (
    STATES,
    advance,
    correct,
    moved,
    place_variance,
    slope_of,
    slope_variance,
    solve,
)
from pipeline.film.tracking.row_reading import read_row
from synth.kernels.compiled import making_kernel

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
SHOWN, HIDDEN = 1, 2  # a row on which a trace is followed
HAND, SURE = 2.0, 0.8  # spots, 1 sigma of a line drawn by hand; share of good rows where there is one
NO_LINES = np.zeros((0, 0))  # drawn by hand


@dataclass(frozen=True)
class Swing:
    """A trace as first estimated."""

    row: float  # where the state holds, px from the edge of the film
    state: Floats  # (6,), see `motion`
    share: float = 1.0  # part of the way that lies on dark paper

    @property
    def amplitude(self) -> float:
        """Half the width of the swing, px."""
        return float(np.hypot(self.state[3], self.state[4]))

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(2.0 * np.pi / self.state[5])

    def at(self, row: float | Floats) -> Floats:
        """State at another row, or at several, (..., 6)."""
        return moved(self.state, row - self.row)


class Filter(NamedTuple):
    """State of the filter; arrays over traces, changed as it runs."""

    states: Floats  # (traces, 6), see `motion`
    covariances: Floats  # (traces, 6, 6)
    alive: NDArray[np.int64]  # 1 where the trace is being followed
    begins: NDArray[np.int64]  # row of the piece from which on it is followed, though not alive now; -1 for none
    lamp: Floats  # recent brightness
    quality: Floats  # share of good rows among the recent ones
    noise: Floats  # (traces, 3), growth of the variances a row
    memory: float  # share by which one row counts in `quality`

    @staticmethod
    def idle(traces: int, period: float) -> "Filter":
        """A filter that follows nothing yet."""
        states, covariances = np.zeros((traces, STATES)), np.zeros((traces, STATES, STATES))
        alive, begins = np.zeros(traces, np.int64), np.full(traces, -1)
        memory = min(0.5, 1.0 / (QUALITY_SWINGS * period))
        return Filter(
            states, covariances, alive, begins, np.ones(traces), np.ones(traces), np.zeros((traces, 3)), memory
        )

    @staticmethod
    def of(swings: Sequence[Swing], row: float) -> "Filter":
        """A filter whose next step leads from `row` to the first row to be read."""
        out = Filter.idle(len(swings), float(np.median([swing.period for swing in swings])))
        for k, swing in enumerate(swings):
            out.restart(k, swing.at(row))
        return out

    def restart(self, trace: int, state: Floats, lamp: float = 1.0, begin: int = -1) -> None:
        """Follow a trace (again) from a state known about as well as a seed is, at once or from row `begin` on."""
        amplitude, period = np.hypot(state[3], state[4]), 2.0 * np.pi / state[5]
        pair = FIRST_PLACE * amplitude + 1.0
        sigmas = [pair, FIRST_RATE * pair * 6.0 / period, FIRST_BEND * amplitude / period**2, pair, pair]
        self.states[trace] = state
        self.covariances[trace] = np.diag(np.square([*sigmas, FIRST_FREQUENCY * state[5]]))
        self.alive[trace], self.begins[trace] = int(begin < 0), begin
        self.lamp[trace], self.quality[trace] = lamp, 0.8
        bend = BEND_GROWTH * amplitude**2 / period**5
        self.noise[trace] = bend, FREQUENCY_GROWTH / period**3, PAIR_GROWTH * amplitude**2 / period

    def turned(self) -> "Filter":
        """The same at the end of a piece, started again from where the traces are."""
        for k in np.flatnonzero(self.alive).tolist():
            self.restart(k, self.states[k].copy(), float(self.lamp[k]))
        return self


class Piece(NamedTuple):
    """Readings of a piece, (traces, rows), and the states before each reading, (rows, traces, ...)."""

    place: Floats
    variance: Floats  # infinite where the reading was not used
    brightness: Floats
    followed: NDArray[np.uint8]  # SHOWN, or HIDDEN where nothing is to be read
    states: Floats
    covariances: Floats


@making_kernel
def _blank_piece(traces: int, rows: int) -> Piece:
    """A piece to be filled."""
    shape = (traces, rows)
    states, covariances = np.zeros((rows, traces, STATES)), np.zeros((rows, traces, STATES, STATES))
    return Piece(
        np.zeros(shape), np.full(shape, np.inf), np.empty(shape), np.zeros(shape, np.uint8), states, covariances
    )


@making_kernel
def _predict(begun: Filter, i: int, order: int, lens: Lens, lines: Floats, piece: Piece) -> None:
    """Carry all traces to row `i` of a piece, and keep their states before it is read."""
    states, covariances, alive, shear = begun.states, begun.covariances, begun.alive, lens.shear
    for k in range(alive.size):
        if alive[k] != 0:
            advance(states[k], covariances[k], begun.noise[k], float(order), shear)
        elif begun.begins[k] == i:
            alive[k], begun.begins[k] = 1, -1
        if alive[k] != 0 and lines.shape[0] > 0 and not math.isnan(lines[k, i]):
            # to where a person says that it runs, as surely as a hand draws
            slope = slope_of(states[k], shear)
            spread = HAND * HAND * lens.spot * lens.spot * (1.0 + slope * slope)
            correct(states[k], covariances[k], lines[k, i] - states[k, 0] - states[k, 3], spread, shear)
            begun.quality[k] = max(begun.quality[k], SURE)
        piece.states[i, k] = states[k]
        piece.covariances[i, k] = covariances[k]
        piece.followed[k, i] = alive[k]


@making_kernel
def run(begun: Filter, darkness: Floats32, first: int, order: int, lens: Lens, lines: Floats) -> Piece:
    """Follow all traces along (1) or against (-1) a piece, on `lines` if any; `begun` becomes the filter after it."""
    states, covariances, alive, lamp, quality = begun.states, begun.covariances, begun.alive, begun.lamp, begun.quality
    rows, traces, spot, shear = darkness.shape[0], alive.size, lens.spot, lens.shear
    piece, prior = _blank_piece(traces, rows), np.ones((traces, 2))
    gaps, gap_of = np.empty((0, 2)), np.zeros(traces + 1, np.int64)
    for turn in range(rows):
        i = turn if order > 0 else rows - 1 - turn
        _predict(begun, i, order, lens, lines, piece)
        for k in range(traces):
            if alive[k] != 0:
                prior[k, 0] = place_variance(states[k], covariances[k], shear)
                prior[k, 1] = max(slope_variance(states[k], covariances[k]), LEAST_SLOPE_VARIANCE)
        fit = read_row(darkness[i], first + i + 0.5, states, alive, lens, lamp, prior, gaps, gap_of, SETTLED)
        for k in range(traces):
            shift, spread, light, light_variance, misfit = fit[k, 0], fit[k, 1], fit[k, 2], fit[k, 3], fit[k, 4]
            piece.brightness[k, i] = light
            if alive[k] == 0:
                continue
            if math.isnan(light):
                piece.followed[k, i] = HIDDEN
            slope = slope_of(states[k], shear)
            stretch = 1.0 + slope * slope
            visible = light * light > VISIBLE * VISIBLE * light_variance and misfit < MISFIT
            dim = max(0.0, 1.0 - light / lamp[k])
            unsure = spread * max(1.0, misfit) + spot * spot * stretch * (1e-3 + 2.25 * dim * dim)
            limit = GATE * GATE * (prior[k, 0] + unsure + SLACK * SLACK * spot * spot * stretch)
            good = visible and shift * shift <= limit
            if not (spread > DEGENERATE * fit[k, 5] or math.isnan(light)):
                quality[k] += begun.memory * ((1.0 if good else 0.0) - quality[k])
            if good:
                piece.place[k, i], piece.variance[k, i] = states[k, 0] + states[k, 3] + shift, unsure
                correct(states[k], covariances[k], shift, unsure, shear)
            if visible:
                doubt = math.sqrt(light_variance) / (0.1 * lamp[k])
                lamp[k] = max(0.02, lamp[k] + LAMP_MEMORY / (1.0 + doubt * doubt) * (light - lamp[k]))
            if quality[k] < GIVEN_UP:
                alive[k] = 0
    return piece


@making_kernel
def replay(
    begun: Filter, place: Floats, variance: Floats, followed: NDArray[np.uint8], lens: Lens, lines: Floats
) -> Piece:
    """A piece once more from the readings that were kept of it, (traces, rows), without the film."""
    traces, rows = place.shape
    piece = _blank_piece(traces, rows)
    for i in range(rows):
        _predict(begun, i, 1, lens, lines, piece)
        for k in range(traces):
            if np.isfinite(variance[k, i]):
                state = begun.states[k]
                shift = place[k, i] - (state[0] + state[3])
                correct(state, begun.covariances[k], shift, variance[k, i], lens.shear)
    piece.followed[:] = followed
    return piece


class Course(NamedTuple):
    """The states of both directions weighted by their covariances: estimated from all readings but the row's own."""

    states: Floats  # (rows, traces, 6)
    variance: Floats  # of the column, (traces, rows)
    slope_variance: Floats
    disagreement: Floats  # of the directions in the column, sigmas
    known: NDArray[np.uint8]  # (traces, rows): 1 forward only, 2 backward only, 3 both, 0 none


@making_kernel
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


@dataclass(frozen=True)
class Section:
    """Traces of one section, from left to right."""

    first: int  # row of the film
    darkness: Floats32  # (rows, columns), above blank film
    swings: tuple[Swing, ...]  # one a trace, all at one row
    states: Floats  # (rows, traces, 6), see `motion`
    place: Floats  # (traces, rows), NaN where there is no reading
    brightness: Floats
    hidden: NDArray[np.bool_]  # (traces, rows), where nothing is to be read
    share: Floats  # (traces,), rows read of those followed that are not hidden
    optics: Optics  # with which it was read

    @property
    def period(self) -> float:
        """Rows in a full swing."""
        return float(np.median([swing.period for swing in self.swings]))


def follow_from(swings: Sequence[Swing], darkness: Floats32, first: int, optics: Optics, least: float) -> Section:
    """Follow swings given at one row both ways through a section; fewer rows than `least` count as so many."""
    begin = round(swings[0].row - 0.5) - first
    begun = Filter.of(swings, first + begin - 0.5)
    run(begun, darkness[begin:], first + begin, 1, optics.lens, NO_LINES)
    backward, forward = (run(begun.turned(), darkness, first, order, optics.lens, NO_LINES) for order in (-1, 1))
    course = combined(forward, backward, optics.spot, optics.shear)
    states, known = course.states, course.known > 0
    used = np.isfinite(backward.variance) & known
    place, light = np.where(used, backward.place, np.nan), np.where(used, backward.brightness, np.nan)
    hidden = backward.followed == HIDDEN
    share = used.sum(axis=1) / (np.maximum(known.sum(axis=1), least) - hidden.sum(axis=1)).clip(1)
    there = tuple(Swing(first + begin + 0.5, state.copy()) for state in states[begin])
    return Section(first, darkness, there, states, place, light, hidden, share, optics)
