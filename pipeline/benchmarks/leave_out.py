"""Suite `leave-out`: what `process` imports and what it spends, method by method.

A method pays for nothing that it does not use: neither scipy.signal nor matplotlib nor dask nor pydantic may be loaded.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import data_schemas
from pipeline.benchmarks.clock import tree_environment
from pipeline.benchmarks.scenes import linear
from pipeline.methods import PAIR_METHODS
from synth import simulate

FORBIDDEN = ("scipy.signal", "matplotlib", "dask", "pydantic")


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a method. Quick processes half a minute of record, full half an hour."""
    scene = linear(duration=30.0 if quick else 1800.0, noise=1e-5)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "linear.record.nc"
        data_schemas.write(simulate(scene)[0], path)
        _probe(path, ",".join(PAIR_METHODS))  # kernels are compiled and cached before anything is timed
        for method in PAIR_METHODS:
            found = _probe(path, method)
            modules = set(found["modules"])
            seconds = found["seconds"]
            yield {
                "method": method,
                "modules": len(modules),
                "ours": sum(name.split(".")[0] in ("pipeline", "synth", "data_schemas") for name in modules),
                "scipy": sum(name.split(".")[0] == "scipy" for name in modules),
                "numba": sum(name.split(".")[0] == "numba" for name in modules),
                "import_ms": 1e3 * seconds["import"],
                "read_ms": 1e3 * seconds["read"],
                "process_ms": 1e3 * seconds["process"],
                "write_ms": 1e3 * seconds["write"],
                "methods_loaded": " ".join(
                    sorted(name.rsplit(".", 1)[1] for name in modules if name.startswith("pipeline.methods."))
                ),
                "forbidden": " ".join(name for name in FORBIDDEN if name in modules),
                "pass": modules.isdisjoint(FORBIDDEN),
            }


def _probe(path: Path, method: str) -> dict[str, Any]:
    words = (sys.executable, "-m", "pipeline.benchmarks.probe", str(path), method)
    found = subprocess.run(words, env=tree_environment(), check=True, capture_output=True, text=True)
    said: dict[str, Any] = json.loads(found.stdout)
    return said
