"""The kinds of input that a batch takes, and how each becomes a record; a further kind is one more row of `KINDS`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import data_schemas
import synth
from pipeline.batch.job import Allow, Config, Kind

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.scene import Scene
    from pipeline.batch.inputs import Variant


def read_record(path: Path, _config: Config, allow: Allow) -> DataTree:
    """A record file: looked over, then read."""
    return data_schemas.read(path, declared=allow)


def simulate_scene(path: Path, config: Config, allow: Allow) -> DataTree:
    """A scene, or a member of it: simulated, its truth forgotten."""
    scene = data_schemas.load_scene(path, allow_paths=config.allow_paths)
    if config.member:
        scene = member_of(scene, config.member, config.variant)
    allow(8 * scene.count * (len(scene.traces) + 1))
    record, _ = synth.simulate(scene)
    return record


def member_of(scene: Scene, number: int, variant: Variant) -> Scene:
    """The scene of one point of a grid, with a seed of its own.

    `SceneError` for a key that the scene does not have, or a value that is not allowed.
    """
    from synth.ensemble import member, member_scenes

    vary: dict[str, Any] = {key: lambda _chance, value=value: value for key, value in variant}
    next(member_scenes(scene, 1, vary=vary))  # an unknown key is told with the nearest known one
    return member(scene, number, vary=vary)


def digitise_film(path: Path, _config: Config, allow: Allow) -> DataTree:
    """The scan of a film: read by what stands in NAME.film.toml beside it."""
    from pipeline.film.digitise import digitise

    # read piece by piece, the rows' arrays apart; other formats than TIFF are decoded whole, from a fifth of their size
    piecewise = path.suffix.lower() in _TIFF
    allow(path.stat().st_size // 8 if piecewise else 5 * path.stat().st_size)
    return digitise(path)


def description_beside(path: Path) -> Path:
    """Where the description of a film is kept."""
    from data_schemas.film_description import description_path

    return description_path(path)


_TIFF = (".tif", ".tiff")
KINDS = (
    Kind("record", (".record.nc", ".nc"), read_record),
    Kind("film", _TIFF, digitise_film, beside=description_beside),
    Kind("film as PNG or JPEG", (".png", ".jpg", ".jpeg"), digitise_film, searched=False, beside=description_beside),
    Kind("scene", (".toml",), simulate_scene, searched=False),
)  # All kinds, by the endings of their files
