"""Confines a process that reads files of anybody's making: it opens no sockets, and changes no files but where it may.

Linux has two walls for that, which hold for the process and all that it starts, for good: a filter of system calls
(seccomp), which refuses those about sockets, and Landlock, which refuses to write, make, rename or remove files other
than beneath named folders. Where the system lacks one, or a container forbids it, the process goes on without.
"""

import contextlib
import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple


class Machine(NamedTuple):
    """What differs between processors; numbers of system calls as in Linux's ``unistd.h``."""

    architecture: int  # ``AUDIT_ARCH_*`` of linux/audit.h, as the filter is told it.
    seccomp: int
    refused: tuple[tuple[int, int], ...]
    """First and last call of each range: about sockets, and io_uring, which opens them by other ways."""


_IO_URING, _X32 = (425, 427), (0x40000000, 0xFFFFFFFF)  # the latter are calls of a second numbering
MACHINES = {
    "x86_64": Machine(0xC000003E, 317, ((41, 55), (288, 288), (299, 299), (307, 307), _IO_URING, _X32)),
    "aarch64": Machine(0xC00000B7, 277, ((198, 212), (242, 243), (269, 269), _IO_URING)),
}

# linux/prctl.h, seccomp.h, bpf_common.h: offsets are those of struct seccomp_data
_NO_NEW_PRIVILEGES = 38
_SET_FILTER, _ALL_THREADS = 1, 1
_LOAD, _RETURN, _EQUAL, _ABOVE, _AT_LEAST = 0x20, 0x06, 0x15, 0x25, 0x35
_CALL, _ARCHITECTURE = 0, 4
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000 | errno.EPERM

# linux/landlock.h; the calls have these numbers on all processors
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION, _BENEATH = 1, 1
_WRITE_FILE, _REMOVE_FILE, _MAKE_FOLDER, _MAKE_FILE, _TRUNCATE = 1 << 1, 1 << 5, 1 << 7, 1 << 8, 1 << 14
_SINCE = {1: 0x1FF2, 2: 1 << 13, 3: _TRUNCATE, 5: 1 << 15}
"""Rights to change anything, by the version of Landlock that brought them."""


def confine(folders: Iterable[Path]) -> tuple[bool, bool]:
    """Confine this process: no sockets, nothing written but beneath folders; whether each of the two holds.

    Landlock holds for the thread that asks and for those it starts, so ask before there are others.
    """
    if sys.platform != "linux" or sys.maxsize < 1 << 32:
        return False, False
    library = ctypes.CDLL(None)
    library.syscall.restype = ctypes.c_long
    library.prctl(_NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))
    return _refuse_sockets(library), _refuse_writing(library, folders)


def socket_filter(machine: Machine) -> bytes:
    """The filter as a classic BPF program: refused calls fail with EPERM, as do all of another architecture."""
    refuse = (_RETURN, 0, 0, _REFUSE)
    program = [(_LOAD, 0, 0, _ARCHITECTURE), (_EQUAL, 1, 0, machine.architecture), refuse, (_LOAD, 0, 0, _CALL)]
    for first, last in machine.refused:
        program += [(_AT_LEAST, 0, 2, first), (_ABOVE, 1, 0, last), refuse]
    return b"".join(struct.pack("=HBBI", *each) for each in [*program, (_RETURN, 0, 0, _ALLOW)])


def ruleset(version: int) -> tuple[int, int, int]:
    """What a version of Landlock can refuse: changes of files, TCP, and abstract sockets and signals to others."""
    files = sum(right for since, right in _SINCE.items() if since <= version)
    return files, 0b11 if version >= 4 else 0, 0b11 if version >= 6 else 0


def _refuse_sockets(library: ctypes.CDLL) -> bool:
    machine = MACHINES.get(platform.machine())
    if machine is None:
        return False
    program = socket_filter(machine)
    held = ctypes.create_string_buffer(program, len(program))
    described = struct.pack("HxxxxxxP", len(program) // 8, ctypes.addressof(held))
    return bool(library.syscall(*_longs(machine.seccomp, _SET_FILTER, _ALL_THREADS), described) == 0)


def _refuse_writing(library: ctypes.CDLL, folders: Iterable[Path]) -> bool:
    version = library.syscall(*_longs(_CREATE_RULESET, 0, 0, _VERSION))
    if version < 1:
        return False
    refused = ruleset(version)
    attributes = struct.pack("QQQ", *refused)  # older systems take more than they know where the rest is zero
    rules = library.syscall(*_longs(_CREATE_RULESET), attributes, *_longs(len(attributes), 0))
    if rules < 0:
        return False
    in_files = refused[0] & (_WRITE_FILE | _TRUNCATE)
    in_folders = in_files | _REMOVE_FILE | _MAKE_FOLDER | _MAKE_FILE
    try:
        for place, rights in [(Path(os.devnull), in_files), *((folder, in_folders) for folder in folders)]:
            with contextlib.suppress(OSError):  # what is not there
                opened = os.open(place, os.O_PATH | os.O_CLOEXEC)
                library.syscall(*_longs(_ADD_RULE, rules, _BENEATH), struct.pack("=Qi", rights, opened), *_longs(0))
                os.close(opened)
        return bool(library.syscall(*_longs(_RESTRICT_SELF, rules, 0)) == 0)
    finally:
        os.close(rules)


def _longs(*numbers: int) -> Iterator[ctypes.c_long]:
    return map(ctypes.c_long, numbers)
