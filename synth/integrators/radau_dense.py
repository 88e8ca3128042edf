"""The collocation polynomial of a step: Newton's form on the nodes 1 = c_s, ..., c_1, 0.

Inside the step it is the dense output, beyond it the first guess of the next step.
"""

from __future__ import annotations

from typing import Any

from synth.integrators.radau_tables import Tableau
from synth.kernels.compiled import kernel


@kernel
def differences(count: Any, size: Any, tableau: Tableau, increments: Any, out: Any) -> None:
    """Divided differences (s + 1, n) of the increments (s, n); the increment at 0 is zero."""
    s = len(count)
    for c in range(len(size)):
        for i in range(s):
            out[i, c] = increments[s - 1 - i, c]
        out[s, c] = 0.0
    for level in range(1, s + 1):
        for i in range(s, level - 1, -1):
            for c in range(len(size)):
                out[i, c] = (out[i, c] - out[i - 1, c]) * tableau.reciprocals[i, i - level]


@kernel
def evaluate(at: float, size: Any, tableau: Tableau, polynomial: Any, out: Any) -> None:
    """Increment `out` (n,) at the share `at` of the step."""
    s = tableau.nodes.size
    for c in range(len(size)):
        out[c] = polynomial[s, c]
    for i in range(s - 1, -1, -1):
        away = at - tableau.nodes[s - 1 - i]
        for c in range(len(size)):
            out[c] = out[c] * away + polynomial[i, c]
