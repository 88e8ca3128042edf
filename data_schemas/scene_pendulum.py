"""A pendulum of a scene: its period, its damping and how it starts."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from data_schemas.scene_fields import Label, Number, Section, quantity


class FreeStart(Section):
    """The free harmonic at t = 0, on top of the forced solution (physics sheet, section 1.2, last item)."""

    kind: Literal["free"] = quantity("free", "", "the pendulum swings freely on top of the forced solution")
    amplitude: Number = quantity(..., "rad", "amplitude of the free harmonic at t = 0", ge=0, le=3.1)
    phase: Number = quantity(0.0, "rad", "phase of the free harmonic at t = 0", ge=-100, le=100)


class StateStart(Section):
    """The whole motion at t = 0, forced part included."""

    kind: Literal["state"] = quantity("state", "", "the pendulum starts from this angle and angular velocity")
    angle: Number = quantity(..., "rad", "angle from the vertical at t = 0", ge=-3.1, le=3.1)
    angular_velocity: Number = quantity(0.0, "rad s-1", "angular velocity at t = 0", ge=-100, le=100)


Start = Annotated[FreeStart | StateStart, Field(discriminator="kind")]


class Pendulum(Section):
    """One pendulum of the apparatus."""

    label: Label = quantity(..., "", "name of the pendulum, as in the record; no two alike")
    period: Number = quantity(..., "s", "full period at infinitesimal arc and at reference_gravity", ge=0.01, le=100)
    damping_rate: Number = quantity(
        0.0, "s-1", "rate gamma at which the free amplitude decays, exp(-gamma t)", ge=0, le=0.05
    )
    start: Start = quantity(..., "", "how the pendulum starts: kind = 'free' or 'state'")
