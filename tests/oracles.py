"""The slow, obvious versions: what the package must reproduce, digit for digit.

Everything here is exact rational arithmetic and plain loops, each written from its definition. Nothing is taken from
the package. The loops compute in gmpy2's fractions, which equal Python's and are many times faster.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import isqrt, log2
from typing import TypeVar

from gmpy2 import mpq

Matrix = list[list[mpq]]
Number = TypeVar("Number", Fraction, mpq)


def split(x: Number, base: int, precision: int) -> tuple[int, int, int, int]:
    """Write x > 0 as (digits + p / q) * base**e with `precision` digits before the point and 0 <= p < q."""
    p, q = x.numerator, x.denominator  # plain integers are many times faster than Fractions
    e = int((p.bit_length() - q.bit_length()) / log2(base)) - precision  # roughly; corrected below
    p, q = p * base ** max(-e, 0), q * base ** max(e, 0)
    while p >= q * base**precision:
        q *= base
        e += 1
    while p < q * base ** (precision - 1):
        p *= base
        e -= 1
    return *divmod(p, q), q, e


def rounded(x: Number, base: int, precision: int, nearest: bool) -> Number:
    """The number of `precision` digits nearest to x, half away from zero; or x with the further digits dropped."""
    if x < 0:
        return -rounded(-x, base, precision, nearest)
    if x == 0:
        return x
    digits, p, q, e = split(x, base, precision)
    if nearest and 2 * p >= q:
        digits += 1
    return type(x)(digits * base**e) if e >= 0 else type(x)(digits, base**-e)


def square_root(x: Fraction, base: int, precision: int, nearest: bool) -> Fraction:
    """The root of x >= 0, rounded: the largest multiple of its last digit's unit whose square is not above x."""
    if x == 0:
        return Fraction(0)
    e = split(x, base, 1)[-1] // 2 - precision + 1  # of the root's last digit
    square = x / Fraction(base) ** (2 * e)
    root = isqrt(square.numerator // square.denominator)
    assert root**2 <= square < (root + 1) ** 2
    if nearest and (2 * root + 1) ** 2 <= 4 * square:
        root += 1
    return root * Fraction(base) ** e


class Arithmetic:
    """Operations on fractions that are numbers of one format, each rounded once."""

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        self.fl: Callable[[mpq], mpq] = lambda x: rounded(mpq(x), base, precision, nearest)

    def total(self, x: Sequence[mpq]) -> mpq:
        s = x[0]
        for term in x[1:]:
            s = self.fl(s + term)
        return s

    def dot(self, x: Sequence[mpq], y: Sequence[mpq]) -> mpq:
        return self.total([self.fl(mpq(p) * mpq(q)) for p, q in zip(x, y, strict=True)])

    def matmul(self, a: Matrix, b: Matrix) -> Matrix:
        return [[self.dot(row, [line[j] for line in b]) for j in range(len(b[0]))] for row in a]

    def eliminate(self, a: Matrix, b: Matrix, pivot: bool) -> tuple[Matrix, Matrix, Matrix, list[int]]:
        """L, U, the reduced right-hand sides and the order of the rows; ZeroDivisionError on a zero pivot."""
        fl, n = self.fl, len(a)
        u, b, order = [list(map(mpq, row)) for row in a], [list(map(mpq, row)) for row in b], list(range(n))
        lower = [[mpq(int(i == j)) for j in range(n)] for i in range(n)]
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
                u[i][k] = mpq(0)
                for j in range(k + 1, n):
                    u[i][j] = fl(u[i][j] + fl(m * u[k][j]))
                for j in range(len(b[i])):
                    b[i][j] = fl(b[i][j] + fl(m * b[k][j]))
        return lower, u, b, order

    def solve(self, a: Matrix, b: Matrix, pivot: bool) -> Matrix:
        fl, n = self.fl, len(a)
        _, u, c, _ = self.eliminate(a, b, pivot)
        x = [[mpq(0)] * len(b[0]) for _ in range(n)]
        for column in range(len(b[0])):
            for k in range(n - 1, -1, -1):
                s = c[k][column]
                for j in range(k + 1, n):
                    s = fl(s - fl(u[k][j] * x[j][column]))
                x[k][column] = fl(s / u[k][k])
        return x

    def inv(self, a: Matrix, pivot: bool) -> Matrix:
        n = len(a)
        return self.solve(a, [[mpq(int(i == j)) for j in range(n)] for i in range(n)], pivot)
