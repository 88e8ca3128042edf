"""Every Numba option of the project, chosen here once.

What is compiled is kept on disk (`stored.py`): a compile of seconds at each start is not acceptable to a person at a
prompt.
`fastmath` stays off: callees inherit it, and error-free transforms (two-sum, two-product) then return zero.
Plain sums of products may be reordered, by name (`summing_kernel`).
`error_model="numpy"` because a division by zero must give inf, not a branch to an exception in the inner loop.
`nogil=True` so that threads may run records side by side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from synth.kernels.parts import Kernel

Function = TypeVar("Function", bound=Callable[..., Any])


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
    return cast(Function, Kernel(function, targetoptions=options))
