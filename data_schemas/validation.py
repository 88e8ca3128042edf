"""Checks a file of any kind: that it is safe, whole, and means what its schema says."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from .checking import faults
from .contents import Contents, shown
from .errors import FileError, RecordError, SceneError
from .layouts import LAYOUTS, Kind
from .reading import load


def validate(path: str | os.PathLike[str]) -> list[str]:
    """Every fault of a file at once, one line each; an empty list for a good one. Bad content never raises.

    Parameters
    ----------
    path : path
        A record, truth or result; or, told by its suffix ``.toml``, a scene, the description of a film or edits of one.

    Returns
    -------
    list of str
        ``path: group/name: what is wrong; what to do``.
    """
    if Path(path).suffix == ".toml":
        return _faults(_loader(path), path)
    try:
        contents = load(path)
    except FileError as error:
        return [str(error)]
    kind, found = _kind(contents)
    found += [] if kind is None else faults(contents, kind)
    return [f"{shown(path, 400)}: {fault}" for fault in dict.fromkeys(found)]


def _loader(path: str | os.PathLike[str]) -> Callable[[str | os.PathLike[str]], object]:
    """What reads a TOML file of its kind."""
    from . import film_description, film_edits
    from .scene import load_scene
    from .text_files import load_toml

    kinds = {film_description.KIND: film_description.load_description, film_edits.KIND: film_edits.load_edits}
    try:
        return kinds.get(str(load_toml(path, "a scene", SceneError).get("kind")), load_scene)
    except SceneError:  # the scene's own check says what is wrong
        return load_scene


def _faults(load: Callable[[str | os.PathLike[str]], object], path: str | os.PathLike[str]) -> list[str]:
    try:
        load(path)
    except (SceneError, RecordError, FileError) as error:
        return [str(error)]
    return []


def _kind(contents: Contents) -> tuple[Kind | None, list[str]]:
    """What the file says it is, or failing that looks like, with the fault of not saying it well."""
    schema = contents[""].attrs.get("schema")
    for kind, layout in LAYOUTS.items():
        if isinstance(schema, str) and schema == layout.schema:
            return kind, []
    for kind, layout in LAYOUTS.items():
        if not layout.groups.keys().isdisjoint(contents):
            return kind, []  # the check of this kind says what is wrong with the attribute
    known = ", ".join(layout.schema for layout in LAYOUTS.values())
    said = "is missing at the root" if schema is None else f"is {shown(repr(schema))}"
    return None, [f"attribute schema: {said} and no group is known; set it to one of {known}"]
