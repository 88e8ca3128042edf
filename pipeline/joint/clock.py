"""Errors of a film's times that last: what the noise of its time marks leaves open of the paper's motion.

White noise of the marks passes to the times at low frequencies as it is, up to where the paper moves smoothly. That of
the clock's mean rate is the ledger's; what varies within the record is cosines here, whose variance is that noise's.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.joint import kinds
from pipeline.joint.constants import Constant, Constants, is_mode, log_likelihood
from pipeline.joint.course import prior_root
from pipeline.joint.explanation import Fitted, fitted

FIRST, MOST = 2, 32  # half turns of a cosine in the record: one is the mean rate's; slow ones move gravity most
SIZES = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the stated uncertainty, as the likelihood finds it
CORNERS = (0.2, 0.5, 5.0)  # of the highest frequency, from which the paper's smooth motion leaves less


def with_clock(fit: Fitted) -> Fitted:
    """The fit with the errors of a film's times as unknowns; itself where the record states none."""
    model, problem = fit.model, fit.model.problem
    duration, spectrum = problem.lattice.duration, problem.time_noise**2
    if not spectrum:
        return fit
    highest = min(MOST, int(duration * problem.time_doubt**2 / spectrum))
    half_turns = range(FIRST, highest)
    if not half_turns:
        return fit
    prior = float(np.sqrt(2.0 * spectrum / duration))
    modes = [Constant(f"time error {m}", kinds.CLOCK, prior, width=m * np.pi / duration) for m in half_turns]
    whole = (*model.constants, *modes)
    _, of = problem.run(model.assumed, whole, about=fit.path, root=prior_root(whole, model.course))

    def likelihood(constants: Constants) -> float:
        root = prior_root(constants, model.course)
        return log_likelihood(constants, of.normal, float(of.totals[0]), float(of.totals[1]), root)

    tried = [_weighed(whole, size, part * highest * np.pi / duration) for size, part in product(SIZES, CORNERS)]
    return fitted(replace(model, constants=max(tried, key=likelihood)), fit.path)


def _weighed(constants: Constants, size: float, corner: float) -> Constants:
    """Time errors by so much larger beforehand, and smaller above a corner, rad s-1."""
    return tuple(
        replace(each, prior=size * each.prior / (1.0 + (each.width / corner) ** 2)) if is_mode(each) else each
        for each in constants
    )
