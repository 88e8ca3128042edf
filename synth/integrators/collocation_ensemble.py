"""Many clocks on yielding supports at once: members share weights and lengths of intervals, and threads share members.

A member's own arithmetic already fills vector registers (the nodes of an interval are its lanes). What members share
is the rest: the linear part that is carried is rounded to ten bits, so that few weights serve all, and what was
rounded off returns exactly through the remainder; lengths of intervals are tried out once, on the first member. So a
member's last bits depend on the first member, but on no other and not on the number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.integrators.collocation import check_collocates, limits_for, local_tolerance
from synth.integrators.collocation_remainders import linear_part
from synth.integrators.collocation_run import Problem, Run, chosen, run
from synth.integrators.explicit import checked
from synth.phase import Floats

_BITS = 10  # of the linear part that is carried


def integrate_ensemble(
    systems: Any, starts: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-9, workers: int | None = None
) -> Floats:
    """Integrate many members to the same times.

    Parameters
    ----------
    systems : NamedTuple, or sequence of NamedTuples
        One system whose parameters may have a leading axis of members (`members_of`), or one system a member, all of
        one type. Systems as for `collocation.integrate`.
    starts : (members, n) array
        States at the first of `times`.
    times : (k,) array
        Increasing, s.
    tolerance : float
        Error wanted, relative to the size of each component. It is not estimated here: integrate a member alone.
    workers : int, optional
        Threads; by default one a processor.

    Returns
    -------
    (members, k, n) float64

    Raises
    ------
    RefusedError
        As `collocation.integrate`; the first member that is refused stops all.
    UsageError
        Arguments that cannot be meant.

    Examples
    --------
    >>> from synth.systems.metronomes import Metronomes
    >>> pairs = Metronomes(np.array([[6.0, 6.1], [6.0, 6.2]]), np.array([0.01, 0.02]))
    >>> integrate_ensemble(pairs, [[0.1, 0.0, 0.0, 0.0]] * 2, [0.0, 0.5, 1.0]).shape
    (2, 3, 4)
    """
    states = np.array(starts, dtype=np.float64)
    if states.ndim != 2 or not len(states):
        raise UsageError("starts must be one row a member, (members, n)")
    first, instants = checked(states[0], times, tolerance)
    each = list(systems) if not hasattr(systems, "_fields") else members_of(systems, len(states))
    if len(each) != len(states) or not np.isfinite(states).all():
        raise UsageError(f"{len(each)} systems and {len(states)} starts: give one finite start a member")
    check_collocates(each[0])
    carried = [_rounded(system) for system in each]
    longest = Problem.of(each[0], carried[0]).longest
    limits = limits_for(local_tolerance(tolerance, instants, longest))
    depth = chosen(Run.begin(Problem.of(each[0], carried[0], longest), first, float(instants[0]), limits))
    result = np.empty((len(states), instants.size, first.size))

    def member(index: int) -> None:
        problem = Problem.of(each[index], carried[index], longest)
        run(problem, states[index], instants, limits, depth=depth, out=result[index])

    with ThreadPoolExecutor(workers or _processors()) as pool:
        for done in [pool.submit(member, index) for index in range(len(states))]:
            done.result()
    return result


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def members_of(system: Any, members: int) -> list[Any]:
    """One system a member, from one whose parameters may have a leading axis of members.

    A number given as (members,) and an array given with one axis more than usual are taken apart, in nested terms too;
    everything else is shared.

    Examples
    --------
    >>> from synth.systems.resistance import Viscous
    >>> [each.damping_rate.tolist() for each in members_of(Viscous(np.array([[0.1, 0.2], [0.3, 0.4]])), 2)]
    [[0.1, 0.2], [0.3, 0.4]]
    """
    kinds = type(system).__annotations__
    columns = [_taken_apart(value, kinds[name], members) for name, value in system._asdict().items()]
    return [type(system)(*row) for row in zip(*columns, strict=True)]


def _taken_apart(value: Any, kind: Any, members: int) -> Sequence[Any]:
    if hasattr(value, "_fields"):
        return members_of(value, members)
    axes = {"float": 0, "Floats": 1}.get(getattr(kind, "__forward_arg__", kind))
    if axes is None or np.ndim(value) != axes + 1:
        return [value] * members
    if len(value) != members:
        raise UsageError(f"a parameter has {len(value)} members where the starts have {members}")
    return [float(each) for each in value] if axes == 0 else list(np.ascontiguousarray(value, dtype=np.float64))


def _rounded(system: Any) -> tuple[Floats, Floats]:
    """The linear part with few bits."""
    parts = np.array([[float(each) for each in pair] for pair in linear_part(system)])
    mantissa, exponent = np.frexp(parts)
    rounded = np.ldexp(np.round(np.ldexp(mantissa, _BITS)), exponent - _BITS)
    return rounded[:, 0].copy(), rounded[:, 1].copy()
