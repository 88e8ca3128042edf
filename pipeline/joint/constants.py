"""The unknown constants beside the path: what each is, its prior, and the small solve that they share."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.joint import kinds
from pipeline.joint.passes import Columns


@dataclass(frozen=True)
class Constant:
    """One unknown constant."""

    name: str  # For reports, as "zero of trace 1"
    kind: int  # Of `pipeline.joint.filtering`.
    prior: float  # 1 sigma about `mean`, in the constant's own unit
    index: int = -1  # Pendulum, trace or state it belongs to; -1: all pendulums
    mean: float = 0.0  # Of the prior
    value: float = 0.0  # The latest
    centre: float = 0.0
    width: float = 0.0  # s; see `passes.Columns`.
    stated: bool = False  # Whether the record states its uncertainty: the prior is then not to be doubted


Constants = tuple[Constant, ...]


def columns(constants: Constants) -> Columns:
    """What the kernels take."""
    kind = np.array([each.kind for each in constants], dtype=np.int64)
    return Columns(
        kind,
        np.array([each.index for each in constants], dtype=np.int64),
        np.array([each.centre for each in constants], dtype=np.float64),
        np.array([each.width for each in constants], dtype=np.float64),
        np.array([each.value for each in constants], dtype=np.float64),
        np.flatnonzero((kind > kinds.START) & (kind < kinds.ZERO)),
        np.flatnonzero(kind >= kinds.ZERO),
    )


def spline(times: Floats, knot: Constant) -> Floats:
    """What a knot of a course adds at times: a cubic B-spline, twice as wide on either side as knots lie apart."""
    away = np.abs(times - knot.centre) / knot.width
    return np.asarray((np.maximum(0.0, 2.0 - away) ** 3 - 4.0 * np.maximum(0.0, 1.0 - away) ** 3) / 6.0)


def is_mode(constant: Constant) -> bool:
    """Whether a constant is the size of a time error's cosine."""
    return constant.kind == kinds.CLOCK and constant.width > 0.0


def total(constants: Constants, kind: int, size: int) -> Floats:
    """Sum of the values of one kind by what they belong to, (size,); -1 counts for all."""
    out = np.zeros(size)
    for each in constants:
        if each.kind == kind and each.width == 0.0:
            out[slice(None) if each.index < 0 else each.index] += each.value
    return out


@dataclass(frozen=True)
class Solution:
    """Posterior of the constants."""

    constants: Constants  # With the new values
    step: Floats  # (c,) change from the values before
    covariance: Floats  # (c, c)
    log_likelihood: float  # Marginal, of the readings

    def sigma(self, name: str) -> float:
        """1 sigma of a constant."""
        at = [each.name for each in self.constants].index(name)
        return float(np.sqrt(self.covariance[at, at]))


def solve(
    constants: Constants, normal: Floats, log_deviations: float, count: float, root: Floats | None = None
) -> Solution:
    """Least squares of the prediction errors and the priors, whose covariance has the `root`, (c, c), if not
    independent; `normal`: (c + 1, c + 1) products of derivatives and errors, the errors last; `log_deviations`: sum
    over `count` readings."""
    if root is None:
        root = np.diag([each.prior for each in constants])
    off = np.linalg.solve(root, np.array([each.value - each.mean for each in constants]))
    factor = np.linalg.cholesky(root.T @ normal[:-1, :-1] @ root + np.eye(off.size))  # in units of the priors
    whitened = np.linalg.solve(factor, -(root.T @ normal[:-1, -1] + off))
    squares = float(normal[-1, -1] + off @ off - whitened @ whitened)
    moved = root @ np.linalg.solve(factor.T, whitened)
    spread = np.linalg.solve(factor, root.T)
    values = tuple(replace(c, value=c.value + by) for c, by in zip(constants, moved.tolist(), strict=True))
    likelihood = -log_deviations - 0.5 * squares - np.log(np.diag(factor)).sum() - 0.5 * count * np.log(2.0 * np.pi)
    return Solution(values, moved, spread.T @ spread, float(likelihood))


def starts(pendulums: int, frequency: Floats, value: Floats | None = None, arc: float = 0.5) -> Constants:
    """Angle and speed of each pendulum at the first node, within some arc, rad."""
    out = []
    for i in range(pendulums):
        for q, scale in ((0, 1.0), (1, float(frequency[i]))):
            at = 2 * i + q
            out.append(Constant(f"start {at}", kinds.START, arc * scale, at, value=0.0 if value is None else value[at]))
    return tuple(out)
