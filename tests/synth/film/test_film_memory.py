"""Long films are made in the memory of short ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.benchmarks.tables import tree_environment


@pytest.mark.campaign
def test_memory_does_not_grow_with_the_film(tmp_path):
    def peak(seconds):
        probe = Path(__file__).with_name("film_probe.py")
        words = [sys.executable, str(probe), str(tmp_path / "a.tif"), str(seconds)]
        done = subprocess.run(words, env=tree_environment(), check=True, capture_output=True, text=True)
        return float(done.stdout)  # MiB

    assert peak(1012.0) - peak(47.0) < 50.0  # 60,000 and 3,000 rows
