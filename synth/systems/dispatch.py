"""One name for the equations of every system; the TYPE of the parameters decides what is compiled.

A system is a NamedTuple of numbers, arrays, or other NamedTuples: its terms. An integrator calls
`derivative(time, state, system, out)`; Numba compiles in the kernel that the type was registered with: new numbers
never recompile. Under `NUMBA_DISABLE_JIT=1` the same call goes through a table.
"""

import functools
import inspect
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numba.core import types
from numba.extending import overload, register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])

_TABLE: dict[str, dict[type, Callable[..., Any]]] = {}


taken_in: Callable[[Function], Function] = register_jitable
"""Decorator: plain Python that kernels take in; a branch on `argument is None` is decided when they are compiled.

It must return one type all the same: see `or_none`."""


def or_none(function: Function) -> Function:
    """Decorator: as `taken_in`, for a function whose result is None where its first argument is."""

    def choose(first: Any, *others: Any) -> Any:
        return (lambda first, *others: None) if isinstance(first, types.NoneType) else function

    @functools.wraps(function)
    def call(first: Any, *others: Any) -> Any:
        return None if first is None else function(first, *others)

    overload(call, strict=False)(choose)
    return cast(Function, call)


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel's Python code without annotations, to be compiled in: called, it would count references to arrays."""
    code = getattr(function, "py_func", function)
    return FunctionType(code.__code__, code.__globals__, code.__name__, code.__defaults__, code.__closure__)


def by_type(argument: str) -> Callable[[Function], Function]:
    """Decorator: the name below stands for the kernels registered under it, one for each type of this argument."""

    def stand(function: Function) -> Function:
        role, place = function.__name__, list(inspect.signature(function).parameters).index(argument)
        _TABLE.setdefault(role, {})  # modules may come in any order

        @functools.wraps(function)
        def call(*arguments: Any) -> Any:
            return _find(role, type(arguments[place]))(*arguments)

        overload(call, strict=False)(lambda *arguments: plain(_find(role, _class(arguments[place]))))
        return cast(Function, call)

    return stand


def registered(role: str, system: type) -> Callable[[Function], Function]:
    """Decorator: the kernel below plays `role` (a name made `by_type`) for a type."""

    def note(function: Function) -> Function:
        _TABLE.setdefault(role, {})[system] = function
        return function

    return note


def _find(role: str, system: Any) -> Callable[..., Any]:
    if system not in _TABLE[role]:
        raise TypeError(f"{getattr(system, '__name__', system)} has no {role}")
    return _TABLE[role][system]


def _class(system: Any) -> Any:
    """Python's type for that of the compiler."""
    return type(None) if isinstance(system, types.NoneType) else getattr(system, "instance_class", system)


@by_type("system")
def derivative(time: float, state: Any, system: Any, out: Any) -> None:
    """`out = d state / dt`."""


@by_type("system")
def response(state: Any, index: int, system: Any, out: Any) -> None:
    """`out` = change of the state by a unit impulse (torque x time) on pendulum `index`."""


@by_type("system")
def remainder(work: Any, sideways: Any, upwards: Any, system: Any, now: int) -> None:
    """Accelerations less the linear part at all nodes of an interval; see `integrators.collocation_remainders`."""


_STEP = 2.0**-24  # Of a difference: it errs by 3e-8 of the second derivative, and by 2e-9 of the function


@taken_in
def jacobian(time: float, state: Any, system: Any, out: Any, here: Any, there: Any) -> None:
    """`out[i, j] = d(d state_i / dt) / d state_j`, by differences; `here` receives the derivative, `there` is work space."""
    derivative(time, state, system, here)
    for j in range(state.size):
        kept = state[j]
        state[j] = kept + _STEP * max(1.0, abs(kept))
        share = 1.0 / (state[j] - kept)
        derivative(time, state, system, there)
        state[j] = kept
        for i in range(state.size):
            out[i, j] = (there[i] - here[i]) * share


def plain_jacobian(time: float, state: Any, system: Any) -> Any:
    """As `jacobian`, in plain Python: where one evaluation is wanted, compiling would cost seconds."""
    function = plain(_find("derivative", type(system)))

    def slopes(moved: Any) -> Any:
        out = np.zeros_like(moved)
        function(time, moved, system, out)
        return out

    return np.array([(slopes(state + each) - slopes(state)) / _STEP for each in _STEP * np.eye(state.size)]).T
