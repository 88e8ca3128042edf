"""The Cramer-Rao bound of a scene, in mGal of gravity."""

from __future__ import annotations

import numpy as np

from data_schemas.scene import Scene
from data_schemas.scene_recording import Recording
from pipeline.benchmarks.fisher import Pair, bound
from pipeline.gravity import MGAL
from synth import simulate

FINEST = 25.0  # Hz; the trapezoidal sum of the bound wants twenty samples a swing


def gravity_bound(scene: Scene) -> float:
    """Least standard deviation of gravity from a scene's record without gaps, mGal.

    Parameters
    ----------
    scene : Scene
        Two pendulums whose first and whose difference are read with the same white noise at even times.
    """
    noise = scene.recording.noise
    step = float(scene.recording.step)
    every = max(1, round(FINEST * step))
    fine = scene.model_copy(update={"recording": Recording.model_validate({"sampling_rate": every / step})})
    known = simulate(fine)[1]["truth"].dataset
    theta = np.asarray(known["theta"].values)
    n1, n2 = (float(each) for each in known["frequency"].values)
    gamma1, gamma2 = (float(each) for each in known["damping_rate"].values)
    pair = Pair(n2, n1 / n2, gamma2, gamma1 - gamma2, _swing(theta[0] - theta[1], n2, step / every))
    sigma = bound(
        pair,
        theta[0],
        step / every,
        noise,
        noise,
        every=every,
        damping_known=scene.recording.write_damping,
    )
    return 2.0 * scene.gravity * sigma / n2 / MGAL


def _swing(difference: np.ndarray, frequency: float, step: float) -> complex:
    """A - iB of the difference at t = 0, by least squares over two swings: the bound needs it to a per cent."""
    time = np.arange(int(4.0 * np.pi / frequency / step)) * step
    basis = np.stack([np.cos(frequency * time), np.sin(frequency * time)], axis=-1)
    a, b = np.linalg.lstsq(basis, difference[: time.size], rcond=None)[0]
    return complex(a, -b)
