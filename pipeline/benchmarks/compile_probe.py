"""Child of the suite `integrators`: what a method's first call costs beyond a warm one, where nothing is cached."""

from __future__ import annotations

import json
import sys
import time

from pipeline.benchmarks.problems import problems
from pipeline.benchmarks.work_precision import set_up

TOLERANCE = 1e-9


def main(name: str, method: str) -> None:
    """Print one JSON object; imports of the library itself are counted, Python's own start is not."""
    problem = problems(quick=True)[name]
    started = time.perf_counter()
    call = set_up(problem, method, TOLERANCE)
    call()
    first = time.perf_counter()
    call()
    warm = time.perf_counter() - first
    print(json.dumps({"compile_s": first - started - warm}))


if __name__ == "__main__":
    main(*sys.argv[1:])
