"""Scenes that the tests of the simulator vary."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from data_schemas.scene import Scene

Maker = Callable[..., Scene]


@pytest.fixture
def make_scene() -> Maker:
    """A scene of two pendulums and 40 s; keywords replace its parts."""

    def make(**parts: Any) -> Scene:
        scene: dict[str, Any] = {
            "record_id": "test",
            "seed": 11,
            "duration": 40.0,
            "gravity": 9.8123,
            "pendulums": [
                {
                    "label": "1",
                    "period": 1.00966,
                    "start": {"kind": "free", "amplitude": 0.006, "phase": 0.4},
                },
                {
                    "label": "2",
                    "period": 1.00976,
                    "damping_rate": 1e-3,
                    "start": {"kind": "free", "amplitude": 0.012, "phase": 2.2},
                },
            ],
            "motion": [{"kind": "harmonics", "amplitude": [0.1, 0.04], "period": [10.0, 6.3], "phase": [0.2, 1.0]}],
        }
        return Scene.model_validate(scene | parts)

    return make
