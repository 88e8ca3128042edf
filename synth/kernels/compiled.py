"""Compilation of kernels: every Numba option of the project, chosen here once.

What is compiled is kept on disk (`stored.py`): seconds of compilation at each start are not acceptable at a prompt.

What a kernel calls becomes a part of it: typed and lowered once, optimised and made machine code with its caller. Numba
makes of every function that another one calls a program of its own, which Python could call and does not: wrappers that
unpack the arguments, all of LLVM's passes, machine code. Without that the first command compiles in half the time, to
code that runs as fast.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import codegen, environment, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.extending import register_jitable
from numba.np import arrayobj

from synth.kernels.stored import Stored

Function = TypeVar("Function", bound=Callable[..., Any])

_Library: Any = codegen.JITCodeLibrary
_Dispatcher: Any = CPUDispatcher
_unliteral: Any = types.unliteral
_environment_of: Any = environment.lookup_environment
_LARGE = 40  # blocks: taking in larger parts, each with one caller, costs a fifth of the time, for code no faster
_PART = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@register_jitable
def _raise_unequal(source: Any, target: Any) -> None:
    """What Numba does where a slice does not fit, without the numbers in its text: a tenth of all that is compiled."""
    raise ValueError("cannot assign to a slice from an array of another shape")


def _typed_once(resolve: Any) -> Any:
    """What Numba asks all its templates at every sign of a source, once for all of equal operands: an eighth of all
    time."""
    known: dict[Any, Any] = {}

    def resolved(function: Any, context: Any, operands: Any, named: Any) -> Any:
        key = function, tuple(operands)
        if named or getattr(function.typing_key, "__module__", "") != "_operator":
            return resolve(function, context, operands, named)
        if key not in known:
            known[key] = resolve(function, context, operands, named)
        return known[key]

    return resolved


class _LazyLibrary(_Library):  # type: ignore[misc]  # Numba is untyped
    """A library that is optimised and turned into machine code when somebody asks for an address in it."""

    _emitted = False

    def _optimize_functions(self, ll_module: Any) -> None:
        """Nothing yet: all is done with the caller."""
        ll_module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Link what it calls, and no more."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def _finalize_final_module(self) -> None:
        self._emitted = True
        super()._finalize_final_module()
        for each in self._final_module.global_variables:
            known = _environment_of(each.name)
            if known is not None:
                self._codegen.set_env(each.name, known)

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function; 0 for a wrapper that was not made."""
        self._ensure_finalized()
        if not self._emitted:
            if all(each.name != name for each in self._final_module.functions):
                return 0
            self._make_own()
            self._optimize_final_module()
            self._final_module.verify()
            self._finalize_final_module()
        return int(super().get_pointer_to_function(name))

    def _make_own(self) -> None:
        """Tell LLVM that nobody else calls the parts: it drops arguments without use, and takes small parts in."""
        for each in self._final_module.functions:
            if not each.is_declaration and each.linkage.name == "linkonce_odr":
                each.linkage = "internal"
                if sum(1 for _ in each.blocks) > _LARGE:
                    each.add_function_attribute("noinline")

    @property
    def codegen(self) -> Any:
        """Who is told of the function's environment: nobody while there is no machine code that could ask for it."""
        return self._codegen if self._emitted else self

    def serialize_using_object_code(self) -> Any:
        """Machine code, and the names in it; who calls the kernel in another process compiles a part of its own."""
        self._ensure_finalized()
        every = (*self._final_module.functions, *self._final_module.global_variables)
        names = [each.name for each in every if not each.is_declaration]
        return self.name, "object", (self._get_compiled_object(), names)

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, _, (code, names) = state
        self = cls(codegen, name)
        self.enable_object_caching()
        self._set_compiled_object(code)
        self._finalize_final_module()
        codegen._engine._defined_symbols.update(names)
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing to do; see `codegen`."""


class Kernel(_Dispatcher):  # type: ignore[misc]
    """A compiled function that Python and other kernels call; for the latter it compiles a part of them."""

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None, **more: Any) -> None:
        super().__init__(py_func, locals or {}, {**targetoptions, "no_cfunc_wrapper": True}, **more)
        self._part = _Dispatcher(py_func, {}, {**targetoptions, **_PART})
        self._cache = Stored(py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Signature for a caller; numbers that stand in its source are like others, not a type of their own."""
        plain = {name: _unliteral(each) for name, each in kws.items()}
        return self._part.get_call_template([_unliteral(each) for each in args], plain)

    def get_overload(self, sig: Any) -> Any:
        """The function that its callers link."""
        return self._part.get_overload(sig)

    def compile(self, sig: Any) -> Any:
        """Load or compile it for Python, and all that it calls as its parts."""
        generator: Any = cpu_target.target_context.codegen()
        arrays: Any = arrayobj
        function: Any = types.Function.__base__
        with global_compiler_lock:  # what another thread has changed is as it was again
            changes = (
                (generator, "_library_class", _LazyLibrary),
                (arrays, "raise_with_shape_context", _raise_unequal),
                (function, "get_call_type", _typed_once(function.get_call_type)),
            )
            before = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
            try:
                for change in changes:
                    setattr(*change)
                return super().compile(sig)
            finally:
                for change in before:
                    setattr(*change)
                self._cache.release()


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
    # `fastmath` stays off: callees inherit it, and error-free transforms (two-sum, two-product) then return zero;
    # "numpy": a division by zero gives inf, not a branch to an exception in the inner loop;
    # `nogil`: threads may run records side by side
    options = {"nopython": True, "fastmath": fastmath, "error_model": "numpy", "nogil": True}
    return cast(Function, Kernel(function, targetoptions=options))
