"""Where a pendulum starts that is to swing freely on top of the forced solution."""

from __future__ import annotations

import numpy as np

from synth.pendulums.linear import Response
from synth.phase import Floats


def start_state(response: Response, angular_frequency: Floats) -> Floats:
    """Angle and angular velocity at t = 0 of a linear pendulum: its free harmonic on top of the steady motion psi.

    A pendulum released at rest would carry a mean mode of its own (physics sheet, 1.2); a nonlinear pendulum that is to
    start on the forced solution starts from here.

    Parameters
    ----------
    response
        As `pendulums.linear.respond` gives it.
    angular_frequency : (harmonics,)
        Of the motion that it answers, rad/s.

    Returns
    -------
    (2,) float64
        rad, rad/s
    """
    own = complex(-response.damping_rate, float(response.damped_frequency))
    slow = np.array([np.sum(response.forced), np.sum(1j * angular_frequency * response.forced)])
    free = np.array([response.start, own * response.start + np.sum(response.gain)])
    state: Floats = (slow + free).real
    return state
