"""Write films: NAME.film.tif (.png, .jpg), NAME.film.toml with what an observer knows, NAME.truth.json with the rest.

python -m tests.films.make --kinds all --strengths middle --seeds 1:3 --folder F
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import affine_transform

from . import paper, plain
from .kinds import KINDS, STRENGTHS, Case, case_of, owed
from .pendulums import REFERENCE

Floats = NDArray[np.float64]
Pixels = NDArray[Any]

_LONG = 400.0
"""s; films longer than this are written strip by strip, if they are plain TIFFs."""
_OVERLAP = 400
"""Rows that neighbouring strips of one film share."""
_FINE = 2e-4  # s, at which a trace is followed for the truth
_TINT = np.array([0.0, 0.35, 0.75])
"""By how much sepia weakens red, green and blue."""
_DIGITS = 4


def film_of(kind: str, strength: str, seed: int, duration: float | None = None) -> plain.Film:
    """The film of that kind, strength ("weak", "middle", "strong") and number; always the same.

    With a duration, s, instead of the kind's own if that is given.
    """
    digest = hashlib.sha256(f"film/{kind}/{strength}/{seed}".encode()).digest()
    case = case_of(kind, strength)
    if duration is not None:
        case = replace(case, duration=(duration, duration))
    return plain.expose(case, np.random.default_rng(np.frombuffer(digest, dtype="<u4")))


def label_of(kind: str, strength: str, seed: int) -> str:
    """Name of the film's files, without endings."""
    return "-".join([kind.replace(" ", "_").replace(",", "").replace(".", ""), strength, str(seed)])


def write(kind: str, strength: str, seed: int, folder: Path, duration: float | None = None) -> list[Path]:
    """Make a film and its files; gives the images, several if it is in strips."""
    film, label = film_of(kind, strength, seed, duration), label_of(kind, strength, seed)
    status, cause = owed(kind, strength)
    truth = truth_of(film) | {"kind": kind, "strength": strength, "seed": seed, "status": status, "cause": cause}
    images = save(film, folder, label)
    truth |= {"group": KINDS[kind].group, "images": [path.name for path in images]}
    (folder / f"{label}.film.toml").write_text(description(film, label), encoding="utf-8")
    (folder / f"{label}.truth.json").write_text(json.dumps(truth), encoding="utf-8")
    return images


def quantised(grey: plain.Grey, case: Case) -> Pixels:
    """Of grey levels 0 to 1, what the scanner hands over, 8 or 16 bit, grey or colour; one bit as a boolean."""
    if case.negative:
        grey = 1.0 - grey
    if case.bits == 1:
        return grey > 0.45
    top = 255 if case.bits == 8 else 65535
    if case.sepia:
        shade = grey[:, :, None] * (1.0 - case.sepia * _TINT * (1.0 - 0.3 * grey[:, :, None]))
        grey = shade.astype(np.float32)
    return np.clip(np.rint(grey * top), 0, top).astype(np.uint8 if top == 255 else np.uint16)


def pixels(film: plain.Film) -> Iterator[Pixels]:
    """The scan block by block."""
    return (quantised(grey, film.case) for grey in plain.blocks(film))


def save(film: plain.Film, folder: Path, label: str) -> list[Path]:
    """Write the image, or the strips."""
    case = film.case
    if case.strips > 1:
        return _strips(film, folder, label)
    path = folder / f"{label}.film.{case.extension}"
    stated = case.dpi * (1.0 + case.dpi_error)
    plainly = case.extension == "tif" and not (case.reversed or case.tile or case.thumbnail or case.bits == 1)
    if plainly and film.duration > _LONG and film.factor == 1:
        shape = (film.geometry.height, film.geometry.width, *((3,) if case.sepia else ()))
        kind = np.uint8 if case.bits == 8 else np.uint16
        tifffile.imwrite(path, pixels(film), shape=shape, dtype=kind, rowsperstrip=plain.BLOCK, **_tags(case, stated))
        return [path]
    image = np.concatenate(list(pixels(film)))
    if case.reversed:
        image = image[::-1, ::-1]
    if case.extension == "tif":
        with tifffile.TiffWriter(path) as tiff:
            if case.thumbnail:
                small = image[:: case.thumbnail, :: case.thumbnail]
                tiff.write(small, **_tags(case, stated / case.thumbnail))
            layout = {"tile": (case.tile, case.tile), "compression": "zlib"} if case.tile else {"rowsperstrip": 1024}
            tiff.write(image, **layout, **_tags(case, stated))
    else:
        options = {"quality": case.quality} if case.quality else {}
        Image.fromarray(np.ascontiguousarray(image)).save(path, dpi=(stated, stated), **options)
    return [path]


def _tags(case: Case, dpi: float) -> dict[str, Any]:
    light = "minisblack"
    return {"photometric": "rgb" if case.sepia else light, "resolution": (dpi, dpi), "resolutionunit": "INCH"}


def _strips(film: plain.Film, folder: Path, label: str) -> list[Path]:
    """The film scanned in overlapping parts, each lying otherwise."""
    case, random = film.case, np.random.default_rng([film.seed, 7])
    image = np.concatenate(list(plain.blocks(film)))
    height = len(image)
    edges = np.linspace(0, height, case.strips + 1).astype(int)
    out = []
    for index, (first, last) in enumerate(itertools.pairwise(edges)):
        part = image[max(first - _OVERLAP // 2, 0) : min(last + _OVERLAP // 2, height)]
        angle = 0.5 * math.radians(case.turn) * (-1.0) ** index
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        middle = 0.5 * np.array(part.shape)
        shift = middle - turn @ (middle + random.uniform(-5.0, 5.0, 2))
        turned = affine_transform(part, turn, shift, order=3, cval=float(np.percentile(part, 90)))
        out.append(folder / f"{label}.part{index + 1}.tif")
        tifffile.imwrite(out[-1], quantised(turned, case), rowsperstrip=1024, **_tags(case, case.dpi))
    return out


def description(film: plain.Film, label: str) -> str:
    """What the observer states, TOML."""
    from data_schemas.film_description import FilmDescription

    case = film.case
    lines = ['kind = "film-description"', f'record_id = "{label}"', f"speed = {case.speed}"]
    lines += [f"dpi = {case.dpi * (1.0 + case.dpi_error):.6g}", f"mark_interval = {case.interval}", f"gap = {case.gap}"]
    lines.append(f"minute_code = {paper.CODE if case.code == 'double' else 0.0}")
    later = {
        "marks": f'"{case.code}"',
        "optics": '"tangent"' if case.tangent else '"linear"',
        "shrinkage": case.shrinkage,
    }
    # stated as soon as a description may say so
    lines += [f"{key} = {value}" for key, value in later.items() if key in FilmDescription.model_fields]
    for name, factors, lever in zip(case.traces, film.combinations, case.levers_of(len(case.traces)), strict=True):
        stated = ", ".join(f'"{k + 1}" = {factor}' for k, factor in enumerate(factors) if factor)
        lines += ["", "[[traces]]", f'name = "{name}"', f"combination = {{ {stated} }}", f"lever = {lever}"]
    for index, period in enumerate(film.world.periods.tolist()):
        lines += ["", "[[pendulums]]", f'label = "{index + 1}"', f"period = {period!r}"]
        lines.append(f"damping_rate = {film.world.damping}")
        if len(film.world.periods) == 1:
            lines.append(f"length = {REFERENCE * (period / (2.0 * math.pi)) ** 2!r}")
    lines += ["", "[instrument]", f"reference_gravity = {REFERENCE}", ""]
    return "\n".join(lines)


def truth_of(film: plain.Film) -> dict[str, Any]:
    """All that is on the film, in px of the scan as it lies when its rows run with time (pixel i from i to i + 1)."""
    case, factor = film.case, film.factor
    height = film.geometry.height // factor
    times = np.arange(-paper.AHEAD, film.duration + paper.AHEAD, _FINE)
    centres = np.arange(height) + 0.5
    along = np.interp(times, film.drive.times, film.drive.along)
    middle = film.geometry.place(np.full(times.size, 0.5 * paper.WIDTH), along)[0] / factor

    def of_row(rows: Floats, values: Floats) -> Floats:
        """Values where the rows pass the centre of each row of the scan."""
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(rows)) > 0.0])
        return np.interp(centres, rows[rising], values[rising])

    traces = []
    for index, name in enumerate(case.traces):
        rows, columns = (values / factor for values in plain.path(film, index, times))
        column, time = of_row(rows, columns), of_row(rows, times)
        traces.append(
            {
                "name": name,
                "lever": float(case.levers_of(len(case.traces))[index]),
                "column_of_row": _rounded(column),
                "time_of_row": _rounded(time),
                "slope_of_row": _rounded(np.gradient(column)),
                "dark": film.dark[index],
            }
        )
    marks = [
        {"time": mark.time, "kind": mark.kind, "begin": mark.begin, "end": mark.end}
        | {"row": float(np.interp(mark.time, times, middle))}
        for mark in film.marks
        if 0.0 < mark.time < film.duration
    ]
    return {
        "gravity": film.world.gravity,
        "reference_gravity": REFERENCE,
        "periods": film.world.periods.tolist(),
        "damping_rate": film.world.damping,
        "duration": film.duration,
        "chronometer_offset": film.offset,
        "speed": case.speed,
        "dpi": case.dpi,
        "reversed": case.reversed,
        "height": height,
        "width": film.geometry.width // factor,
        "code": case.code,
        "style": case.style,
        "paper_of_row": _rounded(film.geometry.wandered(centres * factor) / factor),
        "events": film.events,
        "marks": marks,
        "time_of_row": _rounded(of_row(middle, times)),
        "traces": traces,
    }


def _rounded(values: Floats) -> list[float]:
    return [float(value) for value in np.round(values, _DIGITS)]


def chosen(text: str, known: tuple[str, ...]) -> list[str]:
    """Of a comma-separated list, or "all"; a group of kinds stands for its kinds."""
    out: list[str] = []
    for name in text.split(","):
        group = [kind for kind in known if kind in KINDS and KINDS[kind].group == name]
        if name != "all" and name not in known and not group:
            raise SystemExit(f"{name!r} is none of: {', '.join(known)}")
        out += list(known) if name == "all" else group or [name]
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", default="all", help="kinds or groups, separated by commas")
    parser.add_argument("--strengths", default="all")
    parser.add_argument("--seeds", default="1:2", help="first:last+1")
    parser.add_argument("--duration", type=float, help="s, instead of the kinds' own")
    parser.add_argument("--folder", type=Path, required=True)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    seeds = range(*(int(part) for part in options.seeds.split(":")))
    kinds, strengths = chosen(options.kinds, tuple(KINDS)), chosen(options.strengths, STRENGTHS)
    for kind, strength, seed in itertools.product(kinds, strengths, seeds):
        for path in write(kind, strength, seed, options.folder, options.duration):
            print(path)


if __name__ == "__main__":
    main()
