"""From a record or a scene to a film: image, what is known of it, and its truth."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.appending import Appended
from data_schemas.errors import FileError, UsageError
from data_schemas.film_description import description_path, film_stem
from data_schemas.scene import Scene
from data_schemas.scene_film import Film
from data_schemas.shield import shielded
from data_schemas.text_files import toml_text
from data_schemas.writing import may_write, place_of, reason, write_text
from synth.film.layout import STRIP, Pixels, plan_film
from synth.film.sidecars import ImageFile, description_of, truth_of
from synth.film.source import source_of
from synth.film.strips import Development, Exposure, blurred, quantised
from synth.phase import Floats
from synth.shipped import load_film

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Exposed:
    """What was made: size of the image, px; length of the film, m; labels of the traces; paths."""

    rows: int
    columns: int
    length: float
    traces: tuple[str, ...]
    image: Path
    description: Path
    truth: Path


def film_truth_path(film: str | os.PathLike[str]) -> Path:
    """Where the truth of a film is kept: beside its image.

    Examples
    --------
    >>> film_truth_path("a/ship.film.tif").name
    'ship.film.truth.nc'
    """
    return Path(film).with_name(film_stem(film) + ".film.truth.nc")


def expose(
    source: xr.DataTree | Scene, film: Film | str | None, path: str | os.PathLike[str], *, seed: int | None = None,
    overwrite: bool = False, progress: Callable[[int, int], object] | None = None,
) -> xr.DataTree:  # fmt: skip
    """Expose a film to a record or a scene, develop and scan it.

    Three files are made: the image (BigTIFF in strips of 1024 rows, along the film), NAME.film.toml, what an observer
    knows of the film, and NAME.film.truth.nc, what he does not.

    Parameters
    ----------
    source : DataTree or Scene
        A record, whose samples are joined by a spline of degree 5 and whose missing stretches leave the film dark; or
        a scene, which is simulated without noise and defects of its recording.
    film : Film, str or None
        The film, or the name of a shipped one; None: that of the scene, else one without any defect.
    path : path
        Of the image, ending in .tif; its folder must exist.
    seed : int, optional
        Of all chance of the film; left out: the film's own, else the scene's, else 0.
    overwrite : bool
        Whether existing files may be replaced.
    progress : callable, optional
        Called with how many rows are done, and of how many, after every strip.

    Returns
    -------
    DataTree
        The truth, as written.

    Raises
    ------
    UsageError
        The swing does not fit on the paper, the film lies too crooked, or tifffile is not there.
    RecordError
        The record is sampled too coarsely, or breaks its layout.
    SceneError, FileError
        As `synth.simulate_to`. Whatever is raised, a KeyboardInterrupt too, nothing half-written stays.

    Examples
    --------
    >>> import tempfile
    >>> from data_schemas import load_scene
    >>> from synth import scene_path
    >>> scene = load_scene(scene_path("linear")).model_copy(update={"duration": 20.0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     truth = expose(scene, Film(lever=500.0), f"{folder}/linear.film.tif")
    >>> truth["slices/column"].sizes["time"]
    1417
    """
    from data_schemas.reading import read

    return read(expose_to(source, film, path, seed=seed, overwrite=overwrite, progress=progress).truth)


def expose_to(
    source: xr.DataTree | Scene, film: Film | str | None, path: str | os.PathLike[str], *, seed: int | None = None,
    overwrite: bool = False, progress: Callable[[int, int], object] | None = None,
) -> Exposed:  # fmt: skip
    """As `expose`, strip by strip: the truth is not read back. What grows with the film are its samples and marks."""
    target = Path(path)
    if target.suffix.lower() not in (".tif", ".tiff"):
        raise UsageError(f"{target}: films are written as TIFF; end the name with .tif")
    for one in (target, description_path(target), film_truth_path(target)):  # refused before the work, not after it
        try:
            may_write(place_of(one), one, overwrite)
        except OSError as error:
            raise FileError(f"{one}: cannot be written, {reason(error)}") from error
    if film is None:
        film = source.film if isinstance(source, Scene) and source.film is not None else Film()
    elif isinstance(film, str):
        film = load_film(film)
    if seed is None:
        seed = film.seed if film.seed is not None else source.seed if isinstance(source, Scene) else 0
    plan = plan_film(source_of(source), film, seed)
    exposure, development, truth = Exposure(plan), Development(plan), truth_of(plan)
    transport, geometry = plan.transport, plan.geometry
    text = toml_text(description_of(plan).model_dump())
    made = Exposed(
        geometry.rows, geometry.columns, geometry.length / geometry.pixels / 1000.0, plan.source.traces,
        target, description_path(target), film_truth_path(target),
    )  # fmt: skip

    with (
        ImageFile(target, made.rows, made.columns, film.bits, film.dpi, overwrite=overwrite) as image,
        Appended(made.truth, made.rows, overwrite=overwrite) as kept,
    ):

        def strips() -> Iterator[Pixels]:
            for number in range(-(-made.rows // STRIP)):
                latent, crossings = exposure.strip(number)
                rows: Floats = number * STRIP + np.arange(len(latent), dtype=np.float64) + 0.5
                kept.append(truth(transport.time_at(geometry.along_at_left(rows)), crossings))
                yield development.strip(number, latent)

        done = 0
        for pixels in blurred(strips(), film.blur):
            strip = quantised(pixels, film.bits)
            if film.upside_down:
                image.write(made.rows - done - len(strip), strip[::-1, ::-1])
            else:
                image.write(done, strip)
            done += len(strip)
            if progress is not None:
                progress(done, made.rows)
        image.finish()
        kept.finish()
        with shielded():  # all or none
            write_text(text, made.description, overwrite=overwrite)
            kept.publish()
            image.publish()
    return made
