"""Suite `stability`: every propagator on every extreme motion.

A motion with its error, or refused with a named reason, never silently wrong. The propagators that `solvers` names must
meet their bound; any other may decline, but not be wrong. Truth is a closed form, an elliptic function in 40 digits, or
a different propagator at a tighter tolerance; `source` says which.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from pydantic import ValidationError

from data_schemas.errors import IsochronyError
from data_schemas.scene import Propagator, Scene
from pipeline.benchmarks import references as truth
from pipeline.benchmarks.problems import GRAVITY, STILL, Swell
from pipeline.benchmarks.tables import Row, progress
from synth import simulate
from synth.phase import Floats
from synth.systems.yielding import ElasticBeam, stiffness_of_ratio

LINEAR: tuple[Propagator, ...] = ("auto", "closed-form", "radau", "explicit")
SINE: tuple[Propagator, ...] = ("auto", "picard", "radau", "explicit")
VIOLENT: tuple[Propagator, ...] = ("auto", "radau", "explicit")
"""Overdamped, or far from the linear pendulum about which collocation expands."""
STIFF: tuple[Propagator, ...] = ("auto", "radau")  # slower than what an explicit step can bear

N = 6.25  # rad/s, of the pendulums
PERIOD = 2.0 * np.pi / N  # s
BOUND = 1e-8  # largest error, relative to the largest angle, of a cell that must be solved
DIGITS, ANOTHER = "elliptic function, 40 digits", "another propagator, tighter"
PROPAGATORS: tuple[Propagator, ...] = get_args(Propagator)
TOLERANCE = 1e-10  # what is asked of propagators that take a tolerance
HONEST = 10.0  # the error may be so many times the propagator's estimate
ROUNDING = 1e-13  # errors below it are rounding
ROUNDED = 4e-16  # of a phase: scenes give periods, whose reciprocals are rounded
MOST = 400  # readings that are compared with the truth
_TIGHTER = 1e-2


@dataclass(frozen=True)
class Motion:
    """One motion, as a scene read `count` times, every `step` s, and the source of its truth."""

    name: str
    scene: Mapping[str, Any]
    step: Fraction
    count: int
    true: Callable[[Sequence[Fraction]], Floats] | None
    """Exact instants give the angles, (instants, pendulums), rad; None: another propagator does."""
    source: str
    solvers: tuple[Propagator, ...]  # propagators that must solve it
    not_asked: tuple[Propagator, ...] = ()  # propagators that would take minutes or hours
    bounds: Mapping[str, float] = field(default_factory=dict)  # of single propagators, tighter than `BOUND`
    apart: float = 0.0  # how far the truth itself may be from this motion, relative: a limit that is only approached


def _scene(
    periods: Sequence[float], start: Sequence[float], step: Fraction, count: int, each: Mapping[str, Any], **more: Any
) -> dict[str, Any]:
    pendulums = []
    for k, period in enumerate(periods):
        begun = {"kind": "state", "angle": start[2 * k], "angular_velocity": start[2 * k + 1]}
        pendulums.append({"label": str(k + 1), "period": period, "start": begun, **each})
    world = {"record_id": "extreme", "gravity": GRAVITY, "reference_gravity": GRAVITY, "pendulums": pendulums}
    return {**world, "duration": float(step * count), "recording": {"sampling_rate": str(1 / step)}, **more}


def _one(amplitude: float, rate: float, phase: float = 0.3) -> Swell:
    return Swell(np.array([amplitude]), np.array([rate]), np.array([phase]))


def _moved(swell: Swell, axis: str = "horizontal") -> list[dict[str, Any]]:
    if not np.any(swell.amplitude):
        return []
    amplitude, rate, phase = (values.tolist() for values in swell)
    return [{"kind": "harmonics", "axis": axis, "amplitude": amplitude, "angular_frequency": rate, "phase": phase}]


def _linear() -> tuple[Motion, ...]:
    def made(
        name: str, start: tuple[float, ...] = (0.01, 0.02), step: Fraction = Fraction(1, 10), count: int = 6001,
        damping: float = 0.0, swell: Swell = STILL, solvers: tuple[Propagator, ...] = LINEAR, **more: Any,
    ) -> Motion:  # fmt: skip
        pendulums = len(start) // 2
        scene = _scene(pendulums * [PERIOD], start, step, count, {"damping_rate": damping}, motion=_moved(swell))
        true = partial(truth.linear, pendulums * [N], pendulums * [damping], start, swell)
        return Motion(name, scene, step, count, true, "closed form, 100 digits", solvers, **more)

    swell, still = _one(0.5, 0.9), (0.0, 0.0)
    bound: Any = {"bounds": {"closed-form": 1e-13}}
    almost = N * (1.0 - 1e-12)  # which rounding of the period takes for overdamped
    return (
        made("exact resonance", swell=_one(1e-3, N), **bound),
        made("resonance detuned by 1e-12", swell=_one(1e-3, N * (1.0 + 1e-12)), **bound),
        made("exact resonance, damped", damping=1e-3, swell=_one(1e-3, N)),
        made("equal frequencies", (0.01, 0.0, 0.01, 0.0), swell=swell, bounds={"closed-form": 1e-14}),
        made("zero amplitude, still", still),
        made("zero amplitude, swell", still, swell=swell),
        made("damping 1e-12 below critical", damping=almost, count=101, swell=swell, solvers=VIOLENT),
        made("overdamped, 10 /s", damping=10.0, count=101, swell=swell, solvers=VIOLENT),
        made("overdamped, 1e4 /s", damping=1e4, count=101, swell=swell, solvers=STIFF),
        made("1 ms long", step=Fraction(1, 10_000), count=11, swell=swell),
        made(
            "1e7 s long, every 10 s", step=Fraction(10), count=1_000_001, damping=1e-7, swell=swell, **bound,
            solvers=("auto", "closed-form"), not_asked=("explicit", "radau", "picard", "beam-collocation"),
        ),
        made("read every 7.3 s", step=Fraction(73, 10), count=301, swell=swell),
        made(
            "forced at 1 kHz", count=101, swell=_one(500.0, 2000.0 * np.pi),
            solvers=("auto", "closed-form", "radau"), not_asked=("explicit",),
        ),
        made("forced at 1e-6 Hz", swell=_one(0.1, 2e-6 * np.pi)),
    )  # fmt: skip


def _sine() -> tuple[Motion, ...]:
    def made(
        name: str, start: tuple[float, float], count: int, true: Callable[[Sequence[Fraction]], Floats] | None = None,
        source: str = ANOTHER, solvers: tuple[Propagator, ...] = VIOLENT, step: Fraction = Fraction(1, 20),
        horizontal: Swell = STILL, vertical: Swell = STILL, **more: Any,
    ) -> Motion:  # fmt: skip
        motion = [*_moved(horizontal), *_moved(vertical, "vertical")]
        scene = _scene([PERIOD], start, step, count, {}, restoring="sine", motion=motion)
        return Motion(name, scene, step, count, true, source, solvers, **more)

    def swing(name: str, angle: float, count: int, step: Fraction = Fraction(1, 20), **more: Any) -> Motion:
        solvers = SINE if angle < 2.0 else VIOLENT
        return made(name, (angle, 0.0), count, partial(truth.swing, N, angle), DIGITS, solvers, step, **more)

    up = partial(truth.separatrix, N)
    fall, turned = _one(-GRAVITY, 0.0, 0.0), _one(-2.0 * GRAVITY, 0.0, 0.0)
    fast, lifted = _one(3.0 * GRAVITY, 2.0, 0.0), _one(2.0 * GRAVITY, 3.0, 0.5)
    return (
        swing("1e-6 rad", 1e-6, 2001),
        swing("1 rad", 1.0, 2001, bounds={"picard": 1e-13}),
        swing("3.1 rad", 3.1, 601),
        swing("3.14159 rad, to the other side", 3.14159, 91),
        swing("1 rad, 1 ms long", 1.0, 11, Fraction(1, 10_000)),
        swing("1 rad, read every 7.3 s", 1.0, 101, Fraction(73, 10)),
        made("over the top", (0.0, 2.5 * N), 401),
        made("on the separatrix, 2 s", (0.0, 2.0 * N), 41, up, "closed form"),
        # on the separatrix rounding alone decides where the pendulum goes
        made("on the separatrix, 20 s", (0.0, 2.0 * N), 401, up, "closed form", ()),
        made("zero amplitude, sine", (0.0, 0.0), 201, lambda instants: np.zeros((len(instants), 1)), "rest", SINE),
        made(
            "free fall, z'' = -g", (0.3, 0.1), 101,
            lambda instants: np.array([[0.3 + 0.1 * float(each)] for each in instants]), "straight line", vertical=fall,
        ),
        made(
            "beyond free fall, z'' = -2 g", (0.3, 0.0), 101,
            lambda instants: np.asarray(np.pi - truth.swing(N, float(np.pi) - 0.3, instants)), DIGITS, vertical=turned,
        ),
        made("several g", (0.1, 0.0), 101, horizontal=fast, vertical=lifted),
        made("resonance", (0.01, 0.0), 2001, solvers=SINE, horizontal=_one(1e-2 * GRAVITY, N, 0.0)),
    )  # fmt: skip


def _beams() -> tuple[Motion, ...]:
    def made(
        name: str, system: ElasticBeam, start: Sequence[float], step: Fraction, count: int, *true: Any, **more: Any
    ) -> Motion:
        support = {
            "kind": "beam", "mass": system.own_mass, "stiffness": system.stiffness,
            "damping_rate": system.damping_rate, "displacement": start[0], "velocity": start[1],
        }  # fmt: skip
        periods = (2.0 * np.pi * np.sqrt(system.length / GRAVITY)).tolist()
        masses = {"mass": float(system.mass[0])}
        scene = _scene(periods, start[2:], step, count, masses, restoring="sine", support=support)
        return Motion(name, scene, step, count, *(true or (None, ANOTHER)), **more)

    light = ElasticBeam(50.0, np.array([0.25]), np.array([1.0]), 0.0, 0.0, GRAVITY)
    frequency = float(np.sqrt(GRAVITY))
    limit = partial(truth.swing, frequency, 1.0), "rigid limit, approached as ratio^-2", STIFF
    out = []
    for power in (2, 4, 6):
        ratio, name = 10.0**power, f"beam 1e{power} times stiffer"
        system = light._replace(stiffness=stiffness_of_ratio(ratio, light), damping_rate=0.3 * ratio * frequency)
        out.append(made(name, system, (0.0, 0.0, 1.0, 0.0), Fraction(10), 2, *limit, apart=0.2 / ratio**2))
    heavy = ElasticBeam(1e-3, np.array([1.0, 1.0]), np.array([1.0, 0.9]), 150.0, 0.0, GRAVITY)
    begun, step = (0.05, 0.0, 0.3, 0.0, -0.2, 0.0), Fraction(1, 20)
    return (*out, made("light beam, M/m = 1e-3", heavy, begun, step, 101, solvers=VIOLENT))


def motions() -> tuple[Motion, ...]:
    """All of them."""
    return (*_linear(), *_sine(), *_beams())


class Found(NamedTuple):
    """What a propagator made of a motion, angles (count, pendulums) and estimated error, or why it made nothing."""

    angles: Floats | None = None
    estimate: float = math.nan
    why: str = ""  # "refused: ..." or "crashed: ..."


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield one row a motion, one cell a propagator. Quick and full are the same."""
    for motion in progress(motions(), "extreme motions"):
        yield judge(motion, {name: attempt(motion, name) for name in PROPAGATORS})


def attempt(motion: Motion, name: Propagator, tolerance: float = TOLERANCE) -> Found:
    """Simulate a motion by a propagator."""
    if name in motion.not_asked:
        return Found(why="refused: not asked, it would take minutes")
    simulation = {"propagator": name, "tolerance": tolerance}
    try:
        truth = simulate(Scene.model_validate({**motion.scene, "simulation": simulation}))[1]
    except (IsochronyError, ValidationError) as refusal:
        return Found(why=f"refused: {refusal}")
    except Exception as fault:  # whatever it is, the row shows it as the failure of this cell
        return Found(why=f"crashed: {type(fault).__name__}: {fault}")
    estimate = next(node.attrs["estimated_error"] for node in truth.subtree if "estimated_error" in node.attrs)
    return Found(np.asarray(truth["truth/theta"].values).T[: motion.count], float(estimate))


def judge(motion: Motion, found: Mapping[Propagator, Found]) -> Row:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    faults: dict[str, list[str]] = {"silently_wrong": [], "refused_unlisted": [], "bound_missed": []}
    cells: dict[str, str] = {}
    for name, one in found.items():
        cells[name] = one.why
        if one.angles is None:
            if one.why.startswith("crashed") or name in motion.solvers:
                faults["refused_unlisted"].append(name)
            continue
        error, doubt = error_of(motion, name, one.angles)
        cells[name] = f"{error:.1e} (est. {one.estimate:.0e})"
        if not error <= max(HONEST * one.estimate, ROUNDING) + doubt:
            faults["silently_wrong"].append(name)
        elif name in motion.solvers and error > motion.bounds.get(name, BOUND) + doubt:
            faults["bound_missed"].append(name)
    told = {name: ", ".join(each) for name, each in faults.items()}
    return {"motion": motion.name, **cells, **told, "truth": motion.source, "pass": not any(faults.values())}


def error_of(motion: Motion, name: Propagator, angles: Floats) -> tuple[float, float]:
    """Largest error over its pendulum's largest true angle (rad where that is 0), and how far off the truth may be."""
    rows = np.unique(np.linspace(0, motion.count - 1, min(motion.count, MOST)).astype(np.int64))
    if motion.true is not None:
        true, doubt = motion.true([motion.step * row for row in rows.tolist()]), motion.apart
    else:  # a different propagator, at a tighter tolerance
        others: list[Propagator] = [each for each in ("explicit", "radau") if each != name]
        answers = (attempt(motion, other, TOLERANCE * _TIGHTER) for other in others)
        other = next((each for each in answers if each.angles is not None), Found(np.full_like(angles, np.nan)))
        true, doubt = np.asarray(other.angles)[rows], other.estimate
    size = np.max(np.abs(true), axis=0, initial=0.0)
    worst = float(np.max(np.abs(angles[rows] - true) / np.where(size > 0.0, size, 1.0), initial=0.0))
    fastest = 2.0 * math.pi / min(each["period"] for each in motion.scene["pendulums"])
    return (worst if math.isfinite(worst) else math.inf), doubt + ROUNDED * fastest * float(motion.step * motion.count)
