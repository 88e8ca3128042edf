"""Compilation of kernels: every Numba option of the project, chosen here once.

What is compiled is kept on disk, since seconds of compilation at each start are not acceptable at a prompt: one index a
kernel, for its sources as they are now. Numba's own cache watches only the file of the function that was called. What
is compiled for types of other packages (a system from a user's script) is not kept: whoever lacks that script could not
read the index any more.

What a kernel calls becomes a part of it: typed and lowered once, optimised and made machine code with its caller, where
Numba makes of every function a program of its own with wrappers. So the first command compiles in half the time.
"""

import contextlib
import glob
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import caching, codegen, environment, types
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.targetconfig import ConfigStack
from numba.extending import register_jitable
from numba.np import arrayobj

from synth.kernels.cache import PACKAGES, ROOT, WATCHERS, cache_folder, stamp

Function = TypeVar("Function", bound=Callable[..., Any])

_codegen: Any = codegen
_Library: Any = codegen.JITCodeLibrary
_Dispatcher: Any = CPUDispatcher
_Cache: Any = caching.FunctionCache
_Files: Any = caching.IndexDataCacheFile
_Flags: Any = ConfigStack
_Result: Any = CompileResult
_unliteral: Any = types.unliteral
_environment_of: Any = environment.lookup_environment
_LARGE = 40  # blocks: taking in larger parts, each with one caller, costs a fifth of the time, for code no faster
_KEPT = 4  # stamps that are kept of a kernel: branches between which somebody works
_PART = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@register_jitable
def _raise_unequal(source: Any, target: Any) -> None:
    """What Numba does where a slice does not fit, without the numbers in its text: a tenth of all that is compiled."""
    raise ValueError("cannot assign to a slice from an array of another shape")


def _typed_once(resolve: Any) -> Any:
    """What Numba asks all its templates at every sign of a source, once for equal operands: an eighth of all time."""
    known: dict[Any, Any] = {}

    def resolved(function: Any, context: Any, operands: Any, named: Any) -> Any:
        key = function, tuple(operands)
        if named or getattr(function.typing_key, "__module__", "") != "_operator":
            return resolve(function, context, operands, named)
        if key not in known:
            known[key] = resolve(function, context, operands, named)
        return known[key]

    return resolved


def _rolled(machine: Any, opt: int = 2, loop_vectorize: bool = False, slp_vectorize: bool = False) -> Any:
    """Passes of LLVM as Numba has them but for unrolling, a tenth of all time: kernels of the pipeline are as fast."""
    chosen = _codegen.ll.create_pipeline_tuning_options(opt)
    chosen.loop_vectorization, chosen.slp_vectorization, chosen.loop_unrolling = loop_vectorize, slp_vectorize, False
    return _codegen.ll.create_pass_builder(machine, chosen)


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
        """Tell LLVM that nobody else calls the parts: it drops arguments without use, and takes small parts in. By
        other names, as what is emitted later would be bound to them: code of others has parts of its own."""
        for each in self._final_module.functions:
            if not each.is_declaration and each.linkage.name == "linkonce_odr":
                each.linkage, each.name = "internal", f"{each.name}.part"
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
        """What was compiled for a signature, or None; of several processes one compiles, and the others wait."""
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
        part = self._part.overloads[tuple(getattr(sig, "args", sig))]
        if "array(" in str(part.signature.return_type) and self.targetoptions["_nrt"] != _Flags.top_or_none().nrt:
            raise TypeError(f"{self.py_func.__name__} returns arrays: it and who calls it count references, or neither")
        return part.entry_point

    def compile(self, sig: Any) -> Any:
        """Load or compile it for Python, and all that it calls as its parts."""
        generator: Any = cpu_target.target_context.codegen()
        arrays: Any = arrayobj
        function: Any = types.Function.__base__
        builder = _rolled if self.__module__.startswith("pipeline.") else _codegen.create_pass_builder
        with global_compiler_lock:  # what another thread has changed is as it was again
            changes = (
                (generator, "_library_class", _LazyLibrary),
                (arrays, "raise_with_shape_context", _raise_unequal),
                (function, "get_call_type", _typed_once(function.get_call_type)),
                (_codegen, "create_pass_builder", builder),
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
    """Compile a numeric kernel on its first call; plain Python under `NUMBA_DISABLE_JIT=1`. It makes no arrays."""
    return _compile(function)


def making_kernel(function: Function) -> Function:
    """As `kernel`, for what makes arrays: references to all are counted, in it alone."""
    return _compile(function, counting=True)


def summing_kernel(function: Function) -> Function:
    """As `kernel`, for loops that add up many products, which may be reordered and fused: vectors, seven times faster.

    NaN and infinity keep their meaning. Never for error-free transforms.
    """
    return _compile(function, {"reassoc", "contract"})


def _compile(function: Function, fastmath: Iterable[str] = (), *, counting: bool = False) -> Function:
    config: Any = numba.config
    if config.DISABLE_JIT:
        return function
    # `fastmath` stays off: callees inherit it, and error-free transforms (two-sum, two-product) then return zero;
    # "numpy": a division by zero gives inf, not a branch to an exception in the inner loop;
    # `nogil`: threads may run records side by side
    options = {"nopython": True, "fastmath": set(fastmath), "error_model": "numpy", "nogil": True, "_nrt": counting}
    return cast(Function, Kernel(function, targetoptions=options))
