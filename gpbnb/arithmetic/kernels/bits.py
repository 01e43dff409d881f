"""What Python does not offer: fused multiply-add, integer views, the high half of a product, memory, addresses."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_WIDE = ir.IntType(128)


def instruction(result: Any, *operands: Any) -> Callable[[Any], Any]:
    """Decorate a function that takes the builder of a compiled function, and values of some types, with their types."""

    def decorate(emit: Any) -> Any:
        @wraps(emit)
        def typed(typingctx: Any, *given: Any) -> Any:
            return result(*operands), lambda context, builder, signature, args: emit(builder, *args)

        return intrinsic(typed)

    return decorate


@instruction(types.float64, types.float64, types.float64, types.float64)
def fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` in float64, rounded once."""
    return builder.fma(a, b, c)


@instruction(types.int64, types.float64)
def bits(builder: Any, x: Any) -> Any:
    """The 64 bits of a float64 as an int64."""
    return builder.bitcast(x, ir.IntType(64))


@instruction(types.float64, types.int64)
def from_bits(builder: Any, n: Any) -> Any:
    """The float64 with these 64 bits, given as an int64."""
    return builder.bitcast(n, ir.DoubleType())


@instruction(types.uint64, types.uint64, types.uint64)
def high_product(builder: Any, a: Any, b: Any) -> Any:
    """The upper 64 bits of the product of two uint64; ``a * b`` is the lower."""
    product = builder.mul(builder.zext(a, _WIDE), builder.zext(b, _WIDE))
    return builder.trunc(builder.lshr(product, ir.Constant(_WIDE, 64)), ir.IntType(64))


@instruction(types.int64, types.uint64)
def leading_zeros(builder: Any, n: Any) -> Any:
    """Number of zero bits above the highest set bit of a uint64, as an int64."""
    return builder.ctlz(n, ir.Constant(ir.IntType(1), 0))


@instruction(types.int64, types.uint64)
def trailing_zeros(builder: Any, n: Any) -> Any:
    """Number of zero bits below the lowest set bit of a uint64, as an int64."""
    return builder.cttz(n, ir.Constant(ir.IntType(1), 0))


@intrinsic
def select(typingctx: Any, condition: Any, a: Any, b: Any) -> Any:
    """``a if condition else b`` without a branch, for two numbers of the same type."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return a(types.boolean, a, a), codegen


@intrinsic
def start(typingctx: Any, array: Any) -> Any:
    """The entries of an array whose entries follow each other in memory."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.make_array(array)(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def at(typingctx: Any, entries: Any, index: Any) -> Any:
    """The entries at an address from an index on."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.gep(args[0], [context.cast(builder, args[1], index, types.intp)])

    return entries(entries, index), codegen


@intrinsic
def copy(typingctx: Any, to: Any, given: Any, count: Any) -> Any:
    """Copy entries at an address to another one."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        to, given, count = args
        size = context.get_abi_sizeof(to.type.pointee)
        cgutils.raw_memcpy(builder, to, given, context.cast(builder, count, signature.args[2], types.intp), size)
        return context.get_dummy_value()

    return types.void(to, given, count), codegen


@intrinsic
def entries(typingctx: Any, table: Any, index: Any, kind: Any) -> Any:
    """The entries of a type, such as ``np.float64``, at the address that an entry of a table holds."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        place = builder.gep(args[0], [context.cast(builder, args[1], index, types.intp)])
        return builder.inttoptr(builder.load(place), context.get_value_type(signature.return_type))

    return types.CPointer(kind.instance_type)(table, index, kind), codegen


@intrinsic
def words(typingctx: Any, address: Any) -> Any:
    """The int64 at an address."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.int64)(address), codegen


@intrinsic
def call(typingctx: Any, address: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Call the function of four arguments at an address, which returns an int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        given, kinds = args[1:], signature.args[1:]
        kind = context.call_conv.get_function_type(types.int64, kinds)
        function = builder.inttoptr(args[0], kind.as_pointer())
        status, found = context.call_conv.call_function(builder, function, types.int64, kinds, given)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return found

    return types.int64(address, a, b, c, d), codegen
