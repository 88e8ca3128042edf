"""A choice made by type when a kernel is compiled."""

from __future__ import annotations

from collections.abc import Callable
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
