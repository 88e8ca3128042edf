"""A record as one problem: readings on the lattice, what is known, what is assumed; one pass over a stretch of it."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import constants as unknown
from pipeline.joint import filtering, kinds, passes, smoother
from pipeline.joint.constants import Constants, Solution
from pipeline.joint.flow import NODES, POINTS, Flow, flow
from pipeline.joint.lattice import Lattice
from pipeline.joint.ship import Component, Ship

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

NONE2, NONE3 = np.zeros((0, 0)), np.zeros((0, 0, 0))
NO_PATH = NONE2.astype(np.float32)
NOTHING_KEPT = passes.Kept(NONE3, NONE3, np.zeros(0, dtype=np.int64), NONE2, NONE2, NONE2)
LEAST_NOISE = 1e-6  # rad: readings are taken for no better
SPARSE = 2.0  # of the swing between readings, rad
LEVEL = 0.5  # of one pendulum's answer to the ship
MOST_DAMPED = 0.3  # of its frequency
LEAST = 0.1  # of reference gravity, and of a trace's scale
FARTHEST = 100.0  # rad
KEPT = 2**26  # bytes that are kept at once for the smoother; what does not fit is gone through twice


@dataclass(frozen=True)
class Assumed:
    """What is random, and how much of it."""

    ship: tuple[Component, ...]
    kick: Floats  # (p,) rad s-1/2
    noise: Floats
    """(t + 2,) 1 sigma of the readings of each trace, rad, and of recorded accelerations over reference gravity."""
    sine: bool  # Restoring law
    heave_noise: float = 0.0  # Of an interpolated recording of the heave; see `flow.Flow`.
    breaks: tuple[tuple[int, int], ...] = ()
    """Nodes from which a pendulum goes on as nothing before tells, and that pendulum: a knock, a restart."""

    @property
    def heaves(self) -> bool:
        """Whether vertical motion that is not known acts on the pendulums."""
        return self.sine and any(each.axis == "vertical" for each in self.ship)


@dataclass(frozen=True)
class Problem:
    """A record laid out."""

    lattice: Lattice
    kappa: Floats
    damping: Floats  # (p,) n^2 at reference gravity, s-2; stated damping rates, s-1
    left_out: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (r,) readings that are not used
    heave: "CubicSpline | None" = None
    """Recorded heave over reference gravity by s since the first node; none: not recorded, or a reading."""
    track: Floats = field(default_factory=lambda: np.zeros((0, POINTS)))
    """(k, 4) known change of gravity along the track, from its mean, over reference gravity, at nodes; may be empty."""
    steps: Floats = field(default_factory=lambda: np.zeros(0))
    """(t,) rad, to which samples were rounded, which leaves lines of its own; 0: not so that it shows."""
    time_doubt: float = 0.0  # 1 sigma of a film's times, s: errors that last for seconds; see `film_errors.with_clock`.
    time_noise: float = 0.0
    """White noise of the marks from which these times come, times the root of their interval, s3/2; 0: not stated."""
    paper_steps: tuple[float, ...] = ()
    """s since the first node: steps of a film's paper, taken off as well as they show there."""
    pace: Floats = field(default_factory=lambda: np.zeros(0))
    """(r,) a film's mean speed over that at the reading: delays on it are lengths; empty: it is not stated."""
    repeating: Floats = field(default_factory=lambda: np.zeros(0))
    """(t,) rad, root mean square of the errors repeating with the swing that the readings are without; empty: none."""

    @property
    def pendulums(self) -> int:
        """Number of pendulums."""
        return int(self.kappa.size)

    @property
    def traces(self) -> int:
        """Number of traces."""
        return int(self.lattice.combination.shape[0])

    @property
    def swing(self) -> float:
        """Frequency of the pendulums at reference gravity, rad s-1."""
        return float(np.sqrt(self.kappa.mean()))

    @property
    def sparse(self) -> bool:
        """Whether readings are so far apart that sidebands of the swing lie upon each other."""
        return self.lattice.interval * self.swing > SPARSE

    @cached_property
    def instants(self) -> Floats:
        """Times of the nodes of each step since the first node, s, (k, 4)."""
        return np.asarray(self.lattice.step * (np.arange(self.lattice.nodes)[:, None] + NODES))

    @cached_property
    def recorded(self) -> list[Floats]:
        """The recorded heave and its derivative with time there; (0, 4) without one."""
        return [np.zeros((0, POINTS)) if self.heave is None else self.heave(self.instants, k) for k in (0, 1)]

    @cached_property
    def mixed(self) -> Floats:
        """Weights of the pendulums in each trace by cross-talk, which gives each of them all others, (t, p)."""
        return np.asarray(self.lattice.combination @ (1.0 - np.eye(self.pendulums)))

    @property
    def tells_apart(self) -> bool:
        """Whether traces tell all pendulums, of which there are several."""
        return bool(self.pendulums == self.traces == np.linalg.matrix_rank(self.lattice.combination) > 1)

    def others(self) -> Floats:
        """What cross-talk adds to each reading, by what all traces say at its time, (r,) rad; 0 where one is missing;
        the traces must tell pendulums apart."""
        own, size = self.lattice, self.traces
        of_traces = own.trace < size
        at = np.cumsum(np.diff(own.time[of_traces], prepend=-np.inf) > 0.0) - 1
        read = np.full((at[-1] + 1, size), np.nan)
        read[at, own.trace[of_traces]] = own.value[of_traces]
        seen = read @ np.linalg.inv(own.combination).T @ self.mixed.T
        out = np.zeros(own.value.size)
        out[of_traces] = np.nan_to_num(seen[at, own.trace[of_traces]])
        return out

    def leaves_heave_open(self, sine: bool) -> bool:
        """Whether vertical motion acts under a law, and no recording says how."""
        return sine and self.heave is None

    def reading(self, value: Floats) -> "Problem":
        """The same with other values of the readings, (r,)."""
        return replace(self, lattice=replace(self.lattice, value=value))

    @property
    def differences(self) -> list[int]:
        """Traces that hardly see the ship's horizontal motion; all of them where none does."""
        found = np.abs(self.lattice.combination.sum(axis=1)) < LEVEL
        return [j for j in range(self.traces) if found[j] or not found.any()]

    def weights(self, trace: int) -> Floats:
        """Of each pendulum in a trace; none in the acceleration behind the last."""
        return self.lattice.combination[trace] if trace < self.traces else np.zeros(self.pendulums)

    def flow(self, assumed: Assumed, constants: Constants) -> Flow:
        """One step under the constants' values."""
        count, gravity = self.pendulums, float(unknown.total(constants, kinds.GRAVITY, 1)[0])
        ratio, damping, quadratic, dry = (
            unknown.total(constants, kind, count) for kind in (kinds.RATIO, kinds.DAMPING, kinds.QUADRATIC, kinds.DRY)
        )
        rate = np.abs(self.damping + damping) / np.sqrt(self.kappa)
        if gravity < LEAST or np.any(self.gain(constants) < LEAST - 1.0) or np.any(rate > MOST_DAMPED):
            raise np.linalg.LinAlgError("nothing swings, or is read, under the constants that would be")
        of_each = self.kappa * (1.0 + ratio), self.damping + damping, assumed.kick, quadratic, dry
        fade = sum(c.value for c in constants if c.kind == kinds.FADE)
        fade += max((c.centre for c in constants if c.kind == kinds.DRY), default=0.0)
        sway = float(unknown.total(constants, kinds.SWAY, 1)[0])
        numbers = gravity, assumed.sine, fade, sway, assumed.heave_noise
        return flow(self.lattice.step, assumed.ship, *(tuple(each.tolist()) for each in of_each), *numbers)

    def gain(self, constants: Constants) -> Floats:
        """Error of the scale of each trace, and of the accelerations."""
        return self._of_readings(constants, kinds.GAIN, kinds.READ_HEAVE_SCALE)

    def _of_readings(self, constants: Constants, of_traces: int, of_heave: int) -> Floats:
        """Values of constants of each trace, and of the accelerations, (t + 2,)."""
        found: Floats = np.zeros(self.traces + 2)
        found[: self.traces] = unknown.total(constants, of_traces, self.traces)
        return found + unknown.total(constants, of_heave, self.traces + 2)

    def cubic(self, constants: Constants) -> float:
        """What the optics make of an angle x beside x, over its cube, rad-2."""
        return float(unknown.total(constants, kinds.CUBIC, 1)[0])

    def in_its_scale(self, assumed: Assumed, constants: Constants) -> Assumed:
        """With ship and kicks as the scale of the traces that see them makes them: assumed as they are read."""
        level = self.lattice.combination.sum(axis=1)
        share = (self.pendulums - 1) * unknown.total(constants, kinds.CROSS, 1)
        more = level * (self.gain(constants)[: self.traces] + share)
        if not more.any() or not level.any():
            return assumed
        scale = 1.0 + float(level @ more) / float(level @ level)
        ship = tuple(c if c.axis == "vertical" else replace(c, rms=c.rms / scale) for c in assumed.ship)
        return replace(assumed, ship=ship, kick=assumed.kick / scale)

    def readings(self, assumed: Assumed, constants: Constants, nodes: slice = slice(None)) -> passes.Readings:
        """The readings of some nodes, the first of them number 0, less what the constants say of the traces."""
        own, gain, (begin, end, _) = self.lattice, self.gain(constants), nodes.indices(self.lattice.nodes)
        some = slice(int(own.first[begin]), int(own.first[end]))
        trace, time, pace = own.trace[some], own.time[some], self.pace[some]
        delay = self._of_readings(constants, kinds.DELAY, kinds.READ_HEAVE_DELAY)
        late = delay[trace] * (pace if pace.size else 1.0) if delay.any() else 0.0
        value = own.value[some] - unknown.total(constants, kinds.ZERO, self.traces + 2)[trace]
        for each in constants:
            if each.kind == kinds.STEP:
                value -= np.where((trace == each.index) & (time >= each.centre), each.value, 0.0)
            elif each.kind == kinds.DRIFT:
                value -= np.where(trace == each.index, each.value * (time - each.centre) / each.width, 0.0)
            elif each.kind == kinds.CLOCK:
                shape = np.cos(each.width * time) * (time >= each.centre)
                late = late + np.where(trace < self.traces, each.value * shape, 0.0)
        value /= 1.0 + gain[trace]
        cubic = self.cubic(constants)
        if cubic:
            value -= np.where(trace < self.traces, cubic * value**3 * (1.0 - 3.0 * cubic * value**2), 0.0)
        variance = (assumed.noise**2 / (1.0 + gain) ** 2)[trace]
        if self.left_out.size:
            variance[self.left_out[some]] = np.inf
        combination = own.combination + unknown.total(constants, kinds.CROSS, 1) * self.mixed
        first, offset = own.first - some.start, own.offset[some] - late if np.any(late) else own.offset[some]
        others = self.others()[some] if any(each.kind == kinds.CROSS for each in constants) else np.zeros(0)
        return passes.Readings(first, trace, offset, value, variance, combination, others, pace)

    def known(self, constants: Constants, sine: bool) -> Floats:
        """Z that acts beside the states: recorded heave under its constants, gravity as it changes along the track."""
        course = [each for each in constants if each.kind == kinds.GRAVITY and each.width > 0.0 and each.value]
        scale = 1.0 + float(unknown.total(constants, kinds.HEAVE_SCALE, 1)[0])
        late = float(unknown.total(constants, kinds.HEAVE_DELAY, 1)[0])
        heave = self.heave if sine else None
        if not course and not self.track.size and heave is None:
            return np.zeros((0, POINTS))
        out: Floats = np.zeros_like(self.instants)
        if heave is not None:
            out += scale * (heave(self.instants + late) if late else self.recorded[0])
        if self.track.size:
            out += self.track
        for each in course:
            out += each.value * unknown.spline(self.instants, each)
        return out

    def run(
        self, assumed: Assumed, constants: Constants, *, span: tuple[int, int] | None = None, about: Floats = NO_PATH,
        gate: float = 0.0, root: Floats | None = None,
    ) -> tuple[Solution, passes.Pass]:  # fmt: skip
        """One pass with derivatives by all constants, and their solution; LinAlgError where a covariance lost its sign.
        `span`: first node, to which START belongs, and the one behind the last; `about`: (k, d) path of the
        linearisation; `gate`: readings so many deviations off are left out (0: none); `root`: (c, c), of the priors."""
        begin, end = (0, self.lattice.nodes) if span is None else span
        task, of = self._task(assumed, constants, about, gate, slice(begin, end))
        _go(task, begin, end, of, NOTHING_KEPT)
        return self._solution(task.readings, of, constants, root, slice(begin, end)), of

    def fit(
        self, assumed: Assumed, constants: Constants, *, about: Floats = NO_PATH, gate: float = 0.0,
        root: Floats | None = None, smooth: bool = True,
    ) -> tuple[Solution, passes.Pass, Floats]:  # fmt: skip
        """The same of the whole record, with errors at the solution, and the smoothed path, (k, d), or `about`."""
        task, of = self._task(assumed, constants, about, gate, smooth=smooth)
        nodes, (size, width) = self.lattice.nodes, of.state.shape
        smoothing = 2 * self.pendulums * (size + width) if smooth else 0
        reading = 2 * size + width if smooth else width
        stretch = max(1, KEPT // (8 * (smoothing + reading * -(-self.lattice.node.size // nodes))))
        begins = list(range(0, nodes, stretch))
        again = not smooth and len(begins) > 1  # for the errors at the solution alone
        keep = NOTHING_KEPT if again else _room(task, size, width, min(stretch, nodes), smooth=smooth)
        states = []
        for begin in begins:
            states.append((of.state.copy(), of.covariance.copy()))
            _go(task, begin, min(begin + stretch, nodes), of, keep if len(begins) == 1 else NOTHING_KEPT)
        solution = self._solution(task.readings, of, constants, root, slice(0, nodes))
        if again:
            del task  # the largest arrays of a long record
            bare, there = self._task(assumed, solution.constants, about, gate, derived=False)
            _go(bare, 0, nodes, there, NOTHING_KEPT)
            return solution, of._replace(whitened=there.whitened), about
        change = np.append(solution.step, 1.0)
        pushed = change[np.append(task.columns.forced, -1)]
        adjoint, path = np.zeros(size), np.zeros((nodes if smooth else 0, size), dtype=np.float32)
        smoothed = np.empty((min(stretch, nodes) if smooth else 0, size))
        for begin, (state, covariance) in zip(reversed(begins), reversed(states), strict=True):
            end = min(begin + stretch, nodes)
            first, last = task.readings.first[[begin, end]]
            if len(begins) > 1:  # gone through again, and kept this time
                sums = np.zeros_like(of.normal), np.zeros_like(of.totals)
                over = of._replace(state=state.copy(), covariance=covariance.copy(), normal=sums[0], totals=sums[1])
                keep.errors[:] = np.nan
                _go(task, begin, end, over, keep)
            of.whitened[first:last] = keep.errors[: last - first] @ change
            if smooth:
                smoother.smooth(
                    task, begin, end, pushed, state @ change, covariance, of.whitened, keep, adjoint, smoothed
                )
                if not np.abs(smoothed[: end - begin, : 2 * self.pendulums : 2]).max() < FARTHEST:
                    raise np.linalg.LinAlgError("the path runs away")
                path[begin:end] = smoothed[: end - begin]
        return solution, of, path if smooth else about

    def _task(
        self, assumed: Assumed, constants: Constants, about: Floats, gate: float, nodes: slice = slice(None),
        *, smooth: bool = False, derived: bool = True,
    ) -> tuple[passes.Task, passes.Pass]:  # fmt: skip
        """What a pass takes, and where it begins; `derived`: with derivatives by all constants, not only by knocks,
        which act through them."""
        assumed = self.in_its_scale(assumed, constants)
        ship, flow, known = Ship.of(assumed.ship), self.flow(assumed, constants), self.known(constants, assumed.sine)
        two, felt = 2 * self.pendulums, slice(None if assumed.sine else 0)  # linear pendulums feel no heave
        columns = unknown.columns(tuple(each for each in constants if derived or each.kind == kinds.KNOCK))
        size, width, count = two + ship.drift.shape[0], columns.kind.size + 1, self.lattice.node.size
        state, covariance = np.zeros((size, width)), np.zeros((size, size))
        for c, each in enumerate(constants):
            if each.kind == kinds.START:
                state[each.index, -1] = each.value
                if derived:
                    state[each.index, c] = 1.0
        covariance[two:, two:] = ship.stationary
        task = passes.Task(
            flow=flow, readings=self.readings(assumed, constants, nodes), columns=columns,
            known=known, recorded=self.recorded[0][felt],
            slope=self.recorded[1][felt] * (1.0 + float(unknown.total(constants, kinds.HEAVE_SCALE, 1)[0])),
            about=about, breaks=np.array(sorted(assumed.breaks), dtype=np.int64).reshape(-1, 2), gate=gate,
            plain=not (flow.sine or np.any(flow.quadratic) or np.any(flow.dry) or known.size), settled=NONE2,
        )  # fmt: skip
        arrays = (count if gate else 0, "f4"), (count, "f8"), (count, "f4")
        errors, whitened, scale = (np.full(rows, np.nan, dtype=each) for rows, each in arrays)
        sums = np.zeros((width, width)), np.zeros(3)
        if not (assumed.sine or smooth):  # the smoother knows of no jump of the covariance
            task = task._replace(settled=filtering.settled(task, size, nodes))
        return task, passes.Pass(state, covariance, *sums, errors, whitened, scale)

    def _solution(
        self, readings: passes.Readings, of: passes.Pass, constants: Constants, root: Floats | None, span: slice
    ) -> Solution:
        """What a pass over some nodes says of the constants."""
        gain, cubic = self.gain(constants), self.cubic(constants)
        if np.any(gain) or cubic:  # readings were divided by the trace's slope: their density is that of what was read
            some = slice(readings.first[span.start], readings.first[span.stop])
            trace, used = readings.trace[some], np.isfinite(readings.variance[some])
            of.totals[0] += np.bincount(trace, used, gain.size) @ np.log1p(gain)
            if cubic:
                used &= trace < self.traces
                of.totals[0] += np.sum(np.log1p(3.0 * cubic * readings.value[some][used] ** 2))
        return unknown.solve(constants, of.normal, float(of.totals[0]), float(of.totals[1]), root)


def _go(task: passes.Task, begin: int, end: int, of: passes.Pass, keep: passes.Kept) -> None:
    """Filter a stretch."""
    room = filtering.room_for(task, begin, end, of)
    if not filtering.sweep(task, begin, end, of, keep, room) or not np.all(np.isfinite(of.normal)):
        raise np.linalg.LinAlgError("a covariance of the filter lost its sign")


def _room(task: passes.Task, size: int, width: int, nodes: int, *, smooth: bool) -> passes.Kept:
    """For the errors of stretches of so many nodes, and what the smoother needs of them."""
    first, two = task.readings.first, 2 * task.flow.kappa.size
    rows = int(np.max(first[nodes:] - first[: first.size - nodes]))
    many, all_rows = (nodes, rows) if smooth else (0, 0)
    return passes.Kept(
        np.empty((min(many, 1) if task.plain else many, two, size)),
        np.empty((many, task.columns.forced.size + 1 + task.flow.drives, two)),
        np.empty(many, dtype=np.int64), np.empty((all_rows, size)), np.empty((all_rows, size)),
        np.full((rows, width), np.nan),
    )  # fmt: skip
