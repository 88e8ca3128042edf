"""What all tests share: what runs on demand only, and what needs compiled kernels."""

from __future__ import annotations

import os
import signal

import pytest
from hypothesis import HealthCheck, settings

# how fast a machine makes examples is no fault of the code
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")
# before anything brings NumPy: last bits depend on the threads of BLAS, of which commands and their children have one
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    compiles = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
    skip = pytest.mark.skip(reason="needs compiled kernels; NUMBA_DISABLE_JIT is set")
    for item in items:
        if not compiles and (item.get_closest_marker("compiled") or item.get_closest_marker("campaign")):
            item.add_marker(skip)


def pytest_configure() -> None:
    """Let commands under test be interrupted: a shell that runs tests in the background has them ignore Ctrl-C."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
