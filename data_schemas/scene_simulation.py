"""How a scene is computed: how exactly, and by which propagator."""

from __future__ import annotations

from typing import Literal

from data_schemas.scene_fields import Number, Section, quantity

Propagator = Literal["auto", "closed-form", "picard", "beam-collocation", "explicit", "radau"]


class Simulation(Section):
    """Left out, everything is as exact as it can be."""

    tolerance: Number | None = quantity(
        None, "1", "largest error wanted, of the largest angle; left out: as exact as the propagator can",
        ge=1e-15, le=1e-2,
    )  # fmt: skip
    propagator: Propagator = quantity(
        "auto", "", "'auto' takes what suits the scene; a name insists on it, or is refused"
    )
