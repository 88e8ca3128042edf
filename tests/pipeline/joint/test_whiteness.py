"""The ship by the errors' spectrum: what a wrong start loses comes back; motion too fast to be followed is in sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from test_method import GRAVITY, in_sigmas, record, row

from pipeline.joint import choice, course, lattice, motion
from pipeline.joint.explanation import Fitted, fitted, grown, shifted
from pipeline.joint.gather import Gathered, gather
from pipeline.joint.ship import Component, Engine, Sea
from pipeline.joint.start import cold_starts, first_fits
from pipeline.joint.unfollowed import unresolved
from pipeline.joint.whiteness import Spectrum, errors_by_frequency

pytestmark = pytest.mark.compiled

SEAS = [
    {"kind": "harmonics", "amplitude": [0.05, 0.04, 0.03], "period": [9.0, 7.7, 6.1]},
    {"kind": "harmonics", "axis": "vertical", "amplitude": [0.05], "period": [8.0]},
]


@pytest.fixture(scope="module")
def gathered() -> Gathered:
    return gather(record(motion=SEAS)[0])


@pytest.fixture(scope="module")
def settled(gathered: Gathered) -> Fitted:
    return first_fits(gathered)[0]


def with_ship(found: Fitted, ship: tuple[Component, ...]) -> Fitted:
    return fitted(replace(found.model, assumed=replace(found.model.assumed, ship=ship)), grown(found.path, 2, ship))


def with_swell(ship: tuple[Component, ...], factor: float) -> tuple[Component, ...]:
    """With the largest component larger by a factor."""
    largest = max(ship, key=lambda each: each.rms)
    return tuple(replace(each, rms=factor * each.rms) if each is largest else each for each in ship)


def test_errors_of_the_true_model_are_white(settled: Fitted) -> None:
    for trace in range(2):
        _, power = errors_by_frequency(settled, trace)
        assert power.size > 1000
        assert np.mean(power[power.size // 2 :]) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("recorded", "lost", "rate"), [(False, 0.0, 10), (True, 0.0, 10), (False, 0.05, 25)])
def test_steps_of_the_lattice_change_neither_likelihood_nor_sigma(
    monkeypatch: pytest.MonkeyPatch, *, recorded: bool, lost: float, rate: int
) -> None:
    """What drives the ship within a step acts in it: a sawtooth would have power at zero frequency, as gravity has."""
    made, _ = record(motion=SEAS, duration=900.0, recording={"sampling_rate": rate, "vertical_acceleration": recorded})
    values = made["record"]["elongation"].values
    values[np.random.default_rng(6).random(values.shape) < lost] = np.nan
    found = first_fits(gather(made))[0]
    if not recorded:
        level = [each for each in found.model.assumed.ship if each.axis == "horizontal"]
        found = with_ship(found, (*level, *(Sea(w, 0.4, 0.01, "vertical") for w in (0.9, 1.6))))
    fits, nodes = [], found.model.problem.lattice
    before = nodes.start + nodes.step * np.arange(nodes.nodes)
    for angle, step in ((0.32, 0.05 if rate == 10 else 0.04), (1.27, 0.2)):
        monkeypatch.setattr(lattice, "MOST_ANGLE", angle)
        problem = gather(made).problem
        assert problem.lattice.step == pytest.approx(step)
        after = problem.lattice.start + step * np.arange(problem.lattice.nodes)
        path = CubicSpline(before, found.path)(after).astype(np.float32)
        model = replace(found.model, problem=problem, constants=shifted(found.about, path, 0))
        fits.append(fitted(model, path, smooth=True))
    fine, coarse = (course.mean_gravity(each.solution, 900.0)[1] for each in fits)
    assert coarse == pytest.approx(fine, rel=0.015)  # 1.0 % at five readings of a trace a node
    apart = fits[0].solution.log_likelihood - fits[1].solution.log_likelihood
    assert abs(apart) < 5e-4 * fits[0].of.totals[1]


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_ship_assumed_wrong_comes_back(settled: Fitted, factor: float) -> None:
    off = with_ship(settled, with_swell(settled.model.assumed.ship, factor))
    lost = settled.solution.log_likelihood - off.solution.log_likelihood
    assert lost > 10.0
    back = motion.reshaped(off)
    assert back.solution.log_likelihood > settled.solution.log_likelihood - 0.1 * lost - 3.0


def test_what_is_foretold_of_a_ship_is_what_the_record_says(settled: Fitted) -> None:
    other = with_swell(settled.model.assumed.ship, 0.7)
    lost = settled.solution.log_likelihood - with_ship(settled, other).solution.log_likelihood
    foretold = -Spectrum.of(settled).gain(replace(settled.model.assumed, ship=other))
    assert foretold == pytest.approx(lost, rel=0.3, abs=3.0)


BOTH = [{"name": label, "combination": {label: 1.0}} for label in "12"]


@pytest.mark.parametrize(
    ("height", "cutoff", "seed", "most"),
    [(0.35, 2.0, 5, 0.15), pytest.param(0.25, 3.0, 4, 0.5, marks=pytest.mark.campaign)],
)
def test_two_traces_of_the_ship_tell_it_as_one_does(height: float, cutoff: float, seed: int, most: float) -> None:
    """Each trace alone shows a half of what the filter makes of their common motion. A sea that one component does not
    follow is no tilting case: 19 +- 11 mGal where a tilt need not meet what no motion there is at the swing."""
    first = {"label": "1", "period": 1.01, "damping_rate": 8e-5}
    second = {"label": "2", "period": 1.0102, "damping_rate": 1e-4}
    starts = ({"kind": "free", "amplitude": arc, "phase": phase} for arc, phase in ((0.0157, 0.4), (0.0343, 2.2)))
    pendulums = [each | {"start": start} for each, start in zip((first, second), starts, strict=True)]
    sea = {"kind": "sea", "significant_height": height, "peak_period": 7.2, "cutoff": cutoff}
    orbits = [sea | {"axis": axis} for axis in ("horizontal", "vertical")]
    reading = {"traces": BOTH, "noise": 5e-5, "vertical_acceleration": False}
    made, gravity = record(seed=seed, duration=1200.0, pendulums=pendulums, motion=orbits, recording=reading)
    found = row(made)
    assert found["gravity_sigma_mgal"] < most
    assert abs(in_sigmas(found, gravity)) < 3.5


def test_motion_at_the_swing_is_no_larger_than_the_record_shows() -> None:
    """Pendulums 7 % apart: what the ship might do at their frequencies would hide gravity a hundred times over."""
    second = {"label": "2", "period": 1.08, "damping_rate": 1e-4}
    first = {"label": "1", "period": 1.01, "damping_rate": 1e-4}
    starts = ({"kind": "free", "amplitude": 0.012, "phase": phase} for phase in (0.4, 2.2))
    pendulums = [each | {"start": start} for each, start in zip((first, second), starts, strict=True)]
    narrow = [{"kind": "harmonics", "amplitude": [0.07, 0.05, 0.05], "period": [13.0, 13.3, 12.8]}]
    made, gravity = record(motion=narrow, duration=800.0, pendulums=pendulums, recording={"noise": 3e-5})
    found = row(made)
    assert found["gravity_sigma_mgal"] < 0.1
    assert abs(in_sigmas(found, gravity)) < 3.5


def test_first_ship_of_a_rough_fit_is_nearly_the_last(gathered: Gathered, settled: Fitted) -> None:
    """The likelihood of the first guess lies closer to the last than to that of the generous ship it began with."""
    rough = cold_starts(gathered, sine=True)[0]
    sought = np.append(np.full(2, np.nan), settled.model.assumed.noise[-2:])
    found = motion.first(rough, sought)
    assert found.noise[:2] == pytest.approx(settled.model.assumed.noise[:2], rel=0.3)
    ships = (found.ship, rough.model.assumed.ship)
    values = [with_ship(settled, ship).solution.log_likelihood for ship in ships]
    best = settled.solution.log_likelihood
    assert best - values[0] < 0.2 * (best - values[1])


def test_outliers_change_no_spectrum(settled: Fitted) -> None:
    errors = settled.of.whitened.copy()
    errors[::97] = 300.0
    spoiled = replace(settled, of=settled.of._replace(whitened=errors))
    clean, dirty = (errors_by_frequency(each, 0)[1] for each in (settled, spoiled))
    assert np.mean(dirty) == pytest.approx(np.mean(clean), rel=0.5)


def test_a_line_is_found_to_its_own_width(gathered: Gathered, settled: Fitted) -> None:
    """A start some widths off ends on the line, whose frequency a step of a hundredth would jump over."""
    line = Engine(20.0, 0.004, 3e-3)
    assumed = replace(settled.model.assumed, ship=(*settled.model.assumed.ship, line))
    shown = Spectrum.of(with_ship(settled, assumed.ship))
    there = replace(shown, power=np.ones_like(shown.power))
    off = replace(assumed, ship=(*assumed.ship[:-1], replace(line, frequency=20.03)))
    found, gain = there.likeliest(off, last=True)
    assert found.ship[-1].peak == pytest.approx(20.0, abs=0.001)
    assert gain == pytest.approx(0.0, abs=1.0)


@pytest.fixture(scope="module")
def unrecorded() -> Fitted:
    return first_fits(gather(record(motion=SEAS, recording={"vertical_acceleration": False})[0]))[0]


def hidden(of: Fitted, component: Component, noise: float) -> tuple[float, float]:
    """What motion does under a reading noise, rad."""
    assumed = replace(of.model.assumed, ship=(component,), noise=np.full(of.model.assumed.noise.size, noise))
    return unresolved(of, assumed)


def test_slow_motion_unseen_slows_by_a_quarter_of_its_square(unrecorded: Fitted) -> None:
    more, doubt = hidden(unrecorded, Sea(0.3, 0.05, 1e-3, "vertical"), 1e3)
    assert more == pytest.approx(0.25e-6, rel=0.02)
    assert 0.5 * more < doubt < more


def test_fast_motion_unseen_stiffens_by_its_mean_square(unrecorded: Fitted) -> None:
    """Kapitza's pendulum: by the square of the swing's frequency over the motion's."""
    line = Engine(50.0, 0.05, 1e-3, "vertical")
    more, doubt = hidden(unrecorded, line, 1e3)
    stiffened = float(unrecorded.model.problem.kappa.mean()) * (line.rms / line.peak) ** 2
    assert more == pytest.approx(-stiffened, rel=0.1)
    assert doubt > 0.5 * stiffened


def test_motion_that_is_followed_changes_nothing(unrecorded: Fitted) -> None:
    swell = Sea(0.8, 0.1, 1e-2, "vertical")
    more, doubt = hidden(unrecorded, swell, 1e-9)
    assert max(abs(more), doubt) < 1e-4 * 0.25 * swell.rms**2
    assert hidden(unrecorded, replace(swell, axis="horizontal"), 1e3) == (0.0, 0.0)


def test_a_line_too_fast_for_the_nodes_asks_for_more_of_them() -> None:
    """An engine of 8 Hz on two readings a node: it shows in the errors alone."""
    seas = [SEAS[0], {"kind": "harmonics", "axis": "vertical", "amplitude": [0.06], "period": [0.125]}]
    made, gravity = record(motion=seas, recording={"sampling_rate": 25, "noise": 1e-5, "vertical_acceleration": False})
    laid = gather(made)
    assert not laid.problem.lattice.dense
    with pytest.raises(motion.UnresolvedError):
        choice.settle(first_fits(laid)[0])
    assert laid.denser().problem.lattice.dense
    assert abs(in_sigmas(row(made), gravity)) < 3.5


def test_a_line_below_the_noise_shows_by_its_phases() -> None:
    """.003 g at 8 Hz, .07 mGal: each of its sidebands is as high as chance makes the highest of all ordinates."""
    seas = [SEAS[0], {"kind": "harmonics", "axis": "vertical", "amplitude": [0.03], "period": [0.125]}]
    reading = {"sampling_rate": 25, "noise": 1e-5, "vertical_acceleration": False}
    made, gravity = record(motion=seas, duration=1500.0, recording=reading)
    found = row(made)
    assert "vertical motion at 8.00 Hz" in found["choice_reason"]
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 0.1


@pytest.mark.parametrize("scale", [3e-4, 3e-3, 1e-2])
def test_knife_edges_that_fade_at_any_speed_leave_gravity(scale: float) -> None:
    dry = {"knife_edge": {"friction": 2e-5, "rate": scale}}
    made, gravity = record(motion=SEAS, pendulum=dry, duration=600.0)
    found = row(made)
    assert gravity == pytest.approx(GRAVITY)
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert "knife-edge friction" in found["choice_reason"]
