"""Compiled kernels on disk: one index a kernel, for the sources that it was made from as they are now.

Numba's own cache watches only the file of the function that was called: a kernel edited in another file would silently
run old code. What is compiled for types of other packages (a system from a user's script) is not kept: whoever lacks
that script could not read the index any more.
"""

from __future__ import annotations

import contextlib
import glob
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching, types
from numba.core.compiler import CompileResult

from synth.kernels.cache import PACKAGES, ROOT, WATCHERS, cache_folder, stamp

_KEPT = 4
"""Stamps that are kept of a kernel: branches between which somebody works."""

_Cache: Any = caching.FunctionCache
_Files: Any = caching.IndexDataCacheFile
_Result: Any = CompileResult


class Stored(_Cache):  # type: ignore[misc]  # Numba is untyped
    """What was compiled of a kernel, by types of its arguments."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func, self._name = function, repr(function)
        self._impl = None  # of numba's own ways to find a folder
        self._held: int | None = None
        self.enable()

    @property
    def cache_path(self) -> str:
        """Where all is."""
        return str(cache_folder())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature, from the present sources; None if nothing was.

        Of several processes that miss a kernel one compiles it, and the others wait until it is there.
        """
        file = self._file(sig)
        target_context.refresh()
        found = self._read(file, sig, target_context)
        if found is None and file is not None:
            self._hold()
            found = self._read(file, sig, target_context)
        if found is None:
            for watcher in WATCHERS:
                watcher(self._py_func.__name__)
        return found

    def _read(self, file: Any, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(OSError):
            data = None if file is None else file.load(self._index_key(sig, target_context.codegen()))
            return None if data is None else _Result._rebuild(target_context, *data)

    def _hold(self) -> None:
        """Let other processes wait; where the system has no such locks, each compiles for itself."""
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            self._held = os.open(cache_folder(), os.O_RDONLY)
            fcntl.flock(self._held, fcntl.LOCK_EX)

    def release(self) -> None:
        """Let other processes go on."""
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the machine code of one signature, or not."""
        file = self._file(sig)
        if file is None or data.library.has_dynamic_globals:
            return
        with contextlib.suppress(OSError):  # a full disk costs the next command time, and this one nothing
            file.save(self._index_key(sig, data.codegen), data._reduce())
            self._prune()

    def _file(self, sig: Any) -> Any:
        arguments = getattr(sig, "args", sig)
        modules = {name for each in arguments for name in _modules(each)}
        if any(name.split(".")[0] not in PACKAGES for name in modules):
            return None
        made_from = stamp(self._py_func.__code__.co_filename, modules)
        if made_from is None:
            return None
        return _Files(self.cache_path, f"{self._base}-{made_from}", made_from)

    @property
    def _base(self) -> str:
        code = self._py_func.__code__
        path = Path(code.co_filename)
        place = path.relative_to(ROOT) if path.is_relative_to(ROOT) else Path(path.name)
        return ".".join([*place.with_suffix("").parts, code.co_qualname.replace("<locals>.", "")])

    def _prune(self) -> None:
        folder = cache_folder()
        indexes = folder.glob(f"{glob.escape(self._base)}-{'?' * 16}.nbi")
        for index in sorted(indexes, key=lambda each: each.stat().st_mtime)[:-_KEPT]:
            for file in folder.glob(f"{glob.escape(index.stem)}.*"):
                file.unlink(missing_ok=True)


def _modules(argument: Any) -> Iterator[str]:
    """Where the types are defined that an argument's type names."""
    kinds: Any = types
    if isinstance(argument, kinds.BaseNamedTuple):
        yield argument.instance_class.__module__
    if isinstance(argument, kinds.BaseTuple):
        for each in argument.types:
            yield from _modules(each)
