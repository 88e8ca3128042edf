"""Writes a tree to a file that is either whole or not there.

The file is made in memory, written under a temporary name in the same folder, flushed to the disk, read back,
compared with what was meant, and only then given its name: a full disk, a kill or a fault of the library
leaves the folder as it was.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from .checksum import ATTRIBUTE, digest
from .contents import from_tree, shown
from .encoding import encoded
from .errors import FileError

if TYPE_CHECKING:
    import xarray as xr

_BLOCK = 1 << 22  # bytes


def write(tree: xr.DataTree, path: str | os.PathLike[str], *, overwrite: bool = False, owner: str = "") -> None:
    """Write a record, truth or result.

    Parameters
    ----------
    tree : xarray.DataTree
        Variables of plain numbers or text. What they mean is not looked at: that is `check`.
    path : path
        Of the file to make; its folder must exist.
    overwrite : bool
        Whether an existing file may be replaced.
    owner : str
        Of the temporary file, part of its name.

    Raises
    ------
    FileError
        The file exists, the folder does not or cannot be written, the disk is full, or a variable has a type
        or name that no file can hold. Nothing is left behind, and an older file stays as it was.
    """
    with _placed(path, overwrite, owner) as temporary:
        try:
            contents = from_tree(tree)
            contents[""].attrs.pop(ATTRIBUTE, None)
            contents[""].attrs[ATTRIBUTE] = digest(contents)
            image = encoded(contents)
        except FileError as error:
            raise FileError(f"{shown(path, 400)}: {error}") from None
        _flushed(temporary, image)
        if not _verified(temporary, image):
            raise FileError(f"{shown(path, 400)}: was not written, the disk gives other bytes back; check the disk")


def write_text(text: str, path: str | os.PathLike[str], *, overwrite: bool = False, owner: str = "") -> None:
    """Write a text file that is either whole or not there, UTF-8; raises as `write`."""
    with _placed(path, overwrite, owner) as temporary:
        _flushed(temporary, memoryview(text.encode()))


@contextlib.contextmanager
def _placed(path: str | os.PathLike[str], overwrite: bool, owner: str) -> Iterator[Path]:
    """A temporary path beside that of a file: it gets the file's name at the end, or is removed after a fault."""
    target = place_of(path)
    temporary = beside(target, owner)
    try:
        may_write(target, path, overwrite)
        yield temporary
        give_name(temporary, target, path, overwrite)
    except OSError as error:
        raise FileError(f"{shown(path, 400)}: cannot be written, {reason(error)}") from error
    finally:
        # gone already when it was renamed; a folder that went away took it along
        with contextlib.suppress(OSError):
            temporary.unlink()


def place_of(path: str | os.PathLike[str]) -> Path:
    """Where a file of that name goes: folders may be links, a link of the name itself is replaced, not followed."""
    folder, name = os.path.split(os.fspath(path))
    return Path(os.path.realpath(folder or os.curdir), name)


def may_write(target: Path, path: str | os.PathLike[str], overwrite: bool) -> None:
    """Refuse a place where no file can be, or where one is that may not be replaced.

    `FileError`; `OSError` where the folder cannot be looked into.
    """
    if not target.parent.is_dir():
        raise FileError(f"{shown(path, 400)}: its folder does not exist; make the folder first")
    if not os.path.lexists(target):
        return
    if target.is_dir() or not (target.is_file() or target.is_symlink()):
        raise FileError(f"{shown(path, 400)}: is not an ordinary file; give the path of a file")
    if not overwrite:
        raise _exists(path)


def beside(target: Path, owner: str = "") -> Path:
    """A temporary name of its own in the folder of the target."""
    return target.with_name(f".isochrony-{owner}{secrets.token_hex(8)}.part")


def _exists(path: str | os.PathLike[str]) -> FileError:
    return FileError(f"{shown(path, 400)}: exists already; give --force (overwrite=True) to replace it")


def _flushed(temporary: Path, image: memoryview) -> None:
    """Write all bytes to a new file and wait until they are on the disk."""
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    with os.fdopen(descriptor, "wb") as file:
        file.write(image)
        file.flush()
        os.fsync(file.fileno())


def _verified(temporary: Path, image: memoryview) -> bool:
    """Whether a file holds these bytes."""
    with open(temporary, "rb") as file:
        return all(file.read(_BLOCK) == image[at : at + _BLOCK] for at in range(0, len(image) + 1, _BLOCK))


def give_name(temporary: Path, target: Path, path: str | os.PathLike[str], overwrite: bool) -> None:
    """Give a file its name in one step, and make the folder remember it.

    `FileError`: a file of that name appeared in the meantime; `OSError`: the file system refuses.
    """
    if overwrite:
        os.replace(temporary, target)
    else:
        try:
            os.link(temporary, target)  # unlike a rename, refuses a file that appeared in the meantime
        except FileExistsError:
            raise _exists(path) from None
        except OSError:  # a file system without hard links
            os.replace(temporary, target)
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Make a folder remember the names in it, also through a power cut; `OSError` where the file system fails."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def reason(error: OSError) -> str:
    """What the system says, and the remedy."""
    return f"{error.strerror or shown(error)}; free space, or choose a folder you may write to"
