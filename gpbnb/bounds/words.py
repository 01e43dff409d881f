r"""The largest roundings of a filter in fixed-point words, and a check that nothing overflows.

Sums are exact. A product is rounded where the accumulator has fewer fraction bits than it, and a sum where it is
stored, each by at most half a unit, or a unit if not to nearest. These errors do not depend on the size of the numbers.

References
----------
Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gpbnb.bounds.units import units
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT
from gpbnb.filters.words import IntegerProgram


def rounding_limits(made: IntegerProgram) -> NDArray[np.float64]:
    """Return the largest rounding error of each operation, (o,); zero where the result needs no more bits."""
    data, sums = made.words.data, made.words.accumulator
    of_sums, of_data = (float(units(fmt).errors[0]) for fmt in (sums, data))
    bits: list[float] = [data.fraction_bits] * (made.program.n + made.program.m)
    found = np.zeros(len(made.program.operations))
    for o, (code, a, b) in enumerate(made.program.operations.tolist()):
        needed, wide = bits[b], made.program.wide[o]
        if code == MULTIPLY:
            factor = made.coefficients[a]
            needed = needed + math.log2(factor.denominator) - _twos(factor.numerator) if factor else -math.inf
        elif code in (ADD, SUBTRACT):
            needed = max(needed, bits[a])
        for fmt, error in ((sums, of_sums), (data, of_data)):
            if needed > fmt.fraction_bits and (fmt is sums or not wide):
                found[o] += error
                needed = fmt.fraction_bits
        bits.append(needed)
    return found


def _twos(n: int) -> int:
    """Return how often 2 divides a whole number."""
    return (n & -n).bit_length() - 1


class WordErrors:
    """The largest rounding errors of results; it remembers the sizes of the results for which it was last asked."""

    def __init__(self, made: IntegerProgram) -> None:
        self._made, self._limits, self._sizes = made, rounding_limits(made), dict[int, float]()

    def __call__(self, o: int, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
        self._sizes[o] = float(sizes[0]) + self._limits[o]
        return np.full(sizes.shape, self._limits[o])

    def check_range(self, ends: NDArray[np.float64]) -> None:
        """Raise OverflowError if a result may be beyond its format; what wraps need not fit before it is stored.

        `ends` (n,) are the largest sizes of the states after the step, with all roundings.
        """
        program, words = self._made.program, self._made.words
        ends_of = dict(zip((program.outputs - program.n - program.m).tolist(), ends.tolist(), strict=True))
        for o, after in self._sizes.items():
            size = min(after, ends_of.get(o, math.inf))
            wide = bool(program.wide[o])
            kept = [words.accumulator] if words.accumulator.overflow != "wrap" or not wide else []
            for fmt in kept if wide else [*kept, words.data]:
                if size > float(fmt.largest):
                    what = "a product" if program.operations[o, 0] == MULTIPLY else "a sum"
                    raise OverflowError(
                        f"{what}, operation {o + 1} of {len(program.operations)}, may reach {size:.6g}, beyond the "
                        f"{fmt.integer_bits} integer bits of {'the data' if fmt is words.data else 'the sums'}; "
                        f"{math.frexp(size + float(fmt.unit))[1]} hold it"
                    )
