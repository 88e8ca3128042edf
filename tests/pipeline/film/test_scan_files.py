"""Any image of a film gives the same rows: TIFF of every layout, PNG, JPEG, turned, inverted, coloured; or one line."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from data_schemas.errors import FileError, IsochronyError, UsageError
from pipeline.film.scan.files import CLOCKWISE, TURNS, in_memory, to_grey, turned
from pipeline.film.scan.opening import open_scan

tifffile = pytest.importorskip("tifffile")
Image = pytest.importorskip("PIL.Image")


def film(rows: int = 300, columns: int = 97, kind: type = np.uint8, seed: int = 0) -> np.ndarray:
    """Light film with one dark wavy line."""
    top = np.iinfo(kind).max
    grey = 0.85 + 0.01 * np.random.default_rng(seed).standard_normal((rows, columns))
    line = 0.5 * columns + 0.3 * columns * np.sin(np.arange(rows) / 9.0)
    grey -= 0.6 * np.exp(-0.5 * ((np.arange(columns) - line[:, None]) / 1.2) ** 2)
    return np.round(np.clip(grey, 0, 1) * top).astype(kind)


LAYOUTS = {
    "plain": {"rowsperstrip": 64},
    "one-strip": {},
    "deflated": {"compression": "zlib", "rowsperstrip": 64},
    "differences": {"compression": "zlib", "rowsperstrip": 37, "predictor": True},
    "tiles": {"tile": (32, 48)},
    "deflated-tiles": {"tile": (32, 48), "compression": "zlib", "predictor": True},
    "bigtiff": {"bigtiff": True, "rowsperstrip": 64},
    "big-endian": {"byteorder": ">", "compression": "zlib", "rowsperstrip": 64, "predictor": True},
    "white-is-zero": {"photometric": "miniswhite", "rowsperstrip": 64},
}


def save(path: Path, pixels: np.ndarray, **layout) -> Path:
    general = {key: layout.pop(key) for key in ("bigtiff", "byteorder") if key in layout}
    with tifffile.TiffWriter(path, **general) as writer:
        writer.write(pixels, **layout)
    return path


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_of_tiff_gives_the_same_rows(tmp_path, name, kind):
    pixels = film(kind=kind)
    stored = np.iinfo(kind).max - pixels if name == "white-is-zero" else pixels
    scan = open_scan(save(tmp_path / "film.tif", stored, **LAYOUTS[name]))
    assert (scan.rows, scan.columns, scan.full_scale) == (*pixels.shape, np.iinfo(kind).max)
    for first, stop in ((0, 300), (63, 65), (250, 300), (10, 11), (-5, 400)):
        np.testing.assert_array_equal(scan.read(first, stop), pixels[max(0, first) : stop])


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("channels", [3, 4])
def test_colour_becomes_grey_whatever_its_planes(tmp_path, planar, channels):
    pixels = film()
    colour = np.stack([pixels] * 3 + [np.full_like(pixels, 7)] * (channels - 3), axis=-1)
    stored = np.ascontiguousarray(np.moveaxis(colour, -1, 0)) if planar == "separate" else colour
    extra = {"extrasamples": ["unassalpha"]} if channels == 4 else {}
    path = save(tmp_path / "film.tif", stored, photometric="rgb", planarconfig=planar, rowsperstrip=50, **extra)
    np.testing.assert_array_equal(open_scan(path).read(0, 300), pixels)


@pytest.mark.parametrize("first", [True, False])
def test_thumbnail_in_file_is_passed_over(tmp_path, first):
    pixels = film()
    with tifffile.TiffWriter(tmp_path / "film.tif") as writer:
        for page in (pixels[::4, ::4], pixels) if first else (pixels, pixels[::4, ::4]):
            writer.write(page, rowsperstrip=64)
    np.testing.assert_array_equal(open_scan(tmp_path / "film.tif").read(0, 300), pixels)


def test_luma_weighs_the_colours_and_white_stays_white():
    colours = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]], dtype=np.uint8)
    assert to_grey(colours).tolist() == [[76, 150, 29, 255]]  # ITU-R BT.601
    assert to_grey(np.full((1, 1, 3), 65535, dtype=np.uint16)).tolist() == [[65535]]


WHOLE = [("png", mode) for mode in ("L", "RGB", "RGBA", "P", "I;16")]
WHOLE += [("jpg", "L"), ("jpg", "RGB"), ("lzw.tif", "L"), ("lzw.tif", "I;16")]


@pytest.mark.parametrize(("ending", "mode"), WHOLE)
def test_png_jpeg_and_rare_tiffs_are_decoded_whole(tmp_path, ending, mode):
    pixels = film(kind=np.uint16 if mode == "I;16" else np.uint8)
    path = tmp_path / f"film.{ending}"
    image = Image.fromarray(pixels)
    more = {"compression": "tiff_lzw"} if ending == "lzw.tif" else {"quality": 95} if ending == "jpg" else {}
    (image if mode == "I;16" else image.convert(mode)).save(path, dpi=(300, 300), **more)
    scan = open_scan(path)
    largest = np.abs(scan.read(0, 300).astype(float) - pixels).max()
    assert largest <= (20 if ending == "jpg" else 0)
    assert scan.scale == pytest.approx(25.4 / 300, rel=1e-4)


@pytest.mark.parametrize("degrees", CLOCKWISE)
def test_turns_are_clockwise(degrees):
    pixels = film(60, 40)
    image = in_memory(pixels, Path("a"))
    result = turned(image, CLOCKWISE[degrees])
    np.testing.assert_array_equal(result.read(0, result.rows), np.rot90(pixels, -degrees // 90))
    np.testing.assert_array_equal(result.read(7, 19), np.rot90(pixels, -degrees // 90)[7:19])


@pytest.mark.parametrize("code", range(1, 9))
def test_orientation_tag_sets_the_picture_upright(tmp_path, code):
    from PIL import ImageOps

    path = tmp_path / "film.png"
    exif = Image.Exif()
    exif[274] = code
    Image.fromarray(film()).save(path, exif=exif)
    with Image.open(path) as image:
        shown = np.asarray(ImageOps.exif_transpose(image))
    if shown.shape[1] > shown.shape[0]:
        shown = np.rot90(shown, -1)  # the long side runs down
    scan = open_scan(path)
    np.testing.assert_array_equal(scan.read(0, scan.rows), shown)


def test_turns_combine():
    pixels = film(50, 30)
    image = in_memory(pixels, Path("a"))
    for turn in TURNS:
        shown = pixels.T if "t" in turn else pixels
        shown = shown[:: -1 if "r" in turn else 1, :: -1 if "c" in turn else 1]
        for other in CLOCKWISE:
            both = turned(turned(image, turn), CLOCKWISE[other])
            np.testing.assert_array_equal(both.read(0, both.rows), np.rot90(shown, -other // 90))


@pytest.mark.parametrize("layout", ["plain", "deflated", "tiles"])
def test_film_that_lies_across_is_turned_in_pieces(tmp_path, layout, monkeypatch):
    monkeypatch.setattr("pipeline.film.scan.files.CHUNK", 300 * 21)
    pixels = film()
    scan = open_scan(save(tmp_path / "film.tif", np.rot90(pixels).copy(), **LAYOUTS[layout]))
    np.testing.assert_array_equal(scan.read(0, 300), pixels)
    np.testing.assert_array_equal(scan.read(17, 23), pixels[17:23])
    np.testing.assert_array_equal(scan.upside_down().read(0, 300), pixels[::-1, ::-1])


def test_light_lines_become_dark_and_the_option_decides_otherwise(tmp_path):
    pixels = film()
    negative = save(tmp_path / "negative.tif", 255 - pixels)
    scan = open_scan(negative)
    np.testing.assert_array_equal(scan.read(0, 300), pixels)
    assert "light" in scan.notes[0]
    np.testing.assert_array_equal(open_scan(negative, lines="dark").read(0, 300), 255 - pixels)


def test_resolution_from_tags_in_inches_or_centimetres_or_the_option(tmp_path):
    pixels = film()
    for unit, value in (("INCH", 300.0), ("CENTIMETER", 300.0 / 2.54)):
        path = save(tmp_path / f"{unit}.tif", pixels, resolution=(value, value), resolutionunit=unit)
        assert open_scan(path).scale == pytest.approx(25.4 / 300)
        assert open_scan(path, dpi=600).scale == pytest.approx(25.4 / 600)
    assert open_scan(save(tmp_path / "none.tif", pixels)).scale is None
    screen = save(tmp_path / "screen.tif", pixels, resolution=(72, 72), resolutionunit="INCH")
    assert open_scan(screen).scale is None
    with pytest.raises(FileError, match="square pixels"):
        open_scan(save(tmp_path / "oblong.tif", pixels, resolution=(300, 150), resolutionunit="INCH"))


def test_options_are_checked():
    with pytest.raises(UsageError, match="orientation '45': give one of auto, 0"):
        open_scan("film.tif", orientation="45")
    with pytest.raises(UsageError, match="lines 'grey'"):
        open_scan("film.tif", lines="grey")
    with pytest.raises(UsageError, match="dpi 0"):
        open_scan("film.tif", dpi=0.0)
    with pytest.raises(UsageError, match="no film is named"):
        open_scan([])


def hostile(folder: Path) -> dict[str, Path]:
    """Files that are no film, by what is wrong with them."""
    good = save(folder / "good.tif", film(), rowsperstrip=64, compression="zlib").read_bytes()
    plain = save(folder / "plain.tif", film(), rowsperstrip=64).read_bytes()
    Image.fromarray(film()).save(folder / "good.png")
    png = (folder / "good.png").read_bytes()
    Image.fromarray(film()).save(folder / "good.jpg")
    chunk = b"IHDR" + struct.pack(">IIBBBBB", 2**31 - 1, 2**31 - 1, 8, 0, 0, 0, 0)
    bomb = png[:8] + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk)) + png[33:]
    content = {
        "empty": b"",
        "text": b"this is no image at all\n" * 100,
        "truncated-tiff": good[: len(good) // 2],
        "truncated-plain": plain[:-2000],
        "tiff-header-only": b"II*\0",
        "tiff-wild-offset": b"II*\0\xff\xff\xff\xff",
        "tiff-noise": b"II*\0" + np.random.default_rng(0).bytes(5000),
        "tiff-damaged-strip": good.replace(b"\x78", b"\x00"),
        "truncated-png": png[: len(png) // 2],
        "png-magic-only": png[:8],
        "png-bomb": bomb,
        "truncated-jpeg": (folder / "good.jpg").read_bytes()[:900],
        "jpeg-magic-only": b"\xff\xd8\xff\xe0",
    }
    for name, bytes_ in content.items():
        (folder / name).write_bytes(bytes_)
    paths = {name: folder / name for name in content}
    save(paths.setdefault("float", folder / "float"), film().astype(np.float32))
    save(paths.setdefault("signed", folder / "signed"), film().astype(np.int16))
    save(paths.setdefault("narrow", folder / "narrow"), film(300, 4))
    save(paths.setdefault("several", folder / "several"), np.stack([film(), film()]), photometric="minisblack")
    return {**paths, "absent": folder / "absent.tif", "folder": folder, "null": Path("a\0b")}


def read_all(path: Path) -> np.ndarray:
    scan = open_scan(path)
    return scan.read(0, scan.rows)


def test_hostile_files_give_one_clear_line(tmp_path):
    for name, path in hostile(tmp_path).items():
        with pytest.raises(IsochronyError) as raised:
            read_all(path)
        message = str(raised.value)
        assert "\n" not in message, name
        assert len(message) < 400, name
        assert ":" in message, name


def test_a_file_that_was_cut_off_is_refused_before_anything_is_read(tmp_path):
    paths = hostile(tmp_path)
    for name in ("truncated-plain", "truncated-tiff"):
        with pytest.raises(FileError, match=r"cut off|damaged"):
            open_scan(paths[name])


def test_tiff_cut_or_changed_at_any_byte_never_leaves_with_another_fault(tmp_path):
    good = save(tmp_path / "good.tif", film(64, 40), rowsperstrip=16, compression="zlib").read_bytes()
    rng = np.random.default_rng(1)
    path = tmp_path / "changed.tif"
    for trial in range(300):
        changed = bytearray(good)
        for place in rng.integers(0, len(good) if trial % 2 else 400, 3):
            changed[place % len(good)] = rng.integers(0, 256)
        path.write_bytes(bytes(changed[: len(good) if trial % 3 else rng.integers(0, len(good))]))
        try:
            scan = open_scan(path)
            scan.read(0, min(scan.rows, 2000))
        except IsochronyError:
            pass


def test_tiff_that_promises_what_its_bytes_cannot_hold_is_refused(tmp_path):
    path = save(tmp_path / "film.tif", film(), rowsperstrip=300, compression="zlib")
    with tifffile.TiffFile(path, mode="r+b") as tiff:
        for name in ("ImageLength", "RowsPerStrip"):
            tiff.pages[0].tags[name].overwrite(60000)
    with pytest.raises(FileError, match=r"too few bytes|too large|damaged|has .* of"):
        read_all(path)
