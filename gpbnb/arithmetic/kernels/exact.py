"""Correctly rounded arithmetic on Python integers: any base, any precision, every rounding, any range.

A pair ``(m, e)`` represents ``m * base**e``. Zero is ``(0, 0)``; every other number is normalized,
``base**(t-1) <= abs(m) < base**t``, so that equal numbers are equal pairs. Subnormal numbers are normalized as well;
their last digits are zeros. Every function computes the exact result and rounds it once.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache, wraps
from math import isqrt, log2, log10
from typing import Any, TypeVar, cast
from weakref import WeakValueDictionary

from gpbnb.arithmetic.rounding import DRAW_BITS, Limits, Rounding, Rules

Pair = tuple[int, int]

ZERO: Pair = (0, 0)
Made = TypeVar("Made")
LARGEST_BITS = 10_000_000  # longer integers would take minutes or exhaust the memory
_LARGEST_POWER_OF_TEN = int(LARGEST_BITS / log2(10))
_MASK = 2**64 - 1


def integer_text(n: int) -> str:
    """Decimal digits of an integer of any length; ``str`` refuses more than 4300 digits."""
    return str(Decimal(n))


def draw(seed: int, count: int) -> int:
    """Random bits for rounding number `count`: the upper bits of SplitMix64."""
    z = (seed + count * 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return (z ^ (z >> 31)) >> (64 - DRAW_BITS)


def size_text(value: Fraction) -> str:
    """Write a number for a message: seven digits, or a power of ten beyond the range of float64."""
    try:
        return f"{float(value):.7g}"
    except OverflowError:
        power = (abs(value.numerator).bit_length() - value.denominator.bit_length()) * log10(2)
        return f"{'-' if value < 0 else ''}10**{power:.0f}"


class ExactKernel:
    """Scalar operations in one format.

    Results are first rounded as if the exponent had no upper limit; a rounded result beyond the largest number
    overflows. In a format without subnormal numbers, rounded results below the smallest normal number become zero.
    """

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.base, self.precision, self.rounding, self.limits, _ = rules
        #: Whether ties are the only numbers that are not rounded to their nearest neighbour.
        self.nearest = self.rounding.to_nearest
        self.count = 0  # roundings so far, which select the random bits
        self._unlimited = self.limits is None  # what has no limits takes shorter ways
        #: Whether references use the format: base 2 to nearest without limits, rounded by shifts.
        self._plain = self.base == 2 and self._unlimited and self.rounding is Rounding.NEAREST
        self._bits = log2(self.base)
        self._smallest = self.base ** (self.precision - 1)
        self.limit = self.base**self.precision
        self._largest_exponent = int(LARGEST_BITS / self._bits)
        # Powers that the operations need; for very long significands they are computed on demand.
        self._powers = [self.base**k for k in range(min(2 * self.precision + 8, 512))]
        if self.limits is not None:
            #: Exponent of the last digit of the smallest normal number.
            self.quantum = self.limits.emin - self.precision + 1
            largest = self.limits.largest / Fraction(self.base) ** self.quantum
            m, e = self._normalized(int(largest), self.quantum)
            self.top = e, m  # exponent first, so that tuples compare by size
            # The limits, in units of the last digit of the smallest normal number.
            self._lowest = int(self.limits.lowest / Fraction(self.base) ** self.quantum)
            self._largest = int(largest)

    def __reduce__(self) -> tuple[Any, ...]:
        return kernel, (self.rules,)

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        self.count = 0

    # -- from exact values ---------------------------------------------------------------------

    def from_ratio(self, p: int, q: int, e: int = 0) -> Pair:
        """Round ``p / q * base**e``; ``q`` must be positive."""
        self.count += 1
        if p == 0:
            return ZERO
        if q == 1:
            return self._round_integer(p, e)
        return self._round_quotient(p, q, e)

    def from_decimal(self, p: int, q: int, k: int) -> Pair:
        """Round ``p / q * 10**k``; ``q`` must be positive."""
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
            return p == 0
        if self.base == 10:
            e, k = e - k, 0
        numerator = m * q * self.base ** max(e, 0) * 10 ** max(-k, 0)
        return numerator == p * 10 ** max(k, 0) * self.base ** max(-e, 0)

    # -- operations ----------------------------------------------------------------------------

    def add(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        self.count += 1
        return self._sum(m1, e1, m2, e2)

    def subtract(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        return self.add(m1, e1, -m2, e2)

    def multiply(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        self.count += 1
        n = m1 * m2
        return self._round_integer(n, e1 + e2) if n else ZERO

    def divide(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        """Round the quotient; callers exclude ``m2 == 0``."""
        self.count += 1
        if m1 == 0:
            return ZERO
        return self._round_quotient(m1 if m2 > 0 else -m1, abs(m2), e1 - e2)

    def fused(self, m1: int, e1: int, m2: int, e2: int, m3: int, e3: int) -> Pair:
        """``a * b + c``, rounded once."""
        self.count += 1
        return self._sum(m1 * m2, e1 + e2, m3, e3)

    def sqrt(self, m: int, e: int) -> Pair:
        """Round the square root; callers exclude ``m < 0``."""
        self.count += 1
        if m == 0:
            return ZERO
        # Enough digits that the root has t, and as many more as a random rounding compares.
        shift = self.precision + 2 * DRAW_BITS * (self.rounding is Rounding.STOCHASTIC)
        shift += (e - shift) & 1
        n = 4 * m * self.power(shift)
        root = isqrt(n)  # in halves of the last digit; one more bit marks a root between two of them
        return self._round_quotient(2 * root + (root * root != n), 4, (e - shift) // 2)

    def negative(self, m: int, e: int) -> Pair:
        return (-m, e) if self._unlimited else self._within(-m, abs(m), e)

    def absolute(self, m: int, e: int) -> Pair:
        return (abs(m), e) if self._unlimited else self._within(1, abs(m), e)

    def _sum(self, m1: int, e1: int, m2: int, e2: int) -> Pair:
        if m1 == 0 or m2 == 0:
            m, e = (m1, e1) if m2 == 0 else (m2, e2)
            return self._round_integer(m, e) if m else ZERO
        if e1 < e2:
            m1, e1, m2, e2 = m2, e2, m1, e1
        gap = 3 * self.precision + DRAW_BITS + 2
        if e1 - e2 > gap and self._unlimited:
            # Only the sign of the smaller number matters: it is far below the digits that decide a rounding.
            m2, e2 = (1 if m2 > 0 else -1), e1 - 2 * DRAW_BITS - 3
        n = m1 * self.power(e1 - e2) + m2
        return self._round_integer(n, e2) if n else ZERO

    def compare(self, m1: int, e1: int, m2: int, e2: int) -> int:
        """-1, 0 or 1 if the first number is less than, equal to or greater than the second."""
        if m1 == 0 or m2 == 0 or (m1 < 0) != (m2 < 0):
            return (m1 > m2) - (m1 < m2)
        larger = (e1, abs(m1)) > (e2, abs(m2))
        smaller = (e1, abs(m1)) < (e2, abs(m2))
        return larger - smaller if m1 > 0 else smaller - larger

    # -- to other number types -----------------------------------------------------------------

    def to_fraction(self, m: int, e: int) -> Fraction:
        """The exact value."""
        if abs(e) > self._largest_exponent:
            raise OverflowError(
                f"got a number of about {self.about(e)}; needed an exponent of at most "
                f"{self._largest_exponent} in size to write it as a Fraction; scale the numbers"
            )
        return Fraction(m * self.base**e) if e >= 0 else Fraction(m, self.base**-e)

    def to_float(self, m: int, e: int) -> float:
        """Round to the nearest float64, ties to the even significand."""
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

    def _round_integer(self, n: int, e: int) -> Pair:
        """Round ``n * base**e``, ``n`` not zero."""
        a = abs(n)
        if self._plain:
            drop = a.bit_length() - self.precision
            m = a << -drop if drop <= 0 else ((a >> (drop - 1)) + 1) >> 1
            return self._within(n, m, e + drop)
        drop = self._dropped(self.digits(a) - self.precision, e)
        if drop <= 0:
            return (n * self.power(-drop), e + drop) if self._unlimited else self._within(n, a, e)
        if drop > self.digits(a) + DRAW_BITS + 2:  # far below half a unit of the last digit
            a, e, drop = 1, e + drop - DRAW_BITS - 2, DRAW_BITS + 2
        unit = self.power(drop)
        m, rest = divmod(a, unit)
        return self._within(n, m + self._up(m, rest, unit, n < 0), e + drop)

    def _round_quotient(self, p: int, q: int, e: int) -> Pair:
        """Round ``p / q * base**e``, ``p`` not zero, ``q`` positive."""
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
            case Rounding.HALF_UP:
                return 2 * rest > unit or (2 * rest == unit and not negative)
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
        if self._unlimited:  # it has t digits, or rounding has carried to one more
            m, e = (self._smallest, e + 1) if m == self.limit else (m, e)
            return (m if sign > 0 else -m), e
        if m == 0:
            return ZERO
        limits = cast(Limits, self.limits)
        if limits.fixed:
            return self._within_fixed(m if sign > 0 else -m, e)
        m, e = self._normalized(m, e)
        if not limits.subnormal and e < self.quantum:
            return ZERO
        if (e, m) > self.top:
            return self._beyond(sign > 0, e)
        return (m if sign > 0 else -m), e

    def _within_fixed(self, m: int, e: int) -> Pair:
        """Apply the limits to a fixed-point number."""
        places = e - self.quantum  # below 0 for a normalized number of less than t digits, which ends in zeros
        count = m * self.power(places) if places >= 0 else m // self.power(-places)
        lowest, largest = self._lowest, self._largest
        if not lowest <= count <= largest:
            if cast(Limits, self.limits).overflow != "wrap":
                return self._beyond(count > 0, self.quantum, abs(count))
            count = (count - lowest) % (largest - lowest + 1) + lowest
        return self._normalized(count, self.quantum) if count else ZERO

    def _beyond(self, positive: bool, e: int, count: int = 1) -> Pair:
        """Replace a result beyond the limits by a limit, or refuse it; fixed point gives it as ``count * base**e``."""
        limits = cast(Limits, self.limits)
        if limits.overflow == "saturate":
            return self._normalized(self._largest if positive else self._lowest, self.quantum)
        if limits.fixed:
            about = size_text((count if positive else -count) * Fraction(self.base) ** e)
            needed, cure = f"one from {size_text(limits.lowest)} to {size_text(limits.largest)}", "more integer bits"
        else:
            about = self.about(e)
            needed, cure = f"at most {size_text(limits.largest)} in size", "a format with a larger range"
        raise OverflowError(f"got a result of about {about}; needed {needed}; scale the numbers, or use {cure}")

    def _normalized(self, m: int, e: int) -> Pair:
        """Append zeros up to t digits, or remove them if rounding has carried to more."""
        shift = self.precision - self.digits(abs(m))
        return (m * self.power(shift) if shift >= 0 else m // self.power(-shift)), e - shift


def one_per_format(make: Callable[[Rules], Made]) -> Callable[[Rules], Made]:
    """Make only one object for each format at a time.

    Two of them would draw the random numbers of stochastic rounding from two sequences.
    """
    alive: WeakValueDictionary[Rules, Made] = WeakValueDictionary()
    lock = threading.Lock()

    @lru_cache(maxsize=256)
    @wraps(make)
    def made(rules: Rules) -> Made:
        with lock:
            if (known := alive.get(rules)) is None:
                alive[rules] = known = make(rules)
            return known

    return made


@one_per_format
def kernel(rules: Rules) -> ExactKernel:
    """Return the kernel of a format."""
    return ExactKernel(rules)
