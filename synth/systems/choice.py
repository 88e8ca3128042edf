"""A choice made by type when a kernel is compiled."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar

from numba.extending import overload

Chooser = TypeVar("Chooser", bound=Callable[..., Any])


def chosen_for(function: Callable[..., Any]) -> Callable[[Chooser], Chooser]:
    """Decorator: the function below takes the argument types of `function` and returns the code to compile.

    Numba wants the chooser and what it returns to have the same signature, annotations included, and a lambda has
    none; so the chooser's are taken off.
    """

    def register(chooser: Chooser) -> Chooser:
        chooser.__annotations__ = {}
        overload(function)(chooser)
        return chooser

    return register


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel's Python code, for the compiler to take in as its own.

    Called as a kernel, each call would count references to every array of the parameters: 60 ns where the
    arithmetic takes 6. Numba wants signatures without annotations here (see `chosen_for`).
    """
    code = getattr(function, "py_func", function)
    return FunctionType(code.__code__, code.__globals__, code.__name__, code.__defaults__, code.__closure__)
