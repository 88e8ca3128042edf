"""From a record or a scene to a film in three files: the image, what an observer knows of it, and its truth."""

import contextlib
import os
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from data_schemas import film_description
from data_schemas.appending import Appended
from data_schemas.contents import Contents, Entry, Group
from data_schemas.errors import UsageError
from data_schemas.layouts import root_attributes
from data_schemas.scene import Scene
from data_schemas.scene_recording import Film
from data_schemas.shield import shielded
from data_schemas.text_files import toml_text
from data_schemas.variables import attributes
from data_schemas.writing import Placed, write_text
from synth import load_film
from synth.film.layout import STRIP, FilmPlan, Pixels, plan_film
from synth.film.source import source_of
from synth.film.strips import Crossings, Development, Exposure, blurred, quantised
from synth.phase import Floats
from synth.recording.observe import described, label_array


class Exposed(NamedTuple):
    """What was made: size of the image, px; length of the film, m; labels of the traces; paths."""

    rows: int
    columns: int
    length: float
    traces: tuple[str, ...]
    image: Path
    description: Path
    truth: Path


def film_truth_path(film: str | os.PathLike[str]) -> Path:
    """Where the truth of a film is kept: a/ship.film.truth.nc beside a/ship.film.tif."""
    return Path(film).with_name(film_description.film_stem(film) + ".film.truth.nc")


def expose(
    source: xr.DataTree | Scene, film: Film | str | None, path: str | os.PathLike[str], *, seed: int | None = None,
    overwrite: bool = False, progress: Callable[[int, int], object] | None = None,
) -> xr.DataTree:  # fmt: skip
    """Expose a film to a record or a scene, develop and scan it; returns its truth.

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
    description, truth = film_description.description_path(target), film_truth_path(target)
    for each in (target, description, truth):  # refused before the work, not after it
        with Placed(each, overwrite=overwrite):
            pass
    scene = source if isinstance(source, Scene) else None
    if film is None:
        film = scene.film if scene is not None and scene.film is not None else Film()
    elif isinstance(film, str):
        film = load_film(film)
    seeds = [seed, film.seed, None if scene is None else scene.seed, 0]
    plan = plan_film(source_of(source), film, next(each for each in seeds if each is not None))
    exposure, development, lay_out = Exposure(plan), Development(plan), _truth_of(plan)
    geometry, transport = plan.geometry, plan.transport
    total = geometry.rows
    text = toml_text(_description_of(plan).model_dump())

    with (
        ImageFile(target, total, geometry.columns, film.bits, film.dpi, overwrite=overwrite) as image,
        Appended(truth, total, overwrite=overwrite) as kept,
    ):

        def strips() -> Iterator[Pixels]:
            for number in range(-(-total // STRIP)):
                latent, crossings = exposure.strip(number)
                rows: Floats = number * STRIP + np.arange(len(latent), dtype=np.float64) + 0.5
                kept.append(lay_out(transport.time_at(geometry.along_at_left(rows)), crossings))
                yield development.strip(number, latent)

        done = 0
        for pixels in blurred(strips(), film.blur):
            strip = quantised(pixels, film.bits)
            if film.upside_down:
                image.write(total - done - len(strip), strip[::-1, ::-1])
            else:
                image.write(done, strip)
            done += len(strip)
            if progress is not None:
                progress(done, total)
        image.finish()
        kept.finish()
        with shielded():  # all or none
            write_text(text, description, overwrite=overwrite)
            kept.publish()
            image.publish()
    length = geometry.length / geometry.pixels / 1000.0
    return Exposed(total, geometry.columns, length, plan.source.traces, target, description, truth)


def _description_of(plan: FilmPlan) -> film_description.FilmDescription:
    """What the observer knows: the camera as it is meant to be, and the instrument as the record states it."""
    source, film, layout, known = plan.source, plan.film, plan.layout, plan.source.instrument
    traces = []
    for name, weights, lever, place in zip(
        source.traces, source.combination, layout.lever, layout.position, strict=True
    ):
        own = {label: float(weight) for label, weight in zip(source.pendulums, weights, strict=True) if weight}
        traces.append({"name": name, "combination": own, "lever": float(lever), "position": float(place)})
    labels = [str(each) for each in known.get("pendulum", source.pendulums)]
    stated = [name for name in film_description.DescribedPendulum.model_fields if name in known]
    own_labels = [(k, label) for k, label in enumerate(labels) if label in source.pendulums]
    pendulums = [{"label": label, **{name: float(known[name][k]) for name in stated}} for k, label in own_labels]
    stated = [name for name in film_description.DescribedInstrument.model_fields if name in known]
    bases = []
    for k, base in enumerate(known.get(film_description.BASE, ())):
        values = {key: float(known[name][k]) for name, key in film_description.BASES.items() if name in known}
        rows = {key: known[name][k] for name, key in film_description.PERIODS.items() if name in known}
        periods = {key: {label: float(row[at]) for at, label in own_labels} for key, row in rows.items()}
        bases.append({"label": str(base), **values, **periods})
    return film_description.FilmDescription.model_validate(
        {
            "record_id": source.record_id, "title": source.title, "start_time": source.start_time,
            "speed": film.speed, "dpi": film.dpi, "mark_interval": film.mark_interval, "gap": film.gap,
            "minute_code": film.minute_code, "restoring": source.restoring, "traces": traces, "pendulums": pendulums,
            "instrument": {name: float(known[name]) for name in stated if np.ndim(known[name]) == 0}, "bases": bases,
            "readings": source.readings,
        }
    )  # fmt: skip


def _truth_of(plan: FilmPlan) -> Callable[[Floats, Crossings], Contents]:
    """Lay out the truth of some rows of a film, given the times of their centre lines at the left edge, (rows,) s."""
    source, layout, marks = plan.source, plan.layout, plan.marks
    said = {"title": source.title, "history": f"exposed with seed {plan.seed}", "source": "model"}
    attrs: dict[str, Any] = {**root_attributes("film-truth", source.record_id, **said), "seed": plan.seed}
    models = {"film": plan.film, "scene": source.scene}
    attrs |= {name: model.model_dump_json() for name, model in models.items() if model is not None}
    clock = attributes("time") | {"units": f"seconds since {source.start_time}"}
    labels = {"trace": label_array(source.traces)}
    places = {"optical_lever": layout.lever, "position": layout.position, "offset": layout.offset}
    rows = plan.geometry.row_at_left(plan.transport.travel(marks.time))
    flags = {"minute": marks.minute, "missing": marks.missing, "spurious": marks.spurious}
    marked = {"mark_time": marks.time, "mark_row": rows, **flags}
    marks_group = described("marks", {name: (("mark",), value) for name, value in marked.items()}, {})

    def lay_out(time: Floats, crossings: Crossings) -> Contents:
        slices = crossings._asdict()
        slices = {"exposure_time": slices.pop("time"), **slices}
        variables: dict[str, Any] = {name: (("trace",), value) for name, value in places.items()}
        variables |= {name: (("trace", "time"), value) for name, value in slices.items()}
        return {
            "": Group(dict(attrs), {"time": Entry(("time",), time, clock)}),
            "slices": described("slices", variables, labels),
            "marks": marks_group,
        }

    return lay_out


class ImageFile(Placed):
    """A BigTIFF whose rows come in any order; a context that leaves nothing behind without `publish`.

    `FileError` as `data_schemas.write`, from any method; `UsageError` where the package tifffile is not there.
    """

    _file: IO[bytes] | None = None
    _begin = 0

    def __init__(
        self, path: str | os.PathLike[str], rows: int, columns: int, bits: int, dpi: float, *, overwrite: bool = False
    ) -> None:
        super().__init__(path, overwrite=overwrite)
        self._shape, self._bits, self._dpi = (rows, columns), bits, dpi

    def __enter__(self) -> Self:
        try:
            tifffile: Any = import_module("tifffile")
        except ImportError:
            raise UsageError(
                "films need the package tifffile; install it with: pip install 'isochrony[film]'"
            ) from None
        super().__enter__()
        with self.named():
            with tifffile.TiffWriter(self.temporary, bigtiff=True, byteorder="<") as made:
                self._begin, _ = made.write(
                    shape=self._shape, dtype=f"uint{self._bits}", rowsperstrip=STRIP, photometric="minisblack",
                    resolution=(self._dpi, self._dpi), resolutionunit="INCH", software="isochrony", metadata=None,
                    returnoffset=True,
                )  # fmt: skip
            self._file = open(self.temporary, "r+b")  # closed at the end of the block
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        super().__exit__(kind, error, at)

    def write(self, first: int, pixels: NDArray[Any]) -> None:
        """Write rows from number `first` on."""
        assert self._file is not None
        with self.named():
            self._file.seek(self._begin + first * self._shape[1] * self._bits // 8)
            self._file.write(np.ascontiguousarray(pixels, dtype=f"<u{self._bits // 8}").data)

    def finish(self) -> None:
        """Bring the file to the disk, so that `publish` only gives it its name."""
        assert self._file is not None
        with self.named():
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
