"""What the pendulums hang on: a fixed support, or one that they move."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from data_schemas.scene_fields import Number, Section, quantity


class FixedSupport(Section):
    """The support follows the ship and nothing else."""

    kind: Literal["fixed"] = quantity("fixed", "", "the support follows the ship and nothing else")


def _mass() -> Number:
    number: Number = quantity(..., "kg", "M, effective mass of the support without pendulums", gt=0, le=1e9)
    return number


class BeamSupport(Section):
    """An elastic beam that moves up and down: systems (1) and (2) of Kanunnikov and Lamper."""

    kind: Literal["beam"] = quantity("beam", "", "an elastic beam that moves up and down")
    mass: Number = _mass()
    stiffness: Number = quantity(..., "N m-1", "K, vertical stiffness", gt=0, le=1e15)
    damping_rate: Number = quantity(0.0, "s-1", "eps0; the beam is braked by eps0 (M + sum of masses) x'", ge=0, le=1e9)
    displacement: Number = quantity(0.0, "m", "x at t = 0, downwards from the static sag", ge=-1000, le=1000)
    velocity: Number = quantity(0.0, "m s-1", "x' at t = 0, downwards", ge=-1000, le=1000)
    equations: Literal["full", "reduced"] = quantity(
        "full", "", "'full' for system (1), 'reduced' for system (2), which holds at small arcs and for like clocks"
    )


class FrameSupport(Section):
    """A frame that yields sideways, in the swing plane."""

    kind: Literal["frame"] = quantity("frame", "", "a frame that yields sideways")
    mass: Number = _mass()
    stiffness: Number = quantity(..., "N m-1", "K, horizontal stiffness", ge=0, le=1e15)
    resistance: Number = quantity(0.0, "N s m-1", "B; the frame is braked by B X'", ge=0, le=1e12)
    displacement: Number = quantity(0.0, "m", "X at t = 0, relative to the ship", ge=-1000, le=1000)
    velocity: Number = quantity(0.0, "m s-1", "X' at t = 0, relative to the ship", ge=-1000, le=1000)


class BoardSupport(Section):
    """A board that rolls freely, with metronomes on it (Pantaleone 2002)."""

    kind: Literal["board"] = quantity("board", "", "a board that rolls freely, with metronomes on it")
    coupling: Number = quantity(
        ..., "1", "b; what the metronomes' bobs weigh of the whole, times lever over reduced length", gt=0, lt=1
    )


Support = Annotated[FixedSupport | BeamSupport | FrameSupport | BoardSupport, Field(discriminator="kind")]
