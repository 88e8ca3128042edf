# mypy: disable-error-code="attr-defined,call-arg,import-untyped,no-untyped-call,untyped-decorator"
# (Numba's extension interface has no types, and an intrinsic is called without its first argument.)
"""Sixteen doubles at once, for kernels that must not depend on what the compiler finds out about their loops.

`load(array, (row, start))` takes sixteen neighbours, `store` puts them back, arithmetic works on all, and a plain
number stands for sixteen. Products and sums may be fused, never reordered. Under `NUMBA_DISABLE_JIT=1` the same code
runs on slices of NumPy arrays.
"""

import inspect
import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_model

LANES = 16
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FUSED = ("contract",)
_BY_PLACE = inspect.Parameter.POSITIONAL_OR_KEYWORD


class LanesType(types.Type):
    """Type of sixteen doubles."""

    def __init__(self) -> None:
        super().__init__(name="Lanes16")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """A plain number stands for as many equal ones."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None


lanes_type = LanesType()


@register_model(LanesType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _cast(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    value = context.cast(builder, value, source, types.float64)
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), zeros)


def _operator(symbol: Any, arity: int, lower: Any) -> None:
    class _Template(AbstractTemplate):
        key = symbol

        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and any(isinstance(each, LanesType) for each in args):
                return signature(lanes_type, *[lanes_type] * arity)
            return None

    infer_global(symbol)(_Template)
    lower_builtin(symbol, *[LanesType] * arity)(lambda context, builder, sig, args: lower(builder, *args))


for _method, *_symbols in (
    ("fadd", operator.add, operator.iadd),
    ("fsub", operator.sub, operator.isub),
    ("fmul", operator.mul, operator.imul),
    ("fdiv", operator.truediv),
):
    for _symbol in _symbols:
        _operator(_symbol, 2, lambda builder, *both, method=_method: getattr(builder, method)(*both, flags=_FUSED))


def _declared(module: Any, name: str, result: Any, arguments: list[Any]) -> Any:
    return module.globals.get(name) or ir.Function(module, ir.FunctionType(result, arguments), name)


_FABS = f"llvm.fabs.v{LANES}f64", _VECTOR, [_VECTOR]
_operator(operator.neg, 1, lambda builder, value: builder.fneg(value))
_operator(abs, 1, lambda builder, value: builder.call(_declared(builder.module, *_FABS), [value]))


def _lowered(result: Any, code: Any) -> Any:
    """Decorator: where the function below is compiled, it is these instructions instead."""

    def stand(function: Any) -> Any:
        def typed(typing: Any, *arguments: Any) -> Any:
            return result(*arguments), code

        names = ("typing", *inspect.signature(function).parameters)
        typed.__signature__ = inspect.Signature([inspect.Parameter(name, _BY_PLACE) for name in names])
        instructions = intrinsic(typed)
        overload(function, strict=False)(lambda *arguments: lambda *arguments: instructions(*arguments))
        return function

    return stand


def _address(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Pointer to an element of an array, as to a vector; the second argument is its indices, the last contiguous."""
    array, indices = sig.args[:2]
    if not (isinstance(array, types.Array) and array.dtype == types.float64 and array.layout == "C"):
        raise TypeError(f"lanes want contiguous arrays of doubles, not {array}")
    made = context.make_array(array)(context, builder, args[0])
    offset = ir.Constant(ir.IntType(64), 0)
    for k in range(array.ndim):
        index = context.cast(builder, builder.extract_value(args[1], k), indices[k], types.intp)
        stride = builder.extract_value(made.strides, k)
        offset = builder.add(offset, builder.mul(index, stride, flags=("nsw",)), flags=("nsw",))
    base = builder.bitcast(made.data, ir.IntType(8).as_pointer())
    return builder.bitcast(builder.gep(base, [offset], inbounds=True), _VECTOR.as_pointer())


def _sum(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    name = f"llvm.vector.reduce.fadd.v{LANES}f64"
    function = _declared(builder.module, name, ir.DoubleType(), [ir.DoubleType(), _VECTOR])
    return builder.call(function, [ir.Constant(ir.DoubleType(), -0.0), args[0]], fastmath=("reassoc",))


def _above_zero(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    value = context.cast(builder, args[0], sig.args[0], lanes_type)
    above = builder.fcmp_ordered(">", value, ir.Constant(_VECTOR, [0.0] * LANES))
    return builder.select(above, value, ir.Constant(_VECTOR, [float("nan")] * LANES))


def _put(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    value = context.cast(builder, args[2], sig.args[2], lanes_type)
    builder.store(value, _address(context, builder, sig, args), align=8)
    return context.get_dummy_value()


@_lowered(lanes_type, lambda context, builder, *of: builder.load(_address(context, builder, *of), align=8))
def load(array: Any, indices: tuple[int, ...]) -> Any:
    """Sixteen neighbours of a contiguous array from this element on."""
    return array[(*indices[:-1], slice(indices[-1], indices[-1] + LANES))].copy()


@_lowered(types.void, _put)
def store(array: Any, indices: tuple[int, ...], value: Any) -> None:
    """Put sixteen neighbours back."""
    array[(*indices[:-1], slice(indices[-1], indices[-1] + LANES))] = value


@_lowered(types.float64, _sum)
def total(value: Any) -> float:
    """Sum of them."""
    return float(np.sum(value))


@_lowered(lanes_type, _above_zero)
def positive(value: Any) -> Any:
    """The value where it is above zero, elsewhere NaN."""
    return np.where(value > 0.0, value, np.nan)
