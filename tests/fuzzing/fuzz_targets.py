"""Readers of files of anybody's making: whatever the bytes, each returns or raises an error of the product's own."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tifffile
import xarray as xr
from PIL import Image
from sealing import sealed

import data_schemas
import synth
from data_schemas.checksum import ATTRIBUTE
from data_schemas.errors import IsochronyError
from data_schemas.film_description import load_description
from data_schemas.layouts import CONVENTIONS, LAYOUTS
from data_schemas.reading import skim
from data_schemas.scene_motion import Table
from pipeline.cli import small
from pipeline.cli.parser import parser_of
from pipeline.film.scan.opening import open_scan
from pipeline.importing.record import ImportOptions, import_csv
from synth import films, load_film
from synth.motion.tabulated import read_table

SECONDS, BYTES = 10.0, 1 << 30
"""What a reader may take for one input."""

Read = Callable[[Path], object]


@dataclass(frozen=True)
class Target:
    """Readers of one kind of file.

    Attributes
    ----------
    ending : str
        Of the file's name.
    readers : tuple of functions
        Each is given the file's path.
    seeds : function
        Makes good files in a folder, and gives their contents.
    seal : function
        Makes checksums of changed contents right.
    """

    ending: str
    readers: tuple[Read, ...]
    seeds: Callable[[Path], Iterator[bytes]]
    seal: Callable[[bytes], bytes] = bytes

    def __call__(self, folder: Path, data: bytes) -> None:
        """Read a content by all readers; what is not the product's own error comes out."""
        path = folder / f"input{self.ending}"
        path.write_bytes(data)
        for reader in self.readers:
            with contextlib.suppress(IsochronyError):
                reader(path)


def _constants(table: Path) -> None:
    """The constants of an instrument beside a table, as `isochrony import` takes them."""
    swing = table.with_name("swing.csv")
    if not swing.exists():
        swing.write_text("0 0.01\n1 -0.01\n2 0.01\n")
    words = [str(swing), "--instrument", str(table), "-o", str(table.with_name("swing.record.nc")), "--force"]
    with contextlib.redirect_stdout(io.StringIO()):
        small.import_table(parser_of("import").parse_args(words))


def _importing(**options: Any) -> Read:
    return lambda path: import_csv(path, ImportOptions(**options))


def _motion(**columns: Any) -> Read:
    return lambda path: read_table(Table(file=str(path), **columns))


def _netcdf(path: Path) -> None:
    """What `read` refuses all refuse."""
    data_schemas.read(path)
    for reader in (data_schemas.validate, skim, import_csv, _motion(time="time", value="heave")):
        with contextlib.suppress(IsochronyError):
            reader(path)


def hdf5_seeds(folder: Path) -> Iterator[bytes]:
    """Records as the product writes them, as other software does, and a table of motion."""
    tree = xr.DataTree.from_dict(
        {
            "/": xr.Dataset(
                coords={"time": ("time", np.arange(12.0), {"units": "seconds since 2000-01-01T00:00:00Z"})}
            ),
            "/record": xr.Dataset(
                {
                    "elongation": (("trace", "time"), np.ones((2, 12)), {"units": "rad"}),
                    "combination": (("trace", "pendulum"), np.eye(2)),
                },
                coords={"trace": ["1", "1-2"], "pendulum": ["1", "2"]},
            ),
            "/instrument": xr.Dataset({"period": ("pendulum", np.ones(2)), "reference_gravity": 9.81}),
        }
    )
    tree.attrs = {
        "Conventions": CONVENTIONS,
        "schema": LAYOUTS["record"].schema,
        "schema_version": LAYOUTS["record"].version,
        "record_id": "a",
        "source": "made",
    }
    path, other = folder / "seed.nc", folder / "other.nc"
    data_schemas.write(tree, path, overwrite=True)
    with h5py.File(path, "a") as file:
        del file.attrs[ATTRIBUTE]
    yield path.read_bytes()
    for library in ("earliest", "latest"):
        with h5py.File(path) as file, h5py.File(other, "w", libver=library) as copy:
            _copied(file, copy, packed=library == "latest")
        yield other.read_bytes()
    series = {"time": np.arange(9.0), "heave": np.ones(9)}
    with h5py.File(other, "w") as file:
        for name, values in series.items():
            file[name] = values
        file["time"].make_scale("time")
        file["heave"].dims[0].attach_scale(file["time"])
    yield other.read_bytes()


def _copied(source: h5py.Group, copy: h5py.Group, packed: bool) -> None:
    """Arrays and attributes without what ties dimensions; integers with scale, offset and filters where asked for."""
    for name, value in source.attrs.items():
        if isinstance(value, str | float):
            copy.attrs[name] = value
    for name, member in source.items():
        if isinstance(member, h5py.Group):
            _copied(member, copy.create_group(name), packed)
        elif packed and member.dtype.kind == "f" and member.ndim:
            made = copy.create_dataset(name, data=member[()].astype("i2"), compression=4, shuffle=True, fletcher32=True)
            made.attrs.update({"scale_factor": 0.5, "add_offset": 1.0, "_FillValue": np.int16(-9)})
        else:
            copy[name] = member[()]


def film_seeds(folder: Path) -> Iterator[bytes]:
    """A dark line on light paper, in every kind of file."""
    column = 12.0 + 6.0 * np.sin(np.arange(48) / 5.0)
    grey = np.uint8(np.clip(220.0 - 150.0 * np.exp(-((np.arange(24) - column[:, None]) ** 2)), 0.0, 255.0))
    colour = np.repeat(grey[:, :, None], 3, axis=2)
    path = folder / "seed.tif"
    for pixels, big, order, layout in (
        (grey, False, "<", {"rowsperstrip": 16, "resolution": (600, 600)}),
        (grey, False, ">", {"rowsperstrip": 16, "compression": "zlib", "predictor": True}),
        (grey.astype(np.uint16) * 257, False, "<", {"tile": (16, 16), "compression": "zlib"}),
        (grey, True, "<", {"photometric": "miniswhite"}),
        (np.moveaxis(colour, 2, 0), False, "<", {"planarconfig": "separate", "photometric": "rgb", "rowsperstrip": 16}),
        (colour, False, "<", {"photometric": "rgb", "rowsperstrip": 48, "compression": "zlib"}),
    ):
        with tifffile.TiffWriter(path, bigtiff=big, byteorder=order) as writer:
            writer.write(pixels, metadata=None, **layout)
        yield path.read_bytes()
    image = Image.fromarray(grey)
    turned = Image.Exif()
    turned[274] = 6
    for picture, kind, saving in (
        (image, "TIFF", {"compression": "tiff_lzw"}),
        (image, "PNG", {"dpi": (600, 600)}),
        (image.convert("P"), "PNG", {"exif": turned}),
        (Image.fromarray(grey.astype(np.uint16) * 257), "PNG", {}),
        (image, "JPEG", {"dpi": (600, 600)}),
        (image.convert("RGB"), "JPEG", {"exif": turned, "progressive": True}),
    ):
        stream = io.BytesIO()
        picture.save(stream, kind, **saving)
        yield stream.getvalue()


def csv_seeds(_: Path) -> Iterator[bytes]:
    """Tables as programs and instruments write them."""
    for text in (
        "time,angle\n" + "".join(f"{0.5 * k:.2f},{0.01 * (-1) ** k}\n" for k in range(12)),
        "0 0.01\n1 -0.01\n2 0.01\n",
        "# t (ms);1 [deg];1-2 [deg]\n0;1,5;nan\n1;-1,4;0,1\n2;1,4;-\n",
        "clock\tleft_mrad\n2024-05-01T12:00:00.25Z\t1\n2024-05-01T12:00:01.123456789Z\t2\n",
        "mass_A,,\nt,x,y\n" + "".join(f"{k},{np.sin(k):.3f},{-np.cos(k):.3f}\n" for k in range(12)),
        "2000000,0.01,9\n2000000.25,0.02,9\n2000000.5,0.01,9\n",
    ):
        yield text.encode()


def toml_seeds(_: Path) -> Iterator[bytes]:
    """Shipped scenes and films, a film's description, constants of an instrument."""
    for name in synth.scenes():
        yield synth.scene_path(name).read_bytes()
    presets = Path(synth.__file__).parent / "film" / "presets"
    for name in films():
        yield (presets / f"{name}.toml").read_bytes()
    yield b"""kind = "film-description"
record_id = "a"
start_time = "1937-05-01T12:00:00Z"
speed = 5.0
[[traces]]
name = "1"
combination = {"1" = 1.0}
lever = 2000.0
[[pendulums]]
label = "1"
period = 1.01
[[bases]]
label = "before"
time = -3600.0
gravity = 9.81
period = {1 = 1.01}
[[readings]]
time = 0.0
latitude = 60.0
"""
    yield b'period = 1.01\nreference_gravity = 9.81\nlatitude = 60.0\nrestoring = "sine"\ndamping_rate = {1 = 1e-4}\n'


TARGETS = {
    "hdf5": Target(
        ".nc",
        (_netcdf,),
        hdf5_seeds,
        sealed,
    ),
    "film": Target(".tif", (open_scan,), film_seeds, sealed),
    "csv": Target(
        ".csv",
        (
            import_csv,
            _importing(periods={"1": 1.0, "2": 1.0001}, gravity=9.81),
            _importing(time="2", columns=("3", "1:upper"), unit="deg", combinations={"upper": "1-2"}, noise=0.1),
            _importing(position="2,3", periods={"": 1.0}, gravity=9.81, accelerations={"vertical_acceleration": "1"}),
            _motion(time="t", value="x"),
            _motion(time=1, value=2),
        ),
        csv_seeds,
    ),
    "toml": Target(".toml", (data_schemas.load_scene, load_description, load_film, _constants), toml_seeds),
}


def mutated(whole: bytes, draw: np.random.Generator) -> bytes:
    """Bytes changed, cut out, doubled, put in from elsewhere, or made extreme; one to four times."""
    bad = bytearray(whole)
    for _ in range(draw.integers(1, 5)):
        at, other = (int(place) for place in draw.integers(len(bad) + 1, size=2))
        length = int(draw.integers(1, 16))
        match draw.integers(6):
            case 0:
                bad[at : at + 1] = draw.bytes(1)
            case 1:
                del bad[at : at + length]
            case 2:
                bad[at:at] = bad[at : at + length] * int(draw.integers(1, 9))
            case 3:
                bad[at : at + length] = bad[other : other + length]
            case 4:
                bad[at : at + 4] = int(draw.integers(1 << 32)).to_bytes(4, "little")
            case _:
                extremes = (b"\xff" * 8, b"\0" * 8, b"nan", b"1e999", b"-9" * 9, b"[" * 99, b"\n", b"=", b'"""', b"0x")
                bad[at : at + 8] = extremes[draw.integers(len(extremes))]
    return bytes(bad)
