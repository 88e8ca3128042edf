"""Its presence puts this folder on the path, so that tests here import `mark_lists`, `small_film` and `spot_film`."""

from __future__ import annotations

import pytest

import data_schemas

SCENE = """
record_id = "night"
duration = 130.0
gravity = 9.8123
reference_gravity = 9.81
restoring = "linear"
pendulums = [
  { label = "1", period = 1.00966, damping_rate = 1e-4, start = { kind = "free", amplitude = 5e-3, phase = 0.4 } },
  { label = "2", period = 1.009760966, damping_rate = 1e-4, start = { kind = "free", amplitude = 4e-3, phase = 2.2 } },
]
motion = [ { kind = "harmonics", amplitude = [0.01], period = [10.0] } ]
"""


@pytest.fixture(scope="session")
def path(tmp_path_factory):
    """Two minutes of a typical film."""
    pytest.importorskip("tifffile")
    import synth

    folder = tmp_path_factory.mktemp("film")
    (folder / "night.toml").write_text(SCENE)
    synth.expose_to(data_schemas.load_scene(folder / "night.toml"), "typical", folder / "night.film.tif")
    return folder / "night.film.tif"
