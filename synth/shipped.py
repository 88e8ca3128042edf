"""The scenes and films that ship with the package, and films in files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import SceneError

if TYPE_CHECKING:
    from data_schemas.scene_recording import Film

_SCENES = Path(str(resources.files("synth") / "scenes"))
_FILMS = Path(str(resources.files("synth") / "film" / "presets"))


def scenes() -> tuple[str, ...]:
    """Names of the shipped scenes, in alphabetical order.

    Examples
    --------
    >>> "demo" in scenes()
    True
    """
    return tuple(sorted(each.stem for each in _SCENES.glob("*.toml")))


def scene_path(name: str) -> Path:
    """Path of a shipped scene, ready for `data_schemas.load_scene`.

    Parameters
    ----------
    name
        One of `scenes()`.

    Raises
    ------
    SceneError
        If no scene of that name ships; the message lists those that do.
    """
    if name not in scenes():
        raise SceneError(f"no scene {name!r} ships with isochrony; there are: {', '.join(scenes())}")
    return _SCENES / f"{name}.toml"


def films() -> tuple[str, ...]:
    """Names of the shipped films, in alphabetical order.

    Examples
    --------
    >>> films()
    ('bad', 'clean', 'historic-slow', 'typical')
    """
    return tuple(sorted(each.stem for each in _FILMS.glob("*.toml")))


def load_film(name: str) -> Film:
    """Read a film: the name of a shipped one, or a TOML file with its keys (or with a section `film`, as a scene has).

    Raises
    ------
    SceneError
        No such film ships, or the file has faults; one line names them.
    """
    from pydantic import ValidationError

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
