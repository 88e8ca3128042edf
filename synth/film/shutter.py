"""The camera in time: how the film runs, and when light falls on it (the chronometer's shutter, the lamp, gaps)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_recording import Film
from synth.phase import Floats
from synth.seeds import generator

_MINUTE = 60.0
_KNOTS = 8  # of the random error of the speed, in its correlation time
_MOST = 4.0  # sigmas: a wilder error is cut off, so that the film never stands


class Marks(NamedTuple):
    """Every gap of the shutter, and those that were left out, in order of time, (marks,)."""

    time: Floats  # of their middle, s
    minute: NDArray[np.uint8]  # 1: second gap of a full minute
    missing: NDArray[np.uint8]  # 1: left out
    spurious: NDArray[np.uint8]  # 1: no mark at all


class Light(NamedTuple):
    """Stretches of constant light, in order and apart: begin, end, s, and factor of the lamp, (stretches,) each."""

    begin: Floats
    end: Floats
    factor: Floats

    def between(self, first: float, last: float) -> Light:
        """The stretches that touch a time."""
        here = slice(np.searchsorted(self.end, first, side="left"), np.searchsorted(self.begin, last, side="right"))
        return Light(self.begin[here], self.end[here], self.factor[here])


def set_marks(film: Film, begin: float, end: float, seed: int) -> Marks:
    """The chronometer's marks at multiples of the interval, and what chance makes of them."""
    if not film.gap:
        empty = np.zeros(0, np.uint8)
        return Marks(np.zeros(0), empty, empty, empty)
    index = np.arange(np.ceil(begin / film.mark_interval - 1e-9), np.floor(end / film.mark_interval + 1e-9) + 1)
    mark = (index + 0.0) * film.mark_interval  # no negative zero
    absent = generator(seed, "film missing marks").random(mark.size) < film.missing_marks
    within = np.abs(mark - _MINUTE * np.round(mark / _MINUTE))
    full = within < 0.25 * min(film.mark_interval, _MINUTE) if film.minute_code else np.zeros(mark.size, bool)
    second = mark[full] + film.minute_code
    false = generator(seed, "film spurious marks").uniform(begin, end, film.spurious_marks)
    time = np.concatenate([mark, second, false])
    kind = np.repeat([0, 1, 2], [mark.size, second.size, false.size])
    missing = np.concatenate([absent, absent[full], np.zeros(false.size, bool)])
    order = np.argsort(time, kind="stable")
    return Marks(time[order], *(each[order].astype(np.uint8) for each in (kind == 1, missing, kind == 2)))


def light_of(film: Film, marks: Marks, begin: float, end: float, dark: Floats) -> Light:
    """What falls on the film of one trace of a record from begin to end, s: before and after, the lamp is off.

    `dark` are stretches without a record, (stretches, 2) s.
    """
    shut = marks.time[marks.missing == 0]
    gaps = np.column_stack([shut - 0.5 * film.gap, shut + 0.5 * film.gap])
    blackouts = np.array([(each.start, each.stop) for each in film.blackouts]).reshape(-1, 2)
    closed = np.concatenate([gaps, blackouts, np.reshape(dark, (-1, 2))])
    weak = [edge for each in film.dimmings for edge in (each.start, each.stop)]
    # the light changes at these moments only
    edges = np.unique(np.clip(np.concatenate([[begin, end], closed.ravel(), weak]), begin, end))
    middle = 0.5 * (edges[1:] + edges[:-1])
    starts, stops = np.sort(closed, axis=0).T
    is_open = np.searchsorted(starts, middle) == np.searchsorted(stops, middle)
    factor = np.full(middle.size, film.lamp)
    for each in film.dimmings:
        factor[(middle > each.start) & (middle < each.stop)] *= each.factor
    lit = is_open & (factor > 0.0)
    return Light(edges[:-1][lit], edges[1:][lit], factor[lit])


class Transport:
    """Travel of the film from the begin of the record, mm.

    With x = t - begin the speed is v (1 + drift x / (end - begin) + wow sin(2 pi x / period + phase) + walk(x)); before
    the begin and after the end it stays what it is there. The walk is a stationary Markov sequence, straight between
    its knots, so that the travel is exact.
    """

    def __init__(self, film: Film, begin: float, end: float, seed: int) -> None:
        self._film, self._begin, self._length = film, begin, end - begin
        self._phase = float(generator(seed, "film wow").uniform(0.0, 2 * np.pi)) if film.wow else 0.0
        if film.walk:
            from scipy.interpolate import make_interp_spline
            from scipy.signal import lfilter

            count = int(np.ceil(self._length / (film.walk_time / _KNOTS))) + 1
            keep = np.exp(-1.0 / _KNOTS)
            draws = generator(seed, "film walk").standard_normal(count)
            draws[1:] *= np.sqrt(1.0 - keep**2)
            walk = film.walk * np.clip(lfilter([1.0], [1.0, -keep], draws), -_MOST, _MOST)
            self._walk = make_interp_spline(np.arange(count) * (film.walk_time / _KNOTS), walk, k=1)
            self._walked = self._walk.antiderivative()
        self.length = float(self.travel(np.array([end]))[0])
        """Travel at the end, mm."""

    def travel(self, time: Floats) -> Floats:
        """Travel at a time, mm."""
        film = self._film
        since = np.clip(time - self._begin, 0.0, self._length)
        run = since + 0.5 * film.drift * since**2 / self._length
        if film.wow:
            turn = 2 * np.pi / film.wow_period
            run += film.wow / turn * (np.cos(self._phase) - np.cos(turn * since + self._phase))
        if film.walk:
            run += self._walked(since)
        beyond = (time - self._begin) - since
        return film.speed * run + beyond * self.speed(time)

    def speed(self, time: Floats) -> Floats:
        """Speed at a time, mm/s."""
        film = self._film
        since = np.clip(time - self._begin, 0.0, self._length)
        rate = 1.0 + film.drift * since / self._length
        if film.wow:
            rate += film.wow * np.sin(2 * np.pi / film.wow_period * since + self._phase)
        if film.walk:
            rate += self._walk(since)
        return film.speed * rate

    def time_at(self, travel: Floats) -> Floats:
        """Time at a travel, s; to 1e-12 of the record's length, by Newton's steps kept in a shrinking bracket."""
        end, slowest = self._begin + self._length, 0.1 * self._film.speed
        low = np.full(travel.shape, self._begin + float(np.min(travel, initial=0.0)) / slowest - 1.0)
        most = end + (float(np.max(travel, initial=0.0)) - self.length) / slowest
        high = np.full(travel.shape, max(most, end) + 1.0)
        time = np.clip(self._begin + travel / self._film.speed, low, high)
        for _ in range(80):
            error = self.travel(time) - travel
            low, high = np.where(error <= 0, time, low), np.where(error >= 0, time, high)
            step = time - error / self.speed(time)
            step = np.where((step > low) & (step < high), step, 0.5 * (low + high))
            if np.max(np.abs(step - time), initial=0.0) <= 1e-12 * (1.0 + self._length):
                return step
            time = step
        return time
