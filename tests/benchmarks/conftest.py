"""Short scenes: the suites' own machinery, without half an hour of record."""

from __future__ import annotations

import pytest

from pipeline.benchmarks import scenes


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> float:
    """Make every scene that names no duration a minute long, s."""
    monkeypatch.setattr(scenes, "DURATION", 60.0)
    return 60.0
