"""The methods of `process`, each declared once: name, words, formula, where it is.

A method of one difference is a function `Prepared -> Estimate`, imported when it is asked for; `joint` fits all traces
at once (`pipeline.joint`), and `auto` is `joint`, or the period of a single trace. Others come by `register_method`, or
by entry points of the group "isochrony.methods", whose objects are such functions.
"""

import importlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError

if TYPE_CHECKING:
    from pipeline.prepared import Estimate, Prepared

Function = Callable[["Prepared"], "Estimate"]


@dataclass(frozen=True)
class Method:
    """What help, demonstration, pictures and results say of a method."""

    function: Function | str  # `Prepared -> Estimate`, or "module:name", imported when asked for; empty: all traces
    short: str  # what it is, in a few words
    words: str  # the same in a line


DECLARED = {
    name: Method(**declared)
    for name, declared in json.loads(Path(__file__).with_name("declared.json").read_text(encoding="utf-8")).items()
}
"""Those of the package, the plainest first."""
PAIR_METHODS: tuple[str, ...] = tuple(name for name, each in DECLARED.items() if each.function)
"""Methods of the package that look at one difference of two pendulums."""
METHODS: tuple[str, ...] = tuple(DECLARED)  # What `process` takes, beside those that are registered
BEST_FIRST = ("joint", "shooting", "projection", "complex", "panteleev", "general", "vening-meinesz", "uncorrected")
"""Methods, the most exact first."""
GROUP = "isochrony.methods"  # Of entry points


def register_method(name: str, function: Function, *, words: str = "") -> None:
    """Add a method to those of `process`.

    Parameters
    ----------
    name : str
        By which it is asked for.
    function : callable
        `Prepared -> Estimate`.
    words : str
        What it does, in a line.

    Raises
    ------
    UsageError
        The name is that of a method of the package.
    """
    if name in METHODS:
        raise UsageError(f"method '{name}': is one of the package; register yours by another name")
    DECLARED[name] = Method(function, words, words)


def known(name: str) -> bool:
    """Whether there is such a method; entry points are looked at where it is none of the package."""
    if name not in DECLARED:
        from importlib.metadata import entry_points

        for point in entry_points(group=GROUP, name=name):
            register_method(name, point.load(), words=f"of {point.value}")
    return name in DECLARED


def method(name: str) -> Function:
    """The function of a method; `UsageError`: there is none of that name."""
    if not known(name) or not DECLARED[name].function:
        import difflib

        near = difflib.get_close_matches(name, DECLARED, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise UsageError(f"method '{name}': {hint}choose from {', '.join(DECLARED)}")
    function = DECLARED[name].function
    if callable(function):
        return function
    module, _, place = function.partition(":")
    found: Function = getattr(importlib.import_module(module), place)
    return found
