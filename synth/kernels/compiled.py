"""Every Numba option of the project, chosen here once.

`cache=True` because a cold compile of seconds at each start is not acceptable to a person at a prompt.
`fastmath` stays off: callees inherit it, and error-free transforms (two-sum, two-product) then return zero.
Plain sums of products may be reordered, by name (`summing_kernel`).
`error_model="numpy"` because a division by zero must give inf, not a branch to an exception in the inner loop.
`nogil=True` so that threads may run records side by side.

What is compiled for types of other packages (a system from a user's script) is not kept: whoever lacks that script
could not read the index any more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import caching, types

from synth.kernels.cache import PACKAGES, cache_folder
from synth.kernels.parts import Kernel

Function = TypeVar("Function", bound=Callable[..., Any])

_Cache: Any = caching.FunctionCache


class _OwnCache(_Cache):  # type: ignore[misc]  # Numba is untyped
    """Keeps what is compiled for types of this project alone."""

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the machine code of one signature, or not."""
        if all(_is_known(argument) for argument in getattr(sig, "args", sig)):
            super().save_overload(sig, data)


def _is_known(argument: Any) -> bool:
    """Whether an argument's type can be named without anybody else's module."""
    kinds: Any = types
    if isinstance(argument, kinds.BaseNamedTuple):
        named = argument.instance_class.__module__.split(".")[0] in PACKAGES
        return named and all(_is_known(each) for each in argument.types)
    if isinstance(argument, kinds.BaseTuple):
        return all(_is_known(each) for each in argument.types)
    return True


def kernel(function: Function) -> Function:
    """Compile a numeric kernel on its first call; plain Python under `NUMBA_DISABLE_JIT=1`."""
    return _compile(function, fastmath=False)


def summing_kernel(function: Function) -> Function:
    """As `kernel`, for loops that add up many products.

    Sums may be reordered and fused, which lets LLVM use vector instructions (seven times faster for a
    Gram matrix); NaN and infinity keep their meaning. Never for error-free transforms.
    """
    return _compile(function, fastmath={"reassoc", "contract"})


def _compile(function: Function, fastmath: bool | set[str]) -> Function:
    config: Any = numba.config
    if config.DISABLE_JIT:
        return function
    options = {"nopython": True, "fastmath": fastmath, "error_model": "numpy", "nogil": True}
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())
    try:
        compiled: Any = Kernel(function, targetoptions=options)
        compiled._cache = _OwnCache(function)  # as `cache=True` does, with a choice of what to keep
    finally:
        config.CACHE_DIR = before
    return cast(Function, compiled)
