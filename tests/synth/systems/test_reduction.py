"""The reduced beam in SI units: round trip, its limit, its refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_equations import slope

from data_schemas.errors import RefusedError
from synth.systems.reduced_beam import reduced
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.terms import harmonics, together
from synth.systems.yielding import ElasticBeam, stiffness_of_ratio

LENGTH = np.array([0.249, 0.2484])


def clocks(arc: float = 0.0138, **parts: Any) -> ElasticBeam:
    drive = VanDerPolDrive(np.full(2, 0.06), arc / LENGTH)
    beam = ElasticBeam(50.0, np.full(2, 0.25), LENGTH, 1.0, 0.25, 9.81, drive)
    return beam._replace(stiffness=stiffness_of_ratio(2.02, beam), **parts)


def test_reduced_beam_is_the_limit_of_the_full_one() -> None:
    """What (2) neglects falls with the square of the arc, but for lengths taken as one."""
    shares = np.array([1.4, 0.3, -0.7, 1.1])
    errors = []
    for arc in (0.0138, 0.00138):
        beam = clocks(arc)._replace(length=np.full(2, 0.249))
        beam = beam._replace(terms=VanDerPolDrive(np.full(2, 0.06), np.full(2, arc / 0.249)))
        made = reduced(beam)
        own = np.concatenate([[0.02 * arc**2, 0.01 * arc**2], shares])  # the beam answers the square of the arc
        full = slope(beam, own * made.units)
        small = slope(made.system, own) * made.time_scale
        errors.append(np.abs((full / made.units)[1::2] - small[1::2]) / np.abs(small[1::2]))
    assert errors[0].max() < 0.02
    np.testing.assert_allclose(errors[0][1:] / errors[1][1:], 100.0, rtol=0.05)
    assert errors[0][0] / errors[1][0] > 90.0


def test_constants_are_those_of_the_formula_sheet() -> None:
    made = reduced(clocks())
    assert made.time_scale == pytest.approx(2.02 * np.sqrt(9.81 / 0.249) / 2, rel=1e-14)
    fast, mean = 2 * made.time_scale, LENGTH.mean()
    system = made.system
    assert system.coupling == pytest.approx(0.25 * 0.0138**2 / (2 * mean * 50.5) / mean, rel=1e-14)
    assert (system.drive, system.beam_damping) == pytest.approx((2 * 0.06 / fast, 0.25 / fast), rel=1e-15)
    np.testing.assert_allclose(fast**2 * (1 + system.detuning), 4 * 9.81 / LENGTH, rtol=1e-14)
    state = np.array([1e-3, 0.2, 0.1, -0.3, 0.2, 0.4])
    np.testing.assert_allclose((state / made.units)[[2, 4]], state[[2, 4]] * LENGTH / 0.0138, rtol=1e-15)


DRIVE = clocks().terms


@pytest.mark.parametrize(
    ("parts", "word"),
    [
        ({"terms": None}, "van-der-pol"),
        ({"terms": together(DRIVE, Viscous(np.full(2, 0.1)))}, "van-der-pol"),
        ({"terms": DRIVE._replace(rate=np.array([0.06, 0.07]))}, "escapement rates"),
        ({"terms": DRIVE._replace(angle=np.array([0.05, 0.06]))}, "arcs"),
        ({"terms": DRIVE._replace(angle=np.array([0.05, 0.0]))}, "above zero"),
        ({"mass": np.array([0.25, 0.3])}, "masses"),
        ({"vertical": harmonics([1.0], [1.0], [0.0])}, "motion"),
        ({"horizontal": harmonics([1.0], [1.0], [0.0])}, "motion"),
    ],
)
def test_what_the_reduced_system_cannot_hold_is_refused(parts: dict[str, Any], word: str) -> None:
    with pytest.raises(RefusedError, match=word) as caught:
        reduced(clocks()._replace(**parts))
    assert "\n" not in str(caught.value)
    assert "'full'" in str(caught.value)


def test_equal_angles_on_nearly_equal_lengths_are_held() -> None:
    assert reduced(clocks()._replace(terms=DRIVE._replace(angle=np.full(2, 0.055)))).system.drive > 0
