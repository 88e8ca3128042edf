"""What reads untrusted inputs opens no sockets, and writes nowhere but in its batch's folder and its scratch."""

from __future__ import annotations

import errno
import functools
import json
import os
import platform
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest
from batch_parts import METHODS, Processes, config_of, write_record

import data_schemas
from pipeline.batch import confinement
from pipeline.batch import executors as isolated
from pipeline.batch.confinement import MACHINES, confine, ruleset, socket_filter
from pipeline.batch.executors import Isolated, pooled
from pipeline.batch.job import Config, Kind
from pipeline.cli.batch import read_record
from pipeline.processing import process
from synth.kernels.cache import cache_folder

ROOT = Path(__file__).parents[2]
REFUSED = {
    "x86_64": {"socket": 41, "connect": 42, "sendto": 44, "sendmsg": 46, "bind": 49, "listen": 50, "socketpair": 53,
               "accept4": 288, "sendmmsg": 307, "io_uring_setup": 425, "socket of x32": 0x40000000 + 41},
    "aarch64": {"socket": 198, "socketpair": 199, "bind": 200, "listen": 201, "connect": 203, "sendto": 206,
                "sendmsg": 211, "accept4": 242, "sendmmsg": 269, "io_uring_setup": 425},
}  # fmt: skip
ALLOWED = {
    "x86_64": {"read": 0, "write": 1, "mmap": 9, "pread64": 17, "dup": 32, "getpid": 39, "sendfile": 40, "clone": 56,
               "exit": 60, "openat": 257, "accept4 - 1": 287, "futex": 202, "openat2": 437, "landlock": 446},
    "aarch64": {"read": 63, "write": 64, "openat": 56, "mmap": 222, "futex": 98, "shmdt": 197, "readahead": 213,
                "clone": 220, "openat2": 437},
}  # fmt: skip
READ_RIGHTS = 1 << 0 | 1 << 2 | 1 << 3  # execute, read a file, list a folder


def verdict(program: bytes, architecture: int, call: int) -> int:
    """What a classic BPF program returns, by the machine's definition: 32-bit words, jumps counted from the next."""
    data = struct.pack("=IIQ6Q", call, architecture, 0, *[0] * 6)
    lines = list(struct.iter_unpack("=HBBI", program))
    value = at = 0
    while True:
        code, then, otherwise, constant = lines[at]
        at += 1
        if code == 0x06:
            return constant
        if code == 0x20:
            (value,) = struct.unpack_from("=I", data, constant)
        else:
            holds = {0x15: value == constant, 0x25: value > constant, 0x35: value >= constant}[code]
            at += then if holds else otherwise


@pytest.mark.parametrize("name", MACHINES)
def test_filter_refuses_calls_about_sockets_alone(name):
    program, architecture = socket_filter(MACHINES[name]), MACHINES[name].architecture
    for call in REFUSED[name].values():
        assert verdict(program, architecture, call) == 0x00050000 | errno.EPERM
    for call in ALLOWED[name].values():
        assert verdict(program, architecture, call) == 0x7FFF0000


def test_filter_refuses_calls_of_another_architecture():
    """They have other numbers: what is read here may be a socket there."""
    i386 = 0x40000003
    for machine in MACHINES.values():
        assert {verdict(socket_filter(machine), i386, call) for call in range(500)} == {0x00050000 | errno.EPERM}


@pytest.mark.parametrize(
    ("version", "files"), [(1, 0x1FF2), (2, 0x3FF2), (3, 0x7FF2), (4, 0x7FF2), (5, 0xFFF2), (6, 0xFFF2), (9, 0xFFF2)]
)
def test_rights_to_write_are_those_that_a_version_knows(version, files):
    assert ruleset(version) == (files, 3 if version >= 4 else 0, 3 if version >= 6 else 0)
    assert not files & READ_RIGHTS


class System:
    """In place of the C library: a system with a version of Landlock, or none; rights are kept by path."""

    def __init__(self, version, *, fails=()):
        self.version, self.fails = version, fails
        self.granted, self.asked, self.prctl = {}, [], lambda *_: 0
        self.syscall = functools.partial(self._call)  # which can be given a type of result, unlike a method

    def _call(self, number, *given):
        number = number.value
        self.asked.append(number)
        if number in self.fails:
            return -1
        if number == 444 and given[2].value == 1:
            return self.version
        if number == 444:
            return os.open(os.devnull, os.O_RDONLY)
        if number == 445:
            rights, opened = struct.unpack("=Qi", given[2])
            self.granted[os.readlink(f"/proc/self/fd/{opened}")] = rights
        return 0


@pytest.fixture
def system(monkeypatch):
    def use(*given, **named):
        made = System(*given, **named)
        monkeypatch.setattr(confinement.sys, "platform", "linux")
        monkeypatch.setattr(confinement.ctypes, "CDLL", lambda _: made)
        return made

    return use


needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="paths of Linux")


@needs_proc
@pytest.mark.parametrize("version", [1, 2, 3, 7])
def test_folders_get_what_files_in_them_need(system, tmp_path, version):
    """Neither links, devices, sockets and pipes, nor moves between folders; what is not there gets nothing."""
    asked = system(version)
    assert confine([tmp_path, tmp_path / "none"])[1]
    in_files = 1 << 1 | (1 << 14 if version >= 3 else 0)
    assert asked.granted == {os.devnull: in_files, str(tmp_path): in_files | 1 << 5 | 1 << 7 | 1 << 8}
    assert asked.asked[-1] == 446


@needs_proc
@pytest.mark.parametrize(
    ("fails", "held"),
    [((444,), (True, False)), ((446,), (True, False)), ((317,), (False, True)), ((317, 444), (False, False))],
)
def test_without_one_wall_the_other_holds(system, monkeypatch, tmp_path, fails, held):
    monkeypatch.setattr(confinement.platform, "machine", lambda: "x86_64")
    system(7, fails=fails)
    assert confine([tmp_path]) == held


def test_a_system_that_knows_neither_is_left_alone(system, monkeypatch, tmp_path):
    asked = system(7)
    monkeypatch.setattr(confinement.platform, "machine", lambda: "riscv64")
    assert confine([tmp_path])[0] is False
    asked.asked.clear()
    monkeypatch.setattr(confinement.sys, "platform", "darwin")
    assert confine([tmp_path]) == (False, False)
    assert asked.asked == []


def outcome(attempt):
    """Number of the error that an attempt ends with, 0 for none."""
    try:
        attempt()
    except OSError as error:
        return error.errno
    return 0


def attempts(inside: Path, outside: Path) -> dict[str, int]:
    """What becomes of all that a process may try; `outside` holds a file and a folder."""
    file, own = outside / "file", inside / "own"

    def elsewhere():
        code = f"open({str(outside / 'child')!r}, 'w')"
        if subprocess.run([sys.executable, "-c", code], capture_output=True).returncode:
            raise PermissionError(errno.EACCES, "in a process that it starts")

    return {
        "socket": outcome(socket.socket),
        "local socket": outcome(lambda: socket.socket(socket.AF_UNIX)),
        "pair": outcome(socket.socketpair),
        "read": outcome(file.read_bytes),
        "list": outcome(lambda: os.listdir(outside)),
        "null": outcome(lambda: Path(os.devnull).write_text("x")),
        "pipe": outcome(lambda: os.write(os.pipe()[1], b"x")),
        "make inside": outcome(lambda: own.mkdir(exist_ok=True)),
        "write inside": outcome(lambda: (own / "a.part").write_text("x")),
        "rename inside": outcome(lambda: os.replace(own / "a.part", own / "a")),
        "remove inside": outcome((own / "a").unlink),
        "nameless inside": outcome(lambda: tempfile.TemporaryFile(dir=inside).close()),
        "flush inside": outcome(lambda: os.fsync(os.open(own, os.O_RDONLY))),
        "link inside": outcome(lambda: os.symlink(outside, own / "link")),
        "fifo inside": outcome(lambda: os.mkfifo(own / "fifo")),
        "write": outcome(lambda: (outside / "new").write_text("x")),
        "overwrite": outcome(lambda: file.open("r+")),
        "append": outcome(lambda: file.open("a")),
        "truncate": outcome(lambda: os.truncate(file, 0)),
        "make": outcome((outside / "made").mkdir),
        "remove": outcome(file.unlink),
        "remove folder": outcome((outside / "folder").rmdir),
        "rename": outcome(lambda: os.rename(file, outside / "other")),
        "move out": outcome(lambda: os.rename(own, outside / "moved")),
        "move in": outcome(lambda: os.rename(file, inside / "moved")),
        "hard link": outcome(lambda: os.link(file, inside / "linked")),
        "nameless": outcome(lambda: tempfile.TemporaryFile(dir=outside).close()),
        "memory of another": outcome(lambda: open(f"/proc/{os.getppid()}/mem", "r+b")),
        "by a process": outcome(elsewhere),
    }


SOCKETS = {"socket", "local socket", "pair"}
WORK = {"read", "list", "null", "pipe"} | {
    f"{word} inside" for word in ["make", "write", "rename", "remove", "nameless", "flush"]
}


def check(found: dict[str, int], outside: Path, sockets: bool, files: bool) -> None:
    """What has to work did, and what was to be refused was, as far as the system has what it takes."""
    assert {name for name in WORK if found[name]} == set()
    if sockets:
        assert {found[name] for name in SOCKETS} == {errno.EPERM}
    if files:
        others = found.keys() - SOCKETS - WORK
        assert {name for name in others if found[name] not in (errno.EACCES, errno.EXDEV, errno.EPERM)} == set()
        assert sorted(os.listdir(outside)) == ["file", "folder"]
        assert (outside / "file").read_text() == "kept"


CHILD = """
import json, sys, threading
sys.path[:0] = {paths!r}
from pathlib import Path
import test_confinement as tests
tests.report(*map(Path, sys.argv[1:]))
"""


def report(inside: Path, outside: Path) -> None:
    """Confine this process, which is a child of the test; say what holds, and what an older thread may."""
    ready, found = threading.Event(), []
    thread = threading.Thread(target=lambda: (ready.wait(), found.append(outcome(socket.socket))))
    thread.start()
    held = confine([inside])
    ready.set()
    thread.join()
    print(json.dumps([held, found[0], attempts(inside, outside)]))


@functools.cache
def supported() -> tuple[bool, bool]:
    """Whether this system has seccomp and Landlock, and lets us use them."""
    code = "from pipeline.batch.confinement import confine; print(*map(int, confine([])))"
    told = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    sockets, files = map(int, told.split())
    return bool(sockets), bool(files)


@pytest.fixture
def outside(tmp_path):
    folder = tmp_path / "outside"
    (folder / "folder").mkdir(parents=True)
    (folder / "file").write_text("kept")
    return folder


@pytest.fixture
def walls():
    sockets, files = supported()
    if not (sockets or files):
        pytest.skip(
            f"neither seccomp nor Landlock here ({platform.system()} {platform.release()}, {os.uname().machine})"
        )
    return sockets, files


def test_a_confined_process_reads_and_writes_beneath_its_folder(out, outside, walls):
    code = CHILD.format(paths=[str(ROOT), str(Path(__file__).parent)])
    told = subprocess.run(
        [sys.executable, "-c", code, out, outside], cwd=ROOT, capture_output=True, text=True, check=True
    )
    held, in_thread, found = json.loads(told.stdout)
    assert held == list(walls)
    check(found, outside, *walls)
    if walls[0]:
        assert in_thread == errno.EPERM


def test_landlock_and_seccomp_are_here():
    """Skipped says that the tests above show less on this machine."""
    missing = [name for name, held in zip(("seccomp", "Landlock"), supported(), strict=True) if not held]
    if missing:
        pytest.skip(f"without {' and '.join(missing)}: {platform.system()} {platform.release()}")


def prying(path: Path, config: Config, _allow: object) -> None:
    """A kind of input that takes over its reader, and tries all it can; kernels may still be kept."""
    for folder in (None, cache_folder()):
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"x")
    told = [tempfile.gettempdir(), str(cache_folder()), attempts(config.folder, path.parent)]
    (config.folder / "told.json").write_text(json.dumps(told))
    raise ValueError("told")


PRYING = Kind("record", (".record.nc",), prying)


def test_the_reader_of_a_batch_is_confined_before_its_first_input(out, outside, walls):
    with Isolated(METHODS, 60.0) as child:
        assert child.run(outside / "file", config_of(out, "a", kind=PRYING)).error_class == "ValueError"
        scratch, kernels, found = json.loads((out / "told.json").read_text())
        assert Path(kernels) == cache_folder()
        assert Path(scratch).is_dir()
    check(found, outside, *walls)
    assert not Path(scratch).exists()


def test_a_process_serves_another_batch_only_afresh(tmp_path, monkeypatch):
    processes = Processes(*[lambda _: None] * 3)
    monkeypatch.setattr(isolated, "multiprocessing", processes)
    with Isolated(METHODS, 60.0) as child:
        for name in ("one", "one", "other", "one"):
            child.begin(tmp_path, config_of(tmp_path / name, "a"))
    begun = [process.given for process in processes.made]
    assert [folder.name for _, _, folder, _ in begun] == ["one", "other", "one"]
    assert len({scratch for *_, scratch in begun}) == 3
    assert not any(os.path.exists(scratch) for *_, scratch in begun)


def test_confined_results_are_the_same_numbers(tmp_path, out):
    jobs = []
    for number in range(3):
        path = write_record(tmp_path / f"{number}.record.nc", number)
        kind = Kind("record", (".record.nc",), read_record)
        jobs.append((path, config_of(out, f"deep/{number}", kind=kind, memory=512 << 20)))
    outcomes = [one for each in pooled(jobs, workers=1, methods=METHODS, timeout=60.0) for one in each]
    assert [one.status for one in outcomes] == ["ok"] * 3
    for path, config in jobs:
        direct = process(data_schemas.read(path), method=METHODS[0])
        assert data_schemas.read(config.output).attrs["numbers_sha256"] == direct.attrs["numbers_sha256"]
    assert sorted(os.listdir(out)) == ["deep"]
