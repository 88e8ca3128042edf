"""What a scene pays for its terms: one record, its scene growing term by term; run, compile and start-up time, modules.

Each scene is simulated in processes of its own: first with an empty folder for compiled code, then with what the first
has left there. The difference of their first runs is compiling; what the second still needs beyond a warm run is
importing and loading.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from data_schemas.scene import Scene
from pipeline.benchmarks.clock import tree_environment

_SWELL = {"kind": "harmonics", "amplitude": [0.1, 0.05], "period": [9.0, 6.5], "phase": [0.0, 1.0]}
_HEAVE = _SWELL | {"axis": "vertical", "phase": [1.5, 2.5]}
_VAN_DER_POL = {"kind": "van-der-pol", "rate": 0.01, "angle": 0.02}
_EDGE = {"knife_edge": {"friction": 1e-5, "rate": 0.01}}
_KICK = {"kind": "impulse", "energy": 1e-5}
_BEAM = {"kind": "beam", "mass": 50.0, "stiffness": 2.0e5, "damping_rate": 0.5}

ADDED: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    "linear, still": ({}, {}, {}),
    "+ horizontal motion": ({"motion": [_SWELL]}, {}, {}),
    "+ sine": ({"restoring": "sine"}, {}, {}),
    "+ vertical motion": ({"motion": [_SWELL, _HEAVE]}, {}, {}),
    "+ quadratic damping": ({}, {"quadratic_damping": 1e-3}, {"quadratic_damping": 1e-3}),
    "+ knife edge": ({}, _EDGE, _EDGE),
    "+ van der Pol": ({}, {"escapement": _VAN_DER_POL}, {}),
    "+ impulse": ({}, {}, {"escapement": _KICK}),
    "+ beam": ({"support": _BEAM}, {"mass": 0.25}, {"mass": 0.25}),
}
"""What each row adds to the scene, to its first and to its second pendulum."""

_BELONGS = {
    "+ sine": ("numba", "synth.propagators.picard", "synth.kernels.collocation"),
    "+ quadratic damping": ("synth.assembly", "synth.systems.driven_pendulums", "synth.integrators.explicit"),
    "+ impulse": ("synth.integrators.events",),
    "+ beam": ("synth.systems.elastic_beam",),
    "never": (
        "synth.integrators.radau", "synth.integrators.splitting", "synth.integrators.collocation",
        "synth.systems.flexible_frame", "synth.systems.metronomes", "synth.systems.reduction", "synth.explanation",
        "matplotlib", "dask",
    ),
}  # fmt: skip
"""Modules that nobody may load before the row that brings their term."""


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a scene: CPU time, modules, variables of the truth. Quick: a record ten times shorter."""
    first_run = None
    for name, scene in scenes(duration=60.0 if quick else 600.0).items():
        with tempfile.TemporaryDirectory() as cache:
            cold, warm = (_probe(scene, cache, 3 if quick else 5) for _ in range(2))
        modules = set(warm["modules"])
        first_run = first_run or warm["warm_s"]
        too_early = sorted(modules & set(not_yet(name)))
        yield {
            "terms": name,
            "propagator": warm["propagator"],
            "run_ms": 1e3 * warm["warm_s"],
            "times_first": warm["warm_s"] / first_run,
            "compile_s": max(0.0, cold["first_s"] - warm["first_s"]),
            "start_ms": 1e3 * max(0.0, warm["first_s"] - warm["warm_s"]),
            "modules": len(modules),
            "ours": sum(each.split(".")[0] in ("synth", "data_schemas") for each in modules),
            "numba": "numba" in modules,
            "variables": warm["variables"],
            "estimated_error": warm["estimated_error"],
            "too_early": " ".join(too_early),
            "pass": not too_early,
        }


def scenes(duration: float) -> dict[str, Scene]:
    """The growing scene, by its newest term."""
    whole: dict[str, Any] = {
        "record_id": "growing",
        "duration": duration,
        "gravity": 9.81,
        "recording": {"sampling_rate": 20},
    }
    pendulums: list[dict[str, Any]] = [
        {"label": label, "period": period, "start": {"kind": "state", "angle": angle}}
        for label, period, angle in (("1", 1.0, 0.02), ("2", 1.001, -0.03))
    ]
    grown = {}
    for name, (scene, *each) in ADDED.items():
        whole |= scene
        pendulums = [pendulum | more for pendulum, more in zip(pendulums, each, strict=True)]
        grown[name] = Scene.model_validate(whole | {"pendulums": pendulums})
    return grown


def not_yet(name: str) -> list[str]:
    """Modules that belong to terms which the scene of this name leaves out."""
    order = [*ADDED, "never"]
    return [module for row, found in _BELONGS.items() if order.index(row) > order.index(name) for module in found]


def _probe(scene: Scene, cache: str, repeats: int) -> dict[str, Any]:
    words = (sys.executable, "-m", "pipeline.benchmarks.cost_probe", scene.model_dump_json(), str(repeats))
    environment = tree_environment() | {"XDG_CACHE_HOME": cache}
    found = subprocess.run(words, env=environment, check=True, capture_output=True, text=True)
    said: dict[str, Any] = json.loads(found.stdout)
    return said
