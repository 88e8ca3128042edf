"""What must fit together between pendulums, support and motion of a scene."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from data_schemas.scene_pendulum import FreeStart, Pendulum
from data_schemas.scene_support import BeamSupport, BoardSupport, FrameSupport

if TYPE_CHECKING:
    from data_schemas.scene import Scene


def frequency(scene: Scene, pendulum: Pendulum) -> float:
    """Circular frequency at infinitesimal arc on a rigid support at the scene's gravity, rad/s."""
    return 2 * math.pi / pendulum.period * math.sqrt(scene.gravity / scene.reference_gravity)


def check_physics(scene: Scene) -> None:
    """Raise ValueError, with the remedy, for what has no equations of motion.

    `restoring = "linear"` is the law of small arcs on a support that is moved sideways, whatever resists or drives
    the pendulums; heave and supports that yield act on real pendulums.
    """
    if scene.restoring == "linear" and any(term.axis == "vertical" for term in scene.motion):
        raise ValueError("a vertical motion acts on real pendulums only; set restoring = 'sine'")
    for each in scene.pendulums:
        own = frequency(scene, each)
        if isinstance(each.start, FreeStart) and each.damping_rate >= own:
            raise ValueError(
                f"pendulums: {each.label!r} with damping_rate = {each.damping_rate:g} 1/s creeps and has no free"
                f" harmonic (its frequency is {own:g} rad/s); start it with kind = 'state'"
            )
    match scene.support:
        case BeamSupport(equations="reduced"):
            _check_reduced(scene)
            _check_masses(scene)
        case BeamSupport() | FrameSupport():
            _check_sine(scene)
            _check_masses(scene)
        case BoardSupport():
            _check_sine(scene)
            _check_board(scene, scene.support)


def _check_sine(scene: Scene) -> None:
    if scene.restoring != "sine":
        raise ValueError(
            f"support: pendulums on a {scene.support.kind} swing with the full sine; set restoring = 'sine'"
        )


def _check_masses(scene: Scene) -> None:
    for each in scene.pendulums:
        if each.mass is None:
            raise ValueError(f"pendulums: {each.label!r} moves the {scene.support.kind} it hangs on; give its mass")


def _check_reduced(scene: Scene) -> None:
    what = "support: the reduced beam knows"
    remedy = "or choose equations = 'full'"
    if scene.restoring != "linear":
        raise ValueError(f"{what} small arcs only; set restoring = 'linear', {remedy}")
    if any(term.kind != "still" for term in scene.motion):
        raise ValueError(f"{what} no motion of the ship; remove it, {remedy}")
    for each in scene.pendulums:
        if each.escapement is None or each.escapement.kind != "van-der-pol":
            raise ValueError(f"{what} clocks with a van-der-pol escapement; give {each.label!r} one, {remedy}")
        if each.damping_rate or each.quadratic_damping or each.knife_edge:
            raise ValueError(f"{what} no resistance; take that of {each.label!r} away, {remedy}")


def _check_board(scene: Scene, board: BoardSupport) -> None:
    if board.coupling * len(scene.pendulums) >= 1:
        raise ValueError(
            f"support: a coupling of {board.coupling:g} makes {len(scene.pendulums)} metronomes outweigh the whole;"
            f" make it smaller than {1 / len(scene.pendulums):g}"
        )
    if any(term.axis == "horizontal" and term.kind != "still" for term in scene.motion):
        raise ValueError(
            "support: a board that rolls freely stays behind when the ship moves sideways; remove the horizontal"
            " motion, or choose the kind 'frame'"
        )
