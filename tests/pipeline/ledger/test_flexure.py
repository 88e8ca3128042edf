"""A support that sways under the pendulums: each alone is slower, their difference is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from ledger_records import entry, row, scene, with_stated

import synth

G, REFERENCE = 9.8054321, 9.81
PERIODS = np.array([1.0097648 / 1.0001, 1.0097648])
MASS = np.array([1.0, 1.3])  # kg


def swaying(stiffness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, both angles, and lengths, by the normal modes of two linear pendulums on a massless spring.

    `theta_i'' + (g/l_i) theta_i = -x''/l_i`, `K x = g sum m_j theta_j`.
    """
    length = REFERENCE * (PERIODS / (2 * np.pi)) ** 2
    inertia = np.eye(2) + G / stiffness * MASS[None, :] / length[:, None]
    values, vectors = np.linalg.eig(np.linalg.solve(inertia, np.diag(G / length)))
    start = np.linalg.solve(vectors.astype(complex), np.array([0.012, 0.008 * np.exp(1.1j)]))
    time = np.arange(3000) * 0.1
    angles = (vectors @ (start[:, None] * np.exp(1j * np.sqrt(values)[:, None] * time))).real
    return time, angles, length


def recorded(angles: np.ndarray) -> xr.DataTree:
    record, _ = synth.simulate(scene(duration=300.0))
    record["record"]["elongation"].values[:] = [angles[0], angles[0] - angles[1]]
    return record


def test_the_difference_sheds_the_sway_and_each_pendulum_does_not() -> None:
    stiffness = 1e6  # N/m: tens of milligals for either pendulum alone
    _, angles, length = swaying(stiffness)
    record = with_stated(recorded(angles), {"support_stiffness": stiffness, "mass": MASS, "length": length})
    found = row(record)
    # adding the formula of a single pendulum would be wrong by the sizes below
    assert (found["gravity_m_s2"] - G) * 1e5 == pytest.approx(0.0, abs=1e-3)
    listed = entry(found, "flexure")
    assert listed["applied"]
    assert listed["value_mgal"] == 0.0
    alone = sizes(listed)
    for pendulum in (0, 1):
        assert alone[pendulum] == pytest.approx(missing(angles[pendulum], PERIODS[pendulum]), rel=0.03)
        assert alone[pendulum] > 20.0


@pytest.mark.compiled
def test_a_frame_with_mass_and_resistance_sways_and_is_shed() -> None:
    """Real pendulums on a frame of 50 kg and 1e6 N/m, by the simulator's own equations of the yielding frame."""
    frame = {"kind": "frame", "mass": 50.0, "stiffness": 1e6, "resistance": 50.0}
    masses = {"first": {"mass": MASS[0]}, "second": {"mass": MASS[1]}}
    recording = {"sampling_rate": 10, "vertical_acceleration": True}
    made = scene(motion=[], restoring="sine", duration=600.0, support=frame, recording=recording, **masses)
    record, truth = (tree.isel(time=slice(600, None)) for tree in synth.simulate(made))  # the frame has rung out
    length = REFERENCE * (PERIODS / (2 * np.pi)) ** 2
    found = row(with_stated(record, {"support_stiffness": 1e6, "mass": MASS, "length": length}), "shooting")
    assert (found["gravity_m_s2"] - G) * 1e5 == pytest.approx(0.0, abs=1e-4)
    alone = sizes(entry(found, "flexure"))
    for pendulum in (0, 1):
        angle = truth["truth"]["theta"].values[pendulum]
        arc = G * 2.0 * np.mean(angle**2) / 8.0 * 1e5
        # the formula knows neither the frame's mass nor that the swings exchange energy
        assert alone[pendulum] == pytest.approx(missing(angle, PERIODS[pendulum]) - arc, rel=0.03)


def test_antiphase_pendulums_leave_the_support_at_rest() -> None:
    """Equal pendulums in antiphase: e = (m g/2Kl)(1 + (A2/A1) cos pi) = 0."""
    record, _ = synth.simulate(
        scene(
            motion=[],
            eps=1e-6,
            first={"start": START | {"phase": 0.4}},
            second={"start": START | {"phase": 0.4 + np.pi}},
        )
    )
    stated = {"support_stiffness": 1e5, "mass": [1.0, 1.0], "length": [0.2534, 0.2534]}
    assert max(abs(size) for size in sizes(entry(row(with_stated(record, stated)), "flexure"))) < 0.5
    together, _ = synth.simulate(
        scene(motion=[], eps=1e-6, first={"start": START}, second={"start": START | {"phase": 0.5}})
    )
    assert min(sizes(entry(row(with_stated(together, stated)), "flexure"))) > 700.0


START: dict[str, Any] = {"kind": "free", "amplitude": 0.01, "phase": 0.0}


def sizes(listed: dict[str, Any]) -> list[float]:
    """What the reason says that either pendulum alone would need, mGal."""
    words = listed["reason"].replace(",", "").split()
    return [float(word) for word in words if word.startswith(("+", "-"))]


def missing(angle: np.ndarray, period: float) -> float:
    """What a single pendulum's mean frequency lacks of the true gravity, mGal, by zero crossings."""
    rising = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    at = rising + angle[rising] / (angle[rising] - angle[rising + 1])
    count = np.arange(at.size)
    slope = np.polyfit(count, 0.1 * at, 1)[0]
    return float((G - REFERENCE * (period / slope) ** 2) * 1e5)
