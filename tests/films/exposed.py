"""Films by the project's own `synth.expose`, every property drawn by chance: the other half beside those of `make`.

python -m tests.films.exposed --seeds 1:101 --folder F
python -m tests.films.score F
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import synth
from data_schemas.scene import Scene, load_scene
from data_schemas.scene_recording import Dimming, Film, FilmTrace, Stretch

FLAWS = 3
"""At most, of those that a film has beside grain and drive."""
Random = np.random.Generator


def scene(random: Random) -> Scene:
    """Two pendulums under a swell, 130 to 300 s long, periods 1e-5 to 3e-3 apart."""
    shipped = load_scene(synth.scene_path("film"))
    period = random.uniform(0.99, 1.03)
    apart = random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-5.0, -2.5)
    pendulums = []
    for pendulum, own in zip(shipped.pendulums, (period, period * (1.0 + apart)), strict=True):
        start = pendulum.start.model_copy(
            update={"amplitude": random.uniform(0.003, 0.007), "phase": random.uniform(-np.pi, np.pi)}
        )
        pendulums.append(pendulum.model_copy(update={"period": own, "start": start}))
    seed, height = int(random.integers(1, 1000)), random.uniform(0.0, 1.5)
    motion = [each.model_copy(update={"seed": seed, "significant_height": height}) for each in shipped.motion]
    changes = {
        "duration": round(random.uniform(130.0, 300.0), 1),
        "gravity": 9.81 + 1e-5 * random.uniform(-300.0, 300.0),
        "pendulums": tuple(pendulums),
        "motion": tuple(motion),
        "seed": seed,
    }
    return shipped.model_copy(update=changes)


def flaws(random: Random, seconds: float) -> dict[str, dict[str, Any]]:
    """What may be wrong with a film, by name."""
    begin = random.uniform(20.0, seconds - 40.0)
    return {
        "crossing": {"traces": (FilmTrace(name="1", position=60.0), FilmTrace(name="1-2", position=66.0))},
        "offset": {"traces": (FilmTrace(name="1"), FilmTrace(name="1-2", offset=random.uniform(-3.0, 3.0)))},
        "blackout": {"blackouts": (Stretch(start=begin, stop=begin + random.uniform(1.0, 15.0)),)},
        "dim": {"dimmings": (Dimming(start=begin, stop=begin + 20.0, factor=random.uniform(0.1, 0.6)),)},
        "dirt": {"dust": random.uniform(10.0, 100.0), "scratches": random.uniform(1.0, 10.0), "handwriting": 2},
        "torn": {"torn_end": random.uniform(20.0, 100.0)},
        "upside down": {"upside_down": True},
        "marks": {"missing_marks": random.uniform(0.01, 0.15), "spurious_marks": int(random.integers(0, 10))},
        "rough drive": {"wow": random.uniform(0.003, 0.02), "walk": random.uniform(0.001, 0.005)},
        "shrunk": {"stretch_along": random.uniform(-0.01, 0.01), "stretch_across": random.uniform(-0.005, 0.005)},
        "askew": {"skew": random.uniform(-1.0, 1.0), "rotation": random.uniform(-0.5, 0.5)},
        "fogged": {"fog": 0.4, "fog_gradient": random.uniform(-0.2, 0.2), "vignette": random.uniform(0.0, 0.2)},
        "blurred": {"blur": random.uniform(0.3, 1.0)},
        "light lines": {"polarity": "positive"},
        "16 bit": {"bits": 16},
        "steep curve": {"gamma": random.uniform(1.0, 2.2), "density_max": random.uniform(1.0, 2.5)},
        "strong lamp": {"lamp": random.uniform(0.3, 3.0)},
        "long gaps": {"gap": random.uniform(0.02, 0.06)},
    }


def write(seed: int, folder: Path) -> str:
    """Write the film of a seed with what is known of it and the truth; its name."""
    random = np.random.default_rng(seed)
    course = scene(random)
    film: dict[str, Any] = {
        "speed": float(random.choice([2.8, 4.0, 5.0, 7.0, 10.0])),
        "dpi": float(random.choice([200, 300, 300, 400, 600])),
        "spot": random.uniform(0.07, 0.14),
        "grain": random.uniform(0.02, 0.09),
        "wow": random.uniform(0.0, 0.004),
        "drift": random.uniform(-0.01, 0.01),
    }
    options = flaws(random, course.duration)
    chosen = random.choice(list(options), size=int(random.integers(0, FLAWS + 1)), replace=False).tolist()
    for each in chosen:
        film |= options[each]
    label, kind = f"exposed-{seed}", ", ".join(sorted(chosen)) or "plain"
    synth.expose(course, Film(**film), folder / f"{label}.film.tif", seed=seed, overwrite=True)
    truth = {"kind": kind, "group": "exposed", "strength": "middle", "seed": seed, "cause": ""}
    truth |= {"status": "sound" if not chosen else "readable", "gravity": course.gravity}
    truth["images"] = [f"{label}.film.tif"]
    (folder / f"{label}.truth.json").write_text(json.dumps(truth), encoding="utf-8")
    return label


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1:101", metavar="A:B")
    parser.add_argument("--folder", type=Path, required=True)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    first, stop = map(int, options.seeds.split(":"))
    for seed in range(first, stop):
        print(write(seed, options.folder), flush=True)


if __name__ == "__main__":
    main()
