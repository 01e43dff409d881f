"""Unsigned integers of 128 bits for compiled functions, with the operators of Python's integers.

They live only inside compiled functions: Python can neither make nor receive one. Sums, differences and products keep
the lower 128 bits; shifts take 0 to 127 places.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel import models
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import register_model

from gpbnb.arithmetic.kernels.bits import high_product, instruction, leading_zeros
from gpbnb.arithmetic.kernels.compiling import inner

_BITS = ir.IntType(128)
_WORD = ir.IntType(64)
_U1 = np.uint64(1)
_HALF_WORD = np.uint64(2**32 - 1)


class _UInt128(types.Type):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__(name="uint128")


uint128 = _UInt128()


@register_model(_UInt128)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, numba_type: Any) -> None:
        super().__init__(manager, numba_type, _BITS)


def _operator(function: Any, result: Any, second: Any, emit: Any) -> None:
    """Give an operator on uint128 its type, and the instruction that computes it."""
    template = type(
        f"Of128Bits_{function.__name__}",
        (ConcreteTemplate,),
        {"key": function, "cases": [signature(result, uint128, second)]},
    )
    infer_global(function)(template)

    def lowered(context: Any, builder: Any, _: Any, args: Any) -> Any:
        a, b = args
        return emit(builder, a, builder.zext(b, _BITS) if second is not uint128 else b)

    lower_builtin(function, uint128, second)(lowered)


_I = ir.IRBuilder
for _function, _emit in (
    (operator.add, _I.add), (operator.sub, _I.sub), (operator.mul, _I.mul), (operator.or_, _I.or_),
    (operator.and_, _I.and_),
):  # fmt: skip
    _operator(_function, uint128, uint128, _emit)
for _function, _emit in ((operator.lshift, _I.shl), (operator.rshift, _I.lshr)):
    _operator(_function, uint128, types.int64, _emit)
_SIGNS = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
for _name, _sign in _SIGNS.items():
    _compared = lambda builder, a, b, sign=_sign: builder.icmp_unsigned(sign, a, b)  # noqa: E731
    _operator(getattr(operator, _name), types.boolean, uint128, _compared)


@instruction(uint128, types.uint64)
def wide(builder: Any, n: Any) -> Any:
    """A uint64 as a uint128."""
    return builder.zext(n, _BITS)


@instruction(types.uint64, uint128)
def low_word(builder: Any, n: Any) -> Any:
    """The lower 64 bits of a uint128."""
    return builder.trunc(n, _WORD)


@instruction(types.uint64, uint128)
def high_word(builder: Any, n: Any) -> Any:
    """The upper 64 bits of a uint128."""
    return builder.trunc(builder.lshr(n, ir.Constant(_BITS, 64)), _WORD)


@inner(forceinline=True)
def joined(high: Any, low: Any) -> Any:
    """The uint128 with these two words."""
    return (wide(high) << 64) | wide(low)


@inner(forceinline=True)
def length(n: Any) -> Any:
    """Number of bits of a uint128; 0 for zero."""
    high = high_word(n)
    return 128 - leading_zeros(high) if high != 0 else 64 - leading_zeros(low_word(n))


@inner(forceinline=True)
def words_product(a: Any, b: Any) -> Any:
    """The product of two uint64, as a uint128."""
    return wide(a) * wide(b)


@inner(forceinline=True)
def product(a: Any, b: Any) -> Any:
    """The product of two uint128, as its upper and lower 128 bits."""
    a1, a0, b1, b0 = high_word(a), low_word(a), high_word(b), low_word(b)
    low, high = words_product(a0, b0), words_product(a1, b1)
    cross, other = words_product(a0, b1), words_product(a1, b0)
    middle = wide(high_word(low)) + wide(low_word(cross)) + wide(low_word(other))
    high = high + wide(high_word(cross)) + wide(high_word(other)) + wide(high_word(middle))
    return high, joined(low_word(middle), low_word(low))


@inner(forceinline=True)
def shifted_left(high: Any, low: Any, k: Any) -> Any:
    """Shift 256 bits, given as two uint128, to the left by 0 to 127 places."""
    return (high << k) | ((low >> 1) >> (127 - k)), low << k


@inner
def divided_by_word(high: Any, low: Any, d: Any) -> Any:
    """Divide a number of two words by a word: quotient, which must fit into a word, and remainder.

    Knuth, The art of computer programming 2, 4.3.1, algorithm D, in digits of 32 bits.
    """
    s = leading_zeros(d)
    d <<= s
    d1, d0 = d >> np.int64(32), d & _HALF_WORD
    r = (high << s) | ((low >> _U1) >> (63 - s))
    low = low << s
    q = np.uint64(0)
    for part in (low >> np.int64(32), low & _HALF_WORD):
        digit = r // d1
        rest = r - digit * d1
        while digit > _HALF_WORD or digit * d0 > ((rest << np.int64(32)) | part):
            digit -= _U1
            rest += d1
            if rest > _HALF_WORD:
                break
        r = ((r << np.int64(32)) | part) - digit * d
        q = (q << np.int64(32)) | digit
    return q, r >> s


@inner
def reciprocal(d: Any) -> Any:
    """The word floor((2**192 - 1) / d) - 2**64 of a uint128 d whose highest bit is set.

    Moeller and Granlund, Improved division by invariant integers (2011), algorithm 6.
    """
    d1, d0 = high_word(d), low_word(d)
    v, _ = divided_by_word(~d1, ~np.uint64(0), d1)
    p = d1 * v + d0
    if p < d0:
        v -= _U1
        if p >= d1:
            v -= _U1
            p -= d1
        p -= d1
    t = high_product(v, d0)
    p += t
    if p < t:
        v -= _U1
        if joined(p, v * d0 + d0) >= d:
            v -= _U1
    return v


@inner(forceinline=True)
def _next_word(rest: Any, word: Any, d: Any, v: Any) -> Any:
    """Divide ``rest * 2**64 + word`` by d, with rest < d and the reciprocal v of d: one word of a quotient, remainder.

    Moeller and Granlund, algorithm 5.
    """
    u1 = low_word(rest)
    q = words_product(v, high_word(rest)) + rest
    digit, fraction = high_word(q), low_word(q)
    r1 = u1 - digit * high_word(d)
    r = joined(r1, word) - words_product(low_word(d), digit) - d
    digit += _U1
    if high_word(r) >= fraction:
        digit -= _U1
        r = r + d
    if r >= d:
        digit += _U1
        r = r - d
    return digit, r


@inner(forceinline=True)
def divided(high: Any, low: Any, d: Any, v: Any) -> Any:
    """Divide 256 bits, given as two uint128, by d > high with its highest bit set and the reciprocal v.

    Returns the quotient and the remainder, both uint128.
    """
    first, rest = _next_word(high, high_word(low), d, v)
    second, rest = _next_word(rest, low_word(low), d, v)
    return joined(first, second), rest
