"""The microscaling formats of the Open Compute Project: blocks of numbers that share a power of two as their scale.

References
----------
OCP Microscaling Formats (MX) specification, version 1.0 (2023).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Order

BIAS = 127
"""What an E8M0 word adds to the exponent of its power of two; the word 255 is NaN."""


class ScaledBlocks(NamedTuple):
    """Numbers in blocks along the last axis.

    Attributes
    ----------
    exponents : (..., n / k), the exponents of the scales, from -127 to 127.
    elements : (..., n / k, k), in the format of the elements.
    """

    exponents: NDArray[Any]
    elements: FloatArray

    def to_fractions(self) -> NDArray[Any]:
        """Return the exact numbers (..., n), each an element times the scale of its block."""
        found = np.asarray(self.elements.to_fractions(), dtype=object) * _scales(self.exponents)
        return cast(NDArray[Any], found.reshape((*found.shape[:-2], -1)))

    def to_bits(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the E8M0 words of the scales, and the words of the elements."""
        return (self.exponents + BIAS).astype(np.uint8), self.elements.to_bits()


@dataclass(frozen=True)
class MicroscalingFormat:
    """Blocks of `block` elements that share a scale in E8M0, a power of two from 2**-127 to 2**127.

    Parameters
    ----------
    element : format of the elements, such as FP8_E4M3 or FP4_E2M1, or ``FixedFormat(1, 6, "even")`` for MXINT8, whose
        elements are two's complement numbers from -2 to 127/64. Elements saturate.
    block : number of elements in a block, 32 in the specification.

    Raises
    ------
    ValueError : elements without a range, or a block below 1.

    Examples
    --------
    >>> from gpbnb import FP4_E2M1, MicroscalingFormat
    >>> mx = MicroscalingFormat(FP4_E2M1, block=4)
    >>> x = mx.array([1, -40, 3, 100])
    >>> x.exponents.tolist(), x.elements.to_float().tolist(), x.to_fractions().astype(float).tolist()
    ([4], [[0.0, -2.0, 0.0, 6.0]], [0.0, -32.0, 0.0, 96.0])
    """

    element: FloatFormat | FixedFormat
    block: int = 32

    def __post_init__(self) -> None:
        if self.block < 1:
            raise ValueError(f"block: got {self.block}; needed at least 1")
        if self.element.limits is None or self.element.base != 2:
            raise ValueError(f"element: got {self.element}; needed a format of base 2 with a range, such as FP4_E2M1")
        element: Any = self.element
        object.__setattr__(self, "element", replace(element, overflow="saturate"))

    def array(self, values: Any) -> ScaledBlocks:
        """Convert numbers (..., n) to blocks along the last axis.

        The scale of a block is the largest power of two not above its largest number, divided by the largest power of
        two that an element can store. The scale is at least 2**-127, also for a block of zeros. Elements beyond their
        range saturate.

        Raises
        ------
        TypeError, ValueError : entries that are not finite numbers, or n is not a multiple of the length of a block.
        OverflowError : a scale above 2**127.
        """
        given = exact(values)
        if not given.ndim or given.shape[-1] % self.block:
            raise ValueError(
                f"got numbers of shape {given.shape}; needed a multiple of {self.block} along the last axis; "
                "append zeros"
            )
        given = given.reshape((*given.shape[:-1], -1, self.block))
        largest = abs(given).max(axis=-1, initial=cast(Any, Fraction(0)))
        most = _exponent(self.element.largest)
        exponents = np.frompyfunc(lambda size: max(_exponent(size) - most, -BIAS) if size else -BIAS, 1, 1)(largest)
        exponents = np.asarray(exponents, dtype=int)
        if exponents.size and exponents.max() > BIAS:
            raise OverflowError(f"got a scale of 2**{exponents.max()}; needed at most 2**{BIAS}; scale the numbers")
        return ScaledBlocks(exponents, self.element.array(given / _scales(exponents)))

    def from_bits(self, scales: Any, elements: Any) -> ScaledBlocks:
        """Return the blocks stored in E8M0 words (..., n / k), the scales, and in words of elements (..., n / k, k).

        Raises
        ------
        ValueError : a scale that is NaN, or an element that is not a finite number.
        """
        words = np.asarray(scales)
        if words.size and not (words.min() >= 0 and words.max() < 255):
            raise ValueError("got a scale that is NaN, or no word of 8 bits; needed words from 0 to 254")
        return ScaledBlocks(words.astype(int) - BIAS, self.element.from_bits(elements))


def _scales(exponents: NDArray[Any]) -> Any:
    """Return the exact scales, (..., n / k, 1)."""
    return np.frompyfunc(lambda exponent: Fraction(2) ** int(exponent), 1, 1)(exponents)[..., np.newaxis]


def _exponent(size: Fraction) -> int:
    """Return the exponent of the largest power of two not above a number."""
    e = size.numerator.bit_length() - size.denominator.bit_length()
    return e if size >= Fraction(2) ** e else e - 1


def microscaling_dot(
    a: ScaledBlocks, b: ScaledBlocks, sums: FloatFormat, order: Order = "left", fused: bool = False
) -> FloatArray:
    r"""Inner product of two vectors in blocks, :math:`\sum_j X_j Y_j \sum_i p_{ji} q_{ji}`, in a stated order.

    In the format `sums`, the products of the elements of a block are formed and added as in
    :func:`gpbnb.arithmetic.linalg.matmul`; the result is multiplied by the exact product of both scales, which
    takes one rounding; and the blocks are added from left to right. The specification of microscaling leaves precision
    and order open.

    Parameters
    ----------
    a, b : vectors with equal blocks; their elements may have different formats.
    sums : the format of products and sums, which must hold the elements exactly.
    order, fused : order of the additions within a block, and whether products are added by fused multiply-add.

    Raises
    ------
    ValueError : different shapes; elements that `sums` does not hold.
    OverflowError : a result beyond the range of `sums`.
    """
    if a.elements.shape != b.elements.shape or a.elements.ndim != 2:
        raise ValueError(f"got blocks of shapes {a.elements.shape} and {b.elements.shape}; needed two equal vectors")
    left, right = sums.array(a.elements), sums.array(b.elements)
    for given, stored in ((a, left), (b, right)):
        if not (exact(given.elements) == exact(stored)).all():
            raise ValueError(f"sums: got {sums}, which does not hold every element; needed more digits or range")
    total = sums.zeros(())
    for j, power in enumerate((a.exponents + b.exponents).tolist()):
        inner = linalg.dot(left[j], right[j], order, fused)
        # The exact product with a power of two, which the format itself may not hold, is rounded once.
        scaled = sums.array(inner.to_fractions() * Fraction(2) ** power)
        total = scaled if j == 0 else total + scaled
    return total
