"""The filter's state, started from seeds and run over pieces of film."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.follow import follow, replay
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.motion import STATES
from pipeline.film.tracking.seeding import Swing

# Growth a swing of the variance of the slow part's bend (in amplitudes a swing squared), of the frequency (in radians a
# swing) and of the pair (in amplitudes). The swell of a ship bends the slow part by up to 1.5 A/P^2 within a swing or
# so, and wow of 3 % in 7 s changes the frequency by 0.16 rad/P a swing. A tenth of that is allowed for: both are slow
# against the filter's memory of a third of a swing, so that little of them is left out.
BEND_GROWTH, FREQUENCY_GROWTH, PAIR_GROWTH = 0.01, 1e-3, 1e-6
FIRST_PLACE, FIRST_RATE, FIRST_BEND, FIRST_FREQUENCY = 0.03, 0.3, 0.5, 0.03
QUALITY_SWINGS = 0.5


@dataclass
class Filter:
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
        return Filter(
            np.zeros((traces, STATES)),
            np.zeros((traces, STATES, STATES)),
            np.zeros(traces, np.int64),
            np.ones(traces),
            np.ones(traces),
            np.zeros((traces, 3)),
            min(0.5, 1.0 / (QUALITY_SWINGS * period)),
        )

    def copy(self) -> Filter:
        """Its own arrays."""
        return replace(
            self,
            states=self.states.copy(),
            covariances=self.covariances.copy(),
            alive=self.alive.copy(),
            lamp=self.lamp.copy(),
            quality=self.quality.copy(),
            noise=self.noise.copy(),
        )

    def restart(self, trace: int, state: Floats, lamp: float = 1.0, alive: bool = True) -> None:
        """Follow a trace (again) from a state known about as well as a seed is, at once or when its row comes."""
        self.states[trace] = state
        self.covariances[trace] = first_covariance(state)
        self.alive[trace], self.lamp[trace], self.quality[trace] = int(alive), lamp, 0.8
        self.noise[trace] = process_noise(state)


@dataclass(frozen=True)
class Piece:
    """What the filter made of a piece: arrays (traces, rows), and (rows, traces, ...) of before each reading."""

    place: Floats
    variance: Floats
    brightness: Floats
    followed: NDArray[np.uint8]
    states: Floats
    covariances: Floats

    @staticmethod
    def empty(traces: int, rows: int) -> Piece:
        """Room for a piece."""
        return Piece(
            np.empty((traces, rows)),
            np.empty((traces, rows)),
            np.empty((traces, rows)),
            np.zeros((traces, rows), np.uint8),
            np.zeros((rows, traces, STATES)),
            np.zeros((rows, traces, STATES, STATES)),
        )

    def of(self, trace: int, rows_behind: int = 0) -> Piece:
        """One trace of the piece, with rows added behind that were not followed."""
        more = Piece.empty(1, rows_behind)
        more.variance[:] = np.inf
        one = slice(trace, trace + 1)
        return Piece(
            np.concatenate([self.place[one], more.place], axis=1),
            np.concatenate([self.variance[one], more.variance], axis=1),
            np.concatenate([self.brightness[one], more.brightness], axis=1),
            np.concatenate([self.followed[one], more.followed], axis=1),
            np.concatenate([self.states[:, one], more.states]),
            np.concatenate([self.covariances[:, one], more.covariances]),
        )


def process_noise(state: Floats) -> Floats:
    """Growth a row of the variances of bend, frequency and pair."""
    amplitude, period = np.hypot(state[3], state[4]), 2.0 * np.pi / state[5]
    bend = BEND_GROWTH * amplitude**2 / period**5
    return np.array([bend, FREQUENCY_GROWTH / period**3, PAIR_GROWTH * amplitude**2 / period])


def first_covariance(state: Floats) -> Floats:
    """How well a seed is known."""
    amplitude, period = np.hypot(state[3], state[4]), 2.0 * np.pi / state[5]
    pair = FIRST_PLACE * amplitude + 1.0
    sigmas = [pair, FIRST_RATE * pair * 6.0 / period, FIRST_BEND * amplitude / period**2, pair, pair]
    return np.diag(np.square([*sigmas, FIRST_FREQUENCY * state[5]]))


def start(swings: Sequence[Swing], row: float) -> Filter:
    """A filter whose next step leads from `row` to the first row to be read."""
    begun = Filter.idle(len(swings), float(np.median([swing.period for swing in swings])))
    for k, swing in enumerate(swings):
        begun.restart(k, swing.at(row))
    return begun


def run(
    filter_: Filter,
    darkness: NDArray[np.float32],
    first: int,
    order: int,
    optics: Optics,
    begins: NDArray[np.int64] | None = None,
) -> Piece:
    """Follow all traces over a piece of film, along it (order 1) or against it (-1).

    `begins` names rows of the piece from which on traces are followed that are not alive, -1 for none.
    """
    piece = Piece.empty(filter_.states.shape[0], darkness.shape[0])
    follow(
        darkness,
        first,
        order,
        filter_.states,
        filter_.covariances,
        filter_.alive,
        np.full(filter_.alive.size, -1) if begins is None else begins,
        filter_.lamp,
        filter_.quality,
        optics.numbers(),
        optics.curve.table(),
        filter_.noise,
        filter_.memory,
        piece.place,
        piece.variance,
        piece.brightness,
        piece.followed,
        piece.states,
        piece.covariances,
    )
    return piece


def run_again(filter_: Filter, place: Floats, variance: Floats, followed: NDArray[np.uint8], optics: Optics) -> Piece:
    """A piece once more from the readings that were kept of it, (traces, rows), without the film."""
    piece = Piece.empty(*place.shape)
    place, variance = np.ascontiguousarray(place), np.ascontiguousarray(variance)
    followed = np.ascontiguousarray(followed)
    replay(
        filter_.states,
        filter_.covariances,
        filter_.alive,
        filter_.noise,
        optics.shear,
        place,
        variance,
        followed,
        piece.states,
        piece.covariances,
    )
    return Piece(place, variance, piece.brightness, followed, piece.states, piece.covariances)
