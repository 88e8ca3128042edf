"""Which of the traces found anew is which of those lost: by amplitude, resting place and phase.

Through a blackout the paper may have run fast or slow, which shifts the phases of all traces alike, and the ship may
have moved the slow part. What the pendulums keep are their amplitudes and the phase between them.
"""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.tracking.section import Section

AMPLITUDE, PLACE, PHASE, COMMON = 0.06, 0.5, 0.25, 1.5  # 1 sigma: of the amplitude (twice), radians
AMBIGUOUS = 9.0  # how much worse the second best must be
WORST = 40.0
MOST_TRACES = 6


def match(section: Section, last: list[tuple[float, Floats]]) -> list[int] | None:
    """Trace number of each swing of the section, None if it cannot be told; -1 for a swing that is none of them."""
    found = section.swings
    if len(found) > MOST_TRACES or len(last) > MOST_TRACES:
        return None
    cost = []
    size = min(len(found), len(last))
    for chosen in permutations(range(len(found)), size):
        for names in combinations(range(len(last)), size):
            cost += [(_cost(section, chosen, names, last), chosen, names)]
    cost.sort(key=lambda each: each[0])
    if cost[0][0] > WORST * size or (len(cost) > 1 and cost[1][0] - cost[0][0] < AMBIGUOUS):
        return None
    result = [-1] * len(found)
    for place, name in zip(cost[0][1], cost[0][2], strict=True):
        result[place] = name
    return result


def _cost(
    section: Section,
    chosen: tuple[int, ...],
    names: tuple[int, ...],
    last: list[tuple[float, Floats]],
) -> float:
    total, phases = 0.0, []
    for place, name in zip(chosen, names, strict=True):
        swing = section.swings[place]
        row, state = last[name]
        amplitude = float(np.hypot(state[3], state[4]))
        total += (np.log(swing.amplitude / amplitude) / AMPLITUDE) ** 2
        total += ((swing.state[0] - state[0]) / (PLACE * amplitude)) ** 2
        then = np.arctan2(state[4], state[3]) + state[5] * (swing.row - row)
        phases.append(np.arctan2(swing.state[4], swing.state[3]) - then)
    turned = np.exp(1j * np.array(phases))
    common = float(np.angle(turned.mean()))
    apart = np.angle(turned * np.exp(-1j * common))
    return float(total + np.sum((apart / PHASE) ** 2) + (common / COMMON) ** 2)
