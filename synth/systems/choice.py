"""A choice made by type when a kernel is compiled."""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

from numba.core import types
from numba.extending import overload, register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])


def taken_in(function: Function) -> Function:
    """Decorator: plain Python that kernels take in; a branch on `argument is None` is decided when they are compiled.

    What is returned must be of one type all the same: see `or_none` for the choice between None and something.
    """
    register_jitable(function)
    return function


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
    """The kernel's Python code, for the compiler to take in as its own.

    Called as a kernel, each call would count references to every array of the parameters: 60 ns where the
    arithmetic takes 6. It comes without annotations, which Numba would compare.
    """
    code = getattr(function, "py_func", function)
    return FunctionType(code.__code__, code.__globals__, code.__name__, code.__defaults__, code.__closure__)
