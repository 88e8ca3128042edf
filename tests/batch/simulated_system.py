"""What processes ask of the operating system, answered by a disk in memory; every call may be the one that fails.

The calls of `os`, `io` and `fcntl` are replaced for as long as a system is mounted: paths below `ROOT`, and the
descriptors that came of them, are the simulation's, all others go where they always went.
"""

from __future__ import annotations

import builtins
import contextlib
import errno
import fcntl
import io
import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from random import Random
from typing import Any, ClassVar
from unittest import mock

from simulated_disk import FIRST, ROOT, Descriptor, Disk, File, Folder, fault

_GROWING = ("create", "write", "mkdir", "link", "replace")
_LOOKING = ("stat", "open", "read", "close", "scandir")
_SPARED = ("stat", "close")  # by EIO: a disk of which nothing is known any more is no file system
FAULTS = ("kill", "kill", "power", "power", "eio", "eio", "full", "short", "interrupt", "terminate", "jump")


MET: Counter[str] = Counter()
"""How often each fault was met, over all systems."""


class Killed(BaseException):
    """The end of a simulated process: nothing that it does on unwinding has any effect."""


class Process:
    """Who asks; dies at its call number `left`, if that is given."""

    def __init__(self, left: int | None = None) -> None:
        self.alive, self.left = True, left
        self.open: dict[int, Descriptor] = {}

    def end(self) -> None:
        self.alive = False
        for each in self.open.values():
            if isinstance(each.node, File) and each.node.holder is self:
                each.node.holder = None
        self.open.clear()


class System:
    """Disk, clocks and processes.

    `plan` says which call meets which of `FAULTS`: by its number, or by minus its number among the calls that change
    something, between which a kill makes no difference.
    """

    mounted: ClassVar[System | None] = None

    def __init__(self, chance: Random, told: Callable[[str], object] | None = None) -> None:
        self.chance, self.told = chance, told
        self.disk = Disk()
        self.clock = self.wall = 1e9
        self.workers: list[Callable[[], None]] = []
        """Each lets a process that works come as far as chance says, and ends it."""
        self.boot({})

    def boot(self, plan: dict[int, str]) -> None:
        """A new command on the same disk."""
        self.main = self.process = Process()
        self.plan, self.count, self.changes, self.full_until = plan, 0, 0, 0
        self.failed: set[str] = set()
        """Paths where the disk failed."""
        self.workers.clear()

    @contextlib.contextmanager
    def running(self, process: Process) -> Iterator[None]:
        """Another process asks."""
        before, self.process = self.process, process
        try:
            yield
        finally:
            self.process = before

    def step(self, call: str, path: str, torn: Callable[[], object] = lambda: None) -> str | None:
        """One call: let happen what is planned for it; what is left for the caller to do is returned.

        `torn` does part of a call that is not done to its end.
        """
        asking = self.process
        if not asking.alive:
            raise Killed
        self.count += 1
        if self.told is not None:
            self.told(f"{self.count:4d} {'main' if asking is self.main else 'worker'} {call} {path}")
        what = self.plan.pop(self.count, None)
        if call not in _LOOKING:
            self.changes += 1
            what = self.plan.pop(-self.changes, None) or what
        if asking.left is not None:
            asking.left -= 1
            if asking.left < 0:
                torn()
                asking.end()
                raise Killed
        postponed = (what == "short" and call != "write") or (what == "eio" and call in _SPARED)
        if postponed or (what in ("interrupt", "terminate") and asking is not self.main):
            self.plan.setdefault(self.count + 1, what or "")
            what = None
        if what is not None:
            MET[what] += 1
            if self.told is not None:
                self.told(f"     ^ {what}")
        if what in ("kill", "power"):
            torn()
            self.lose(power=what == "power")
        elif what == "eio":
            self.failed.add(path)
            raise fault(errno.EIO, path)
        elif what == "full":
            self.full_until = self.count + self.chance.choice((1, 5, 30, 1000))
        elif what == "jump":
            self.clock += self.chance.choice((60.0, 5000.0))
            self.wall += self.chance.uniform(-1e7, 1e7)
        elif what == "interrupt":
            signal.raise_signal(signal.SIGINT)
        elif what == "terminate":
            if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
                self.lose(power=False)
            signal.raise_signal(signal.SIGTERM)
        if self.count < self.full_until and call in _GROWING:
            torn()
            raise fault(errno.ENOSPC, path)
        return what

    def lose(self, *, power: bool) -> None:
        """End all processes at once, and with the power what only the cache knows."""
        self.plan.clear()
        self.full_until = 0
        for worker in self.workers:
            worker()
        self.main.end()
        self.process.end()
        if power:
            self.disk.lose_power(self.chance)
        raise Killed

    def tick(self) -> float:
        """Seconds of a clock that only goes forward."""
        self.clock += 1e-3
        return self.clock

    def open(self, path: str, flags: int, mode: int = 0o777) -> int:
        folder, name = self.disk.parent(path)
        node = self.disk.top if path == ROOT else folder.cached.get(name)
        if flags & os.O_CREAT and node is None:
            self.step("create", path)
            node = File()
            folder.change(None, name, node)
        else:
            self.step("open", path)
            if node is None:
                raise fault(errno.ENOENT, path)
            if flags & os.O_EXCL:
                raise fault(errno.EEXIST, path)
        descriptor = self.disk.descriptor()
        self.process.open[descriptor] = Descriptor(path, node, flags)
        return descriptor

    def write(self, descriptor: int, data: Any) -> int:
        opened = self.at(descriptor)
        node = opened.node
        assert isinstance(node, File)
        data = bytes(data)
        offset = len(node.cached) if opened.flags & os.O_APPEND else opened.at

        def torn() -> int:
            size = self.chance.randint(0, len(data) - 1)
            node.change(offset, data[:size])
            opened.at = offset + size
            return size

        if self.step("write", opened.path, torn) == "short":
            return torn() or self.write(descriptor, data)  # interrupted before the first byte Python asks again
        node.change(offset, data)
        opened.at = offset + len(data)
        return len(data)

    def fsync(self, descriptor: int) -> None:
        opened = self.at(descriptor)
        try:
            self.step("fsync", opened.path)
        except OSError:
            if isinstance(opened.node, File) and self.chance.random() < 0.5:
                opened.node.fail_to_sync()
            raise
        opened.node.sync()

    def ftruncate(self, descriptor: int, size: int) -> None:
        opened = self.at(descriptor)
        assert isinstance(opened.node, File)
        self.step("ftruncate", opened.path)
        if size != len(opened.node.cached):
            opened.node.change(size, None)

    def close(self, descriptor: int) -> None:
        opened = self.at(descriptor)
        self.step("close", opened.path)
        del self.process.open[descriptor]
        if isinstance(opened.node, File) and opened.node.holder is self.process:
            opened.node.holder = None

    def at(self, descriptor: int) -> Descriptor:
        if not self.process.alive:
            raise Killed
        return self.process.open[descriptor]

    def flock(self, descriptor: int, _how: int) -> None:
        node = self.at(descriptor).node
        assert isinstance(node, File)
        if node.holder not in (None, self.process):
            raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
        node.holder = self.process

    def stat(self, path: str, **_: object) -> os.stat_result:
        self.step("stat", path)
        return self.disk.status(path)

    def mkdir(self, path: str, mode: int = 0o777) -> None:
        folder, name = self.disk.parent(path)
        self.step("mkdir", path)
        if name in folder.cached:
            raise fault(errno.EEXIST, path)
        folder.change(None, name, Folder())

    def rmdir(self, path: str) -> None:
        folder, name = self.disk.parent(path)
        self.step("rmdir", path)
        node = self.disk.find(path)
        if not isinstance(node, Folder) or node.cached:
            raise fault(errno.ENOTEMPTY, path)
        folder.change(name)

    def unlink(self, path: str) -> None:
        folder, name = self.disk.parent(path)
        self.step("unlink", path)
        if not isinstance(self.disk.find(path), File):
            raise fault(errno.EISDIR, path)
        folder.change(name)

    def replace(self, path: str, target: Any) -> None:
        folder, name = self.disk.parent(path)
        beside, other = self.disk.parent(os.fspath(target))
        assert folder is beside
        self.step("replace", os.fspath(target))
        folder.change(name, other, self.disk.find(path))

    def scandir(self, path: str) -> Listing:
        self.step("scandir", path)
        node = self.disk.find(path)
        if not isinstance(node, Folder):
            raise fault(errno.ENOTDIR, path)
        names = list(node.cached)
        self.chance.shuffle(names)
        return Listing([Listed(name, f"{path}/{name}", isinstance(node.cached[name], Folder)) for name in names])

    def open_file(self, path: str, mode: str = "r", buffering: int = -1, *_: object, **__: object) -> Any:
        assert mode in ("r", "rb"), mode
        return self.fdopen(self.open(path, os.O_RDONLY), mode, buffering)

    def fdopen(self, descriptor: int, mode: str = "r", buffering: int = -1, encoding: str | None = None) -> Any:
        raw = Raw(self, descriptor)
        if buffering == 0:
            return raw
        buffered = io.BufferedReader(raw) if "r" in mode else io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding=encoding)


class Listed:
    def __init__(self, name: str, path: str, folder: bool) -> None:
        self.name, self.path, self._folder = name, path, folder

    def is_dir(self) -> bool:
        return self._folder

    def is_symlink(self) -> bool:
        return False


class Listing:
    def __init__(self, entries: list[Listed]) -> None:
        self._left = iter(entries)

    def __enter__(self) -> Listing:
        return self

    def __exit__(self, *_: object) -> None: ...

    def __iter__(self) -> Iterator[Listed]:
        return self._left

    def __next__(self) -> Listed:
        return next(self._left)


class Raw(io.RawIOBase):
    """A file object over a descriptor; silent when its process is gone, as is all that unwinds then."""

    def __init__(self, system: System, descriptor: int) -> None:
        self._system, self._descriptor, self._process = system, descriptor, system.process

    def fileno(self) -> int:
        return self._descriptor

    def readable(self) -> bool:
        return True

    writable = seekable = readable

    def seek(self, offset: int, whence: int = 0, /) -> int:
        opened = self._system.at(self._descriptor)
        assert isinstance(opened.node, File)
        opened.at = offset + (0, opened.at, len(opened.node.cached))[whence]
        return opened.at

    def readinto(self, buffer: Any, /) -> int:
        opened = self._system.at(self._descriptor)
        assert isinstance(opened.node, File)
        self._system.step("read", opened.path)
        data = opened.node.cached[opened.at : opened.at + len(buffer)]
        buffer[: len(data)] = data
        opened.at += len(data)
        return len(data)

    def write(self, data: Any, /) -> int:
        return self._system.write(self._descriptor, data) if self._process.alive else len(data)

    def close(self) -> None:
        if not self.closed:
            super().close()
            if self._descriptor in self._process.open:
                self._system.close(self._descriptor)


def _inside(target: object) -> bool:
    if System.mounted is None:
        return False
    if isinstance(target, int):
        return target >= FIRST
    return isinstance(target, str | os.PathLike) and os.fspath(target).startswith(ROOT)


def _either(real: Callable[..., Any], ours: Callable[..., Any]) -> Callable[..., Any]:
    def call(target: Any, *args: Any, **kwargs: Any) -> Any:
        if not _inside(target):
            return real(target, *args, **kwargs)
        return ours(System.mounted, target if isinstance(target, int) else os.fspath(target), *args, **kwargs)

    return call


@contextlib.contextmanager
def calls_replaced() -> Iterator[None]:
    """Give what is inside to the system that is mounted; one may follow the other."""
    names = ("open", "write", "fsync", "ftruncate", "close", "stat", "mkdir", "rmdir", "unlink", "replace", "scandir")
    places = [(os, name, getattr(System, name)) for name in (*names, "fdopen")] + [
        (os, "lstat", System.stat),
        (io, "open", System.open_file),
        (builtins, "open", System.open_file),
        (fcntl, "flock", System.flock),
    ]
    with contextlib.ExitStack() as stack:
        for owner, name, ours in places:
            stack.enter_context(mock.patch.object(owner, name, _either(getattr(owner, name), ours)))
        yield
