"""What one record of the suite is made with, and the kinds of disturbance: what varies with the strength, what else.

The defaults are the record on which every kind builds: half an hour of two pendulums at 10 Hz in a swell that costs
one milligal if ignored, read to 1e-5 rad, its law and damping stated. What is not here (period, difference of the
periods, gravity, phases, the sea's harmonics) is drawn for each record.

Strengths are chosen so that a reduction that ignores the disturbance errs by about .1, 1 and 10 mGal or more, where the
physics gives a figure. Group `sea` is the world and the reading; group `instrument` is constants and faults of the
apparatus: zeros, tilt, accelerometer, gains, delays, clocks, clipping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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


class Kind:
    """One entry of the table: what its strengths rest on, and fields of `Case`; those of three values vary."""

    def __init__(self, source: str, **fields: Any) -> None:
        self.source = source
        self.varied = {name: value for name, value in fields.items() if isinstance(value, tuple) and len(value) == 3}
        self.common = {name: value for name, value in fields.items() if name not in self.varied}


_BROWNE = "g <x''^2>/(2 g^2): Browne 1937"
_HEAVE = "-<z''^2>/(4 g): rectified heave"
_ARC = "n (1 - a^2/16): finite arc"
_READING = "1 sigma of a slope over half an hour"
_KICKED = "1 sigma of a slope .77 k/(a sqrt T) of n"
_GUESS = "by size: no closed form"
_G = 9.81
_ROUGH = {"swell": (0.015, 0.05), "states_heave": True}
_ARCS = {"amplitudes": ((0.004, 0.003), (0.012, 0.009), (0.03, 0.025))}

SEA: dict[str, Kind] = {
    # motion of the ship
    "swell": Kind(_BROWNE, swell=((0.005, 0.0), (0.015, 0.0), (0.05, 0.0)), noise=0.0),
    "swell at 25 Hz": Kind(_BROWNE, swell=((0.005, 0.0), (0.015, 0.0), (0.05, 0.0)), rate=25.0),
    "near-resonant": Kind("beta of (31)", resonant=(1e-5, 1e-4, 8e-4)),
    "heave recorded": Kind(_HEAVE, swell=((0.005, 0.01), (0.03, 0.1), (0.15, 0.5)), states_heave=True),
    "heave not recorded": Kind(_HEAVE, swell=((0.005, 0.006), (0.015, 0.02), (0.03, 0.1))),
    "wind sea and swell": Kind(
        _HEAVE,
        swell=((0.004, 0.004), (0.01, 0.015), (0.03, 0.06)),
        wind_sea=((0.003, 0.004), (0.01, 0.015), (0.03, 0.06)),
    ),
    "wind sea and swell, heave recorded": Kind(
        _HEAVE,
        swell=((0.004, 0.004), (0.01, 0.03), (0.05, 0.2)),
        wind_sea=((0.003, 0.004), (0.01, 0.03), (0.05, 0.2)),
        states_heave=True,
    ),
    "waves of 1 to 2 s": Kind(
        ".005 g rms at 1 s: -8.7 mGal", wind_sea=((6e-4, 6e-3), (2e-3, 0.018), (6e-3, 0.06)), wind_period=1.6
    ),
    "vibration at 3 Hz": Kind("3 Hz .01 g: -8 mGal", vibration=(0.001 * _G, 0.0035 * _G, 0.0125 * _G), rate=25.0),
    "vibration at 7 Hz": Kind(
        "7.3 Hz .02 g: -3.8 mGal", vibration=(0.003 * _G, 0.01 * _G, 0.04 * _G), vibration_frequency=7.3, rate=25.0
    ),
    "engine near 2 n": Kind("1e-3 g: +14 mGal", engine=(1e-5 * _G, 1e-4 * _G, 1e-3 * _G)),
    "engine at 2.2 Hz": Kind(".003 g: +4.9 mGal", engine=(5e-4 * _G, 1.5e-3 * _G, 5e-3 * _G), engine_frequency=2.2),
    "engine at 8 Hz": Kind(_GUESS, engine=(0.003 * _G, 0.01 * _G, 0.03 * _G), engine_frequency=8.0, rate=25.0),
    "turn of the ship": Kind("-g <psi^2>/2 while it lasts", turn=(0.3, 1.0, 3.0)),
    "change of speed": Kind("-g <psi^2>/2 while it lasts", speed_change=(1.0, 3.0, 8.0)),
    "gravity changing": Kind("change over the record, mGal", gravity_change=(2.0, 20.0, 100.0)),
    "gravity wave of 20 min": Kind("amplitude, mGal", gravity_wave=(2.0, 15.0, 50.0)),
    # pendulums
    "beats through zero": Kind(
        "least amplitude of the difference", amplitudes=((0.012, 0.011), (0.012, 0.0117), (0.012, 0.012)), split=1e-3
    ),
    "large arcs": Kind(_ARC, amplitudes=((0.025, 0.02), (0.05, 0.04), (0.1, 0.08))),
    "kicks of one pendulum": Kind(_KICKED, kicks=((1e-7, 0.0), (1e-6, 0.0), (1e-5, 0.0))),
    "kicks of both pendulums": Kind(_KICKED, kicks=((1e-7, 1e-7), (1e-6, 1e-6), (1e-5, 1e-5))),
    "knock of one pendulum": Kind("phase by 1/a of it", knocks=((1e-6, 0.0), (1e-5, 0.0), (1e-3, 0.0))),
    "knock of the frame": Kind("phase by 1/a of it", knocks=((1e-5, 1e-5), (1e-4, 1e-4), (3e-3, 3e-3))),
    "restart": Kind("change of the free swing", restart=(1e-3, 0.1, 1.0)),
    "damping not stated": Kind("1e-4 /s: 26 mGal", damping_difference=(1e-6, 1e-5, 1e-4), states_damping=False),
    "damping stated wrong": Kind("20 %: -.6 mGal at 1e-4", damping_error=(0.02, 0.2, 1.0)),
    "dampings that differ": Kind("1e-4 /s: 26 mGal", damping_difference=(1e-5, 5e-5, 2e-4)),
    "quadratic damping": Kind("31 mGal at 4 q n a/(3 pi) = gamma", quadratic=(3e-5, 3e-4, 3e-3)),
    "knife-edge damping": Kind("2 f/(pi n a) = gamma", friction=(1e-7, 3e-6, 3e-5)),
    "law not stated": Kind(_ARC, **_ARCS, states_law=False),
    "linear law not stated": Kind(_ARC, **_ARCS, states_law=False, linear=True),
    # reading
    "reading noise": Kind(_READING, noise=(1e-5, 1e-4, 5e-4)),
    "noise not stated": Kind(_READING, noise=(1e-6, 3e-5, 3e-4), states_noise=False),
    "short record": Kind(_READING, duration=(600.0, 300.0, 180.0)),
    "few samples a swing": Kind("10 to 4 Hz", rate=(10.0, 5.0, 4.0), swell=(0.015, 0.02), states_heave=True),
    "half-second marks": Kind(_READING, noise=(1e-6, 1e-5, 1e-4), rate=2.0),
    "second marks": Kind(_READING, noise=(1e-6, 1e-5, 1e-4), rate=1.0),
    "uneven times": Kind("of the interval, known", jitter=(0.05, 0.3, 0.9)),
    "samples lost": Kind("share", lost=(0.1, 0.3, 0.6), swell=(0.015, 0.02), states_heave=True),
    "one gap": Kind("s", gap=(30.0, 120.0, 300.0)),
    "one gap, heave not recorded": Kind("s", gap=(30.0, 120.0, 300.0), swell=(0.015, 0.03)),
    "ten gaps": Kind("s", gap=(5.0, 20.0, 60.0), gaps=10),
    "first trace lost": Kind("s", first_gap=(20.0, 60.0, 300.0)),
    "minutes lost": Kind("s of every two minutes", lost_of_two_minutes=(20.0, 60.0, 90.0)),
    "outliers": Kind("share, 3 mrad", outliers=(1e-3, 0.01, 0.05)),
    "bursts": Kind("number of 2 s, 3 mrad", bursts=(2, 8, 30)),
    "mixture": Kind("three of the kinds above at once"),
}
INSTRUMENT: dict[str, Kind] = {
    "zero of the first trace": Kind("-g b^2/2: 3 mrad -4.4 mGal", zero_first=(0.001, 0.003, 0.01)),
    "zero drift": Kind("4 mrad: -.25 mGal", zero_drift=(0.001, 0.004, 0.02)),
    "zero step of the first trace": Kind("as its zero", zero_step_first=(0.001, 0.004, 0.015)),
    "zero step of the difference": Kind(_GUESS, zero_step_difference=(1e-4, 1e-3, 5e-3)),
    "case tilts, recorded": Kind(".2 degrees: -2.9 mGal", tilt=(0.2, 1.0, 5.0)),
    "case tilts, acceleration recorded": Kind(
        ".2 degrees: -2.9 mGal", tilt=(0.2, 1.0, 5.0), states_tilt="acceleration"
    ),
    "gain of the first trace": Kind("1 % of the arc and split terms", gain_first=(0.001, 0.003, 0.01)),
    "scale of all angles": Kind("1 %: -2 mGal", gain_all=(0.001, 0.005, 0.03), states_scale=(0.001, 0.005, 0.03)),
    "delay between traces": Kind("10 ms: 6 to 9 mGal at 1e-4", delay=(3e-4, 1e-3, 0.01)),
    "clock step": Kind(".5 ms: .8 mGal", clock_step=(1e-4, 5e-3, 0.02)),
    "period ratio wrong": Kind("1e-6: -2 mGal", ratio_error=(1e-7, 1e-6, 5e-6)),
    "heave with bias": Kind("-b", heave_bias=(2.0, 20.0, 200.0), **_ROUGH),
    "heave with scale": Kind(
        "2 (s - 1) <z''^2>/(4 g)", heave_scale=(1.005, 1.05, 1.2), swell=(0.03, 0.15), states_heave=True
    ),
    "heave with delay": Kind(_GUESS, heave_delay=(0.03, 0.1, 0.3), swell=(0.03, 0.15), states_heave=True),
    "heave of wrong sign": Kind(
        ".015 g rms: +79 mGal", swell=((0.01, 0.01), (0.02, 0.05), (0.03, 0.15)), heave_scale=-1.0, states_heave=True
    ),
    "six zero steps": Kind("1 sigma of each, rad", zero_steps=(1e-4, 1e-3, 5e-3)),
    "cubic optics": Kind("3/4 of c a^2 is a gain; 4/3: tan(2 x)/2", cubic=(0.1, 4.0 / 3.0, 10.0)),
    "wow": Kind("s", wow=(1e-5, 1e-4, 1e-3)),
    "planes not parallel": Kind("10 mrad: .2 mGal", plane=(1e-3, 0.01, 0.05), resonant=1e-4, swell=(0.015, 0.0)),
    "planes that rock": Kind("-<y''^2>/(2 g)", rocking=(0.03, 0.1, 0.3)),
    "released within the record": Kind("s", released=(20.0, 60.0, 300.0)),
    "case follows the apparent vertical": Kind("g <p^2>/2", follows=(0.3, 0.9, 1.1)),
    "heave with gaps": Kind("share", heave_lost=(0.01, 0.1, 0.3), **_ROUGH),
    "quantisation": Kind("step, rad", quantisation=(1e-4, 1e-3, 5e-3)),
    "clipping": Kind("of the largest elongation", clip=(0.99, 0.9, 0.7)),
    "one of three dead": Kind("share of the record", dead=(0.03, 0.3, 1.0), pendulums=3),
    "traces identical": Kind("share of the record", copied=(0.03, 0.3, 1.0)),
}
KINDS = SEA | INSTRUMENT
_UNMIXED = ("mixture", "linear law not stated", "short record", "second marks", "engine at 8 Hz")
MIXABLE = tuple(name for name in SEA if name not in _UNMIXED)
"""What a mixture draws from, without an engine that noise hides; of two that set one quantity the later holds."""


def case_of(kind: str, strength: str, base: Case | None = None) -> Case:
    """The case of a kind at a strength; over another one if that is given."""
    entry, place = KINDS[kind], STRENGTHS.index(strength)
    varied = {name: values[place] for name, values in entry.varied.items()}
    return replace(base or Case(), **entry.common, **varied)
