"""The methods of `process`, each declared once: name, words, formula, where it is.

A method of one difference is a function `Prepared -> Estimate`, imported when it is asked for; `joint` fits all traces
at once (`pipeline.joint`), and `auto` is `joint`, or the period of a single trace. Others come by `register_method`, or
by entry points of the group "isochrony.methods", whose objects are such functions.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
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


_PHASES, _EXACT = "pipeline.methods.phases", "pipeline.methods.exact"
DECLARED: dict[str, Method] = {
    "uncorrected": Method(f"{_PHASES}:uncorrected", "slope of the phase",
        "slope of the difference pendulum's phase, nothing corrected"),
    "vening-meinesz": Method(f"{_PHASES}:vening_meinesz", "formula (9)",
        "formula (9), the fictitious pendulum with the raw first pendulum"),
    "panteleev": Method(f"{_PHASES}:panteleev", "paper's formula (27)", "formula (27), the separated free harmonic"),
    "general": Method(f"{_PHASES}:general", "corrected formula (38)",
        "formulas (36) and (38) with the model's phase speeds, finite arc, slow acceleration of the support"),
    "complex": Method(f"{_PHASES}:complex_form", "(27), complex form",
        "complex form of (27), works where the amplitude passes through zero"),
    "projection": Method(f"{_EXACT}:projection", "exact if it is linear",
        "exact identity of linear pendulums, clean uniform records"),
    "shooting": Method(f"{_EXACT}:shooting", "exact inversion",
        "exact identity of real pendulums, clean uniform records; heave as recorded, or none"),
    "joint": Method("", "all, by likelihood",
        "state-space model of all pendulums, ship and instrument, by likelihood; gravity along the track"),
    "auto": Method("", "", "joint (default); of a single trace its period"),
}  # fmt: skip
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
