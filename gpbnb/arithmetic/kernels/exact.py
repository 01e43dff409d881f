"""Correctly rounded arithmetic on Python integers: any base, any precision, unbounded exponent.

A pair ``(m, e)`` represents ``m * base**e``. Zero is ``(0, 0)``; every other number is normalized,
``base**(t-1) <= abs(m) < base**t``, so that equal numbers are equal pairs. Every function computes the exact result and
rounds it once.
"""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from math import isqrt, log2

Pair = tuple[int, int]

ZERO: Pair = (0, 0)
LARGEST_BITS = 10_000_000  # longer integers would take minutes or exhaust the memory
_LARGEST_POWER_OF_TEN = int(LARGEST_BITS / log2(10))


def integer_text(n: int) -> str:
    """Decimal digits of an integer of any length; ``str`` refuses more than 4300 digits."""
    return str(Decimal(n))


class ExactKernel:
    """Scalar operations in one format.

    Parameters
    ----------
    base : number base, at least 2.
    precision : digits of the significand, t in the documents, at least 1.
    nearest : round to nearest, half away from zero (hung1984, II (3)); else chop (II (9)).
    """

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        self.base = base
        self.precision = precision
        self.nearest = nearest
        self._bits = log2(base)
        self._smallest = base ** (precision - 1)
        self.limit = base**precision
        self._largest_exponent = int(LARGEST_BITS / self._bits)
        # Powers that the operations need; for very long significands they are computed on demand.
        self._powers = [base**k for k in range(min(2 * precision + 8, 512))]

    # -- from exact values ---------------------------------------------------------------------

    def from_ratio(self, p: int, q: int, e: int = 0) -> Pair:
        """Round ``p / q * base**e``; ``q`` must be positive."""
        if p == 0:
            return ZERO
        if q == 1:
            return self._round_integer(p, e)
        return self._round_quotient(p, q, e)

    def from_decimal(self, p: int, q: int, k: int) -> Pair:
        """Round ``p / q * 10**k``; ``q`` must be positive.

        Raises
        ------
        OverflowError : the base is not 10 and ``10**k`` is too long an integer to write out.
        """
        if k == 0 or self.base == 10:
            return self.from_ratio(p, q, k)
        if p == 0:
            return ZERO
        if abs(k) > _LARGEST_POWER_OF_TEN:
            raise OverflowError(
                f"got a decimal exponent of {integer_text(k)}; needed at most {_LARGEST_POWER_OF_TEN} "
                f"in size to convert to base {self.base}; use base 10, or scale the number"
            )
        return self.from_ratio(p * 10**k, q) if k > 0 else self.from_ratio(p, q * 10**-k)

    def is_exactly(self, pair: Pair, p: int, q: int, k: int) -> bool:
        """Whether ``pair``, the rounded ``p / q * 10**k``, equals this number exactly."""
        m, e = pair
        if m == 0:
            return True  # no other number rounds to zero
        if self.base == 10:
            e, k = e - k, 0
        numerator = m * q * self.base ** max(e, 0) * 10 ** max(-k, 0)
        return numerator == p * 10 ** max(k, 0) * self.base ** max(-e, 0)

    # -- operations ----------------------------------------------------------------------------

    def add(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        if m1 == 0:
            return m2, e2
        if m2 == 0:
            return m1, e1
        if e1 < e2:
            m1, e1, m2, e2 = m2, e2, m1, e1
        if e1 - e2 > self.precision + 1:
            # Only the sign of the smaller operand matters. It is below base**-2 units in the last digit of the larger
            # one, and the nearest number or midpoint is at least 1 / (2 * base) units away, even just below a power of
            # the base.
            m2, e2 = (1 if m2 > 0 else -1), e1 - 3
        n = m1 * self.power(e1 - e2) + m2
        return self._round_integer(n, e2) if n else ZERO

    def subtract(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        return self.add(m1, e1, -m2, e2)

    def multiply(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        n = m1 * m2
        return self._round_integer(n, e1 + e2) if n else ZERO

    def divide(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        """Round the quotient; callers exclude ``m2 == 0``."""
        if m1 == 0:
            return ZERO
        return self._round_quotient(m1 if m2 > 0 else -m1, abs(m2), e1 - e2)

    def fused(self, m1: int, e1: int, m2: int, e2: int, m3: int, e3: int) -> Pair:
        """``a * b + c``, rounded once."""
        m, e = m1 * m2, e1 + e2
        if m == 0:
            return m3, e3
        if m3 == 0:
            return self._round_integer(m, e)
        (m, e), (n, f) = ((m, e), (m3, e3)) if e >= e3 else ((m3, e3), (m, e))
        if e - f > 3 * self.precision + 2:
            n, f = (1 if n > 0 else -1), e - self.precision - 3  # far below: only its sign matters
        n += m * self.power(e - f)
        return self._round_integer(n, f) if n else ZERO

    def sqrt(self, m: int, e: int) -> Pair:
        """Round the square root; callers exclude ``m < 0``."""
        if m == 0:
            return ZERO
        # The root of a number with 2t - 1 or 2t digits and an even exponent has exactly t digits.
        shift = self.precision if (e - self.precision) % 2 == 0 else self.precision - 1
        n = m * self.power(shift)
        root = isqrt(n)
        # In integers, n >= (root + 1/2)**2 means n - root**2 > root. Neither a tie nor a carry can occur, because n is
        # at most (b**t - 1) * b**t, whose root is below b**t - 1/2.
        if self.nearest and n - root * root > root:
            root += 1
        return root, (e - shift) // 2

    def negative(self, m: int, e: int) -> Pair:
        return -m, e

    def absolute(self, m: int, e: int) -> Pair:
        return abs(m), e

    def compare(self, m1: int, e1: int, m2: int, e2: int) -> int:
        """-1, 0 or 1 if the first number is less than, equal to or greater than the second."""
        if m1 == 0 or m2 == 0 or (m1 < 0) != (m2 < 0):
            return (m1 > m2) - (m1 < m2)
        larger = (e1, abs(m1)) > (e2, abs(m2))
        smaller = (e1, abs(m1)) < (e2, abs(m2))
        return larger - smaller if m1 > 0 else smaller - larger

    # -- to other number types -----------------------------------------------------------------

    def to_fraction(self, m: int, e: int) -> Fraction:
        """The exact value.

        Raises
        ------
        OverflowError : the value is too long an integer to write out.
        """
        if abs(e) > self._largest_exponent:
            raise OverflowError(
                f"got a number of about {self.about(e)}; needed an exponent of at most "
                f"{self._largest_exponent} in size to write it as a Fraction; scale the numbers"
            )
        return Fraction(m * self.base**e) if e >= 0 else Fraction(m, self.base**-e)

    def to_float(self, m: int, e: int) -> float:
        """Round to the nearest float64, ties to the even significand.

        Raises
        ------
        OverflowError : the result would be infinite, or a nonzero number would become zero.
        """
        if m == 0:
            return 0.0
        if abs(e) <= self._largest_exponent + self.precision and abs(e * self._bits + m.bit_length()) < 1200:
            try:
                # Python rounds the quotient of two integers correctly.
                value = (m * self.base**e) / 1 if e >= 0 else m / self.base**-e
            except OverflowError:
                value = 0.0
            if value != 0.0:
                return value
        raise OverflowError(
            f"got a number of about {self.about(e)}; needed one within the range of float64, "
            "2**-1074 to 2**1024; scale it, or use to_fractions()"
        )

    def about(self, e: int) -> str:
        """Approximate size of a number with exponent e, for messages."""
        return f"{integer_text(self.base)}**{integer_text(e + self.precision - 1)}"

    # -- rounding ------------------------------------------------------------------------------

    def power(self, k: int) -> int:
        """The base to the power k, at least 0."""
        return self._powers[k] if k < len(self._powers) else self.base**k

    def digits(self, n: int) -> int:
        """Number of base-b digits of ``n > 0``."""
        if self.base == 2:
            return n.bit_length()
        count = int((n.bit_length() - 1) / self._bits) + 1  # off by one or two, corrected below
        while self.power(count) <= n:
            count += 1
        while self.power(count - 1) > n:
            count -= 1
        return count

    def _carry(self, m: int, e: int) -> Pair:
        """Normalize a positive significand that rounding may have carried to t + 1 digits."""
        return (self._smallest, e + 1) if m == self.limit else (m, e)

    def _round_integer(self, n: int, e: int) -> Pair:
        """Round ``n * base**e``, ``n`` not zero."""
        a = abs(n)
        drop = self.digits(a) - self.precision
        if drop <= 0:
            return n * self.power(-drop), e + drop
        unit = self.power(drop)
        m, rest = divmod(a, unit)
        if self.nearest and 2 * rest >= unit:
            m += 1
        m, e = self._carry(m, e + drop)
        return (m if n > 0 else -m), e

    def _round_quotient(self, p: int, q: int, e: int) -> Pair:
        """Round ``p / q * base**e``, ``p`` not zero, ``q`` positive."""
        a = abs(p)
        shift = self.precision - self.digits(a) + self.digits(q)
        numerator, denominator = (a * self.power(shift), q) if shift >= 0 else (a, q * self.power(-shift))
        if numerator >= denominator * self.limit:  # t + 1 digits, not t
            denominator *= self.base
            shift -= 1
        m, rest = divmod(numerator, denominator)
        if self.nearest and 2 * rest >= denominator:
            m += 1
        m, e = self._carry(m, e - shift)
        return (m if p > 0 else -m), e


@lru_cache(maxsize=256)
def kernel(base: int, precision: int, nearest: bool) -> ExactKernel:
    """Return the kernel of a format; each is made only once."""
    return ExactKernel(base, precision, nearest)
