"""How many processors this process may use."""

from __future__ import annotations

import os


def processors() -> int:
    """Processors of this process; all of the machine where the system cannot tell."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
