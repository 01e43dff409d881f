"""The slow, obvious versions: what the package must reproduce, digit for digit.

Exact rational arithmetic and plain loops, each written from its definition, with an explicit rounding after each
operation. Nothing is taken from the package. Numbers are gmpy2's fractions, which equal Python's and are many times
faster.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import floor, isqrt, log2

import mpmath
from gmpy2 import mpq

ZERO, ONE = mpq(0), mpq(1)


# -- roundings --------------------------------------------------------------------------------------------------------


def to_multiple(x, base, power, mode):
    """The multiple of base**power that a rounding mode gives for x."""
    p, q = x.numerator * base ** max(-power, 0), x.denominator * base ** max(power, 0)
    low, rest = divmod(p, q)
    up = (
        rest > 0
        and {
            "down": False,
            "up": True,
            "chop": x < 0,
            "odd": low % 2 == 0,
            "even": 2 * rest > q or (2 * rest == q and low % 2 == 1),
            "nearest": 2 * rest > q or (2 * rest == q and x > 0),
            "half up": 2 * rest >= q,
        }[mode]
    )
    return mpq((low + up) * base ** max(power, 0), base ** max(-power, 0))


def exponent(x, base):
    """The largest e for which base**e is not above the size of x, which is not zero."""
    p, q = abs(x.numerator), x.denominator
    e = int((p.bit_length() - q.bit_length()) / log2(base))  # roughly
    while p * base ** max(-e - 1, 0) >= q * base ** max(e + 1, 0):
        e += 1
    while p * base ** max(-e, 0) < q * base ** max(e, 0):
        e -= 1
    return e


def floating(base, digits, mode, emin=None, subnormal=True):
    """A function that rounds to digits of a base; below base**emin with the spacing there, or to zero."""

    def r(x):
        if not x:
            return ZERO
        e = exponent(x, base)
        if emin is not None and subnormal:
            e = max(e, emin)
        found = to_multiple(x, base, e - digits + 1, mode)
        if emin is not None and not subnormal and abs(found) < mpq(base) ** emin:
            return ZERO
        return found

    return r


def fixed(bits, mode):
    """A function that rounds to fraction bits."""
    return lambda x: to_multiple(x, 2, -bits, mode)


def limited(fmt_bits, integer_bits, overflow):
    """A function that limits a number to a two's complement word, or wraps it, or raises OverflowError."""
    low, high = -(mpq(2) ** integer_bits), mpq(2) ** integer_bits - mpq(1, 2**fmt_bits)

    def keep(x):
        if low <= x <= high:
            return x
        if overflow == "saturate":
            return high if x > 0 else low
        if overflow == "wrap":
            return (x - low) % (2 * -low) + low
        raise OverflowError

    return keep


def rounds(fmt):
    """A function that rounds to a format, of the corpus or of the package; OverflowError beyond one that raises."""
    mode = getattr(fmt.rounding, "value", fmt.rounding)
    if mode == "stochastic":
        raise NotImplementedError("random numbers of the package")
    if not hasattr(fmt, "base") or hasattr(fmt, "integer"):
        r, keep = fixed(fmt.fraction, mode), limited(fmt.fraction, fmt.integer, fmt.overflow)
        return lambda x: keep(r(x))
    r = floating(fmt.base, fmt.precision, mode, fmt.emin, fmt.subnormal)
    if fmt.emax is None:
        return r
    top = getattr(fmt, "largest", None)
    if not isinstance(top, Fraction):
        top = (fmt.base**fmt.precision - 1) * mpq(fmt.base) ** (fmt.emax - fmt.precision + 1)

    def in_range(x):
        found = r(x)
        if abs(found) <= top:
            return found
        if getattr(fmt.overflow, "value", fmt.overflow) == "saturate":
            return top if found > 0 else -top
        raise OverflowError

    return in_range


def exactly(x):
    """A number of gmpy2 as a Fraction of Python."""
    return Fraction(int(x.numerator), int(x.denominator))


def root(x):
    """The square root, or a number that rounds as it does."""
    p, q = isqrt(x.numerator), isqrt(x.denominator)
    if p * p == x.numerator and q * q == x.denominator:
        return mpq(p, q)
    shift = 900 - (x.numerator.bit_length() - x.denominator.bit_length()) // 2
    scale = mpq(2) ** shift
    return mpq(2 * isqrt(floor(x * scale**2)) + 1, 2) / scale


@cache
def _precise():
    context = mpmath.mp.clone()
    context.prec = 1000
    return context


MPMATH = {
    "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh", "arccosh": "acosh", "arctanh": "atanh",
    "arctan2": "atan2", "deg2rad": "radians", "rad2deg": "degrees",
}  # fmt: skip


def elementary(name, *arguments):
    """The value of a function with 900 bits; exactly, where it has fewer than 600."""
    mp = _precise()
    x = [mp.mpf(int(each.numerator)) / int(each.denominator) for each in arguments]
    if name == "exp2":
        found = mp.power(2, x[0])
    elif name == "log2":
        found = mp.log(x[0]) / mp.log(2)
    elif name == "cbrt":
        found = mp.sign(x[0]) * mp.root(abs(x[0]), 3)
    elif name == "float_power":
        found = mp.power(*x)
    else:
        found = getattr(mp, MPMATH.get(name, name))(*x)
    sign, mantissa, e, _ = found._mpf_
    value = (-1) ** sign * mpq(int(mantissa)) * mpq(2) ** e
    short = floating(2, 600, "even")(value)
    return short if short and abs(value / short - 1) < mpq(1, 2**900) else value


# -- matrices ---------------------------------------------------------------------------------------------------------


def summed(r, x, y, order="left", fused=False, block=32):
    """An inner product, each result rounded by r."""

    def in_a_row(first, end):
        total = r(x[first] * y[first])
        for k in range(first + 1, end):
            total = r(x[k] * y[k] + total) if fused else r(total + r(x[k] * y[k]))
        return total

    def halved(first, end):
        middle = (first + end) // 2
        return r(x[first] * y[first]) if end - first == 1 else r(halved(first, middle) + halved(middle, end))

    if not len(x):
        return ZERO
    if order == "pairwise":
        return halved(0, len(x))
    step = block if order == "blocked" else len(x)
    total, *others = (in_a_row(k, min(k + step, len(x))) for k in range(0, len(x), step))
    for each in others:
        total = r(total + each)
    return total


def transposed(A):
    return [list(row) for row in zip(*A, strict=True)]


def unit(n):
    return [[mpq(int(i == j)) for j in range(n)] for i in range(n)]


class Numbers:
    """Matrices as lists of rows of numbers of one format, with every operation rounded by `r`.

    `sums` rounds the sums of products, with the settings of :func:`summed`; `roundoff` is the share by which variances
    are raised first, see `storable`.
    """

    def __init__(self, r, roundoff=None, sums=None, **order):
        self.r, self.roundoff, self.sums, self.order = r, roundoff, sums or r, order

    @classmethod
    def of(cls, fmt, sums=None, **order):
        """The numbers of a format of the corpus or of the package."""
        base, digits = getattr(fmt, "base", 2), getattr(fmt, "precision", None)
        roundoff = mpq(base) ** (1 - (fmt.integer + fmt.fraction if digits is None else digits))
        mode = getattr(fmt.rounding, "value", fmt.rounding)
        roundoff = roundoff / 2 if mode in ("nearest", "even") else roundoff
        return cls(rounds(fmt), roundoff, rounds(sums) if sums else None, **order)

    def root(self, x):
        return self.r(root(x))

    def store(self, A):
        return [[self.r(mpq(a)) for a in row] for row in A]

    def total(self, x):
        s = x[0]
        for term in x[1:]:
            s = self.r(s + term)
        return s

    def dot(self, x, y):
        return self.r(summed(self.sums, x, y, **self.order))

    def times(self, *factors):
        found = factors[0]
        for each in factors[1:]:
            columns = transposed(each)
            found = [[self.dot(row, column) for column in columns] for row in found]
        return found

    def plus(self, A, B, sign=1):
        return [[self.r(a + sign * b) for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]

    def eliminate(self, A, B, pivot=False, negative=True):
        """L, U, the reduced right sides and the order of the rows; ZeroDivisionError on a zero pivot.

        The negative of a factor may saturate, and is multiplied and added; or a product is subtracted, as in filters.
        """
        r, n = self.r, len(A)
        A, B, order = [list(map(mpq, row)) for row in A], [list(map(mpq, row)) for row in B], list(range(n))
        lower = unit(n)
        for k in range(n):
            if pivot:
                best = max(range(k, n), key=lambda i: abs(A[i][k]))  # the first of equal ones
                for each in (A, B, order):
                    each[k], each[best] = each[best], each[k]
                lower[k][:k], lower[best][:k] = lower[best][:k], lower[k][:k]
            if A[k][k] == 0:
                raise ZeroDivisionError
            for i in range(k + 1, n):
                lower[i][k] = f = r(A[i][k] / A[k][k])
                A[i][k] = ZERO
                for row, above, first in ((A[i], A[k], k + 1), (B[i], B[k], 0)):
                    for j in range(first, len(row)):
                        row[j] = r(row[j] + (r(r(-f) * above[j]) if negative else -r(f * above[j])))
        return lower, A, B, order

    def solve(self, A, B, pivot=False, negative=True):
        r, n = self.r, len(A)
        _, U, C, _ = self.eliminate(A, B, pivot, negative)
        for column in range(len(B[0])):
            for k in range(n - 1, -1, -1):
                s = C[k][column]
                for j in range(k + 1, n):
                    s = r(s - r(U[k][j] * C[j][column]))
                C[k][column] = r(s / U[k][k])
        return C

    def inv(self, A, pivot=False, negative=True):
        return self.solve(A, unit(len(A)), pivot, negative)

    def inverse(self, A):
        """As filters compute it."""
        return self.inv(A, negative=False)

    def has_positive_pivots(self, A):
        """Whether elimination without exchanges meets only positive pivots."""
        try:
            _, U, _, _ = self.eliminate(A, [[] for _ in A], negative=False)
        except ZeroDivisionError:
            return False
        return all(U[i][i] > 0 for i in range(len(U)))

    def cholesky(self, A, error=ValueError):
        """Lower triangle of the root; `error` is raised for a negative pivot."""
        r, n = self.r, len(A)
        L = [[ZERO] * n for _ in range(n)]
        for j in range(n):
            rest = [A[i][j] for i in range(n)]
            for k in range(j):
                rest = [r(a - r(L[i][k] * L[j][k])) for i, a in enumerate(rest)]
            if rest[j] < 0:
                raise error
            L[j][j] = self.root(rest[j])
            for i in range(j + 1, n):
                L[i][j] = r(rest[i] / L[j][j]) if L[j][j] else ZERO
        return L

    def factors(self, A):
        """U and, on its diagonal, D of U D U' = A, and whether A is semidefinite in this arithmetic."""
        A, n, r, sound = [list(map(mpq, row)) for row in A], len(A), self.r, True
        U = [[ZERO] * n for _ in range(n)]
        for j in range(n - 1, -1, -1):
            U[j][j] = d = A[j][j]
            sound = sound and d >= 0 and (d > 0 or not any(A[i][j] for i in range(j)))
            for i in range(j):
                U[i][j] = r(A[i][j] / d) if d else ZERO
            for i in range(j):
                for k in range(i + 1):
                    A[k][i] = r(A[k][i] - r(U[k][j] * A[i][j]))
        return U, sound

    def exact_factors(self, A):
        """Exact factors, rounded."""
        return self.store(EXACT.factors(A)[0])


EXACT = Numbers(lambda x: x, ZERO)


def of_factors(U):
    """U D U', exactly."""
    n, W = len(U), with_units(U)
    return EXACT.times(W, [[U[i][i] * (i == j) for j in range(n)] for i in range(n)], transposed(W))


def with_units(U):
    """The unit triangle above the diagonal of a matrix."""
    return [[a if j > i else mpq(int(i == j)) for j, a in enumerate(row)] for i, row in enumerate(U)]
