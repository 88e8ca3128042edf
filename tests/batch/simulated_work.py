"""What stands in for the work of a batch: records of JSON, results closed by a digest, and what batches are made of."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from random import Random
from typing import Any

from simulated_disk import ROOT, Disk
from simulated_system import System

from data_schemas.contents import Contents, Group, from_tree
from data_schemas.errors import FileError, RecordError, RefusedError
from pipeline.batch.job import owner_of
from pipeline.batch.ledger import NAME

INPUTS = f"{ROOT}/in"
FATES = ("good", "good", "good", "good", "good", "refused", "bad", "odd")
STATUS = {"good": "ok", "refused": "refused", "bad": "failed", "odd": "failed"}


class Violated(BaseException):
    """Something was lost, doubled or silently wrong; of no kind that the batch takes for a fault of one record."""


def hold(true: object, what: str) -> None:
    if not true:
        raise Violated(what)


class Result:
    """In place of a tree: attributes alone."""

    def __init__(self, **attrs: Any) -> None:
        self.attrs = attrs


def contents_of(tree: Any) -> Contents:
    return {"": Group(dict(tree.attrs))} if isinstance(tree, Result) else from_tree(tree)


def encoded(contents: Contents) -> memoryview:
    text = json.dumps(contents[""].attrs, sort_keys=True).encode()
    return memoryview(text + b"\n" + hashlib.sha256(text).hexdigest().encode())


def decoded(data: bytes) -> dict[str, Any]:
    text, _, digest = data.rpartition(b"\n")
    if digest != hashlib.sha256(text).hexdigest().encode():
        raise FileError("the file was damaged")
    attrs: dict[str, Any] = json.loads(text)
    return attrs


def process(made: dict[str, Any], *, gain_uncertainty: float, **_: object) -> Result:
    if made["fate"] == "refused":
        raise RefusedError("the record is one that nobody can use")
    if made["fate"] == "bad":
        raise RecordError("the record is bad")
    if made["fate"] == "odd":
        raise ZeroDivisionError("a fault of ours")
    return Result(id=made["id"], gravity=value(made, gain_uncertainty), elapsed=time_of(), configuration="{}")


def value(made: dict[str, Any], gain: float) -> float:
    number: float = made["value"] * (1.0 + gain)
    return number


def time_of() -> float:
    assert System.mounted is not None
    return System.mounted.tick()


def summaries(result: Result) -> list[dict[str, Any]]:
    row = {"record_id": result.attrs["id"], "status": "ok", "method": "projection", "flags": ()}
    return [{**row, "gravity_m_s2": result.attrs["gravity"], "corrections_mgal": {}}]


def table(columns: dict[str, Any]) -> Result:
    return Result(table=json.dumps(columns, default=list))


class World:
    """What a batch works on; few of them, so that what an undisturbed batch makes of each is soon known."""

    def __init__(self, number: int) -> None:
        chance = Random(number)
        self.number = number
        self.out = ROOT + chance.choice(("/out", "/out", "/deep/er/out"))
        self.made = [
            {"id": f"r{each}", "value": 9.8 + each / 64, "fate": chance.choice(FATES)}
            for each in range(chance.randint(1, 5))
        ]
        folders = chance.choice((("",), ("a/", "b/"), ("", "a/b/")))
        self.paths = [f"{INPUTS}/{chance.choice(folders)}{each}.record.nc" for each in range(len(self.made))]
        # one name too deep to be a common folder
        self.paths[0] = f"{INPUTS}/0.record.nc"
        self.keys = [path.removeprefix(f"{INPUTS}/").replace(".record.nc", ".result.nc") for path in self.paths]
        self.foreign = {f"{INPUTS}/.isochrony-0.part": b"theirs"}
        self.own = f".isochrony-{owner_of(Path(self.out))}"
        if self.out == f"{ROOT}/out":
            self.foreign |= {
                f"{self.out}/notes.txt": b"mine",
                f"{self.out}/.isochrony-000000000000-1.part": b"another batch's",
                f"{self.out}/copied/{NAME}": b"a ledger",
                f"{self.out}/copied/{self.own}0.part": b"half",
            }

    def input(self, each: int) -> bytes:
        return json.dumps(self.made[each]).encode()

    def lay(self, disk: Disk) -> None:
        disk.add(f"{INPUTS}/.keep", b"")
        for path, content in self.foreign.items():
            disk.add(path, content)
        for each, path in enumerate(self.paths):
            disk.add(path, self.input(each))

    def status(self) -> int:
        good = sum(made["fate"] == "good" for made in self.made)
        return 0 if good == len(self.made) else 1 if good else 3
