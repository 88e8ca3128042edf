"""The scenes that ship with the package."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from data_schemas.errors import SceneError


def scenes() -> tuple[str, ...]:
    """Names of the shipped scenes, in alphabetical order.

    Examples
    --------
    >>> "demo" in scenes()
    True
    """
    folder = resources.files("synth") / "scenes"
    return tuple(sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml")))


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
    return Path(str(resources.files("synth") / "scenes" / f"{name}.toml"))
