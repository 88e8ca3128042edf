"""A pendulum of a scene: its period, how it starts, what resists its swing and what drives it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from data_schemas.scene_fields import Label, Number, Section, extra, quantity


class FreeStart(Section):
    """The free harmonic at t = 0, on top of the forced solution (physics sheet, section 1.2, last item).

    Both are meant as for a linear pendulum on a rigid support: the pendulum that is simulated gets their angle and
    angular velocity at t = 0.
    """

    kind: Literal["free"] = quantity("free", "", "the pendulum swings freely on top of the forced solution")
    amplitude: Number = quantity(..., "rad", "amplitude of the free harmonic at t = 0", ge=0, le=3.1)
    phase: Number = quantity(0.0, "rad", "phase of the free harmonic at t = 0", ge=-100, le=100)


class StateStart(Section):
    """The whole motion at t = 0, forced part included."""

    kind: Literal["state"] = quantity("state", "", "the pendulum starts from this angle and angular velocity")
    angle: Number = quantity(..., "rad", "angle from the vertical at t = 0; whole turns count", ge=-1000, le=1000)
    angular_velocity: Number = quantity(0.0, "rad s-1", "angular velocity at t = 0", ge=-100, le=100)


Start = Annotated[FreeStart | StateStart, Field(discriminator="kind")]


class KnifeEdge(Section):
    """Dry friction of a knife edge, smoothed: theta'' gains -friction * tanh(theta'/rate)."""

    friction: Number = quantity(..., "rad s-2", "angular deceleration by friction of a fast swing", gt=0, le=1e4)
    rate: Number = quantity(
        ..., "rad s-1", "angular velocity at which friction has reached 76 % of itself", ge=1e-9, le=100
    )


class VanDerPolEscapement(Section):
    """An escapement that acts all the time: theta'' gains rate * (1 - (theta/angle)^2) * theta'."""

    kind: Literal["van-der-pol"] = quantity("van-der-pol", "", "drives below an angle and brakes above it")
    rate: Number = quantity(..., "s-1", "eps, the rate at which a small swing is driven", gt=0, le=1e6)
    angle: Number = quantity(
        ..., "rad", "angle at which the drive turns into a brake; a weakly driven pendulum comes to swing twice as far",
        gt=0, le=100,
    )  # fmt: skip


class ImpulseEscapement(Section):
    """An escapement that kicks the pendulum along its motion whenever it passes an angle."""

    kind: Literal["impulse"] = quantity("impulse", "", "a kick whenever the pendulum passes an angle")
    angle: Number = quantity(0.0, "rad", "angle at which the kick comes", ge=-1000, le=1000)
    direction: Literal["rising", "falling", "both"] = quantity(
        "both", "", "kicks come while the angle is 'rising', 'falling', or 'both' ways"
    )
    energy: Number = quantity(
        ..., "rad2 s-2", "energy that a kick gives, divided by mass and square of the length", gt=0, le=1e6
    )


Escapement = Annotated[VanDerPolEscapement | ImpulseEscapement, Field(discriminator="kind")]


class Pendulum(Section):
    """One pendulum of the apparatus.

    Its reduced length is reference_gravity * (period/(2 pi))^2.
    """

    label: Label = quantity(..., "", "name of the pendulum, as in the record; no two alike")
    period: Number = quantity(
        ..., "s", "full period at infinitesimal arc, on a rigid support and at reference_gravity", ge=0.01, le=100
    )
    mass: Number | None = quantity(None, "kg", "mass of the bob; a beam or a frame needs it", gt=0, le=1e6)
    temperature_coefficient: Number = quantity(0.0, "s K-1", "what a kelvin more adds to the period", ge=-1e-2, le=1e-2)
    density_coefficient: Number = quantity(
        0.0, "s", "what air of conditions.air_density_reference adds to the period in vacuum", ge=-1, le=1
    )
    drift: Number = quantity(
        0.0, "s day-1", "what a day adds to the period, from the record's start on; the record states none of it",
        ge=-1e-2, le=1e-2,
    )  # fmt: skip
    damping_rate: Number = quantity(
        0.0, "s-1", "rate gamma at which the free amplitude decays, exp(-gamma t)",
        resistance="viscous damping", ge=0, le=1e4,
    )  # fmt: skip
    quadratic_damping: Number = quantity(
        0.0, "rad-1", "c of the resistance of turbulent air, theta'' gains -c |theta'| theta'",
        resistance="quadratic damping", ge=0, le=1e4,
    )  # fmt: skip
    kick_intensity: Number = quantity(
        0.0, "rad s-1/2", "k of random kicks by air and knife edge, d theta' = n k dW; white, and each pendulum's own",
        ge=0, le=1e-2,
    )  # fmt: skip
    knife_edge: KnifeEdge | None = quantity(
        None, "", "dry friction of the knife edge; left out: none", resistance="knife edge"
    )
    escapement: Escapement | None = quantity(
        None, "", "what keeps the pendulum going, kind = 'van-der-pol' or 'impulse'; left out: nothing"
    )
    plane: Number = quantity(
        0.0, "rad", "angle of its plane of swing about the vertical from that of the record", ge=-1.6, le=1.6
    )
    start: Start = quantity(..., "", "how the pendulum starts: kind = 'free' or 'state'")


RESISTANCES: dict[str, str] = {
    name: extra(Pendulum, name)["resistance"] for name in Pendulum.model_fields if "resistance" in extra(Pendulum, name)
}
"""Fields of a pendulum that resist its swing, and their names."""
