"""A batch on a simulated system, disturbed as its seed says, resumed until it ends.

    PYTHONPATH=. python tests/batch/simulated_batch.py --seeds 20000
    PYTHONPATH=. python tests/batch/simulated_batch.py --seed 4711

The second tells every call of the system that one seed made.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from simulated_command import Command
from simulated_disk import ROOT, File, Folder
from simulated_system import FAULTS, MET, calls_replaced
from simulated_work import STATUS, Violated, World, hold

from pipeline.batch.ledger import NAME

WORLDS = 40


class Simulation(Command):
    """The batch of one seed."""

    def __init__(self, seed: int, told: Callable[[str], object] | None = None) -> None:
        chance = Random(seed)
        super().__init__(World(chance.randrange(WORLDS)), chance, told)

    def go(self) -> None:
        """All of it."""
        chance = self.chance
        how = chance.choice(("serial", "1", "2", "3"))
        work = ("--executor", "serial") if how == "serial" else ("--jobs", how)
        share = chance.choice((0.0, 0.0, 0.1, 0.5))
        for number in range(chance.randint(1, 4)):
            faults = chance.choice((1, 1, 1, 2, 3)) if share == 0.0 or chance.random() < 0.7 else 0
            plan = {self.moment(): chance.choice(FAULTS) for _ in range(faults)}
            words = [*work, *(["--limit", "1"] if chance.random() < 0.05 else [])]
            begun = f"{self.world.out}/{NAME}" in dict(self.system.disk.files())
            if number or begun:
                words.append(chance.choice(("--resume",) * 5 + ("--retry-failed",) * 3 + ("--force",)))
            status = self.run(words, plan, share)
            self.tell(f"-- run {number}: {status}")
            self.look(status)
            self.settle()
            if chance.random() < 0.2:
                self.meddle()
        self.end(work)

    def moment(self) -> int:
        """See `System.plan`; about as many as an undisturbed batch makes."""
        chance, count = self.chance, len(self.world.made)
        if chance.random() < 0.25:
            return chance.randint(1, 80 + 40 * count)
        return -chance.randint(1, chance.choice((8, 15 + 8 * count)))

    def settle(self) -> None:
        """Where nothing is begun yet, let the folders made for it be there: a folder that the next command only meets,
        it does not bring to the disk.
        """
        if not self.ledger():
            folder = self.system.disk.top
            for name in self.world.out.removeprefix(ROOT + "/").split("/"):
                folder.sync()
                folder = folder.cached.get(name, Folder())

    def end(self, work: tuple[str, ...]) -> None:
        """Undisturbed to the end."""
        status = self.run([*work, "--resume"])
        hold(status in (0, 1, 3), f"--resume ends with {status}")
        self.look(status)
        self.tidy()
        if any(one.status == "failed" for one, _ in self.rows()):
            status = self.run([*work, "--retry-failed"])
            self.look(status)
            self.tidy()
        hold(status == self.world.status(), f"the end is {status}, not {self.world.status()}")
        for one, made in self.rows():
            hold(one.status == STATUS[made["fate"]], f"{one.key}: {one.status} of a {made['fate']} record")
        found = self.tables()
        for name, data in self.undisturbed().items():
            hold(found[name] == data, f"{name} is not that of an undisturbed batch")
        worked = self.worked
        hold(self.run([*work, "--resume"]) == status, "going on once more ends otherwise")
        hold(self.worked == worked, "going on once more worked again")
        hold(self.tables() == found, "going on once more changed the summary")
        self.look(status)
        self.system.disk.lose_power(self.chance)
        self.look(None)
        hold(self.tables() == found, "a power loss at the end changed the summary")

    def tidy(self) -> None:
        for path, _ in self.system.disk.files():
            hold(self.world.own not in path or path in self.world.foreign, f"{path} is left over")
        hold(not self.system.main.open, "descriptors are left open")

    def rows(self) -> Iterator[tuple[Any, dict[str, Any]]]:
        lines = self.ledger()
        hold(set(lines) == set(self.world.keys), f"outcomes: {sorted(lines)}")
        return ((lines[key], made) for key, made in zip(self.world.keys, self.world.made, strict=True))

    def meddle(self) -> None:
        """Somebody edits an input, damages or deletes a result, or wants other settings."""
        chance, disk = self.chance, self.system.disk
        each = chance.randrange(len(self.world.made))
        key = self.world.keys[each]
        what = chance.choice(("edit", "settings", "damage", "delete"))
        self.tell(f"-- {what} {key}")
        if what == "edit":
            self.world.made[each]["value"] += 1 / 1024
            disk.add(self.world.paths[each], self.world.input(each))
            self.changed.add(key)
        elif what == "settings":
            self.gain = 0.5 if self.gain == 0.0 else 0.0
            self.changed.update(self.world.keys)
        elif (path := f"{self.world.out}/{key}") in dict(disk.files()):
            self.changed.add(key)
            self.damaged.add(key)
            node = disk.find(path)
            assert isinstance(node, File)
            data = bytearray(node.cached)
            data[chance.randrange(len(data))] ^= 1
            if what == "damage":
                disk.add(path, bytes(data))
            else:
                folder, name = disk.parent(path)
                folder.change(name)
                folder.sync()


def violation(seed: int, told: Callable[[str], object] | None = None) -> str | None:
    """What does not hold in the batch of a seed; calls must be replaced."""
    try:
        Simulation(seed, told).go()
    except Violated as error:
        return str(error)
    return None


def violations(seeds: Any) -> Iterator[tuple[int, str]]:
    """Seeds whose batch breaks a promise, and what it is."""
    with calls_replaced():
        for seed in seeds:
            if (what := violation(seed)) is not None:
                yield seed, what


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20_000, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--most", type=int, default=10, help="failures after which to leave")
    parser.add_argument("--seed", type=int, help="replay this one, call by call")
    options = parser.parse_args()
    if options.seed is not None:
        with calls_replaced():
            what = violation(options.seed, lambda line: print(line, file=sys.__stdout__))
        print(what or "nothing lost, doubled or wrong")
        return what is not None
    begun, failures = time.perf_counter(), 0
    seeds = range(options.first, options.first + options.seeds)
    for seed, what in itertools.islice(violations(seeds), options.most):
        failures += 1
        print(f"seed {seed}: {what}", flush=True)
    print(", ".join(f"{name} {count}" for name, count in sorted(MET.items())))
    print(f"{options.seeds} seeds, {failures} failures, {time.perf_counter() - begun:.0f} s")
    return failures > 0


if __name__ == "__main__":
    sys.exit(main())
