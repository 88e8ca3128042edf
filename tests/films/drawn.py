"""Films in which everything is drawn by chance, half of them sound, half with one or two defects.

    python -m tests.films.drawn --seeds 1:101 --folder F
    python -m tests.films.score F --lines L

Beside `make`, whose kinds vary one thing at a time, these combine them: layouts, optics, marks, emulsion, drive, scan,
and what the observer states. They share no code with the product, nor with `plain`. A seed always gives the same film.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from PIL import Image

from .rendered import AHEAD, INTERVAL, REFERENCE, Draws, Floats, Grey, Scene, develop, expose, factors, lay_out, scan

Random = np.random.Generator

DEFECTS = (
    "crease", "dirt", "faded", "halation", "heavy grain", "jpeg", "leak", "marks", "off edge", "offset", "short gaps",
    "slow", "splice", "stain", "standstill", "steep", "strobe", "thick", "thin", "tilt", "unequal", "vignette",
    "wander", "wow",
)  # fmt: skip
"""In the order in which they are drawn by number and applied; "marks" are missing and false ones."""
_TOP_SLOPE = 11.0
"""Of the traces of a sound film: a steeper one is faint between its turning points."""
_FINE = 5e-4  # s, at which a trace is followed for the truth


def draw(seed: int, without: Collection[str] = ()) -> Draws:
    """All that the film of a seed is made with; `without` some defects, or "all"."""
    random = np.random.default_rng(seed + 90000)
    count = 0 if random.random() < 0.5 else int(_one_of(random, 1, 1, 2))
    defects = random.choice(DEFECTS, 3, replace=False).tolist()[:count] if count else []
    if count and random.random() < 0.25:
        defects[0] = "standstill"
    defects = [name for name in sorted(set(defects)) if name not in without and "all" not in without]
    film: Draws = {"seed": seed, "defects": defects} | _swings(random)
    film |= _exposures(random, film["layout"])
    film |= _scan(random)
    changes = _flaws(random, film)
    for name in defects:
        film |= changes[name]
    return film


def _one_of(random: Random, *values: Any) -> Any:
    return values[random.integers(len(values))]


def _sign(random: Random) -> int:
    return 1 if random.random() < 0.5 else -1


def _swings(random: Random) -> Draws:
    """Pendulums, sea, and the paper's speed; a pendulum's amplitude is that of its own trace in mm."""
    uniform = random.uniform
    duration, chronometer, gravity = uniform(100, 200), uniform(0, 60), REFERENCE + uniform(-0.01, 0.01)
    period = uniform(0.99, 1.03)
    layout = _one_of(random, "1,1-2", "1,1-2", "1,1-2", "1,1-2", "1,2", "1,2,1-2", "1,1-2,2-3").split(",")
    apart = _one_of(random, 1e-5, 1e-4, 1e-4, 3e-4, 5e-4) * _sign(random)
    film = {"chronometer_offset": chronometer, "gravity": gravity, "layout": layout}
    film |= {"periods": [period, period * (1 + apart), period * (1 + apart * 0.4)]}
    film |= {"damping": uniform(3e-5, 2e-4), "states_damping": bool(random.random() < 0.92)}
    first, phase = uniform(3, 8), uniform(0, 2 * math.pi)
    between = uniform(0.45, 1.0) * math.pi * _sign(random)
    amplitudes = np.array([first, first * uniform(0.7, 1.2), first * uniform(0.7, 1.2)])
    phases = np.array([phase, phase + between, phase - between * 0.9])
    film |= {"lever": float(_one_of(random, 1000, 1500, 2000, 2000, 3000))}
    # Hz, rad, m/s^2
    waves = [[uniform(0.05, 0.16), uniform(0, 6.28), uniform(0.003, 0.03)] for _ in range(random.integers(1, 5))]
    film |= {"waves": waves, "heaves": bool(random.random() < 0.25)}
    speed, dpi = float(_one_of(random, 4, 5, 5, 6, 8, 10)), int(_one_of(random, 200, 300, 300, 300, 400, 600))
    if random.random() < 0.1:
        speed, duration = uniform(12, 20), min(duration, 130.0)
    vectors = amplitudes * np.exp(1j * phases)
    steepest = 6.25 / speed * max(abs(sum(sign * vectors[k] for k, sign in factors(name))) for name in layout)
    amplitudes *= min(1.0, _TOP_SLOPE / steepest)
    film |= {"duration": duration, "speed": speed, "dpi": dpi}
    return film | {"amplitudes": amplitudes.tolist(), "phases": phases.tolist()}


def _exposures(random: Random, layout: list[str]) -> Draws:
    """Lamps, marks and drive."""
    uniform = random.uniform
    return {
        "spot": uniform(0.08, 0.13),  # 1 sigma
        "profile": _one_of(random, "gauss", "gauss", "disc", "skirt"),
        "lamps": [uniform(0.7, 1.6) for _ in layout],
        "mark_kind": _one_of(random, *["gaps"] * 5, "edge", "lines", "antilines"),
        "code": _one_of(random, "double", "double", "long", "omitted", "none"),
        "gap": uniform(0.025, 0.05),
        "states_kind": bool(random.random() < 0.6),
        "states_code": bool(random.random() < 0.5),
        "states_gap": bool(random.random() < 0.4),
        "missing": _one_of(random, 0.0, 0.0, 0.01, 0.02),  # share of the marks
        "false": _one_of(random, 0, 0, 1, 3),
        "drift": uniform(-0.01, 0.01),  # of the speed, from end to end
        "wow": uniform(0, 0.003),
        "wow_period": uniform(4, 11),
        "walk": uniform(0, 0.002),  # of the speed, slow noise
        "wander": uniform(0, 0.12),  # of the paper sideways
        "offsets": [uniform(-0.2, 0.2) for _ in layout],  # of the traces along the film
        "stands": [],  # where, of the film, and for how long
        "splice": None,
        "off_edge": None,
        "strobe": False,
    }


def _scan(random: Random) -> Draws:
    """Emulsion, dirt and scanner."""
    uniform = random.uniform
    return {
        "middle_exposure": uniform(0.12, 0.3),
        "gamma": uniform(1.1, 1.8),
        "top_density": uniform(1.2, 2),
        "fog": uniform(0.06, 0.25),
        "halation": uniform(0, 0.01),
        "grain": uniform(0.01, 0.06),
        "clump": _one_of(random, 0.0, 0.0, 0.5, 1.0),  # px, 1 sigma
        "dust": uniform(0, 10),  # to 10^4 mm^2
        "scratches": uniform(0, 2),  # to the metre
        "hairs": _one_of(random, 0, 0, 1, 2),
        "tilt": uniform(-0.25, 0.25),  # degrees
        "uneven": uniform(0, 0.08),
        "vignette": uniform(0, 0.1),
        "blur": uniform(0.3, 0.8),  # px
        "format": _one_of(random, "tif8", "tif8", "tif16", "png", "jpg", "jpg"),
        "quality": int(uniform(85, 96)),
        "polarity": _one_of(random, "negative", "negative", "positive"),
        "srgb": bool(random.random() < 0.5),
        "border": _one_of(random, 0.0, 0.0, 2.0, 4.0),  # of the bed around the paper
        "bed": _one_of(random, 0.03, 0.97),
        "landscape": bool(random.random() < 0.12),
        "states_speed": bool(random.random() < 0.85),
        "states_positions": bool(random.random() < 0.6),
        "stains": [],
        "fade": None,
        "creases": [],
        "leak": None,
    }


def _flaws(random: Random, film: Draws) -> dict[str, Draws]:
    """What each defect changes; all are drawn, in this order, whatever the film has."""
    uniform = random.uniform
    gaps = {"mark_kind": "gaps"}

    def stand() -> list[float]:
        place = uniform(0.15, 0.85)
        return [place, _one_of(random, uniform(0.3, 0.9), 1.01, uniform(1, 3), uniform(3, 5), 2.02, 5.05)]

    def crease() -> list[float]:
        return [uniform(0.1, 0.9), uniform(0.2, 0.45) * _sign(random), uniform(1, 5)]

    def stain() -> list[float]:
        return [uniform(0, 1), uniform(0, 1), uniform(5, 25), uniform(0.3, 0.9)]

    flaws: dict[str, Draws] = {
        "standstill": {"stands": sorted(stand() for _ in range(_one_of(random, 1, 1, 2)))},
        "marks": {"missing": uniform(0.1, 0.25), "false": int(uniform(10, 40))},
        "wander": {"wander": uniform(0.8, 2)},
        "splice": {"splice": [uniform(0.3, 0.7), uniform(0, 6), uniform(-0.6, 0.6)]},
        "stain": {"stains": [stain() for _ in range(5)]},
        "faded": {"fade": [uniform(0.1, 0.7), uniform(0.08, 0.25), uniform(0.1, 0.4)]},
        "crease": {"creases": [crease() for _ in range(3)]},
        "leak": {"leak": [_one_of(random, "start", "end"), uniform(0.5, 3), uniform(10, 40)]},
        "off edge": {"off_edge": uniform(0.4, 0.8)},
        "unequal": {"lamps": _divided(film["lamps"], film["seed"], uniform(8, 20))},
        "thin": {"spot": uniform(0.04, 0.06)},
        "thick": {"spot": uniform(0.2, 0.3)},
        "steep": {"amplitudes": (np.array(film["amplitudes"]) * uniform(1.8, 3)).tolist()},
        "halation": {"halation": uniform(0.05, 0.12)},
        "heavy grain": {"grain": uniform(0.12, 0.2), "clump": 1.5},
        "dirt": {"dust": uniform(40, 100), "hairs": 8, "scratches": 10.0},
        "wow": {"wow": uniform(0.015, 0.03)},
        "tilt": {"tilt": uniform(0.6, 1.5) * _sign(random)},
        "jpeg": {"format": "jpg", "quality": int(uniform(30, 55))},
        "offset": {"offsets": [*film["offsets"][:-1], uniform(0.8, 1.8)]},
        "vignette": {"uneven": uniform(0.3, 0.6), "vignette": uniform(0.3, 0.6)},
        "short gaps": gaps | {"gap": uniform(0.008, 0.014)},
        "slow": gaps | {"speed": uniform(1.5, 2.4), "duration": film["duration"] * 1.5},
    }
    return flaws | {"strobe": gaps | {"strobe": True, "speed": 2.5, "code": "double"}}


def _divided(lamps: list[float], seed: int, factor: float) -> list[float]:
    """One of the lamps is that much weaker."""
    return [lamp / factor if k == seed % len(lamps) else lamp for k, lamp in enumerate(lamps)]


def save(film: Draws, clear: Grey, base: str) -> Path:
    """Write the image."""
    path, tag = Path(f"{base}.film.{film['format'][:3]}"), (film["dpi"], film["dpi"])
    if film["format"] == "tif16":
        tifffile.imwrite(path, (clear * 65535 + 0.5).astype(np.uint16), resolution=tag, resolutionunit=2)
        return path
    levels = (clear * 255 + 0.5).astype(np.uint8)
    if film["format"] == "tif8":
        tifffile.imwrite(path, levels, resolution=tag, resolutionunit=2, rowsperstrip=256)
    elif film["format"] == "png":
        Image.fromarray(levels).save(path, dpi=tag)
    else:
        Image.fromarray(levels).save(path, dpi=tag, quality=film["quality"])
    return path


def description(scene: Scene, label: str) -> str:
    """What the observer states, TOML."""
    film = scene.film
    lines = ['kind = "film-description"', f'record_id = "{label}"']
    lines += [f"speed = {film['speed']:.3g}"] if film["states_speed"] else []
    lines += [f"dpi = {film['dpi']}.0", f"mark_interval = {INTERVAL}"]
    lines += [f"gap = {film['gap']:.3f}"] if film["states_gap"] and film["mark_kind"] == "gaps" else []
    lines += [f'marks = "{film["code"]}"'] if film["states_code"] or film["strobe"] else []
    bright = (film["mark_kind"] == "antilines") == (film["polarity"] == "negative")
    kind = film["mark_kind"] if film["mark_kind"] in ("gaps", "edge") else "bright-lines" if bright else "dark-lines"
    lines += [f'mark_kind = "{kind}"'] if film["states_kind"] and not film["strobe"] else []
    lines.append('restoring = "sine"')
    for name, position in zip(film["layout"], scene.positions, strict=True):
        stated = ", ".join(f'"{k + 1}" = {sign}' for k, sign in factors(name))
        lines += ["[[traces]]", f'name = "{name}"', f"combination = {{ {stated} }}", f"lever = {film['lever']}"]
        lines += [f"position = {position + film['border']:.1f}"] if film["states_positions"] else []
    for k, period in enumerate(film["periods"][: len(scene.angles)]):
        lines += ["[[pendulums]]", f'label = "{k + 1}"', f"period = {period:.12f}"]
        lines += [f"damping_rate = {film['damping']}"] if film["states_damping"] else []
    return "\n".join([*lines, "[instrument]", f"reference_gravity = {REFERENCE}", ""])


def truth_of(scene: Scene) -> dict[str, Any]:
    """Gravity, and where the traces are, in px of the scan as it lies when its rows run with time."""
    film, paper, drive = scene.film, scene.paper, scene.drive
    centres = np.arange(paper.rows) + 0.0
    away = (centres[:, None] + 0.5) * paper.pitch - np.array([each[0] for each in film["creases"]]) * paper.length
    pushes, widths = (np.array([each[k] for each in film["creases"]]) for k in (1, 2))
    folded = np.sum(pushes * np.exp(-(away**2) / 2 / widths**2), axis=1) / paper.pitch
    times = np.arange(AHEAD, AHEAD + film["duration"], _FINE)
    traces = []
    for trace, name in enumerate(film["layout"]):
        rows, columns, shown = scene.path(trace, times)
        kept = shown & np.concatenate([[True], np.diff(np.maximum.accumulate(rows)) > 0.0])
        column = np.interp(centres, rows[kept], columns[kept]) + 0.5 + folded
        seconds = np.interp(centres, rows[kept], times[kept]) - AHEAD
        traces.append({"name": name, "lever": film["lever"]})
        traces[-1] |= {"column_of_row": _rounded(column), "time_of_row": _rounded(seconds)}
    seconds = np.array(traces[0]["time_of_row"]) + AHEAD
    beside = np.interp(seconds, drive.times, drive.sideways)
    if paper.splice:
        beside += paper.splice[2] * (np.interp(seconds, drive.times, drive.along) > paper.splice[0])
    lies = beside / paper.pitch / math.cos(paper.tilt) - math.tan(paper.tilt) * (centres + 0.5 - 0.5 * paper.rows)
    return {
        "gravity": film["gravity"],
        "reference_gravity": REFERENCE,
        "duration": film["duration"],
        "chronometer_offset": film["chronometer_offset"] + AHEAD,
        "dpi": film["dpi"],
        "orientation": 90 if film["landscape"] else 0,
        "traces": traces,
        "paper_of_row": _rounded(lies + folded),
        "marks": [{"time": time - AHEAD, "length": length} for time, length in scene.marks],
        "slope": max(scene.amplitudes) * 6.25 / film["speed"],
        "drawn": film,
    }


def _rounded(values: Floats) -> list[float]:
    return [float(value) for value in np.round(values, 4)]


def write(seed: int, folder: Path, without: Collection[str] = ()) -> str:
    """Write the film of a seed with what is known of it and the truth; its name and defects."""
    film, random, label = draw(seed, without), np.random.default_rng(seed + 5), f"drawn-{seed}"
    scene = lay_out(film, random)
    clear = scan(scene, develop(scene, *expose(scene), random), random)
    image = save(film, clear, str(folder / label))
    (folder / f"{label}.film.toml").write_text(description(scene, label), encoding="utf-8")
    kind = ", ".join(film["defects"]) or "plain"
    truth = {"kind": kind, "group": "drawn", "strength": "middle", "seed": seed, "cause": "", "images": [image.name]}
    truth |= {"status": "readable" if film["defects"] else "sound"} | truth_of(scene)
    (folder / f"{label}.truth.json").write_text(json.dumps(truth), encoding="utf-8")
    return f"{label}: {kind}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1:101", metavar="A:B")
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--without", default="", metavar="DEFECT,...", help='not these defects; "all": none')
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    first, stop = map(int, options.seeds.split(":"))
    for seed in range(first, stop):
        print(write(seed, options.folder, options.without.split(",")), flush=True)


if __name__ == "__main__":
    main()
