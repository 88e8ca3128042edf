"""The record: what an instrument would have written down of the motion; and the truth, which no estimator may read."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import Contents, Entry, Group
from data_schemas.layouts import Kind, root_attributes
from data_schemas.scene import Scene, frequency
from data_schemas.scene_recording import Accelerometer
from data_schemas.variables import attributes
from synth.phase import Floats, Phasors
from synth.plan import Plan, SampledMotion
from synth.recording.apparatus import Apparatus, combination, stamps
from synth.recording.clock import Clock
from synth.seeds import generator

Variables = dict[str, tuple[tuple[str, ...], Any]]  # Dimensions and values by name
_TURN = 2 * np.pi
_SCALARS = ("temperature", "air_density", "yaw_rate", "speed", "course", "latitude", "longitude", "height")


def observe(scene: Scene, clock: Clock, sampled: SampledMotion, apparatus: Apparatus) -> Contents:
    """Record a motion at the moments of a clock, as `data_schemas` lays a record out; chunks come in order of time."""
    samples, flags = apparatus.samples(sampled, clock)
    record: dict[str, Any] = {
        "combination": (("trace", "pendulum"), combination(scene)),
        "elongation": (("trace", "time"), samples),
    }
    states_noise = scene.recording.record_uncertainty
    if states_noise if states_noise is not None else scene.recording.noise > 0:
        record["elongation_uncertainty"] = (("trace",), np.full(len(scene.traces), scene.recording.noise))
    if apparatus.loses_samples:
        record["elongation_qc"] = (("trace", "time"), flags)
    record |= apparatus.beside(sampled, clock)
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    traces = {"trace": label_array(each.name for each in scene.traces)}
    measured_from = {} if scene.case is None else {"reference": scene.case.reference}
    instrument: dict[str, Any] = {
        "period": (("pendulum",), np.array([each.period for each in scene.pendulums])),
        "reference_gravity": ((), scene.reference_gravity),
    }
    if scene.recording.write_damping:
        instrument["damping_rate"] = (("pendulum",), np.array([each.damping_rate for each in scene.pendulums]))
    how: dict[str, str] = {"restoring": scene.restoring} if scene.recording.write_restoring else {}
    accelerometer = scene.recording.horizontal_acceleration
    if isinstance(accelerometer, Accelerometer):
        how["acceleration_frame"] = accelerometer.frame
    return {
        "": root(scene, clock, "record", {}),
        "record": described("record", record, traces | labels, measured_from),
        "instrument": described("instrument", instrument | stated(scene, clock.true_seconds), labels, how),
    }


def reveal(clock: Clock, plan: Plan, sampled: SampledMotion, unwrapped: "Unwrapping") -> Contents:
    """Lay out the truth of a record, or of a chunk of it, as `data_schemas` does; chunks must come in order of time.

    theta = free_amplitude * cos(free_phase) + forced to the last digit where the pendulums are linear.
    """
    scene, both, one, time = plan.scene, ("pendulum", "time"), ("pendulum",), ("time",)
    interval = float(scene.recording.mark_interval) if scene.recording.marks else scene.recording.gap_interval
    at_mean = scene.model_copy(update={"gravity": scene.gravity + plan.mean_change})
    kicked = np.array([each.kick_intensity for each in scene.pendulums])
    variables: dict[str, Any] = {
        "gravity": ((), at_mean.gravity),
        "frequency": (one, np.array([frequency(at_mean, each) for each in scene.pendulums])),
        "damping_rate": (one, np.array([each.damping_rate for each in scene.pendulums])),
        "theta": (both, sampled.theta),
        "horizontal_acceleration": (time, sampled.horizontal_acceleration),
        "mark_time": (("mark",), np.arange(0.0, scene.duration, interval) * float(clock.scale)),
    }
    if sampled.gravity_change is not None:
        variables["gravity_course"] = (time, scene.gravity + sampled.gravity_change)
    if kicked.any():
        variables["kick_intensity"] = (one, kicked)
    if sampled.free is not None:
        amplitude = np.abs(sampled.free)
        base = np.array([float(each.damped_frequency) for each in plan.responses])[:, None] * clock.true_seconds
        phase = unwrapped(sampled.free, base)
        variables["free_amplitude"], variables["free_phase"] = (both, amplitude), (both, phase)
        variables["forced"] = (both, sampled.theta - amplitude * np.cos(phase))
    elif sampled.slow is not None:  # motions do not superpose: what linear pendulums would answer
        variables["forced"] = (both, sampled.slow)
    if plan.vertical.angular_frequency.size:
        variables["vertical_acceleration"] = (time, sampled.vertical_acceleration)
    if sampled.support_displacement is not None:
        variables["support_displacement"] = (time, sampled.support_displacement)
    if plan.pitch is not None:
        variables["case_pitch"] = (time, clock.times.acceleration(plan.pitch)[clock.kept])
    if plan.kicks is not None and plan.kicks.jumps:
        moments = [float((each.number + 1) * plan.kicks.step) for each in plan.kicks.jumps]
        variables["event_time"] = (("event",), np.array(moments))
    attrs = {
        "scene": scene.model_dump_json(),
        "seed": scene.seed,
        "propagator": sampled.propagator,
        "estimated_error": sampled.estimated_error,
        "tolerance": plan.tolerance,
        "caution": plan.caution,
    }
    attrs = {name: value for name, value in attrs.items() if value is not None}
    labels = {"pendulum": label_array(each.label for each in scene.pendulums)}
    return {"": root(scene, clock, "truth", attrs), "truth": described("truth", variables, labels)}


def root(scene: Scene, clock: Clock, kind: Kind, attrs: dict[str, Any]) -> Group:
    """Time and the attributes of the whole, for a record or a truth; `attrs` are further ones."""
    time = attributes("time") | {"units": f"seconds since {scene.start_time}"}
    seconds = stamps(scene, clock.seconds) if kind == "record" else clock.seconds
    said = {"title": scene.title, "history": history(scene), "source": "model"}
    return Group(root_attributes(kind, scene.record_id) | said | attrs, {"time": Entry(("time",), seconds, time)})


def history(scene: Scene) -> str:
    """What files say of where they come from."""
    return f"simulated from the scene {scene.record_id!r} with seed {scene.seed}"


def described(
    group: str, variables: dict[str, Any], labels: dict[str, Any], attrs: Mapping[str, Any] = MappingProxyType({})
) -> Group:
    """Variables of a group, each with its unit and meaning, labels first."""
    named = {name: ((name,), data) for name, data in labels.items()} | variables
    return Group(
        dict(attrs),
        {name: Entry(dims, np.asarray(data), attributes(f"{group}/{name}")) for name, (dims, data) in named.items()},
    )


def label_array(names: Iterable[str]) -> NDArray[np.str_]:
    """Labels as text."""
    return np.array(list(names), dtype=np.str_)


def stated(scene: Scene, true_seconds: Floats) -> Variables:
    """Variables of /instrument that state the conditions, each off by a draw of its stated uncertainty."""
    given = scene.conditions
    variables: Variables = {}

    def error(name: str, sigma: float) -> float:
        return sigma * float(generator(scene.seed, f"stated {name}").normal()) if sigma else 0.0

    def per_pendulum(name: str) -> None:
        variables[name] = (("pendulum",), np.array([getattr(each, name) for each in scene.pendulums]))

    values = {name: (getattr(given, name), getattr(given, f"{name}_uncertainty", 0.0)) for name in _SCALARS}
    if scene.recording.chronometer_rate or given.chronometer_rate_uncertainty:
        values["chronometer_rate"] = (scene.recording.chronometer_rate, given.chronometer_rate_uncertainty)
    for name, (value, sigma) in values.items():
        if value is not None:
            variables[name] = ((), value + error(name, sigma))
            if sigma:
                variables[f"{name}_uncertainty"] = ((), sigma)
    if given.temperature is not None:
        variables["temperature_reference"] = ((), given.temperature_reference)
        per_pendulum("temperature_coefficient")
        if given.temperature_amplitude:
            turned = 2.0 * math.pi / given.temperature_period * true_seconds + given.temperature_phase
            course = variables["temperature"][1] + given.temperature_amplitude * np.sin(turned)
            variables["temperature"] = (("time",), course)
    if given.air_density is not None:
        variables["air_density_reference"] = ((), given.air_density_reference)
        per_pendulum("density_coefficient")
    if given.tilt is not None:  # read as an angle and stated as its square
        sigma = given.tilt_uncertainty
        read = given.tilt + error("tilt_mean_square", sigma)
        variables["tilt_mean_square"] = ((), read**2)
        if sigma:
            of_square = math.hypot(2.0 * read * sigma, math.sqrt(2.0) * sigma**2)
            variables["tilt_mean_square_uncertainty"] = ((), of_square)
    return variables | _bases(scene)


def _bases(scene: Scene) -> Variables:
    given = scene.conditions
    if not given.bases:
        return {}
    times, gravities = np.array([(base.time, base.gravity) for base in given.bases]).T
    own, drift = np.array([(each.period, each.drift) for each in scene.pendulums]).T
    periods = (own + drift * times[:, None] / 86400.0) * np.sqrt(scene.reference_gravity / gravities)[:, None]
    variables: Variables = {
        "base": (("base",), label_array(base.label for base in given.bases)),
        "base_time": (("base",), times),
        "base_gravity": (("base",), gravities),
        "base_period": (("base", "pendulum"), periods),
    }
    sigma = given.base_period_uncertainty
    if sigma:
        periods += generator(scene.seed, "base periods").normal(scale=sigma, size=periods.shape)
        variables["base_period_uncertainty"] = (("base", "pendulum"), np.full(periods.shape, sigma))
    return variables


class Unwrapping:
    """Unwraps chunk after chunk, in order of time: the slow difference from the base is counted in whole turns."""

    def __init__(self) -> None:
        self._last: Floats | None = None  # of the difference, (pendulums, 1) rad

    def __call__(self, signal: Phasors, base: Floats) -> Floats:
        """Phase of the next chunk of a signal, (pendulums, samples) rad, begun within half a turn; so is the base."""
        beside = np.angle(signal) - base
        last = beside[:, :1] if self._last is None else self._last
        beside -= _TURN * np.cumsum(np.rint(np.diff(beside, prepend=last) / _TURN), axis=-1)
        self._last = beside[:, -1:].copy()
        return beside + base
