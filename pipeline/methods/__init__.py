"""The methods of `process`, by name.

A method of one difference is a function `Prepared -> Estimate`, imported when it is asked for; `joint` fits all traces
at once (`pipeline.joint`), and `auto` is `joint`, or the period of a single trace.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError

if TYPE_CHECKING:
    from pipeline.estimate import Estimate
    from pipeline.prepared import Prepared

    Method = Callable[[Prepared], Estimate]

_WHERE = {
    "uncorrected": ("phases", "uncorrected"),
    "vening-meinesz": ("vening_meinesz", "estimate"),
    "panteleev": ("phases", "panteleev"),
    "general": ("general", "estimate"),
    "complex": ("phases", "complex_form"),
    "projection": ("projection", "estimate"),
    "shooting": ("shooting", "estimate"),
}
PAIR_METHODS: tuple[str, ...] = tuple(_WHERE)
"""Methods that look at one difference of two pendulums."""
BEST_FIRST = ("joint", "shooting", "projection", "complex", "panteleev", "general", "vening-meinesz", "uncorrected")
"""Methods, the most exact first."""
METHODS: tuple[str, ...] = (*PAIR_METHODS, "joint", "auto")
"""What `process` takes."""


def method(name: str) -> Method:
    """The function of a method.

    Raises
    ------
    UsageError
        There is no such method.
    """
    if name not in _WHERE:
        import difflib

        near = difflib.get_close_matches(name, METHODS, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise UsageError(f"method '{name}': {hint}choose from {', '.join(METHODS)}")
    module, function = _WHERE[name]
    found: Method = getattr(importlib.import_module(f"pipeline.methods.{module}"), function)
    return found
