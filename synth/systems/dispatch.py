"""One name for the equations of every system; the TYPE of the parameters decides what is compiled.

A system is a NamedTuple of numbers (or of arrays, or of other NamedTuples: its terms). An integrator calls
`derivative(time, state, system, out)`; Numba picks the kernel that the type was registered with and compiles it
in, so that new numbers never recompile, a term left out costs nothing, and the result is cached on disk. Under
`NUMBA_DISABLE_JIT=1` the same call goes through a table.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.core import types

from synth.systems.choice import chosen_for, plain

Function = TypeVar("Function", bound=Callable[..., Any])

_TABLE: dict[str, dict[type, Callable[..., Any]]] = {
    "derivative": {},
    "jacobian": {},
    "energy": {},
    "response": {},
    "remainder": {},
}


def registered(role: str, system: type) -> Callable[[Function], Function]:
    """Decorator: the kernel below plays `role` (a key of the table above) for a system type."""

    def note(function: Function) -> Function:
        _TABLE[role][system] = function
        return function

    return note


def _find(role: str, system: Any) -> Callable[..., Any]:
    table = _TABLE[role]
    if system not in table:
        raise TypeError(f"{getattr(system, '__name__', system)} has no {role}")
    return table[system]


def derivative(time: float, state: Any, system: Any, out: Any) -> None:
    """`out = d state / dt`."""
    _find("derivative", type(system))(time, state, system, out)


def jacobian(time: float, state: Any, system: Any, out: Any) -> None:
    """`out[i, j] = d(d state_i / dt) / d state_j`."""
    _find("jacobian", type(system))(time, state, system, out)


def energy(state: Any, system: Any) -> float:
    """Energy of a conservative system (without drive and damping)."""
    return float(_find("energy", type(system))(state, system))


def response(state: Any, index: int, system: Any, out: Any) -> None:
    """`out` = change of the state by a unit impulse (torque x time) on pendulum `index`."""
    _find("response", type(system))(state, index, system, out)


def remainder(
    position: Any, rate: Any, sideways: Any, upwards: Any, system: Any, excess: Any, room: Any, out: Any, now: int
) -> None:
    """Accelerations less the linear part at all nodes of an interval; see `integrators.collocation_lanes`."""
    _find("remainder", type(system))(position, rate, sideways, upwards, system, excess, room, out, now)


def plain_jacobian(time: float, state: Any, system: Any, out: Any) -> None:
    """As `jacobian`, in plain Python: where one evaluation is wanted, compiling would cost seconds."""
    plain(_find("jacobian", type(system)))(time, state, system, out)


def _class(system: Any) -> Any:
    return system.instance_class if isinstance(system, types.NamedTuple | types.NamedUniTuple) else None


@chosen_for(derivative)
def _derivative(time: Any, state: Any, system: Any, out: Any) -> Any:
    return plain(_find("derivative", _class(system)))


@chosen_for(jacobian)
def _jacobian(time: Any, state: Any, system: Any, out: Any) -> Any:
    return plain(_find("jacobian", _class(system)))


@chosen_for(energy)
def _energy(state: Any, system: Any) -> Any:
    return plain(_find("energy", _class(system)))


@chosen_for(response)
def _response(state: Any, index: Any, system: Any, out: Any) -> Any:
    return plain(_find("response", _class(system)))


@chosen_for(remainder)
def _remainder(
    position: Any, rate: Any, sideways: Any, upwards: Any, system: Any, excess: Any, room: Any, out: Any, now: Any
) -> Any:
    return plain(_find("remainder", _class(system)))
