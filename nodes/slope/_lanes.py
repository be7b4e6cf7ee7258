"""Sixteen numbers side by side in compiled loops, as ``lanes.clh`` has them for kernels.

The compiler vectorises a loop over pixels only if it can tell that no array overlaps another.
These types are vectors from the start, on any processor.  numba caches a compiled function until
its own file changes: after a change here, touch the files that import this one.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

LANES = 16
Floats = Any
"""In signatures: LANES numbers, float32."""
Ints = Any
"""The same, int32."""


class _Lanes(types.Type):
    def __init__(self, element: Any) -> None:
        super().__init__(name=f"Lanes({element})")


_FLOATS, _INTS, _MASK = (_Lanes(t) for t in (types.float32, types.int32, types.boolean))
_OF = {types.float32: _FLOATS, types.int32: _INTS}
_I32, _I64 = ir.IntType(32), ir.IntType(64)
_VECTORS = {
    _FLOATS: ir.VectorType(ir.FloatType(), LANES),
    _INTS: ir.VectorType(_I32, LANES),
    _MASK: ir.VectorType(ir.IntType(1), LANES),
}


@register_model(_Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Lanes) -> None:
        super().__init__(manager, kind, _VECTORS[kind])


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    """The address of LANES elements of an array."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), _VECTORS[_OF[kind.dtype]].as_pointer())


@intrinsic
def load(typing: Any, array: Any, at: Any) -> Any:
    """LANES elements of an array of one dimension, from `at` on."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, signature.args[0], *args), align=4)

    return _OF[array.dtype](array, types.int64), emit


@intrinsic
def store(typing: Any, value: Any, array: Any, at: Any) -> Any:
    """Put lanes into an array of one dimension, from `at` on."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[0], _place(context, builder, signature.args[1], *args[1:]), align=4)
        return context.get_dummy_value()

    return types.void(value, array, types.int64), emit


@intrinsic
def splat(typing: Any, value: Any) -> Any:
    """One float32 or int32 in all lanes."""
    kind = _OF[value]

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        empty = ir.Constant(_VECTORS[kind], ir.Undefined)
        first = builder.insert_element(empty, args[0], _I32(0))
        return builder.shuffle_vector(first, empty, _numbers([0] * LANES))

    return kind(value), emit


@intrinsic
def choose(typing: Any, mask: Any, a: Any, b: Any) -> Any:
    """`a` in the lanes where the mask holds, `b` in the others."""
    return a(mask, a, a), lambda _context, builder, _signature, args: builder.select(*args)


@intrinsic
def lanes_of(typing: Any, mask: Any) -> Any:
    """The lanes where a mask holds, as an integer of a bit each."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _I64)

    return types.int64(mask), emit


@intrinsic
def lowest_bit(typing: Any, bits: Any) -> Any:
    """The place of the lowest bit of an integer that is not zero."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.IntType(1)(1))

    return types.int64(types.int64), emit


@intrinsic
def multiply_add(typing: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once if the processor has an instruction for it."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vector = _VECTORS[_FLOATS]
        kind, name = ir.FunctionType(vector, [vector] * 3), f"llvm.fmuladd.v{LANES}f32"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)

    return _FLOATS(_FLOATS, _FLOATS, _FLOATS), emit


Pair = Callable[[Any, Any, Any], Any]
"""Instructions on two vectors, by the builder."""


def _lesser(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def _greater(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _lane_by_lane(pair: Pair, kind: _Lanes, result: _Lanes) -> Any:
    @intrinsic
    def made(typing: Any, a: Any, b: Any) -> Any:
        return result(kind, kind), lambda _context, builder, _kind, args: pair(builder, *args)

    return made


less_of = _lane_by_lane(_lesser, _FLOATS, _FLOATS)
more_of = _lane_by_lane(_greater, _FLOATS, _FLOATS)


def _numbers(of: list[int]) -> Any:
    return ir.Constant(ir.VectorType(_I32, len(of)), of)


def _of_all_lanes(pair: Pair) -> Any:
    @intrinsic
    def made(typing: Any, value: Any) -> Any:
        def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            (left,), half = args, LANES // 2
            while half:
                low, high = (
                    builder.shuffle_vector(left, left, _numbers([*range(first, first + half)]))
                    for first in (0, half)
                )
                left, half = pair(builder, low, high), half // 2
            return builder.extract_element(left, _I32(0))

        return types.float32(_FLOATS), emit

    return made


lowest_lane = _of_all_lanes(_lesser)
highest_lane = _of_all_lanes(_greater)


def _operator(operation: Any, pairs: dict[_Lanes, Pair], result: _Lanes) -> None:
    """Give an operator of the language a meaning for lanes of the same kind."""
    made = {kind: _lane_by_lane(pair, kind, result) for kind, pair in pairs.items()}

    @overload(operation)
    def chosen(a: Any, b: Any) -> Any:
        found: Any = made.get(a) if a == b else None

        def call(a: Any, b: Any) -> Any:
            return found(a, b)

        return found and call


def _compared(sign: str) -> dict[_Lanes, Pair]:
    return {
        _FLOATS: lambda builder, a, b: builder.fcmp_ordered(sign, a, b),
        _INTS: lambda builder, a, b: builder.icmp_signed(sign, a, b),
    }


_operator(operator.add, {_FLOATS: lambda builder, a, b: builder.fadd(a, b)}, _FLOATS)
_operator(operator.sub, {_FLOATS: lambda builder, a, b: builder.fsub(a, b)}, _FLOATS)
_operator(operator.mul, {_FLOATS: lambda builder, a, b: builder.fmul(a, b)}, _FLOATS)
_operator(operator.and_, {_MASK: lambda builder, a, b: builder.and_(a, b)}, _MASK)
_operator(operator.or_, {_MASK: lambda builder, a, b: builder.or_(a, b)}, _MASK)
_operator(operator.lt, _compared("<"), _MASK)
_operator(operator.le, _compared("<="), _MASK)
_operator(operator.eq, _compared("=="), _MASK)
