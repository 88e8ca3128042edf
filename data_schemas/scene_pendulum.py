"""Pendulums of a scene: how they start, what resists and drives them, what is done to them, what they hang on."""

from typing import Annotated, Any, Literal

from pydantic import Field

from data_schemas.scene_fields import Label, Number, Section, quantity


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
    rate: Number = quantity(..., "rad s-1", "rate at which friction reaches 76 % of itself", ge=1e-9, le=100)


class VanDerPolEscapement(Section):
    """An escapement that acts all the time: theta'' gains rate * (1 - (theta/angle)^2) * theta'."""

    kind: Literal["van-der-pol"] = quantity("van-der-pol", "", "drives below an angle and brakes above it")
    rate: Number = quantity(..., "s-1", "eps, the rate at which a small swing is driven", gt=0, le=1e6)
    angle: Number = quantity(..., "rad", "angle of drive turning to brake; a weak drive ends at twice it", gt=0, le=100)


class ImpulseEscapement(Section):
    """An escapement that kicks the pendulum along its motion whenever it passes an angle."""

    kind: Literal["impulse"] = quantity("impulse", "", "a kick whenever the pendulum passes an angle")
    angle: Number = quantity(0.0, "rad", "angle at which the kick comes", ge=-1000, le=1000)
    direction: Literal["rising", "falling", "both"] = quantity("both", "", "the way on which kicks come")
    energy: Number = quantity(..., "rad2 s-2", "energy of a kick over mass and length squared", gt=0, le=1e6)


Escapement = Annotated[VanDerPolEscapement | ImpulseEscapement, Field(discriminator="kind")]


class Pendulum(Section):
    """One pendulum of the apparatus.

    Its reduced length is reference_gravity * (period/(2 pi))^2.
    """

    label: Label = quantity(..., "", "name of the pendulum, as in the record; no two alike")
    period: Number = quantity(..., "s", "full period, infinitesimal arc, rigid support", ge=0.01, le=100)
    mass: Number | None = quantity(None, "kg", "mass of the bob; a beam or a frame needs it", gt=0, le=1e6)
    temperature_coefficient: Number = quantity(0.0, "s K-1", "what a kelvin more adds to the period", ge=-1e-2, le=1e-2)
    density_coefficient: Number = quantity(0.0, "s", "what air of the reference adds to the period", ge=-1, le=1)
    drift: Number = quantity(0.0, "s day-1", "what a day adds to the period, unstated", ge=-1e-2, le=1e-2)
    damping_rate: Number = quantity(0.0, "s-1", "gamma; the free amplitude decays as exp(-gamma t)", ge=0, le=1e4)
    quadratic_damping: Number = quantity(0.0, "rad-1", "c of turbulent air, -c |theta'| theta'", ge=0, le=1e4)
    kick_intensity: Number = quantity(0.0, "rad s-1/2", "k of white random kicks, d theta' = n k dW", ge=0, le=1e-2)
    knife_edge: KnifeEdge | None = quantity(None, "", "dry friction; left out: none")
    escapement: Escapement | None = quantity(None, "", "what drives it: kind = 'van-der-pol' or 'impulse'")
    plane: Number = quantity(0.0, "rad", "azimuth of its plane of swing from the record's plane", ge=-1.6, le=1.6)
    start: Start = quantity(..., "", "how the pendulum starts: kind = 'free' or 'state'")


RESISTANCES = {
    "damping_rate": "viscous damping",
    "quadratic_damping": "quadratic damping",
    "knife_edge": "knife edge",
}  # Fields of a pendulum that resist its swing, and their names; `synth.systems.resistance` has their kernels


class Event(Section):
    """Something done to one pendulum, at the nearest of even instants, 16 or more a period; the truth says when."""

    pendulum: Label = quantity(..., "", "label of the pendulum")
    time: Number = quantity(..., "s", "true time", gt=0, le=1e8)


class Knock(Event):
    """A sudden change of the angular velocity."""

    kind: Literal["knock"] = quantity("knock", "", "the angular velocity changes at once")
    change: Number = quantity(..., "rad", "change of theta'/n", ge=-10, le=10)


class Restart(Event):
    """The pendulum is started anew by hand."""

    kind: Literal["restart"] = quantity("restart", "", "the pendulum is started anew")
    angle: Number = quantity(..., "rad", "angle from which it goes on", ge=-10, le=10)
    angular_velocity: Number = quantity(0.0, "rad s-1", "with this angular velocity", ge=-100, le=100)


class Release(Event):
    """The pendulum is held until then, and released."""

    kind: Literal["release"] = quantity("release", "", "the pendulum is held at an angle until it is released")
    angle: Number = quantity(..., "rad", "angle at which it is held", ge=-10, le=10)


class Clamp(Event):
    """The pendulum stands still from then on."""

    kind: Literal["clamp"] = quantity("clamp", "", "the pendulum is clamped and stands still from then on")
    angle: Number = quantity(0.0, "rad", "angle at which it stands", ge=-10, le=10)


Handling = Annotated[Knock | Restart | Release | Clamp, Field(discriminator="kind")]


class FixedSupport(Section):
    """The support follows the ship and nothing else."""

    kind: Literal["fixed"] = quantity("fixed", "", "the support follows the ship and nothing else")


_MASS: Any = quantity(..., "kg", "M, effective mass of the support without pendulums", gt=0, le=1e9)


class BeamSupport(Section):
    """An elastic beam that moves up and down: systems (1) and (2) of Kanunnikov and Lamper."""

    kind: Literal["beam"] = quantity("beam", "", "an elastic beam that moves up and down")
    mass: Number = _MASS
    stiffness: Number = quantity(..., "N m-1", "K, vertical stiffness", gt=0, le=1e15)
    damping_rate: Number = quantity(0.0, "s-1", "eps0; the beam is braked by eps0 (M + sum of masses) x'", ge=0, le=1e9)
    displacement: Number = quantity(0.0, "m", "x at t = 0, downwards from the static sag", ge=-1000, le=1000)
    velocity: Number = quantity(0.0, "m s-1", "x' at t = 0, downwards", ge=-1000, le=1000)
    equations: Literal["full", "reduced"] = quantity("full", "", "'full': (1); 'reduced': (2), small arcs, like clocks")


class FrameSupport(Section):
    """A frame that yields sideways, in the swing plane."""

    kind: Literal["frame"] = quantity("frame", "", "a frame that yields sideways")
    mass: Number = _MASS
    stiffness: Number = quantity(..., "N m-1", "K, horizontal stiffness", ge=0, le=1e15)
    resistance: Number = quantity(0.0, "N s m-1", "B; the frame is braked by B X'", ge=0, le=1e12)
    displacement: Number = quantity(0.0, "m", "X at t = 0, relative to the ship", ge=-1000, le=1000)
    velocity: Number = quantity(0.0, "m s-1", "X' at t = 0, relative to the ship", ge=-1000, le=1000)


class BoardSupport(Section):
    """A board that rolls freely, with metronomes on it (Pantaleone 2002)."""

    kind: Literal["board"] = quantity("board", "", "a board that rolls freely, with metronomes on it")
    coupling: Number = quantity(..., "1", "b; bobs' share of the mass, times lever over reduced length", gt=0, lt=1)


Support = Annotated[FixedSupport | BeamSupport | FrameSupport | BoardSupport, Field(discriminator="kind")]
