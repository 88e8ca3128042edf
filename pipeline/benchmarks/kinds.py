"""What one record of the suite is made with, and the kinds of disturbance: what varies with the strength, what else.

The defaults are the record on which every kind builds: half an hour of two pendulums at 10 Hz in a swell that costs one
milligal if ignored, read to 1e-5 rad, its law and damping stated; what is not here is drawn for each record. Strengths
are such that a reduction that ignores the disturbance errs by about .1, 1 and 10 mGal or more, where the physics gives
a figure. Group `sea` is the world and the reading; group `instrument` is constants and faults of the apparatus.
"""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Case:
    """SI units and radians, but where a name says otherwise."""

    # pendulums
    duration: float = 1800.0
    amplitudes: tuple[float, float] = (0.012, 0.009)
    split: float = 0.0  # n2/n1 - 1; 0: drawn between 5e-5 and 5e-4, of either sign
    linear: bool = False
    damping: float = 1e-4
    damping_difference: float = 1e-5
    quadratic: float = 0.0
    friction: float = 0.0
    kicks: tuple[float, float] = (0.0, 0.0)  # each pendulum's own, rad/sqrt(s)
    knocks: tuple[float, float] = (0.0, 0.0)  # step of theta'/n of each pendulum, once
    restart: float = 0.0  # change of the free swing at one time, of its amplitude
    pendulums: int = 2
    # the ship; of a sea the root mean squares of x'' and z''
    swell: tuple[float, float] = (0.015, 0.0)
    swell_period: float = 10.0
    wind_sea: tuple[float, float] = (0.0, 0.0)
    wind_period: float = 4.0
    resonant: float = 0.0  # amplitude of x'' that beats with the first pendulum in one to five minutes
    vibration: float = 0.0
    engine: float = 0.0  # amplitudes: of x'' by vibration, of z'' by the engine
    vibration_frequency: float = 3.0
    engine_frequency: float = 0.0  # Hz; 0: beats with twice the swing's in one to five minutes
    turn: float = 0.0  # rate of a turn by 90 degrees at 5 m/s, deg/s
    speed_change: float = 0.0  # within a minute, m/s
    gravity_change: float = 0.0
    gravity_wave: float = 0.0  # mGal: the change over the record, and the amplitude of a wave of 20 minutes
    # reading
    rate: float = 10.0
    jitter: float = 0.0  # of the interval, known
    noise: float = 1e-5
    lost: float = 0.0  # share of samples that are not there
    gap: float = 0.0
    gaps: int = 1
    first_gap: float = 0.0
    lost_of_two_minutes: float = 0.0
    outliers: float = 0.0  # share of samples that are off by some mrad
    bursts: int = 0  # of two seconds of bad reading
    quantisation: float = 0.0
    clip: float = 1.0  # of the largest elongation
    dead: float = 0.0  # share of the record at whose end the last trace stands still
    copied: float = 0.0  # share of the record in which the last trace repeats the first
    # instrument; signs are drawn
    zero_first: float = 0.0
    zero_drift: float = 0.0
    zero_step_first: float = 0.0
    zero_step_difference: float = 0.0
    zero_steps: float = 0.0  # 1 sigma of six steps of the first trace's zero
    cubic: float = 0.0  # of the optics: an angle x is read as x + cubic x^3
    wow: float = 0.0  # error of the record's time, with a period of a minute, s
    plane: float = 0.0
    """Angle of the second pendulum's plane of swing from the first's, rad; y'' then is another sea like x''."""
    rocking: float = 0.0
    """Amplitude of y'' at ten seconds, m/s^2, which the planes of swing follow; its mean squares are stated."""
    released: float = 0.0  # until when the pendulums are held, s
    heave_lost: float = 0.0  # share of ten gaps in a recorded z''
    follows: float = 0.0  # of the apparent vertical, by which a case tilts beside its roll
    tilt: float = 0.0  # amplitude of the case's roll at 8 s, from which elongations are measured, degrees
    tilt_noise: float = 2e-5  # of a recorded tilt, rad
    gain_first: float = 0.0
    gain_all: float = 0.0  # relative errors of the scale, of the first trace and of all
    delay: float = 0.0
    clock_step: float = 0.0
    heave_noise: float = 2e-5
    heave_bias: float = 0.0
    heave_scale: float = 1.0
    heave_delay: float = 0.0
    # what the record states
    states_law: bool = True
    states_damping: bool = True
    states_noise: bool = True
    states_heave: bool = False
    states_scale: float = 0.0  # its uncertainty, relative; 0: not stated
    states_tilt: str = "tilt"
    """What a record from a tilting case holds: "tilt", "acceleration" (horizontal), or "" for neither."""
    damping_error: float = 0.0  # of the damping rates as stated, relative
    ratio_error: float = 0.0  # of n1/n2 as stated


STRENGTHS = ("weak", "middle", "strong")
_G = 9.81  # m/s^2


SEA, INSTRUMENT = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")).values()
KINDS: dict[str, dict[str, Any]] = SEA | INSTRUMENT
_UNMIXED = ("mixture", "linear law not stated", "short record", "second marks", "engine at 8 Hz")
MIXABLE = tuple(name for name in SEA if name not in _UNMIXED)
"""What a mixture draws from, without an engine that noise hides; of two that set one quantity the later holds."""


def case_of(kind: str, strength: str, base: Case | None = None) -> Case:
    """The case of a kind at a strength; over another one if that is given."""
    fields: dict[str, Any] = {}
    for name, value in KINDS[kind].items():
        one: Any = value[STRENGTHS.index(strength)] if varies(value) else value
        one = tuple(one) if isinstance(one, list) else one
        fields[name.removesuffix("_g")] = one * _G if name.endswith("_g") else one
    del fields["source"]
    return replace(base or Case(), **fields)


def varies(value: Any) -> bool:
    """Whether a field of the table has a value for each strength."""
    return isinstance(value, list) and len(value) == len(STRENGTHS)
