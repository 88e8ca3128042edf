"""Long films are made in the memory of short ones."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pipeline.benchmarks.clock import tree_environment

_PROBE = """
import resource, sys
import synth
from data_schemas import load_scene
scene = load_scene(synth.scene_path("film")).model_copy(update={"duration": float(sys.argv[1])})
made = synth.expose_to(scene, "typical", sys.argv[2], overwrite=True)
print(made.rows, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


@pytest.mark.campaign
def test_memory_does_not_grow_with_the_film(tmp_path):
    peaks = {}
    for seconds in (47.0, 1012.0):
        words = [sys.executable, "-c", _PROBE, str(seconds), str(tmp_path / "a.film.tif")]
        done = subprocess.run(words, env=tree_environment(), check=True, capture_output=True, text=True)
        rows, peak = done.stdout.split()
        peaks[int(rows)] = float(peak)
    (few, least), (many, most) = sorted(peaks.items())
    assert 2_900 < few < 3_100
    assert 59_000 < many < 61_000
    assert most - least < 50.0  # MiB
