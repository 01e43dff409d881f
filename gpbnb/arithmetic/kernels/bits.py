"""Machine operations that Python does not offer: fused multiply-add, integer views, the high half of a product."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_WIDE = ir.IntType(128)


@intrinsic
def fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` in float64, rounded once."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen


@intrinsic
def bits(typingctx: Any, x: Any) -> Any:
    """The 64 bits of a float64 as an int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), codegen


@intrinsic
def from_bits(typingctx: Any, n: Any) -> Any:
    """The float64 with these 64 bits, given as an int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), codegen


@intrinsic
def high_product(typingctx: Any, a: Any, b: Any) -> Any:
    """The upper 64 bits of the product of two uint64; ``a * b`` is the lower."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        product = builder.mul(builder.zext(args[0], _WIDE), builder.zext(args[1], _WIDE))
        return builder.trunc(builder.lshr(product, ir.Constant(_WIDE, 64)), ir.IntType(64))

    return types.uint64(types.uint64, types.uint64), codegen


@intrinsic
def leading_zeros(typingctx: Any, n: Any) -> Any:
    """Number of zero bits above the highest set bit of a uint64, as an int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.ctlz(args[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), codegen


@intrinsic
def trailing_zeros(typingctx: Any, n: Any) -> Any:
    """Number of zero bits below the lowest set bit of a uint64, as an int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 0))

    return types.int64(types.uint64), codegen


@intrinsic
def select(typingctx: Any, condition: Any, a: Any, b: Any) -> Any:
    """``a if condition else b`` without a branch, for two numbers of the same type."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return a(types.boolean, a, a), codegen


def _adding_multiples(width: int) -> Any:
    bits_of_all, doubles = ir.VectorType(ir.IntType(64), width), ir.VectorType(ir.DoubleType(), width)
    first = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)

    def repeated(builder: Any, x: Any, kind: Any) -> Any:
        nothing = ir.Constant(kind, ir.Undefined)
        return builder.shuffle_vector(builder.insert_element(nothing, x, ir.IntType(32)(0)), nothing, first)

    @intrinsic
    def add_multiples(typingctx: Any, c: Any, i: Any, b: Any, k: Any, factor: Any, half: Any, mask: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            def at(array: int) -> Any:
                made = context.make_array(signature.args[array])(context, builder, args[array])
                return builder.bitcast(builder.gep(made.data, [args[array + 1]]), doubles.as_pointer())

            def load(place: Any) -> Any:
                found = builder.load(place)
                found.align = 8
                return found

            def rounded(x: Any) -> Any:
                u = builder.add(builder.bitcast(x, bits_of_all), repeated(builder, args[5], bits_of_all))
                return builder.bitcast(builder.and_(u, repeated(builder, args[6], bits_of_all)), doubles)

            place = at(0)
            multiples = rounded(builder.fmul(repeated(builder, args[4], doubles), load(at(2))))
            builder.store(rounded(builder.fadd(load(place), multiples)), place).align = 8
            return context.get_dummy_value()

        return types.void(c, types.int64, b, types.int64, types.float64, types.int64, types.int64), codegen

    return add_multiples


ADDING_MULTIPLES = tuple(_adding_multiples(width) for width in (4, 2, 1))
"""Functions that add multiples of 4, 2 or 1 float64 to others, since compilers do not vectorize loops over so few.

``f(c, i, b, k, factor, half, mask)`` takes arrays contiguous in memory from their entries i and k on, and rounds each
product and each sum by adding `half` to its bits and taking those of `mask`.
"""
