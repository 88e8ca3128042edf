"""Conditions of a scene, the periods and gravity that they give, and what must fit together in a scene."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from data_schemas.scene_fields import Number, Section, Switch, quantity
from data_schemas.scene_motion import Table
from data_schemas.scene_pendulum import RESISTANCES, BeamSupport, BoardSupport, FreeStart, Pendulum

if TYPE_CHECKING:
    from data_schemas.scene import Scene

_TURN = 7.292115e-5  # rad/s, GRS80
_AXIS, _SQUARE_ECCENTRICITY = 6378137.0, 0.00669438002290  # m, GRS80

LARGEST_CHANGE = 1e-2  # Of gravity: 10 Gal, far more than a ship meets


class LinearCourse(Section):
    """gravity + rate * t."""

    kind: Literal["linear"] = quantity("linear", "", "gravity changes evenly")
    rate: Number = quantity(..., "m s-3", "change of gravity in a second; 1 mGal an hour is 2.8e-9", ge=-1, le=1)


class SineCourse(Section):
    """gravity + amplitude * sin(2 pi t/period + phase)."""

    kind: Literal["sine"] = quantity("sine", "", "gravity swings about its mean")
    amplitude: Number = quantity(..., "m s-2", "largest change of gravity", ge=-1, le=1)
    period: Number = quantity(..., "s", "time of a full cycle", ge=10, le=1e9)
    phase: Number = quantity(0.0, "rad", "phase of the sine at t = 0", ge=-100, le=100)


class TableCourse(Table):
    """Gravity + a column of a CSV or netCDF file, given as a tabulated motion is."""

    section: ClassVar[str] = "gravity_course"
    kind: Literal["table"] = quantity("table", "", "gravity changes as a table says")


GravityCourse = Annotated[LinearCourse | SineCourse | TableCourse, Field(discriminator="kind")]


class BaseStation(Section):
    """An occupation of a base station, before or after."""

    label: Annotated[str, Field(strict=True, pattern=r"^[A-Za-z0-9_. +-]{1,40}$")] = quantity(..., "", "its name")
    time: Number = quantity(..., "s", "when, from the record's start; negative before it", ge=-1e9, le=1e9)
    gravity: Number = quantity(..., "m s-2", "gravity of the station", ge=0.1, le=100)


def _error(unit: str, of: str) -> Any:
    return quantity(0.0, unit, f"1 sigma of the error of the record's {of}, which states it", ge=0, le=1e4)


class Conditions(Section):
    """Heat, air, tilt, turn and way of the ship; what is left out does not act and is not in the record.

    The periods of the pendulums hold at temperature_reference in vacuum. A stated uncertainty makes the record's value
    wrong by a draw of that size from the scene's seed.
    """

    temperature: Number | None = quantity(None, "K", "mean temperature of the pendulums", ge=100, le=500)
    temperature_reference: Number = quantity(288.15, "K", "temperature at which the periods hold", ge=100, le=500)
    temperature_amplitude: Number = quantity(0.0, "K", "amplitude of a sine within the record", ge=0, le=100)
    temperature_period: Number = quantity(86400.0, "s", "period of that sine", ge=60, le=1e8)
    temperature_phase: Number = quantity(0.0, "rad", "phase of its sine at t = 0", ge=-100, le=100)
    temperature_uncertainty: Number = _error("K", "temperature")
    air_density: Number | None = quantity(None, "kg m-3", "density of the air in the case", ge=0, le=100)
    air_density_reference: Number = quantity(1.2, "kg m-3", "density at which density_coefficient holds", gt=0, le=100)
    air_density_uncertainty: Number = _error("kg m-3", "air density")
    tilt: Number | None = quantity(None, "rad", "angle of the plane of swing out of the vertical", ge=-0.5, le=0.5)
    tilt_uncertainty: Number = _error("rad", "tilt")
    yaw_rate: Number | None = quantity(None, "rad s-1", "rate of turn of the plane of swing", ge=-1, le=1)
    yaw_rate_uncertainty: Number = _error("rad s-1", "rate of turn")
    latitude: Number | None = quantity(None, "degrees", "latitude, north positive", ge=-90, le=90)
    longitude: Number | None = quantity(None, "degrees", "longitude, east positive", ge=-360, le=360)
    height: Number | None = quantity(None, "m", "height above the sea's surface", ge=-1.2e4, le=1e4)
    tide: Switch = quantity(False, "", "whether the tide of a yielding Earth acts; it needs latitude and longitude")
    speed: Number | None = quantity(None, "m s-1", "speed of the ship over ground", ge=0, le=100)
    course: Number | None = quantity(None, "degrees", "course over ground, from north by east", ge=-360, le=360)
    speed_uncertainty: Number = _error("m s-1", "speed")
    course_uncertainty: Number = _error("degrees", "course")
    chronometer_rate_uncertainty: Number = _error("s day-1", "chronometer rate")
    bases: tuple[BaseStation, ...] = quantity((), "", "occupations of base stations, in order of time")
    base_period_uncertainty: Number = quantity(0.0, "s", "1 sigma of the periods at bases, stated", ge=0, le=1)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.speed is None) != (self.course is None) or (self.speed is not None and self.latitude is None):
            raise ValueError("the ship's way needs latitude, speed and course together")
        if self.tide and (self.latitude is None or self.longitude is None):
            raise ValueError("tide needs latitude and longitude")
        if self.temperature_amplitude and self.temperature is None:
            raise ValueError("temperature_amplitude needs the mean temperature")
        for name in ("temperature", "air_density", "tilt", "yaw_rate", "speed", "course"):
            if getattr(self, f"{name}_uncertainty") and getattr(self, name) is None:
                raise ValueError(f"{name}_uncertainty needs {name}")
        if self.base_period_uncertainty and not self.bases:
            raise ValueError("base_period_uncertainty needs bases")
        times = [base.time for base in self.bases]
        if sorted(set(times)) != times:
            raise ValueError("bases must be in order of time")
        return self


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
    _check_support(scene)


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
    course = scene.gravity_course
    if scene.support.kind != "fixed":
        if course is not None:
            raise ValueError("gravity_course acts on pendulums on a fixed support only; remove it, or the support")
        if scene.events or scene.case is not None or any(each.plane for each in scene.pendulums):
            raise ValueError("events, case and plane are for pendulums on a fixed support; remove them, or the support")
        if any(each.kick_intensity for each in scene.pendulums):
            raise ValueError(
                "kick_intensity acts on pendulums on a fixed support only; set it to 0, or fix the support"
            )
    if scene.restoring == "linear" and scene.case is not None and scene.case.roll is not None:
        raise ValueError("case.roll acts on real pendulums only; set restoring = 'sine'")
    largest = 0.0
    if isinstance(course, LinearCourse):
        largest = abs(course.rate) * scene.duration
    elif isinstance(course, SineCourse):
        largest = abs(course.amplitude)
    if largest > LARGEST_CHANGE * scene.gravity:
        raise ValueError(
            f"gravity_course changes gravity by {largest:.3g} m/s^2, above {LARGEST_CHANGE:g} of it; make it smaller"
        )


def _check_support(scene: Scene) -> None:
    support, reduced = scene.support, isinstance(scene.support, BeamSupport) and scene.support.equations == "reduced"
    if reduced:
        _check_reduced(scene)
    elif support.kind != "fixed" and scene.restoring != "sine":
        raise ValueError(f"support: pendulums on a {support.kind} swing with the full sine; set restoring = 'sine'")
    if isinstance(support, BoardSupport):
        _check_board(scene, support)
    elif support.kind != "fixed":
        for each in scene.pendulums:
            if each.mass is None:
                raise ValueError(f"pendulums: {each.label!r} moves the {support.kind} it hangs on; give its mass")


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
