"""Correctly rounded arithmetic on Python integers with every rounding mode and a limited range.

Numbers are pairs as in :mod:`gpbnb.arithmetic.kernels.exact`. Subnormal numbers are normalized as well; their last
digits are zeros.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import isqrt
from typing import cast

from gpbnb.arithmetic.kernels.exact import ZERO, ExactKernel, Pair
from gpbnb.arithmetic.rounding import DRAW_BITS, Limits, Rounding, Rules

_MASK = 2**64 - 1


def draw(seed: int, count: int) -> int:
    """Random bits for rounding number `count`: the upper bits of SplitMix64."""
    z = (seed + count * 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return (z ^ (z >> 31)) >> (64 - DRAW_BITS)


class LimitedKernel(ExactKernel):
    """Scalar operations in one format with any rounding mode, with or without limits.

    Results are first rounded as if the exponent had no upper limit; a rounded result beyond the largest number
    overflows. In a format without subnormal numbers, rounded results below the smallest normal number become zero.

    Raises
    ------
    OverflowError : a result overflows, and the format neither saturates nor wraps around.
    """

    def __init__(self, rules: Rules) -> None:
        super().__init__(rules.base, rules.precision, rules.rounding in (Rounding.NEAREST, Rounding.EVEN))
        self.rules = rules
        self.rounding, self.limits = rules.rounding, rules.limits
        self.count = 0  # roundings so far, which select the random bits
        if self.limits is not None:
            #: Exponent of the last digit of the smallest normal number.
            self.quantum = self.limits.emin - rules.precision + 1
            largest = self.limits.largest / Fraction(rules.base) ** self.quantum
            m, e = self._normalized(int(largest), self.quantum)
            self.top = e, m  # exponent first, so that tuples compare by size
            # The limits of a fixed-point format, in units of its last digit.
            self._lowest = int(self.limits.lowest / Fraction(rules.base) ** self.quantum)
            self._largest = int(largest)

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        self.count = 0

    # -- operations ----------------------------------------------------------------------------

    def from_ratio(self, p: int, q: int, e: int = 0) -> Pair:
        self.count += 1
        return super().from_ratio(p, q, e)

    def is_exactly(self, pair: Pair, p: int, q: int, k: int) -> bool:
        return p == 0 if pair == ZERO else super().is_exactly(pair, p, q, k)

    def add(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        self.count += 1
        return self._sum(m1, e1, m2, e2)

    def multiply(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        self.count += 1
        return super().multiply(m1, e1, m2, e2)

    def divide(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        self.count += 1
        return super().divide(m1, e1, m2, e2)

    def fused(self, m1: int, e1: int, m2: int, e2: int, m3: int, e3: int) -> Pair:
        """``a * b + c``, rounded once."""
        self.count += 1
        return self._sum(m1 * m2, e1 + e2, m3, e3)

    def sqrt(self, m: int, e: int) -> Pair:
        """Round the square root; callers exclude ``m < 0``."""
        self.count += 1
        if m == 0:
            return ZERO
        # Enough digits that the root has more than t, and more than a random rounding compares.
        shift = 2 * (self.precision + DRAW_BITS) + (e & 1)
        n = m * self.base**shift
        root = isqrt(n)
        # One more digit marks an inexact root, which lies strictly between two integers.
        sticky = int(root * root != n)
        return self._round_integer(root * self.base + sticky, (e - shift) // 2 - 1)

    def negative(self, m: int, e: int) -> Pair:
        return self._within(-m, abs(m), e)

    def absolute(self, m: int, e: int) -> Pair:
        return self._within(1, abs(m), e)

    def _sum(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        if m1 == 0 or m2 == 0:
            m, e = (m1, e1) if m2 == 0 else (m2, e2)
            return self._round_integer(m, e) if m else ZERO
        if e1 < e2:
            m1, e1, m2, e2 = m2, e2, m1, e1
        gap = 3 * self.precision + DRAW_BITS + 2
        if e1 - e2 > gap and self.limits is None:
            # Only the sign of the smaller number matters: it is far below the digits that decide a rounding.
            m2, e2 = (1 if m2 > 0 else -1), e1 - 2 * DRAW_BITS - 3
        n = m1 * self.power(e1 - e2) + m2
        return self._round_integer(n, e2) if n else ZERO

    # -- rounding ------------------------------------------------------------------------------

    def _round_integer(self, n: int, e: int) -> Pair:
        a = abs(n)
        drop = self._dropped(self.digits(a) - self.precision, e)
        if drop <= 0:
            return self._within(n, a, e)
        if drop > self.digits(a) + DRAW_BITS + 2:  # far below half a unit of the last digit
            a, e, drop = 1, e + drop - DRAW_BITS - 2, DRAW_BITS + 2
        unit = self.power(drop)
        m, rest = divmod(a, unit)
        return self._within(n, m + self._up(m, rest, unit, n < 0), e + drop)

    def _round_quotient(self, p: int, q: int, e: int) -> Pair:
        a = abs(p)
        shift = self.precision - self.digits(a) + self.digits(q)
        # With this shift the quotient has t or t + 1 digits, which decides how many are dropped.
        numerator, denominator = (a * self.power(shift), q) if shift >= 0 else (a, q * self.power(-shift))
        drop = self._dropped(int(numerator >= denominator * self.limit), e - shift)
        if drop < 0:
            numerator *= self.power(-drop)
        else:
            denominator *= self.power(drop)
        m, rest = divmod(numerator, denominator)
        return self._within(p, m + self._up(m, rest, denominator, p < 0), e - shift + drop)

    def _dropped(self, excess: int, e: int) -> int:
        """Number of digits to drop from an integer times ``base**e`` that has `excess` digits more than t."""
        if self.limits is None:
            return excess
        if self.limits.fixed:
            return self.quantum - e
        return max(excess, self.quantum - e) if self.limits.subnormal else excess

    def _up(self, m: int, rest: int, unit: int, negative: bool) -> bool:
        """Whether the magnitude ``m + rest / unit`` rounds up to m + 1."""
        match self.rounding:
            case Rounding.NEAREST:
                return 2 * rest >= unit
            case Rounding.EVEN:
                return 2 * rest > unit or (2 * rest == unit and m % 2 == 1)
            case Rounding.CHOP:
                return False
            case Rounding.UP:
                return rest > 0 and not negative
            case Rounding.DOWN:
                return rest > 0 and negative
            case Rounding.ODD:
                return rest > 0 and m % 2 == 0
            case Rounding.STOCHASTIC:
                return draw(self.rules.seed, self.count) * unit < rest << DRAW_BITS

    def _within(self, sign: int, m: int, e: int) -> Pair:
        """Make the pair of a rounded magnitude and apply the limits."""
        if m == 0:
            return ZERO
        if self.limits is not None and self.limits.fixed:
            m = self._wrapped(m if sign > 0 else -m, e)
            return self._normalized(m, self.quantum) if m else ZERO
        m, e = self._normalized(m, e)
        if self.limits is not None:
            if not self.limits.subnormal and e < self.quantum:
                return ZERO
            if (e, m) > self.top:
                raise OverflowError(
                    f"got a result of about {self.about(e)}; needed at most {float(self.limits.largest):.7g} in size; "
                    "scale the numbers, or use a format with a larger range"
                )
        return (m if sign > 0 else -m), e

    def _wrapped(self, m: int, e: int) -> int:
        """Apply the limits to a fixed-point number; returns it in units of its last digit."""
        limits = cast(Limits, self.limits)
        count = m * self.power(e - self.quantum)
        lowest, largest = self._lowest, self._largest
        if lowest <= count <= largest:
            return count
        if limits.overflow == "saturate":
            return largest if count > 0 else lowest
        if limits.overflow == "wrap":
            return (count - lowest) % (largest - lowest + 1) + lowest
        about = float(count * Fraction(self.base) ** self.quantum)
        raise OverflowError(
            f"got a result of about {about:.7g}; needed one from {float(limits.lowest):.7g} to "
            f"{float(limits.largest):.7g}; scale the numbers, or use more integer bits"
        )

    def _normalized(self, m: int, e: int) -> Pair:
        """Append zeros up to t digits, or remove them if rounding has carried to more."""
        shift = self.precision - self.digits(abs(m))
        return (m * self.power(shift) if shift >= 0 else m // self.power(-shift)), e - shift


@lru_cache(maxsize=256)
def limited_kernel(rules: Rules) -> LimitedKernel:
    """Return the kernel of a format; each is made only once."""
    return LimitedKernel(rules)
