"""Child of the table of what terms cost: simulate one scene from its JSON and tell times and what was loaded."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any


def main(scene_json: str, repeats: str) -> None:
    """Print one JSON object: seconds of the first run, of a warm run, modules loaded, and what the truth says."""
    before = set(sys.modules)
    from data_schemas.scene import Scene

    scene = Scene.model_validate_json(scene_json)
    import synth

    first, (_, truth) = _timed(lambda: synth.simulate(scene))
    taken = [_timed(lambda: synth.simulate(scene))[0] for _ in range(int(repeats))]
    print(
        json.dumps(
            {
                "first_s": first,
                "warm_s": statistics.median(taken),
                "modules": sorted(set(sys.modules) - before),
                "variables": len(truth["truth"].data_vars),
                "propagator": truth.attrs["propagator"],
                "estimated_error": truth.attrs["estimated_error"],
            }
        )
    )


def _timed(call: Callable[[], Any]) -> tuple[float, Any]:
    started = time.process_time()
    result = call()
    return time.process_time() - started, result


if __name__ == "__main__":
    sys.modules["dask"] = None  # type: ignore[assignment]  # xarray imports it wherever it is; we must not
    main(*sys.argv[1:])
