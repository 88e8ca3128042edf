"""The simulator: a scene becomes a record and its truth.

`simulate` is the one entry, `simulate_to` its way straight to files; `simulate_ensemble` and
`write_ensemble` make many members of a scene. `scenes` and `scene_path` give the scenes that ship with the package.
Nothing is imported before it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from synth.ensemble import simulate_ensemble
    from synth.ensemble_files import write_ensemble
    from synth.shipped import scene_path, scenes
    from synth.simulation import simulate
    from synth.streaming import simulate_to

__all__ = ["scene_path", "scenes", "simulate", "simulate_ensemble", "simulate_to", "write_ensemble"]

_HOMES = {
    "simulate": "synth.simulation",
    "simulate_to": "synth.streaming",
    "simulate_ensemble": "synth.ensemble",
    "write_ensemble": "synth.ensemble_files",
    "scenes": "synth.shipped",
    "scene_path": "synth.shipped",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'synth' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
