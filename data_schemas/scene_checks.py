"""What must fit together between pendulums, support and motion of a scene."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from data_schemas.scene_conditions import LARGEST_CHANGE, LinearCourse, SineCourse
from data_schemas.scene_pendulum import RESISTANCES, FreeStart, Pendulum
from data_schemas.scene_support import BeamSupport, BoardSupport, FrameSupport

if TYPE_CHECKING:
    from data_schemas.scene import Scene

_TURN = 7.292115e-5  # rad/s, GRS80
_AXIS, _SQUARE_ECCENTRICITY = 6378137.0, 0.00669438002290  # m, GRS80


def period(scene: Scene, pendulum: Pendulum) -> float:
    """Period of a pendulum at reference gravity under the scene's conditions, in the middle of the record, s."""
    given = scene.conditions
    value = pendulum.period + pendulum.drift * 0.5 * scene.duration / 86400.0
    if given.temperature is not None:
        value += pendulum.temperature_coefficient * (given.temperature - given.temperature_reference)
    if given.air_density is not None:
        value += pendulum.density_coefficient * given.air_density / given.air_density_reference
    return value


def lightening(latitude: float, speed: float, course: float) -> float:
    """Loss of gravity on a ship under way, m/s^2, upright centrifugal force of its motion less the Earth's own.

    Parameters
    ----------
    latitude, course
        Degrees; course from north by east.
    speed
        m/s over ground.

    Examples
    --------
    >>> round(lightening(0.0, 4 * 1852 / 3600, 90.0) * 1e5, 1)
    30.1
    """
    slant, way = math.radians(latitude), math.radians(course)
    bulge = math.sqrt(1.0 - (math.sqrt(_SQUARE_ECCENTRICITY) * math.sin(slant)) ** 2)
    east, north = speed * math.sin(way), speed * math.cos(way)
    ring = _AXIS * math.cos(slant) / bulge  # radius of the parallel
    ground = _TURN * ring
    if ring > 1.0:
        eastward = ((ground + east) ** 2 - ground**2) / ring * math.cos(slant)
    else:  # at a pole, where the parallel is a point
        eastward = east**2 * bulge / _AXIS
    return eastward + north**2 * bulge**3 / (_AXIS * (1.0 - _SQUARE_ECCENTRICITY))


def _in_plane(scene: Scene) -> float:
    """Gravity along the plane of swing that does not turn, m/s^2."""
    given, gravity = scene.conditions, scene.gravity
    if given.speed is not None and given.course is not None and given.latitude is not None:
        gravity -= lightening(given.latitude, given.speed, given.course)
    return gravity * math.cos(given.tilt) if given.tilt else gravity


def felt_gravity(scene: Scene) -> float:
    """What accelerations of the support compare with: gravity less what tilt, turn and the ship's way take, m/s^2."""
    turn = scene.conditions.yaw_rate or 0.0
    lengths = [scene.reference_gravity * (period(scene, each) / (2 * math.pi)) ** 2 for each in scene.pendulums]
    return _in_plane(scene) - (turn**2 * sum(lengths) / len(lengths) if turn else 0.0)


def frequency(scene: Scene, pendulum: Pendulum) -> float:
    """Circular frequency at infinitesimal arc on a rigid support at the scene's gravity and conditions, rad/s."""
    own = 2 * math.pi / period(scene, pendulum) * math.sqrt(_in_plane(scene) / scene.reference_gravity)
    turn = scene.conditions.yaw_rate or 0.0
    return math.sqrt(own**2 - turn**2) if turn else own


def check_physics(scene: Scene) -> None:
    """Raise ValueError, with the remedy, for what has no equations of motion.

    `restoring = "linear"` is the law of small arcs on a support that is moved sideways, whatever resists or drives
    the pendulums; heave and supports that yield act on real pendulums.
    """
    if scene.restoring == "linear" and any(term.axis == "vertical" for term in scene.motion):
        raise ValueError("a vertical motion acts on real pendulums only; set restoring = 'sine'")
    _check_conditions(scene)
    _check_changes(scene)
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


_ONE_METAL = 1e-3  # of the relative change of period: n1/n2 then stays within 1e-7 at 10 K


def _check_conditions(scene: Scene) -> None:
    given = scene.conditions
    if scene.support.kind != "fixed" and (given != type(given)() or any(each.drift for each in scene.pendulums)):
        raise ValueError("conditions act on pendulums on a fixed support only; remove them, or the support")
    for each in scene.pendulums:
        if period(scene, each) <= 0.5 * each.period or (given.yaw_rate or 0.0) * each.period > 1.0:
            raise ValueError(f"conditions: {each.label!r} would hardly swing; make coefficients or yaw_rate smaller")
    if given.temperature_amplitude:
        if scene.restoring != "sine":
            raise ValueError("conditions.temperature_amplitude acts on real pendulums only; set restoring = 'sine'")
        shares = [each.temperature_coefficient / period(scene, each) for each in scene.pendulums]
        if max(shares) - min(shares) > _ONE_METAL * max(abs(share) for share in shares):
            raise ValueError(
                "conditions.temperature_amplitude needs pendulums of one metal; give temperature coefficients in"
                " proportion to the periods"
            )


def _check_changes(scene: Scene) -> None:
    course, fixed = scene.gravity_course, scene.support.kind == "fixed"
    if not fixed and course is not None:
        raise ValueError("gravity_course acts on pendulums on a fixed support only; remove it, or the support")
    if not fixed and (scene.events or scene.case is not None or any(each.plane for each in scene.pendulums)):
        raise ValueError("events, case and plane are for pendulums on a fixed support; remove them, or the support")
    if scene.restoring == "linear" and scene.case is not None and scene.case.roll is not None:
        raise ValueError("case.roll acts on real pendulums only; set restoring = 'sine'")
    if not fixed and any(each.kick_intensity for each in scene.pendulums):
        raise ValueError("kick_intensity acts on pendulums on a fixed support only; set it to 0, or remove the support")
    largest = 0.0
    if isinstance(course, LinearCourse):
        largest = abs(course.rate) * scene.duration
    elif isinstance(course, SineCourse):
        largest = abs(course.amplitude)
    if largest > LARGEST_CHANGE * scene.gravity:
        raise ValueError(
            f"gravity_course changes gravity by {largest:.3g} m/s^2, above {LARGEST_CHANGE:g} of it; make it smaller"
        )


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
        if any(getattr(each, name) for name in RESISTANCES):
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
