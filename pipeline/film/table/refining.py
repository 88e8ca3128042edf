"""Gravity of a record that changes while a person looks on: told at once from the last reduction, then reduced anew."""

from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any

import numpy as np
from pebble import ProcessExpired, ProcessFuture, ProcessPool
from xarray import DataTree

from data_schemas.errors import IsochronyError
from pipeline.joint import choice
from pipeline.joint.course import mean_gravity
from pipeline.joint.explanation import fitted
from pipeline.joint.gather import gather
from pipeline.joint.problem import Problem
from pipeline.joint.reduction import Joint, reduce_jointly


@dataclass(frozen=True)
class Gravity:
    """What is known of gravity and its 1 sigma, named as the page takes them; None where it is not, and why."""

    value_m_s2: float | None = None
    sigma_mgal: float | None = None
    method: str = ""
    refused: str | None = None


def going_on(record: DataTree, last: Joint | None) -> Gravity:
    """Gravity by an earlier reduction, refitted, its additions kept; none where the record reaches over other times."""
    if last is None or last.reduction.gravity is None:
        return Gravity()
    old = last.outcome.fit
    try:
        problems = (gather(record, calm=calm).problem for calm in (True, False))
        problem = next((each for each in problems if _grid(each) == _grid(old.model.problem)), None)
        if problem is None:
            return Gravity()
        fit = fitted(replace(old.model, problem=problem), old.path, most=1)
    except (IsochronyError, np.linalg.LinAlgError):
        return Gravity()
    duration = problem.lattice.duration
    (value, sigma), (was, spread) = mean_gravity(fit.solution, duration), mean_gravity(old.solution, duration)
    more = max(last.outcome.sigma**2 - spread**2, 0.0)
    own = float(np.sqrt(sigma**2 + more)) * max(choice.unexplained(fit), last.outcome.spread)
    ratio, total = 1.0 + (value - was) / last.outcome.mean, last.reduction.gravity
    whole = total.sigma * max(1.0, own / (last.outcome.sigma * last.outcome.spread))
    return Gravity(total.gravity * ratio, whole, "joint, gone on with from the last reduction")


def _grid(problem: Problem) -> tuple[int, float, float]:
    lattice = problem.lattice
    return lattice.nodes, lattice.start, lattice.step


class Refining:
    """The whole reduction of a record, in a process of its own, which Ctrl-C leaves to the server."""

    def __init__(self) -> None:
        self.last: Joint | None = None
        self._pool = ProcessPool(1, context=get_context("spawn"))
        self._reduction: ProcessFuture | None = None

    @property
    def busy(self) -> bool:
        """Whether a reduction is under way."""
        return self._reduction is not None

    def begin(self, record: DataTree) -> None:
        """Reduce a record; what was under way is stopped."""
        self.stop()
        self._reduction = self._pool.schedule(_reduce, args=[record.to_dict()])

    def latest(self, known: Gravity) -> Gravity:
        """Gravity by the reduction, once it is there; else what is `known`."""
        if self._reduction is None or not self._reduction.done():
            return known
        reduction, self._reduction = self._reduction, None
        try:
            self.last = found = reduction.result()
        except IsochronyError as fault:
            return Gravity(refused=str(fault))
        except ProcessExpired:
            return Gravity(refused="the reduction ended before it was done; is there memory enough?")
        return Gravity(found.reduction.gravity.gravity, found.reduction.gravity.sigma, "joint")

    def stop(self) -> None:
        """Stop what is under way."""
        if self._reduction is not None:
            self._reduction.cancel()
            self._reduction = None

    def end(self) -> None:
        """Stop what is under way, and the process."""
        self.stop()
        self._pool.stop()
        self._pool.join()


def _reduce(groups: dict[str, Any]) -> Joint:
    return reduce_jointly(DataTree.from_dict(groups), None, 0.0)
