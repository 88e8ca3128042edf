"""The simulator: a scene becomes a record and its truth. Nothing is imported before it is used.

`simulate`, `simulate_to` for one scene; `simulate_ensemble`, `write_ensemble` for many members of it; `expose` for
photographic film. `scenes`, `scene_path`, `films` and `load_film` give what ships with the package.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from data_schemas.scene_recording import Film
    from synth.ensemble import simulate_ensemble as simulate_ensemble
    from synth.ensemble import write_ensemble as write_ensemble
    from synth.film.exposing import expose as expose
    from synth.film.exposing import expose_to as expose_to
    from synth.film.exposing import film_truth_path as film_truth_path
    from synth.streaming import simulate as simulate
    from synth.streaming import simulate_to as simulate_to

_MODULES = {
    "ensemble": ("simulate_ensemble", "write_ensemble"),
    "film.exposing": ("expose", "expose_to", "film_truth_path"),
    "streaming": ("simulate", "simulate_to"),
}
_HOMES = {name: f"synth.{module}" for module, names in _MODULES.items() for name in names}
_SCENES, _FILMS = Path(__file__).parent / "scenes", Path(__file__).parent / "film" / "presets"

__all__ = sorted([*_HOMES, "films", "load_film", "scene_path", "scenes"])


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'synth' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__


def scenes() -> tuple[str, ...]:
    """Names of the shipped scenes, in alphabetical order."""
    return tuple(sorted(each.stem for each in _SCENES.glob("*.toml")))


def scene_path(name: str) -> Path:
    """Path of a shipped scene, one of `scenes()`; `SceneError` with the known names if no scene of that name ships."""
    from data_schemas.errors import SceneError

    if name not in scenes():
        raise SceneError(f"no scene {name!r} ships with isochrony; there are: {', '.join(scenes())}")
    return _SCENES / f"{name}.toml"


def films() -> tuple[str, ...]:
    """Names of the shipped films, in alphabetical order."""
    return tuple(sorted(each.stem for each in _FILMS.glob("*.toml")))


def load_film(name: str) -> "Film":
    """Read a shipped film by its name, or a TOML file with its keys (or with a section `film`, as a scene has).

    `SceneError` in one line if no such film ships, or the file has faults.
    """
    from pydantic import ValidationError

    from data_schemas.errors import SceneError
    from data_schemas.scene_fields import one_line
    from data_schemas.scene_recording import Film
    from data_schemas.text_files import load_toml

    path, known = Path(name), ", ".join(films())
    if path.suffix != ".toml" and path.parent == Path("."):
        if name not in films():
            raise SceneError(f"no film {name!r} ships with isochrony; there are: {known}; or give a TOML file")
        path = _FILMS / f"{name}.toml"
    content = load_toml(path, f"a film (or the name of one of {known})", SceneError)
    try:
        return Film.model_validate(content["film"] if isinstance(content.get("film"), dict) else content)
    except ValidationError as error:
        raise SceneError(f"{path}: {one_line(error, Film)}") from None
