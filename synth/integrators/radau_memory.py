"""Working space without reference counts.

Numba counts references to every array that a kernel is handed, with atomic instructions: in a step of a system of two
unknowns they took half of the time. Kernels are therefore handed addresses into one array, which the caller keeps
alive, and index them as flat arrays; a matrix (m, n) is walked as `i * n + j`. Without compilation an address is a
view, and the same code runs.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils as _builders
from numba.core import types
from numba.extending import intrinsic, overload

cgutils: Any = _builders  # numba is without types
pointer: Any = types.CPointer


def address(array: Any, start: int) -> Any:
    """The 1-D `array` from element `start` on; it must outlive the address."""
    return array[start:]


def _typed(context: Any, array: Any, start: Any) -> Any:
    def generate(builder_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = builder_context.make_array(signature.args[0])(builder_context, builder, arguments[0])
        return cgutils.gep_inbounds(builder, made.data, arguments[1])

    return pointer(array.dtype)(array, start), generate


_address: Any = intrinsic(_typed)
overload(address, strict=False)(lambda array, start: lambda array, start: _address(array, start))
