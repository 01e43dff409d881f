"""Products of matrices in double-double, with high and low parts apart and four sums at a time.

Compilers do not vectorize loops over pairs. The operations, and all digits, are those of
:mod:`gpbnb.arithmetic.kernels.doubledouble`, but no result is checked: the range of the operands is looked at before.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from gpbnb.arithmetic.kernels.bits import bits
from gpbnb.arithmetic.kernels.compiling import borrowing
from gpbnb.arithmetic.kernels.tags import DoubleDouble

WIDTH = 4
ROWS = 8  # whose sums are computed in turns, since each addition waits for the one before it
LEAST_PRODUCTS = 32  # multiplications, from which on taking the parts apart pays
# The parts of numbers with such parts are multiples of 2**-402. So those of products and of their sums are multiples
# of 2**-804, and below 2**1000.
_LEAST, _LIMIT = np.int64((1023 - 350) << 52), np.int64((1023 + 400) << 52)
_MAGNITUDE = np.int64(2**63 - 1)

_DOUBLES = ir.VectorType(ir.DoubleType(), WIDTH)
_FIRST = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)


class _Vectors:
    """Double-double arithmetic on vectors, unchecked: a builder's instructions for :mod:`doubledouble`'s functions."""

    def __init__(self, builder: Any) -> None:
        self.builder, name = builder, f"llvm.fma.v{WIDTH}f64"
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES] * 3)
        self._fma = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)

    def repeated(self, x: Any) -> Any:
        nothing = ir.Constant(_DOUBLES, ir.Undefined)
        return self.builder.shuffle_vector(self.builder.insert_element(nothing, x, ir.IntType(32)(0)), nothing, _FIRST)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        return self.builder.call(self._fma, [a, b, c])

    def two_sum(self, a: Any, b: Any) -> Any:
        plus, minus = self.builder.fadd, self.builder.fsub
        s = plus(a, b)
        c = minus(s, a)
        return s, plus(minus(a, minus(s, c)), minus(b, c))

    def fast_two_sum(self, a: Any, b: Any) -> Any:
        s = self.builder.fadd(a, b)
        return s, self.builder.fsub(b, self.builder.fsub(s, a))

    def add(self, a: Any, b: Any) -> Any:
        s, e = self.two_sum(a[0], b[0])
        t, f = self.two_sum(a[1], b[1])
        s, e = self.fast_two_sum(s, self.builder.fadd(e, t))
        return self.fast_two_sum(s, self.builder.fadd(e, f))

    def multiply(self, a: Any, b: Any) -> Any:
        p = self.builder.fmul(a[0], b[0])
        e = self.fma(a[0], b[0], self.builder.fneg(p))
        others = self.fma(a[0], b[1], self.fma(a[1], b[0], self.builder.fmul(a[1], b[1])))
        return self.fast_two_sum(p, self.builder.fadd(e, others))


def _adding_products(left: bool) -> Any:
    @intrinsic
    def add_products(typingctx: Any, parts: Any, s: Any, t: Any, x: Any, y: Any, high: Any, low: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            made, vectors = context.make_array(signature.args[0])(context, builder, args[0]), _Vectors(builder)

            def place(argument: int) -> Any:
                return builder.bitcast(builder.gep(made.data, [args[argument]]), _DOUBLES.as_pointer())

            def load(argument: int) -> Any:
                found = builder.load(place(argument))
                found.align = 8
                return found

            one, factor = (load(3), load(4)), (vectors.repeated(args[5]), vectors.repeated(args[6]))
            total = vectors.add((load(1), load(2)), vectors.multiply(*((factor, one) if left else (one, factor))))
            for part, argument in zip(total, (1, 2), strict=True):
                builder.store(part, place(argument)).align = 8
            return context.get_dummy_value()

        places = [types.int64] * 4
        return types.void(parts, *places, types.float64, types.float64), codegen

    return add_products


# ``f(parts, s, t, x, y, high, low)`` adds a factor times four numbers, whose parts begin at x and y, to four sums at s
# and t, all in one contiguous array. The last digit of a product depends on which factor is on the left.
_add_left_products, _add_right_products = _adding_products(True), _adding_products(False)


@borrowing
def _is_moderate(a: Any) -> Any:
    least, largest = _LIMIT, np.int64(0)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for part in range(2):
                size = bits(a[i, j, part]) & _MAGNITUDE
                least = min(least, size if size != 0 else _LIMIT)
                largest = max(largest, size)
    return least >= _LEAST and largest < _LIMIT


@borrowing
def _by_rows(a: Any, b: Any, c: Any, width: int, parts: Any) -> None:
    inner, begin = a.shape[1], 2 * ROWS * width
    lows = begin + inner * width
    for k in range(inner):
        for j in range(width):
            parts[begin + k * width + j] = b[k, j, 0] if j < b.shape[1] else 0.0
            parts[lows + k * width + j] = b[k, j, 1] if j < b.shape[1] else 0.0
    for first in range(0, a.shape[0], ROWS):
        rows = min(ROWS, a.shape[0] - first)
        for at in range(begin):
            parts[at] = 0.0
        for k in range(inner):
            for i in range(rows):
                high, low = a[first + i, k, 0], a[first + i, k, 1]
                if high != 0.0:
                    for j in range(0, width, WIDTH):
                        s, x = i * width + j, k * width + j
                        _add_left_products(parts, s, ROWS * width + s, begin + x, lows + x, high, low)
        for i in range(rows):
            for j in range(b.shape[1]):
                c[first + i, j, 0] = parts[i * width + j]
                c[first + i, j, 1] = parts[(ROWS + i) * width + j] + 0.0  # no negative zero


@borrowing
def _by_columns(a: Any, b: Any, c: Any, width: int, parts: Any) -> None:
    rows = a.shape[0]
    for at in range(2 * width):
        parts[at] = 0.0
    for k in range(a.shape[1]):
        for i in range(width):
            parts[2 * width + i] = a[i, k, 0] if i < rows else 0.0
            parts[3 * width + i] = a[i, k, 1] if i < rows else 0.0
        for i in range(0, width, WIDTH):
            _add_right_products(parts, i, width + i, 2 * width + i, 3 * width + i, b[k, 0, 0], b[k, 0, 1])
    for i in range(rows):
        c[i, 0, 0] = parts[i]
        c[i, 0, 1] = parts[width + i] + 0.0


def product_in_planes(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    """c = a b in double-double if no result can leave the range; returns whether it did that."""
    raise TypeError("got a call of product_in_planes from Python; needed one from a function compiled by numba")


@overload(product_in_planes, strict=False, jit_options={"no_cfunc_wrapper": True, "_nrt": True})
def _product_in_planes(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    def of_pairs(fmt: Any, a: Any, b: Any, c: Any) -> Any:
        rows, inner, columns = a.shape[0], a.shape[1], b.shape[1]
        if rows * inner * columns < LEAST_PRODUCTS or (columns == 1 and rows < WIDTH):
            return False
        if not _is_moderate(a) or not _is_moderate(b):
            return False
        if columns == 1:
            width = (rows + WIDTH - 1) // WIDTH * WIDTH
            _by_columns(a, b, c, width, np.empty(4 * width))
        else:
            width = (columns + WIDTH - 1) // WIDTH * WIDTH
            _by_rows(a, b, c, width, np.empty(2 * (ROWS + inner) * width))
        return True

    if getattr(fmt, "instance_class", None) is DoubleDouble:
        return of_pairs
    return lambda fmt, a, b, c: False
