"""The command `batch` on a simulated system, and what must hold of what it leaves, at any moment.

What runs is `pipeline.cli.batch.run` with its ledger, log, executors, `process_record` and atomic writing. In place of
numbers and HDF5 there is JSON closed by a digest, in place of processes of its own there is `Crew`.
"""

from __future__ import annotations

import contextlib
import csv
import datetime
import hashlib
import io
import json
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, ClassVar

from simulated_disk import File
from simulated_system import Killed, System
from simulated_work import (
    INPUTS,
    Violated,
    World,
    contents_of,
    decoded,
    encoded,
    hold,
    process,
    summaries,
    table,
    value,
)
from simulated_workers import Crew

import pipeline.processing
import pipeline.summary
from data_schemas import writing
from data_schemas.errors import FileError, IsochronyError
from pipeline.batch import executors, job, ledger, summary
from pipeline.batch.job import Kind
from pipeline.batch.ledger import NAME, Ledger
from pipeline.cli import batch
from pipeline.cli.parser import parser_of

PARSER = parser_of("batch")


class Command:
    """The command on one system, run again and again, and looked at in between."""

    _known: ClassVar[dict[tuple[Any, ...], dict[str, bytes]]] = {}

    def __init__(self, world: World, chance: Random, told: Callable[[str], object] | None = None) -> None:
        self.world, self.chance = world, chance
        self.system = System(chance, told)
        world.lay(self.system.disk)
        self.gain = 0.0
        self.values: dict[str, set[float]] = {path: set() for path in self.world.paths}
        """All that were ever right."""
        self.durable: dict[str, Any] = {}
        """Outcomes that the ledger said it has, by key."""
        self.changed: set[str] = set()
        """Keys whose input, result or settings somebody changed since."""
        self.damaged: set[str] = set()
        """Keys whose result is not as the batch left it."""
        self.newer: set[str] = set()
        """Keys of which a forced batch may have left a newer result than its line says: --resume does them again."""
        self.words: tuple[str, ...] = ()
        self.worked = 0

    def tell(self, line: str) -> None:
        if self.system.told is not None:
            self.system.told(line)

    def ledger(self) -> dict[str, Any]:
        return ledger_of(dict(self.system.disk.files()).get(f"{self.world.out}/{NAME}", b""))

    def doubtful(self) -> bool:
        """Whether the disk failed to take lines that the cache has: they may go, and are done again then."""
        node = self.system.disk.find(f"{self.world.out}/{NAME}")
        return isinstance(node, File) and bool(node.lost)

    def tables(self) -> dict[str, bytes]:
        files = dict(self.system.disk.files(self.world.out))
        found = {name: files.get(f"{self.world.out}/{name}", b"") for name in summary.NAMES}
        hold(all(found.values()), "there is no summary")
        return found

    def undisturbed(self) -> dict[str, bytes]:
        """Tables of a batch of the same inputs that nothing disturbed, one record after the other."""
        what = self.world.number, *(made["value"] for made in self.world.made), self.gain
        if what not in self._known:
            other = Command(self.world, Random(0))
            other.gain = self.gain
            hold(other.run(["--executor", "serial"]) == self.world.status(), "an undisturbed batch fails")
            other.look(None)
            self._known[what] = other.tables()
        return self._known[what]

    def run(self, words: list[str], plan: dict[int, str] | None = None, share: float = 0.0) -> int | None:
        """The command, with its exit status, and 100 more where it gave up; None where it was killed."""
        system = self.system
        system.boot(dict(plan or {}))
        crew = Crew(system, share)
        system.workers.append(crew.abandon)
        for path, made in zip(self.world.paths, self.world.made, strict=True):
            self.values[path].add(value(made, self.gain))
        self.words = (INPUTS, "-o", self.world.out, "--trusted", "--method", "projection", *words)
        self.words += ("--gain-uncertainty", str(self.gain)) if self.gain else ()
        self.tell(f"-- {' '.join(self.words)}: {plan}")
        with self._instead(crew), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            try:
                return batch.run(PARSER.parse_args(self.words))
            except Killed:
                hold(not system.main.alive, "the end of a worker ends the command")
                return None
            except IsochronyError as error:
                self.tell(f"   {error}")
                return 100 + error.exit_status
            except KeyboardInterrupt:
                return 130
            except Exception as error:
                if not system.main.alive:  # came of what no longer has any effect
                    return None
                raise Violated(f"internal error: {type(error).__name__}: {error}") from error

    @contextlib.contextmanager
    def _instead(self, crew: Crew) -> Iterator[None]:
        """What is simulated, or looked at, in place of what the product uses."""
        clock = SimpleNamespace(monotonic=lambda: self.system.clock, perf_counter=self.system.tick)
        moment = SimpleNamespace(now=lambda _: datetime.datetime.fromtimestamp(self.system.wall, datetime.UTC))
        names = SimpleNamespace(token_hex=lambda count: self.chance.randbytes(count).hex())
        append = Ledger.append

        def appended(ledger: Ledger, outcomes: Any, configurations: Any) -> None:
            outcomes = list(outcomes)
            for one in outcomes:
                self._begun(one.key)
            append(ledger, outcomes, configurations)
            for one in outcomes:
                self.durable[one.key] = one
                self.changed.discard(one.key)
                self.newer.discard(one.key)
                if one.status == "ok":
                    self.damaged.discard(one.key)

        kinds = (Kind("record", (".record.nc",), self._read),)
        places = [
            (executors, "multiprocessing", crew), (executors, "wait", crew.wait), (executors, "time", clock),
            (executors, "gc", SimpleNamespace(collect=lambda: 0)),
            (job, "time", clock), (ledger, "datetime", SimpleNamespace(datetime=moment, UTC=datetime.UTC)),
            (writing, "secrets", names), (writing, "from_tree", contents_of), (writing, "encoded", encoded),
            (summary, "tree_of", table), (batch, "KINDS", kinds),
            (pipeline.processing, "process", process), (pipeline.summary, "summaries", summaries),
            (Ledger, "append", appended), (sys, "argv", ["isochrony", "batch"]), (System, "mounted", self.system),
        ]  # fmt: skip
        with contextlib.ExitStack() as stack:
            for owner, name, ours in places:
                stack.callback(setattr, owner, name, getattr(owner, name))
                setattr(owner, name, ours)
            yield

    def _read(self, path: Path, config: Any, _allow: Any) -> dict[str, Any]:
        """An input, which who reads it is going to work on."""
        with open(path, "rb") as file:
            made: dict[str, Any] = json.loads(file.read())
        self._begun(config.key)
        self.worked += 1
        return made

    def _begun(self, key: str) -> None:
        """A record is worked on, which must not be in vain."""
        if "--force" in self.words:
            self.newer.add(key)
        known = self.durable.pop(key, None)
        if known is not None:
            failed = known.status == "failed" and ("--retry-failed" in self.words or known.input_sha256 is None)
            paths = {self.world.paths[self.world.keys.index(key)], f"{self.world.out}/{key}"}
            anew = "--force" in self.words or key in self.changed | self.newer
            hold(failed or anew or paths & self.system.failed, f"{key}: done again, was {known.status}")

    def look(self, status: int | None) -> None:
        """Nothing lost, nothing wrong, nothing of others touched, at any moment."""
        files = dict(self.system.disk.files())
        out = self.world.out
        for path, content in self.world.foreign.items():
            hold(files.get(path) == content, f"{path} is not as it was")
        for each, path in enumerate(self.world.paths):
            hold(files[path] == self.world.input(each), f"{path} is not as it was")
        lines = self.ledger()
        if status in (0, 1, 3) and not self.doubtful():  # what it kept it has told as done
            self.durable |= lines
        for key, one in self.durable.items():
            line = lines.get(key)
            same = line is not None and (line.status, line.output_sha256) == (one.status, one.output_sha256)
            hold(same, f"{key}: the ledger said {one.status}, now {line}")
            if one.status == "ok" and key not in self.damaged | self.newer:
                data = files.get(f"{out}/{key}")
                hold(data is not None, f"{key}: the result is lost")
                hold(hashlib.sha256(data or b"").hexdigest() == one.output_sha256, f"{key}: is not what was written")
        for path, key in zip(self.world.paths, self.world.keys, strict=True):
            if (data := files.get(f"{out}/{key}")) is not None and key not in self.damaged:
                try:
                    gravity = decoded(data)["gravity"]
                except FileError:
                    raise Violated(f"{key}: a result that is not whole has its name") from None
                hold(gravity in self.values[path], f"{key}: gravity is wrong, {gravity}")
        self._look_at_table(files.get(f"{out}/summary.csv"), status)

    def _look_at_table(self, data: bytes | None, status: int | None) -> None:
        if data is None:
            hold(status != 0, "all is well, and there is no summary")
            return
        rows = list(csv.DictReader(io.StringIO(data.decode(), newline="")))
        hold(data.endswith(b"\n"), "the summary is torn")
        paths = [row["input"] for row in rows]
        hold(len(set(paths)) == len(paths), "an input is twice in the summary")
        for row in rows:
            good = row["status"] == "ok"
            hold(good == bool(row["gravity_m_s2"]), f"{row['input']}: {row['status']} with {row['gravity_m_s2']}")
            if good:
                hold(float(row["gravity_m_s2"]) in self.values[row["input"]], f"{row['input']}: the summary is wrong")
        if status == 0 and "--limit" not in self.words:
            hold(data == self.undisturbed()["summary.csv"], "all is well, and the summary is another")


def ledger_of(data: bytes) -> dict[str, Any]:
    """Last line of each key that is whole, read by other means than the ledger's own."""
    lines = {}
    for line in data.split(b"\n"):
        text, crc = line[:-22].lstrip(b"\0"), line[-10:-2]
        if line[-22:-10] == b', "crc32": "' and crc.decode("ascii", "replace") == f"{zlib.crc32(text):08x}":
            content = json.loads(text + b"}")
            if "key" in content:
                lines[content["key"]] = SimpleNamespace(**content)
    return lines
