"""The explicit integrator of order 8: for violent, driven and escaping motion that is not stiff.

Errors are nearly proportional to local tolerances: two loose runs tell which tolerance the run that counts must have,
and its error follows from its difference from the second. Runs follow until it is what was asked. Where rounding may
matter, a loose run is repeated with noise at every step, which the motion amplifies as it does rounding. Where two runs
have nothing to do with each other any more, their difference itself is the error.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError
from synth.integrators.events import Escapement
from synth.integrators.explicit_march import MOST_STEPS, Run, StiffError
from synth.integrators.trajectory import Trajectory, checked, difference, relative_error, spread
from synth.kernels.compiled import making_kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative

LOOSEST = 1e-6
TIGHTEST = 1e-16  # local tolerance, relative; at the rounding of a step, though increments are added with compensation
_RATIO = 1e4  # usual ratio of the local tolerances of two runs that are compared
_USUAL = 20.0  # error over the local tolerance, in a thousand swings
_ROUNDING = 2.2e-16
_ROUGHEST = 1e-4
_SCOUT = 10.0  # times looser than the loose run
_PATIENT = 20_000  # stiff steps: a hundredth of a second
_NOISES = (1e-8, 1e-11, 1e-14, 1e-15)
_SHAKE = 1e-14  # noise that is surely more than rounding
_ORDER = 8.0
_LINEAR = 0.03  # differences of runs above this are no longer proportional to what made them
_INNOCENT = 1e7  # a motion that makes c of the local tolerance makes less than 1e7 c of rounding; near rest, much
_VISIBLE = 0.1  # share of the tolerance below which rounding need not be known
_CAUTION = 2.0  # since errors are only nearly proportional to the tolerance
_LUCK = 4.0  # since noise is drawn once
_COMPARED = 200  # instants
_MOMENT = 0.01  # of a step, in which the driving force changes evenly
_FEW = 0.01  # outputs that may fall between the kicks of two runs
_AIM = 0.5  # of the tolerance
_FURTHER = 1e-3  # on the local tolerance, where two runs went different ways
_CLEAR = 10.0  # errors by which a turn must miss or pass the level of a kick


def integrate(
    system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10, event: Escapement | None = None
) -> Trajectory:
    """Integrate a system and return its states at `times`; see `trajectory`. Each kick of the `event` restarts it.

    `RefusedError`: stiff motion, a singularity, numbers that are not finite; a crossing so near to a touch that the
    tolerance does not decide whether the escapement fires.
    """
    first, instants = checked(start, times, tolerance)
    made = refine(system, event, first, instants, tolerance)
    if event is not None:
        _check_decided(made, event)
    steps, rejected, evaluations = np.sum([each.counts for each in made.runs + made.probes], axis=0).tolist()
    return Trajectory(instants, made.runs[-1].at(instants), made.estimated_error, steps, evaluations, rejected)


class Refinement(NamedTuple):
    """All runs for one trajectory, with the error of the result."""

    runs: list[Run]  # from the loosest to the last, which is the result
    probes: list[Run]  # runs with noise
    truncation: float  # estimated error of the result that smaller steps would remove,
    rounding: float  # and that which they would not

    @property
    def estimated_error(self) -> float:
        """Of the result, relative, see `synth.integrators.trajectory`."""
        return self.truncation + self.rounding


def refine(system: Any, event: Escapement | None, start: Floats, times: Floats, tolerance: float) -> Refinement:
    """Run until the estimated error meets the tolerance or rounding stops it."""
    run = partial(Run, system, event, start)
    loose = min(max(_RATIO * tolerance / _USUAL, _RATIO * TIGHTEST), _ROUGHEST)
    few = instants(times[0], times[-1])
    times = np.union1d(times, few)
    local = max(loose / _RATIO, TIGHTEST)
    try:
        runs = [run(few, _SCOUT * loose, _PATIENT), run(few, loose, _PATIENT)]
    except StiffError:  # a loose run may be at the edge of stability where a tight one is not
        fine = run(times, local)
        runs = [run(few, loose, MOST_STEPS), fine]
    else:
        apart = _apart(runs[0], runs[-1], few)
        wanted = _AIM * tolerance * runs[0].tolerance / (_CAUTION * apart) if 0.0 < apart < _LINEAR else local
        runs.append(run(times, min(max(wanted, TIGHTEST), 0.1 * loose, LOOSEST)))
    probes: list[Run] = []
    rounding, linear = math.nan, False
    while True:
        rough, fine = runs[-2:]
        apart = _apart(rough, fine, few)
        if not linear:
            # rounding matters where a motion that makes this of its tolerance may make too much of it
            made = _INNOCENT * _ROUNDING * max(1.0, apart / rough.tolerance)
            visible = apart <= _LINEAR and made >= _VISIBLE * tolerance
            probes, rounding = _shaken(run, rough, few, _NOISES) if visible else ([], 0.0)
        linear = apart < _LINEAR
        truncation = _CAUTION * apart * _gain(rough, fine) if linear else apart
        error = truncation + rounding + 2.0 * _ROUNDING
        if truncation <= _AIM * tolerance or error <= tolerance or fine.tolerance <= TIGHTEST:
            break
        factor = min(0.1, _AIM * tolerance / truncation) if linear else _FURTHER
        runs.append(run(times, max(TIGHTEST, fine.tolerance * factor)))
    if not linear:
        # with noise and with its opposite: where the top of a swing decides, one of them falls elsewhere, while runs
        # that differ in their steps only may all fall to the same side by chance
        (up, most), (down, least) = (_shaken(run, fine, few, (noise,)) for noise in (_SHAKE, -_SHAKE))
        probes, rounding = up + down, max(most, least)
    return Refinement(runs, probes, truncation, rounding + 2.0 * _ROUNDING + _clock_rounding(system, fine, few))


def _shaken(run: Callable[..., Run], quiet: Run, few: Floats, noises: Sequence[float]) -> tuple[list[Run], float]:
    """A run repeated with as much noise as it bears, and what it makes of rounding."""
    for noise in noises:
        noisy = run(few, quiet.tolerance, MOST_STEPS, noise)
        moved = _apart(noisy, quiet, few)
        if moved < _LINEAR:
            return [noisy], _LUCK * moved * _ROUNDING / abs(noise)
    return [noisy], moved


def _check_decided(made: Refinement, event: Escapement) -> None:
    """RefusedError where the runs do not decide which kicks were given."""
    rough, fine = made.runs[-2:]
    assert fine.events is not None  # since there is an event
    grazing = np.any(fine.events.margins < _CLEAR * made.estimated_error * fine.scale[event.component])
    if grazing or not _same_kicks(rough, fine):
        raise RefusedError(
            "events: whether a crossing happens is not decided by the tolerance (the motion only touches the level);"
            " move the level, or ask for a smaller tolerance"
        )


def _same_kicks(rough: Run, fine: Run) -> bool:
    """Whether two runs gave the same kicks, but for a last one next to the end."""
    largest, end = 0.0, float(fine.times[-1])
    (times, which), (others, which_others) = rough.happenings, fine.happenings
    for kick in np.union1d(which, which_others):
        one, other = times[which == kick], others[which_others == kick]
        common = min(one.size, other.size)
        largest = max(largest, float(np.max(np.abs(one[:common] - other[:common]), initial=0.0)))
        beyond = np.concatenate([one[common:], other[common:]])
        if beyond.size > 1 or np.any(end - beyond > 10.0 * largest + 1e-9 * abs(end)):
            return False
    return True


def _clock_rounding(system: Any, fine: Run, few: Floats) -> float:
    """What a driven motion makes of time being a double, relative: each step is driven as of a slightly other time."""
    span, steps = float(few[-1] - few[0]), float(fine.counts[0])
    if steps == 0.0:
        return 0.0
    states = fine.at(few)
    moment = _MOMENT * span / steps
    change = np.zeros(states.shape[1])
    _change(system, few, states, moment, change)
    rounded = 0.5 * _ROUNDING * float(np.max(np.abs(few)))
    rate = np.sqrt(change)[None, :] / moment
    return _LUCK * rounded * span / math.sqrt(steps) * relative_error(rate, fine.scale)


@making_kernel
def _change(system: Any, times: Floats, states: Floats, moment: float, out: Floats) -> None:
    """Mean square by which the derivative at a given state changes with time alone in a moment, (n,)."""
    here, aside = np.empty_like(out), np.empty_like(out)
    for k in range(times.size):
        derivative(times[k], states[k], system, here)
        derivative(times[k] + moment, states[k], system, aside)
        for i in range(out.size):
            out[i] += (aside[i] - here[i]) ** 2 / times.size


def instants(begin: float, end: float) -> Floats:
    """Where runs are compared, whatever the outputs are."""
    return np.unique(np.concatenate([begin + (end - begin) * spread(_COMPARED), [end]]))


def _gain(rough: Run, fine: Run) -> float:
    """Error of the finer of two runs over that of the other: the tolerances', more where their steps hardly differ."""
    tighter = fine.tolerance / rough.tolerance
    steps = float(rough.counts[0]) / float(fine.counts[0]) if fine.counts[0] else 0.0
    return min(1.0, tighter * max(1.0, steps**_ORDER / tighter) ** 1.5)


def _apart(one: Run, other: Run, few: Floats) -> float:
    """Largest relative difference of two runs at instants between the same kicks; 1 where their kicks do not match."""
    before = [np.searchsorted(each.happenings[0], few) for each in (one, other)]
    comparable = few[before[0] == before[1]]
    if comparable.size < (1.0 - _FEW) * few.size - 1:
        return 1.0
    return difference(one.at(comparable), other.at(comparable), other.scale)
