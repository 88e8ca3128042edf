"""The collocation polynomial of a step: Newton's form on the nodes 1 = c_s, ..., c_1, 0.

Inside the step it is the dense output, of order s, or the first guess where a part of the step is solved for by itself;
beyond it the first guess of the next step.
"""

from __future__ import annotations

from typing import Any

from synth.integrators.radau_newton import SOLVED, Work, collocate_any, prepare_any
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel, summing_kernel

_N3, _N5, _N7 = THREE.nodes, FIVE.nodes, SEVEN.nodes
_R3, _R5, _R7 = THREE.reciprocals, FIVE.reciprocals, SEVEN.reciprocals


@summing_kernel
def differences(s: int, size: Any, increments: Any, out: Any) -> None:
    """Divided differences (s + 1, n) of the increments (s, n); the increment at 0 is zero."""
    n = len(size)
    reciprocals = _R3 if s == 3 else _R5 if s == 5 else _R7
    for c in range(n):
        for i in range(s):
            out[i * n + c] = increments[(s - 1 - i) * n + c]
        out[s * n + c] = 0.0
    for level in range(1, s + 1):
        for i in range(s, level - 1, -1):
            for c in range(n):
                out[i * n + c] = (out[i * n + c] - out[(i - 1) * n + c]) * reciprocals[i, i - level]


@summing_kernel
def evaluate(at: float, s: int, size: Any, polynomial: Any, out: Any, row: int) -> None:
    """Increments at the share `at` of the step, into a row of `out` (rows, n)."""
    n = len(size)
    nodes = _N3 if s == 3 else _N5 if s == 5 else _N7
    for c in range(n):
        total = polynomial[s * n + c]
        for i in range(s - 1, -1, -1):
            total = total * (at - nodes[s - 1 - i]) + polynomial[i * n + c]
        out[row * n + c] = total


@summing_kernel
def extrapolate(s: int, old: int, begin: float, ratio: float, size: Any, polynomial: Any, z: Any, base: Any) -> None:
    """Increments (s, n) of a step that starts at the share `begin` of one of `old` stages and is `ratio` as long."""
    n = len(size)
    nodes = _N3 if s == 3 else _N5 if s == 5 else _N7
    evaluate(begin, old, size, polynomial, base, 0)
    for i in range(s):
        evaluate(begin + ratio * nodes[i], old, size, polynomial, z, i)
        for c in range(n):
            z[i * n + c] -= base[c]


@kernel
def guess(s: int, old: int, begin: float, ratio: float, size: Any, polynomial: Any, z: Any, point: Any) -> None:
    """First guess of a step from the polynomial of another one of `old` stages (0: none).

    It starts at the share `begin` of that one, and is `ratio` times as long.
    """
    if old == 0:
        for i in range(s * len(size)):
            z[i] = 0.0
    else:
        extrapolate(s, old, begin, ratio, size, polynomial, z, point)


@kernel
def part_step(
    s: int, time: float, part: float, share: float, state: Any, scale: Any, goal: float, jacobian: Any, size: Any,
    polynomial: Any, work: Work, system: Any,
) -> int:  # fmt: skip
    """Solve the first `share` of a step by itself: increments in `work.point`, with the order of the end of a step.

    Returns the corrections made, or 0 where it could not be solved; `work.point` then holds nothing of use.
    """
    if not prepare_any(s, part, jacobian, size, work):
        return 0
    guess(s, s, 0.0, share, size, polynomial, work.z, work.point)
    outcome, turns, _ = collocate_any(s, time, part, state, scale, goal, size, work, system)
    for c in range(len(size)):
        work.point[c] = work.z[(s - 1) * len(size) + c]
    return turns if outcome == SOLVED else 0
