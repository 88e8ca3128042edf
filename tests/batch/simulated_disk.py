"""A file system in memory that knows what is on the disk and what is in its cache alone.

A process sees the cache. What it wrote outlives its death; a power loss it outlives for certain only where it was
brought to the disk: the bytes of a file by `fsync` of the file, a name by `fsync` of its folder. Everything else
survives then, is torn or is lost, as the chance given decides.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from random import Random

ROOT = "/simulated"
FIRST = 1 << 20  # a descriptor no real file has


def fault(number: int, path: str) -> OSError:
    return OSError(number, os.strerror(number), path)


@dataclass(eq=False)
class File:
    cached: bytearray = field(default_factory=bytearray)
    durable: bytes = b""
    pending: list[tuple[int, bytes | None]] = field(default_factory=list)
    """Offset and bytes of writes, or a length and None, since it was last brought to the disk."""
    lost: list[tuple[int, int]] = field(default_factory=list)
    """Ranges that the disk failed to take: the cache counts them as written."""
    holder: object = None
    """Process that has it locked."""

    def change(self, offset: int, data: bytes | None) -> None:
        self.pending.append((offset, data))
        _apply(self.cached, offset, data)
        end = len(self.cached) if data is None else offset + len(data)  # what is written anew is dirty anew
        parts = [part for a, b in self.lost for part in ((a, min(b, offset)), (max(a, end), b))]
        self.lost = [(a, b) for a, b in parts if a < b and (data is not None or b <= offset)]

    def sync(self) -> None:
        self.durable = bytes(self.cached)
        for begin, end in self.lost:
            self.durable = self.durable[:begin] + bytes(len(self.durable[begin:end])) + self.durable[end:]
        self.pending.clear()

    def fail_to_sync(self) -> None:
        """As Linux does: the pages that failed count as clean, and no later call brings them to the disk."""
        size = len(self.cached)
        self.lost += [(at, min(at + len(data), size)) for at, data in self.pending if data is not None and at < size]

    def lose_power(self, chance: Random) -> None:
        kept = bytearray(self.durable)
        for offset, data in self.pending[: chance.randint(0, len(self.pending))]:
            if data is not None:
                end = chance.choice((0, chance.randint(0, len(data)), len(data), len(data)))
                data = data[:end] + bytes(len(data) - end)
            _apply(kept, offset, data)
        self.cached, self.durable = kept, bytes(kept)
        self.pending.clear()
        self.lost.clear()
        self.holder = None


def _apply(content: bytearray, offset: int, data: bytes | None) -> None:
    if data is None:
        del content[offset:]
        offset, data = len(content), bytes(offset - len(content))
    content.extend(bytes(offset - len(content)))
    content[offset : offset + len(data)] = data


@dataclass(eq=False)
class Folder:
    cached: dict[str, File | Folder] = field(default_factory=dict)
    durable: dict[str, File | Folder] = field(default_factory=dict)
    pending: list[tuple[str | None, str | None, File | Folder | None]] = field(default_factory=list)
    """Name that goes, name that comes, and what it names: both of a rename, which is one step."""

    def change(self, goes: str | None, comes: str | None = None, node: File | Folder | None = None) -> None:
        self.pending.append((goes, comes, node))
        _rename(self.cached, goes, comes, node)

    def sync(self) -> None:
        self.durable = dict(self.cached)
        self.pending.clear()

    def lose_power(self, chance: Random) -> None:
        kept = dict(self.durable)
        journal = self.pending[: chance.randint(0, len(self.pending))] if chance.random() < 0.5 else self.pending
        share = 1.0 if journal is not self.pending else chance.random()
        for step in journal:
            if chance.random() < share:
                _rename(kept, *step)
        self.cached, self.durable = dict(kept), kept
        self.pending.clear()


def _rename(names: dict[str, File | Folder], goes: str | None, comes: str | None, node: File | Folder | None) -> None:
    if goes is not None:
        names.pop(goes, None)
    if comes is not None and node is not None:
        names[comes] = node


@dataclass(eq=False)
class Descriptor:
    path: str
    node: File | Folder
    flags: int
    at: int = 0


class Disk:
    """Files and folders by absolute path below `ROOT`; faults as `OSError`.

    What each call is, and whether it may be made, is for `SimulatedSystem`.
    """

    def __init__(self) -> None:
        self.top = Folder()
        self._next = FIRST

    def descriptor(self) -> int:
        self._next += 1
        return self._next

    def find(self, path: str) -> File | Folder:
        node: File | Folder = self.top
        for name in path.removeprefix(ROOT).split("/"):
            if name:
                if not isinstance(node, Folder):
                    raise fault(errno.ENOTDIR, path)
                if name not in node.cached:
                    raise fault(errno.ENOENT, path)
                node = node.cached[name]
        return node

    def parent(self, path: str) -> tuple[Folder, str]:
        above, _, name = path.rpartition("/")
        node = self.find(above)
        if not isinstance(node, Folder):
            raise fault(errno.ENOTDIR, path)
        return node, name

    def status(self, path: str) -> os.stat_result:
        node = self.find(path)
        size = len(node.cached) if isinstance(node, File) else 0
        kind = stat.S_IFREG | 0o644 if isinstance(node, File) else stat.S_IFDIR | 0o755
        return os.stat_result((kind, 0, 1, 1, 0, 0, size, 0, 0, 0))

    def add(self, path: str, content: bytes) -> None:
        """A file that has long been there, with all folders above it."""
        node = self.top
        *above, name = path.removeprefix(ROOT + "/").split("/")
        for each in above:
            below = node.cached.setdefault(each, Folder())
            assert isinstance(below, Folder)
            node.durable[each] = node = below
        node.cached[name] = node.durable[name] = File(bytearray(content), content)

    def files(self, path: str = ROOT) -> Iterator[tuple[str, bytes]]:
        """Path and cached bytes of all files below a folder."""
        node = self.find(path)
        assert isinstance(node, Folder)
        for name, each in node.cached.items():
            if isinstance(each, Folder):
                yield from self.files(f"{path}/{name}")
            else:
                yield f"{path}/{name}", bytes(each.cached)

    def lose_power(self, chance: Random) -> None:
        """Forget what was not brought to the disk, or part of it."""
        left: list[File | Folder] = [self.top]
        known = set()
        while left:
            node = left.pop()
            if id(node) not in known:
                known.add(id(node))
                node.lose_power(chance)
                left += node.cached.values() if isinstance(node, Folder) else ()
