"""What all tests share: tests that need compiled kernels are skipped where compilation is off."""

from __future__ import annotations

import os

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
        return
    skip = pytest.mark.skip(reason="needs compiled kernels; NUMBA_DISABLE_JIT is set")
    for item in items:
        if item.get_closest_marker("compiled") or item.get_closest_marker("campaign"):
            item.add_marker(skip)
