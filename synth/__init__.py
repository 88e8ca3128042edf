"""The simulator: a scene becomes a record and its truth.

`simulate` is the one entry, `simulate_to` its way straight to files; `simulate_ensemble` and
`write_ensemble` make many members of a scene; `expose`
puts a record or a scene on photographic film. `scenes` and `scene_path` give the scenes that ship with the package.
Nothing is imported before it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from synth.ensemble import simulate_ensemble as simulate_ensemble
    from synth.ensemble import write_ensemble as write_ensemble
    from synth.film.exposing import expose as expose
    from synth.film.exposing import expose_to as expose_to
    from synth.film.exposing import film_truth_path as film_truth_path
    from synth.shipped import films as films
    from synth.shipped import load_film as load_film
    from synth.shipped import scene_path as scene_path
    from synth.shipped import scenes as scenes
    from synth.streaming import simulate as simulate
    from synth.streaming import simulate_to as simulate_to

_MODULES = {
    "ensemble": ("simulate_ensemble", "write_ensemble"),
    "film.exposing": ("expose", "expose_to", "film_truth_path"),
    "shipped": ("films", "load_film", "scene_path", "scenes"),
    "streaming": ("simulate", "simulate_to"),
}
_HOMES = {name: f"synth.{module}" for module, names in _MODULES.items() for name in names}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'synth' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
