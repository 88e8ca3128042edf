"""The films that ship with the package, and films in files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from data_schemas.scene_film import Film

if TYPE_CHECKING:
    import xarray as xr


def films() -> tuple[str, ...]:
    """Names of the shipped films, in alphabetical order.

    Examples
    --------
    >>> films()
    ('bad', 'clean', 'historic-slow', 'typical')
    """
    folder = resources.files("synth.film") / "presets"
    return tuple(sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml")))


def load_film(name: str) -> Film:
    """Read a film: the name of a shipped one, or a TOML file with its keys (or with a section `film`, as a scene has).

    Raises
    ------
    SceneError
        No such film ships, or the file has faults; one line names them.
    """
    from pydantic import ValidationError

    from data_schemas.scene_fields import one_line
    from data_schemas.text_files import load_toml

    path = Path(name)
    if path.suffix != ".toml" and path.parent == Path("."):
        if name not in films():
            raise SceneError(
                f"no film {name!r} ships with isochrony; there are: {', '.join(films())}; or give a TOML file"
            )
        path = Path(str(resources.files("synth.film") / "presets" / f"{name}.toml"))
    content = load_toml(path, f"a film (or the name of one of {', '.join(films())})", SceneError)
    try:
        return Film.model_validate(content["film"] if isinstance(content.get("film"), dict) else content)
    except ValidationError as error:
        raise SceneError(f"{path}: {one_line(error, Film)}") from None


def film_of(given: Film | str | None, source: xr.DataTree | Scene) -> Film:
    """The film to expose: as given, by name, that of the scene, or one without defects."""
    if isinstance(given, str):
        return load_film(given)
    if given is None:
        return source.film if isinstance(source, Scene) and source.film is not None else Film()
    return given
