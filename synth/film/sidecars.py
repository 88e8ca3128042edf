"""What is written of a film: the image (a BigTIFF in strips, in any order), what is known, what is not."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from importlib import import_module
from types import TracebackType
from typing import IO, Any, Self

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import Contents, Entry, Group, shown
from data_schemas.errors import FileError, UsageError
from data_schemas.film_description import BASE, BASES, PERIODS, DescribedInstrument, DescribedPendulum, FilmDescription
from data_schemas.layouts import CONVENTIONS, LAYOUTS, VERSION
from data_schemas.variables import attributes
from data_schemas.writing import beside, give_name, may_write, place_of, reason
from synth.film.layout import STRIP, FilmPlan
from synth.film.strips import Crossings
from synth.phase import Floats
from synth.recording.observe import described, label_array


def description_of(plan: FilmPlan) -> FilmDescription:
    """What the observer knows: the camera as it is meant to be, and the instrument as the record states it."""
    source, film, layout = plan.source, plan.film, plan.layout
    traces = []
    for name, weights, lever, place in zip(
        source.traces, source.combination, layout.lever, layout.position, strict=True
    ):
        own = {label: float(weight) for label, weight in zip(source.pendulums, weights, strict=True) if weight}
        traces.append({"name": name, "combination": own, "lever": float(lever), "position": float(place)})
    known = source.instrument
    labels = [str(each) for each in known.get("pendulum", source.pendulums)]
    stated = [name for name in DescribedPendulum.model_fields if name in known]
    shown = [(k, label) for k, label in enumerate(labels) if label in source.pendulums]
    pendulums = [{"label": label, **{name: float(known[name][k]) for name in stated}} for k, label in shown]
    stated = [name for name in DescribedInstrument.model_fields if name in known]
    scalars = {name: float(known[name]) for name in stated if np.ndim(known[name]) == 0}
    return FilmDescription.model_validate(
        {
            "record_id": source.record_id, "title": source.title, "start_time": source.start_time,
            "speed": film.speed, "dpi": film.dpi, "mark_interval": film.mark_interval, "gap": film.gap,
            "minute_code": film.minute_code, "restoring": source.restoring, "traces": traces, "pendulums": pendulums,
            "instrument": scalars, "bases": _bases(known, labels, source.pendulums),
            "readings": source.readings,
        }
    )  # fmt: skip


def _bases(known: dict[str, Any], labels: list[str], shown: tuple[str, ...]) -> list[dict[str, Any]]:
    """Occupations of base stations, as the record states them."""
    bases = []
    for k, label in enumerate(known.get(BASE, ())):
        values = {key: float(known[name][k]) for name, key in BASES.items() if name in known}
        rows = {key: zip(labels, known[name][k], strict=True) for name, key in PERIODS.items() if name in known}
        periods = {key: {own: float(value) for own, value in row if own in shown} for key, row in rows.items()}
        bases.append({"label": str(label), **values, **periods})
    return bases


def truth_of(plan: FilmPlan) -> Callable[[Floats, Crossings], Contents]:
    """Lay out the truth of some rows of a film, given the times of their centre lines at the left edge, (rows,) s."""
    source, layout, marks = plan.source, plan.layout, plan.marks
    attrs = {
        "Conventions": CONVENTIONS, "schema": LAYOUTS["film-truth"].schema, "schema_version": VERSION,
        "record_id": source.record_id, "title": source.title, "history": f"exposed with seed {plan.seed}",
        "source": "model", "film": plan.film.model_dump_json(), "seed": plan.seed,
        **({} if source.scene is None else {"scene": source.scene.model_dump_json()}),
    }  # fmt: skip
    clock = attributes("time") | {"units": f"seconds since {source.start_time}"}
    labels = {"trace": label_array(source.traces)}
    places = {"optical_lever": layout.lever, "position": layout.position, "offset": layout.offset}
    rows = plan.geometry.row_at_left(plan.transport.travel(marks.time))
    flags = {"minute": marks.minute, "missing": marks.missing, "spurious": marks.spurious}
    marked: dict[str, Any] = {"mark_time": marks.time, "mark_row": rows, **flags}
    marks_group = described("marks", {name: (("mark",), value) for name, value in marked.items()}, {})

    def portion(time: Floats, crossings: Crossings) -> Contents:
        slices = {
            "exposure_time": crossings.time, "elongation": crossings.elongation,
            "column": crossings.column, "slope": crossings.slope,
        }  # fmt: skip
        variables: dict[str, Any] = {name: (("trace",), value) for name, value in places.items()}
        variables |= {name: (("trace", "time"), value) for name, value in slices.items()}
        return {
            "": Group(dict(attrs), {"time": Entry(("time",), time, clock)}),
            "slices": described("slices", variables, labels),
            "marks": marks_group,
        }

    return portion


class ImageFile:
    """An image of known size; a context manager, whose end without `publish` leaves nothing behind.

    The file's folder must exist. `FileError` as `data_schemas.write`, from any method; `UsageError` where the package
    tifffile is not there.
    """

    def __init__(
        self, path: str | os.PathLike[str], rows: int, columns: int, bits: int, dpi: float, *, overwrite: bool = False
    ) -> None:
        self._path, self._overwrite = path, overwrite
        self._shape, self._bits, self._dpi = (rows, columns), bits, dpi
        self._target = place_of(path)
        self._temporary = beside(self._target)
        self._file: IO[bytes] | None = None
        self._begin = 0

    def __enter__(self) -> Self:
        try:
            tifffile: Any = import_module("tifffile")
        except ImportError:
            raise UsageError(
                "films need the package tifffile; install it with: pip install 'isochrony[film]'"
            ) from None
        with self._told():
            may_write(self._target, self._path, self._overwrite)
            with tifffile.TiffWriter(self._temporary, bigtiff=True, byteorder="<") as made:
                self._begin, _ = made.write(
                    shape=self._shape, dtype=f"uint{self._bits}", rowsperstrip=STRIP, photometric="minisblack",
                    resolution=(self._dpi, self._dpi), resolutionunit="INCH", software="isochrony", metadata=None,
                    returnoffset=True,
                )  # fmt: skip
            self._file = open(self._temporary, "r+b")  # closed at the end of the block
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        with contextlib.suppress(OSError):  # renamed already, or never made
            self._temporary.unlink()

    def write(self, first: int, pixels: NDArray[Any]) -> None:
        """Write rows from number `first` on."""
        assert self._file is not None
        with self._told():
            self._file.seek(self._begin + first * self._shape[1] * self._bits // 8)
            self._file.write(np.ascontiguousarray(pixels, dtype=f"<u{self._bits // 8}").data)

    def finish(self) -> None:
        """Bring the file to the disk, so that `publish` only gives it its name."""
        assert self._file is not None
        with self._told():
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()

    def publish(self) -> None:
        """Give the finished file its name, in one step."""
        with self._told():
            give_name(self._temporary, self._target, self._path, self._overwrite)

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise FileError(f"{shown(self._path, 400)}: cannot be written, {reason(error)}") from error
