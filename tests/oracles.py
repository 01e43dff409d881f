"""The slow, obvious versions: what the package must reproduce, digit for digit.

Everything here is Python's exact rational arithmetic and plain loops, each written from its definition.
Nothing is taken from the package.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import isqrt, log2

Matrix = list[list[Fraction]]


def split(x: Fraction, base: int, precision: int) -> tuple[int, Fraction, int]:
    """Write x > 0 as (digits + rest) * base**e with `precision` digits before the point and 0 <= rest < 1."""
    p, q = x.numerator, x.denominator  # plain integers are many times faster than Fractions
    e = int((p.bit_length() - q.bit_length()) / log2(base)) - precision  # roughly; corrected below
    p, q = p * base ** max(-e, 0), q * base ** max(e, 0)
    while p >= q * base**precision:
        q *= base
        e += 1
    while p < q * base ** (precision - 1):
        p *= base
        e -= 1
    digits, rest = divmod(p, q)
    return digits, Fraction(rest, q), e


def as_pair(x: Fraction, base: int, precision: int) -> tuple[int, int]:
    """The normalized significand and exponent of a number of the format."""
    if x == 0:
        return 0, 0
    digits, rest, e = split(abs(x), base, precision)
    assert rest == 0
    return (digits if x > 0 else -digits), e


def rounded(x: Fraction, base: int, precision: int, nearest: bool) -> Fraction:
    """The number of `precision` digits nearest to x, half away from zero; or x with the further digits dropped."""
    if x < 0:
        return -rounded(-x, base, precision, nearest)
    if x == 0:
        return Fraction(0)
    digits, rest, e = split(x, base, precision)
    if nearest and rest >= Fraction(1, 2):
        digits += 1
    return digits * Fraction(base) ** e


def square_root(x: Fraction, base: int, precision: int, nearest: bool) -> Fraction:
    """The root of x >= 0, rounded: the largest multiple of its last digit's unit whose square is not above x."""
    if x == 0:
        return Fraction(0)
    e = split(x, base, 1)[2] // 2 - precision + 1  # of the root's last digit
    square = x / Fraction(base) ** (2 * e)
    root = isqrt(square.numerator // square.denominator)
    assert root**2 <= square < (root + 1) ** 2
    if nearest and (2 * root + 1) ** 2 <= 4 * square:
        root += 1
    return root * Fraction(base) ** e


def numbers_below(limit: int, base: int, precision: int) -> list[int]:
    """All integers from 0 to `limit`, and the first beyond, that have at most `precision` digits and then zeros."""
    numbers = list(range(base**precision))
    step = base
    while numbers[-1] <= limit:
        numbers += range(base**precision // base * step, base**precision * step, step)
        step *= base
    return numbers


class Arithmetic:
    """Operations on Fractions that are numbers of one format, each rounded once."""

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        self.fl: Callable[[Fraction], Fraction] = lambda x: rounded(x, base, precision, nearest)

    def total(self, x: Sequence[Fraction]) -> Fraction:
        s = x[0]
        for term in x[1:]:
            s = self.fl(s + term)
        return s

    def dot(self, x: Sequence[Fraction], y: Sequence[Fraction]) -> Fraction:
        return self.total([self.fl(p * q) for p, q in zip(x, y, strict=True)])

    def matmul(self, a: Matrix, b: Matrix) -> Matrix:
        return [[self.dot(row, [line[j] for line in b]) for j in range(len(b[0]))] for row in a]

    def eliminate(self, a: Matrix, b: Matrix, pivot: bool) -> tuple[Matrix, Matrix, Matrix, list[int]]:
        """L, U, the reduced right-hand sides and the order of the rows; ZeroDivisionError on a zero pivot."""
        fl, n = self.fl, len(a)
        u, b, order = [list(row) for row in a], [list(row) for row in b], list(range(n))
        lower = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
        for k in range(n):
            if pivot:
                best = k
                for i in range(k, n):
                    if abs(u[i][k]) > abs(u[best][k]):
                        best = i
                u[k], u[best] = u[best], u[k]
                b[k], b[best] = b[best], b[k]
                order[k], order[best] = order[best], order[k]
                for j in range(k):
                    lower[k][j], lower[best][j] = lower[best][j], lower[k][j]
            if u[k][k] == 0:
                raise ZeroDivisionError
            for i in range(k + 1, n):
                m = -fl(u[i][k] / u[k][k])
                lower[i][k] = -m
                u[i][k] = Fraction(0)
                for j in range(k + 1, n):
                    u[i][j] = fl(u[i][j] + fl(m * u[k][j]))
                for j in range(len(b[i])):
                    b[i][j] = fl(b[i][j] + fl(m * b[k][j]))
        return lower, u, b, order

    def solve(self, a: Matrix, b: Matrix, pivot: bool) -> Matrix:
        fl, n = self.fl, len(a)
        _, u, c, _ = self.eliminate(a, b, pivot)
        x = [[Fraction(0)] * len(b[0]) for _ in range(n)]
        for column in range(len(b[0])):
            for k in range(n - 1, -1, -1):
                s = c[k][column]
                for j in range(k + 1, n):
                    s = fl(s - fl(u[k][j] * x[j][column]))
                x[k][column] = fl(s / u[k][k])
        return x

    def inv(self, a: Matrix, pivot: bool) -> Matrix:
        n = len(a)
        return self.solve(a, [[Fraction(int(i == j)) for j in range(n)] for i in range(n)], pivot)
