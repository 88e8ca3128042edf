"""Child of a test: expose a film and print the most memory that it took."""

from __future__ import annotations

import sys
from pathlib import Path


def peak() -> float:
    """Most memory this process held, MiB.

    What the system calls ru_maxrss counts the parent's too, from before the child became a program of its own; where
    the kernel tells, its count since then is taken.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return float(line.split()[1]) / 1024.0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main(path: str, seconds: str) -> None:
    """Expose the shipped scene for some seconds; print MiB."""
    import synth
    from pipeline.benchmarks.film import scene

    synth.expose_to(scene(float(seconds)), "typical", path, overwrite=True)
    print(peak())


if __name__ == "__main__":
    main(*sys.argv[1:])
