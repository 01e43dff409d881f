r"""Check the certificate of a rounding guarantee: ``python check.py FILE``.

This program needs only Python's standard library, computes with integers and rounds outwards. It trusts the question in
the file: filter, format, form, limits. It verifies the answer: the bound b, and when the gain repeats. ::

    Claim. A filter computes x' = Fx + Kz by products, sums and differences, each rounded once. The exact filter has
    the model, first estimate and measurements as stored; it computes x_k = (I - K_k H_k) Phi_k x_{k-1} + K_k z_k
    and has the innovation v_k = z_k - H_k Phi_k x_{k-1}. While |x|, |v| and |z| are within the limits, estimates
    differ by at most b.

    Theorem. Let a step compute F'x + K'z apart from its roundings, and let column G_g be the effect of a rounding,
    of at most h_g, on the result. The error e_k of the estimate obeys exactly e_k = F' e_{k-1} + w_k with
    w_k = sum_g G_g rho_g + (F' - (I - K'H) Phi) x_{k-1} + (K' - K) v_k and |rho_g| <= h_g.

    (1) If e_{k-1} lies in a set, e_k lies in its image under F' and the columns. A set is a sum of segments and of
    an ellipsoid {y: |ay|^2 <= a M a' for all a}, which also contains segments g_j after M := s (M/t + sum g_j
    g_j'/t_j), with s = t + sum t_j, for any t, t_j > 0, by the inequality of Cauchy and Schwarz. The largest size m(r)
    of r e over a set is a seminorm of the row r, so m(r) <= sum |c_j| m(r_j) + |r - sum c_j r_j| b for any rows r_j,
    if |e| <= b. Steps are taken in blocks: after j steps, e is P_j e_0 plus the effects of their own w, for the product
    P_j of the loops; r P_j is near (1 - j/J) r + (j/J) r P_J, so the set need only be moved at the end of a block.

    (2) For a row C_0, any rows C_1, ..., C_L with 1 <= L <= k, and R_l = C_l F'_{k-l} - C_{l+1}, telescoping gives
    exactly C_0 e_k = sum_{l<L} (C_l w_{k-l} + R_l e_{k-l-1}) + C_L e_{k-L}. If |e_j| <= b for all j < k, then
    |C_0 e_k| <= sum (|C_l w_{k-l}| + |R_l| b) + |C_L| b; or fewer terms meet the set of (1). If that is at most b_i
    for each unit row and phase, then |e_k| <= b for all k, by induction; see proof/guarantee.v. Here C_{l+1} is
    C_l F', rounded down in its last place, so that R_l is at most one unit of it.

    (3) A computed covariance that recurs after a whole number of the model's cycles recurs for ever, with all
    coefficients.

    (4) Let E be the exact step of a covariance, A symmetric, S = H (Phi A Phi' + Q) H' + R definite, K the gain of A,
    F = (I - KH) Phi, and P - A between 0 and D, as symmetric matrices. The gain of P minimizes its E. So
    E(A) <= E(P), and E(P) <= E(A) + F (P - A) F' <= E(A) + F D F', because K is only one of the gains for P. If some
    steps lead from the interval [A, A + D] into itself, covariances stay there. The gain of P differs from K by
    F (P - A) Phi' H' / S_P, where |1/S_P|_ij^2 <= T_ii T_jj for T = 1/S; so by Cauchy and Schwarz its entry i, j
    differs by at most the square root of (F D F')_ii T_jj, times the sum of those of (H Phi D Phi' H')_tt T_tt.

    (5) A result within M is rounded by at most h(M): half a unit in the last place of M, or a whole one unless to
    nearest. M holds the exact filter's limits, b, and earlier roundings of the step. For the last operation of
    state i, M <= |x_i| + b_i, as condition (2) without its rounding h gives b_i - h. Products with powers of the
    base (in a format with a range: with 0 and +-1) and sums with zero are exact. So are sums whose last place is that
    of the smallest numbers: all those of fixed point, which is a format with a single exponent.

    Not covered: stochastic rounding; known inputs; gains that never repeat; limited values; fused operations; other
    orders of sums. For fixed coefficients, the file also states x' = Ax + Bz, which the operations must compute.
"""

from __future__ import annotations

import argparse
import json
import re
from bisect import bisect_right
from copy import copy
from fractions import Fraction
from functools import reduce
from itertools import cycle, product, repeat
from math import gcd, inf, isqrt, lcm, nextafter
from operator import add, le, mul, sub
from typing import Any

# What a file looks like: a tuple lists words, a list holds any number of entries, and a set stands for one or none.
KNOWN, VECTOR, CYCLE = [{Fraction}], [Fraction], [[[Fraction]]]
LIMITS = {"state": KNOWN, "innovation": KNOWN}
RULES = {"base": int, "precision": int, "rounding": ("nearest", "even", "chop", "up", "down", "odd")}
FIXED = RULES | {"fraction_bits": int, "overflow": ("raise", "saturate", "wrap")}
FLOAT = RULES | {"emin": {int}, "emax": {int}, "subnormal": bool, "largest": {Fraction}}
FORMS = ("innovation", "joseph", "hung", "hung second gain", "ud")
MODEL = {"Phi": CYCLE, "H": CYCLE, "Q": CYCLE, "R": CYCLE, "x0": VECTOR, "P0": [VECTOR]}
RECURSION = {"coefficients": VECTOR, "A": [VECTOR], "B": [VECTOR]}
FILTERS = {
    "kalman": {"kind": str, "form": FORMS, "repair": bool, "repaired": [str]} | MODEL,
    "linear": {"kind": str, "states": int, "inputs": int, "operations": [list], "outputs": [int]} | RECURSION,
}
COUNTS = {"repeat": int, "period": int, "first": int, "back": int, "keep": int}
FILE = COUNTS | {
    "certificate": ("rounding guarantee 1",),
    "name": str,
    "order": ("each product and sum rounded once, sums from left to right",),
    "limits": LIMITS | {"measurement": KNOWN},
    "derived": LIMITS,
    "bound": VECTOR,
    "steps": {int},
    "width": [VECTOR],
}
NUMBER = re.compile(r"-?[0-9]{1,4000}([./][0-9]{1,4000})?", re.ASCII)
MULTIPLY, ADD, SUBTRACT = "multiply", "add", "subtract"
ERROR, STATE = "the error may exceed its bound", "a state or an innovation may exceed its limit"
BLOCK = 8  # steps that are taken together, for speed


class NotProvedError(Exception):
    """A claim that is wrong, or that this program cannot prove."""


def need(truth: Any, message: str) -> None:
    if not truth:
        raise NotProvedError(message)


def read(given: Any, schema: Any, name: str = "") -> Any:
    """Return a part of the file, with numbers for texts; it must look like its schema."""
    if isinstance(schema, set):
        (inner,) = schema
        return None if given is None else read(given, inner, name)
    if isinstance(schema, dict):
        if given.keys() - schema.keys():
            raise NotImplementedError(", ".join(sorted(given.keys() - schema.keys())))
        return {key: read(given[key], inner, key) for key, inner in schema.items()}
    if isinstance(schema, tuple):
        if given not in schema:
            raise NotImplementedError(f"{given} {name}")
        return given
    number, rows = schema is Fraction, isinstance(schema, list)
    need(type(given) is (str if number else list if rows else schema), f"got {given!r} as {name}")
    need(not number or NUMBER.fullmatch(given), f"got {given!r} as {name}")
    return [read(x, schema[0], name) for x in given] if rows else schema(given)


def up(n: int, d: int) -> int:
    return -(-n // d)


def each(f: Any, *a: Any) -> Any:
    return [list(map(f, *rows)) for rows in zip(*a, strict=True)]


def size(a: Any, b: Any) -> Any:
    """The largest size of a row's first entries times numbers of at most these sizes."""
    return sum(map(mul, map(abs, a), b))


def turned(a: Any) -> Any:
    return [list(row) for row in zip(*a, strict=True)]


def across(a: Any, b: Any) -> Any:
    """A times b turned, which is a times b for a symmetric b."""
    return [[sum(map(mul, row, other)) for other in b] for row in a]


def around(a: Any, b: Any) -> Any:
    """A b a' for a symmetric b."""
    return across(across(a, b), a)


def diagonal(n: int, x: Any = 1) -> Any:
    return [[x * (i == j) for j in range(n)] for i in range(n)]


def times(columns: Any, sizes: Any, unit: int) -> Any:
    return [[x * s // unit for x in g] for g, s in zip(columns, sizes, strict=True)]


class Arithmetic:
    """Numbers of a format as integers, in units of base**-scale; each operation is rounded once."""

    def __init__(self, given: Any, scale: int) -> None:
        b, t = self.base, self.digits = given["base"], given["precision"]
        need(b > 1 and t > 0, "a base or a precision that is none")
        self.unit, self.low, self.rounding = b**scale, b ** (t - 1), given["rounding"]
        powers = self.powers = [b**k for k in range(2 * scale + t + 2)]
        self.tops, self.exact = [b**t * p for p in powers], set(powers)
        self.nearest, self.fixed = self.rounding in ("nearest", "even"), "overflow" in given
        self.finest, self.normal, self.largest = 0, 0, inf
        if self.fixed:  # all numbers have one exponent, or are below; the most negative one is left out
            only = t - 1 - given["fraction_bits"]
            given = given | {"emin": only, "emax": only, "subnormal": True, "largest": None}
        if given["emin"] is None:
            sound = given["emax"] is None and given["subnormal"] and given["largest"] is None
            need(sound, "a range without its least exponent")
        else:
            if scale < 2 * t + 2 - given["emin"]:
                raise OverflowError
            least, most = scale + given["emin"], scale + given["emax"]
            self.finest, self.normal = (least - t + 1, 0) if given["subnormal"] else (0, b**least)
            nines = (b**t - 1) * b ** (most - t + 1)
            largest = nines if given["largest"] is None else given["largest"] * self.unit
            sound = least <= most and b**most <= largest <= nines and largest % b ** (most - t + 1) == 0
            need(sound, "the largest number is not one")
            self.largest, self.exact = int(largest), {self.unit}

    def last_place(self, q: int) -> int:
        """The exponent of the last digit of a number of q units."""
        return self.finest if q < self.low else max(self.finest, bisect_right(self.tops, q))

    def error(self, most: int, exact: bool, aligned: bool) -> int:
        """The largest error of rounding results of at most so many units; sums have no digit below the finest."""
        need(most <= self.largest, "a number of a step may exceed the largest")
        place = self.last_place(max(most - 1, 0))
        if exact or not most or (aligned and self.finest and place == self.finest):
            return 0
        return max(self.normal, up(self.powers[place], 1 + self.nearest))

    def fit(self, n: int, d: int = 1) -> Any:
        """Round n / d units."""
        q, r = divmod(abs(n), d)
        if r and q < self.low and not self.finest:
            if self.normal:
                return 0
            raise OverflowError
        p = self.powers[self.last_place(q)]
        m, rest = divmod(q, p)
        if rest or r:
            if self.nearest:
                beyond = 2 * (rest * d + r) - p * d
                m += beyond > 0 or (beyond == 0 and (self.rounding == "nearest" or m & 1))
            elif self.rounding != "chop":
                m += {"up": n > 0, "down": n < 0, "odd": not m & 1}[self.rounding]
        need(m * p <= self.largest, "a computed number exceeds the largest of the format")
        return 0 if m * p < self.normal else m * p if n > 0 else -m * p

    def store(self, x: Fraction) -> int:
        return int(self.fit(x.numerator * self.unit, x.denominator))

    def add(self, x: Any, y: Any) -> Any:
        return self.fit(x + y) if x and y else x + y

    def multiply(self, x: Any, y: Any) -> Any:
        return self.fit(x * y, self.unit) if x and y else 0

    def divide(self, x: Any, y: Any) -> Any:
        need(y, "the computed covariance divides by zero")
        return self.fit(x * self.unit if y > 0 else -x * self.unit, abs(y)) if x else 0

    def dot(self, row: Any, column: Any) -> Any:
        return reduce(self.add, map(self.multiply, row, column), 0)

    def product(self, a: Any, b: Any) -> Any:
        return [[self.dot(row, column) for column in turned(b)] for row in a]

    def complement(self, K: Any, H: Any) -> Any:
        """I - KH."""
        KH = self.product(K, H)
        return each(lambda x, y: self.add(x, -y), diagonal(len(KH), self.unit), KH)

    def shorter(self, a: Any, i: int, factor: Any, k: int, first: int = 0) -> None:
        """Subtract a multiple of row k from row i, from a column on."""
        pair = zip(a[i][first:], a[k][first:], strict=True)
        a[i][first:] = [self.add(x, -self.multiply(factor, y)) for x, y in pair]

    def inverse(self, given: Any) -> Any:
        """Eliminate without exchanges and substitute back; return also whether all pivots are positive."""
        m, a = len(given), [list(row) for row in given]
        c = diagonal(m, self.unit)
        for k, i in product(range(m), range(m)):
            if i > k:
                factor = self.divide(a[i][k], a[k][k])
                self.shorter(a, i, factor, k, k + 1)
                self.shorter(c, i, factor, k)
        for k in reversed(range(m)):
            for i in range(k + 1, m):
                self.shorter(c, k, a[k][i], i)
            c[k] = [self.divide(x, a[k][k]) for x in c[k]]
        return c, all(a[i][i] > 0 for i in range(m))

    def factors(self, given: Any) -> Any:
        """U of U D U', with D on its diagonal; None if a pivot is negative, or zero beside another number."""
        n, a = len(given), [list(row) for row in given]
        u = diagonal(n, 0)
        for j in reversed(range(n)):
            u[j][j] = d = a[j][j]
            if d < 0 or (d == 0 and any(a[i][j] for i in range(j))):
                return None
            for i in range(j if d else 0):
                u[i][j] = self.divide(a[i][j], d)
            for i, k in product(range(j if d else 0), range(j)):
                if k <= i:
                    a[k][i] = self.add(a[k][i], -self.multiply(u[k][j], a[i][j]))
        return u


class ExactArithmetic(Arithmetic):
    """The same algorithms with exact numbers."""

    unit, fit = 1, Fraction  # type: ignore[assignment]

    def __init__(self) -> None:
        """No format is needed."""


def definite(given: Any, strictly: bool = False) -> bool:
    """Whether a matrix of exact numbers is symmetric and positive semidefinite or, strictly, definite."""
    u = ExactArithmetic().factors(given)
    return given == turned(given) and u is not None and not (strictly and any(not u[i][i] for i in range(len(u))))


class StepOperations:
    """The operations of a step on n states and m measurements; a product has a coefficient and a value."""

    def __init__(self, n: int, m: int) -> None:
        self.first, self.operations = n + m, list[Any]()
        self.x, self.z = list(range(n)), list(range(n, n + m))

    def emit(self, kind: str, p: int, q: int) -> int:
        self.operations.append((kind, p, q))
        return self.first + len(self.operations) - 1

    def plus(self, p: int, q: int) -> int:
        return self.emit(ADD, p, q)

    def minus(self, p: int, c: int, q: int) -> int:
        return self.emit(SUBTRACT, p, self.emit(MULTIPLY, c, q))

    def sums(self, rows: Any, values: Any) -> list[int]:
        return [
            reduce(self.plus, [self.emit(MULTIPLY, c, v) for c, v in zip(row, values, strict=True)]) for row in rows
        ]


class Kalman:
    """The model as a format stores it; variances are raised until stored covariances and their factors are definite."""

    def __init__(self, a: Arithmetic, given: Any) -> None:
        roundoff = Fraction(1, a.base ** (a.digits - 1) * (1 + a.nearest))
        least = Fraction(2.0**-58 if a.fixed else float(roundoff))
        count = int(1 / least).bit_length() - 1 if given["repair"] else 0
        self.shares, self.a, self.form = [0, *(least * 2**k for k in range(count))], a, given["form"]
        Phi, H, Q, R, x0, P0 = (given[key] for key in ("Phi", "H", "Q", "R", "x0", "P0"))
        self.n, self.m = n, m = len(P0), len(R[0])
        sizes = ((Phi, n, n), (H, m, n), (Q, n, n), (R, m, m), ([P0], n, n), ([[x0]], 1, n))
        fits = all([*map(len, c)] == [columns] * rows for given, rows, columns in sizes for c in given)
        need(fits, "matrices that do not fit together")
        Q, (P0,), R = ([self.sound(c, strictly) for c in cs] for cs, strictly in ((Q, False), ([P0], False), (R, True)))
        self.stored = [[each(a.store, c) for c in given] for given in (Phi, H, Q, R, [P0])]
        self.x0, self.start, self.cycle = [a.store(x) for x in x0], self.stored[4][0], lcm(*map(len, self.stored))
        self.RI = [a.inverse(c) for c in self.stored[3] if self.form == "hung second gain"]
        need(all(positive for _, positive in self.RI), "R loses its definiteness when it is inverted")
        if self.form == "ud":
            self.UQ, self.UR, (self.start,) = map(self.factored, (Q, R, [P0]))

    def raised(self, c: Any, share: Any) -> Any:
        return [[self.a.store(x * (1 + share) if i == j else x) for j, x in enumerate(row)] for i, row in enumerate(c)]

    def sound(self, c: Any, strictly: bool) -> Any:
        need(definite(c, strictly), "a covariance of the model is not symmetric and definite")
        for share in self.shares:
            stored = each(lambda x: Fraction(x, self.a.unit), self.raised(c, share))
            if definite(stored, strictly):
                return stored if share else c
        raise NotProvedError("a stored covariance is not definite, so there is no exact filter")

    def factored(self, given: Any) -> Any:
        for share in self.shares:
            found = [self.a.factors(self.raised(c, share)) for c in given]
            if None not in found:
                return found
        raise NotProvedError("factors of a covariance are not definite in this format, so no filter runs")

    def members(self, k: int) -> Any:
        """Phi, H, Q and R of step k + 1."""
        return [c[k % len(c)] for c in self.stored[:4]]

    def step(self, k: int, P: Any) -> tuple[Any, Any, list[int]]:
        """The next covariance, or its factors; the operations of step k + 1; and the values that become the states."""
        made, (Phi, H, Q, R), a = StepOperations(self.n, self.m), self.members(k), self.a
        z = made.z
        if self.form == "ud":
            P, above, rows, gains = self.factor_step(k, P)
            u = made.sums(Phi, made.x)
            for i, r in product(reversed(range(self.m)), range(self.m)):
                z[i] = made.minus(z[i], above[i][r], z[r]) if r > i else z[i]
            for y, row, K in zip(z, rows, gains, strict=True):
                for c, v in zip(row, u, strict=True):
                    y = made.minus(y, c, v)
                u = [made.plus(v, made.emit(MULTIPLY, c, y)) for c, v in zip(K, u, strict=True)]
            return P, made.operations, u
        V = each(a.add, a.product(a.product(Phi, P), turned(Phi)), Q)
        PHt = a.product(V, turned(H))
        K = a.product(PHt, a.inverse(each(a.add, a.product(H, PHt), R))[0])
        W = a.complement(K, H)
        P = a.product(W, V)
        if self.form == "joseph":
            P = each(a.add, a.product(P, turned(W)), a.product(a.product(K, R), turned(K)))
        if self.form == "hung second gain":
            K = a.product(a.product(P, turned(H)), self.RI[k % len(self.RI)][0])
            W = a.complement(K, H)
        u = made.sums(a.product(W, Phi) if self.form.startswith("hung") else Phi, made.x)
        if not self.form.startswith("hung"):
            z = [made.emit(SUBTRACT, x, y) for x, y in zip(z, made.sums(H, u), strict=True)]
        return P, made.operations, list(map(made.plus, u, made.sums(K, z)))

    def factor_step(self, k: int, U: Any) -> Any:
        """Thornton's prediction, then Bierman's update by one decorrelated measurement after the other."""
        a, n, m, (Phi, H, _, _) = self.a, self.n, self.m, self.members(k)
        UQ, UR, h, gains = self.UQ[k % len(self.UQ)], self.UR[k % len(self.UR)], [list(row) for row in H], []
        D = [u[i][i] for u in (U, UQ) for i in range(n)]
        one = [[[x if i < j else a.unit * (i == j) for j, x in enumerate(r)] for i, r in enumerate(u)] for u in (U, UQ)]
        W, U = [x + y for x, y in zip(a.product(Phi, one[0]), one[1], strict=True)], diagonal(n, 0)
        for j in reversed(range(n)):
            C = list(map(a.multiply, D, W[j]))
            U[j][j] = a.dot(W[j], C)
            for i in range(j):
                U[i][j] = a.divide(a.dot(W[i], C), U[j][j]) if U[j][j] else 0
                a.shorter(W, i, U[i][j], j)
        for i, r in product(reversed(range(m)), range(m)):
            if r > i:
                a.shorter(h, i, UR[i][r], r)
        for i in range(m):
            f = [a.add(a.dot([U[r][j] for r in range(j)], h[i][:j]), h[i][j]) for j in range(n)]
            g, alpha, K = [a.multiply(U[j][j], f[j]) for j in range(n)], UR[i][i], [0] * n
            for j in range(n):
                if g[j]:
                    before, alpha = alpha, a.add(alpha, a.multiply(f[j], g[j]))
                    U[j][j], factor = a.divide(a.multiply(U[j][j], before), alpha), -a.divide(f[j], before)
                    for r in range(j):
                        u, U[r][j] = U[r][j], a.add(U[r][j], a.multiply(factor, K[r]))
                        K[r] = a.add(K[r], a.multiply(g[j], u))
                K[j] = g[j]
            gains.append([a.divide(x, alpha) for x in K])
        return U, UR, h, gains


class ExactCovariance:
    """A matrix A below the exact covariance P, and D for which P is below A + D, in units of 2**-bits."""

    def __init__(self, model: Kalman) -> None:
        Phi, H, Q, R, (P0,) = model.stored
        variances = [c[i][i] for c in (*Q, *R, P0) for i in range(len(c)) if c[i][i]]
        common = gcd(model.a.unit, *(x for given in (Phi, H, Q, R) for c in given for row in c for x in row))
        self.n, self.unit = model.n, model.a.unit // common
        self.bits = bits = 160 + 2 * max(0, *((model.a.unit // x).bit_length() for x in variances))
        self.members = list[Any]()
        for given in map(model.members, range(model.cycle)):
            Phi, H, Q, R = (each(lambda x: x // common, c) for c in given)
            scaled = [each(lambda x, p=p: x * self.unit**p << bits, c) for c, p in ((Q, 1), (R, 3))]
            self.members.append((turned(Phi), Phi, H, turned(H), across(H, turned(Phi)), *scaled))
        self.low = each(lambda x, y: (x << bits) // model.a.unit - y, P0, diagonal(self.n, self.n))
        self.width = diagonal(self.n, 2 * self.n)

    def step(self, k: int) -> tuple[Any, Any]:
        """Take step k + 1; return the gain of A, rounded down, and a bound of its distance from that of P."""
        PhiT, Phi, H, HT, HPhi, Q, R = self.members[k % len(self.members)]
        n, m, unit, bits = self.n, len(H), self.unit, self.bits
        V = each(add, around(Phi, self.low), Q)
        W = across(H, V)
        inverse, positive = ExactArithmetic().inverse(each(add, across(W, H), R))
        need(positive, "an innovation covariance is not definite")
        den = lcm(*(x.denominator for row in inverse for x in row))
        T, WT = each(lambda x: int(x * den), inverse), turned(W)
        X = across(WT, T)
        F = across(each(sub, diagonal(n, den), across(X, HT)), PhiT)
        seen = around(HPhi, self.width)
        below, square = den * unit**2, (den * unit) ** 2
        self.low = each(lambda x, y, z: (x * den - y) // below - z, V, across(X, WT), diagonal(n, n))
        self.width = each(lambda x, y: x // square + y, around(F, self.width), diagonal(n, 3 * n))
        T = [up(T[j][j] * unit**4 << 2 * bits, den) for j in range(m)]
        by = sum(isqrt(up(seen[t][t] * T[t], unit**4)) + 1 for t in range(m))
        roots = [[isqrt(self.width[i][i] * x) + 1 for x in T] for i in range(n)]
        return each(lambda x: (x * unit << bits) // den, X), each(lambda x: up(x * by, 1 << bits) + 1, roots)

    def settled(self, k: int, period: int, width: Any) -> Any:
        """Gains of all steps after the first k, one for each phase, with bounds of their distances."""
        need([*map(len, width)] == [self.n] * self.n, "no interval of the exact covariance")
        width = each(lambda x: int(x * 2**self.bits // 1), width)
        low = each(lambda x, w: x - w // 2, self.low, width)
        gains: list[Any] = []
        for phases in (period, 0):
            more = each(sub, self.low, low)
            rest = each(lambda w, x, d: w - x - d, width, more, self.width)
            need(definite(more) and definite(rest), "the exact covariance was not shown to settle")
            self.low, self.width = low, width
            gains += [self.step(k + p) for p in range(phases)]
        return gains


def near(row: Any, known: Any, whole: int, box: Any) -> int:
    """Bound the largest size of a row by those of others, times shares of `whole`, and of their difference."""
    rest = [whole * x for x in row]
    for share, other, _ in known:
        rest = [x - share * y for x, y in zip(rest, other, strict=True)]
    return up(sum(abs(share) * most for share, _, most in known) + size(rest, box), whole)


class ErrorSet:
    """A set that contains an error or a state: segments of the last steps, a box, and an ellipsoid for all before."""

    def __init__(self, sizes: Any, loops: int, message: str, start: Any = ()) -> None:
        self.sizes, self.loops, self.message, self.n = sizes, loops, message, len(sizes)
        self.counts, self.x = [1] if start else [], [list(start[i : i + 1]) for i in range(self.n)]
        self.box, self.M, self.one = [0] * self.n, diagonal(self.n, 0), diagonal(self.n, 1 << loops)

    def image(self, row: Any, start: int = 0) -> list[int]:
        """A row, in units of 2**-loops, times each segment."""
        total = [start] * len(self.x[0])
        for f, x in zip(row, self.x, strict=True):
            total = list(map(add, total, map(mul, repeat(f), x))) if f else total
        return total

    def most(self, row: Any) -> int:
        """The largest size of a row, in units of 2**-loops, times the vector."""
        return sum(map(abs, self.image(row))) + size(row, self.box) + isqrt(max(0, around([row], self.M)[0][0])) + 1

    def entries(self) -> list[int]:
        """The largest size of each entry."""
        return [sum(map(abs, x)) + self.box[i] + isqrt(self.M[i][i]) + 1 for i, x in enumerate(self.x)]

    def move(self, F: Any) -> None:
        """Take the image of the set, and round its numbers."""
        moved, loops = [self.image(row, 1 << self.loops - 1) for row in F], self.loops
        self.x = [[s >> loops for s in x] for x in moved]
        self.box = [up(size(row, self.box), 1 << loops) + len(moved[0]) for row in F]
        self.M = each(lambda x, y: (x >> 2 * loops) + y, around(F, self.M), diagonal(self.n, self.n))

    def add(self, columns: Any, slack: Any, counts: list[int]) -> None:
        """Add a box, and the columns of as many steps as there are counts."""
        self.counts = self.counts + counts
        self.x = [x + [g[i] for g in columns] for i, x in enumerate(self.x)]
        self.box = list(map(add, self.box, slack))

    def advance(self, steps: Any, keep: int, last: int) -> None:
        """Take some steps, after each of which some rows, first those of the states, must be within limits."""
        new, P, after = ErrorSet(self.sizes, self.loops, self.message), self.one, []
        for F, columns, slack, rows, limits in steps:
            new.move(F)
            new.add(columns, slack, [len(columns)])
            P = each(lambda x: x >> self.loops, across(F, turned(P)))
            rooms = [(limit << self.loops) - new.most(row) for row, limit in zip(rows, limits, strict=True)]
            after.append((each(lambda x: x >> self.loops, across(rows, turned(P))), rooms))
        old, count = copy(self), len(steps)
        self.move(P)
        box, (before, later) = old.entries(), ([x << self.loops for x in s.entries()] for s in (old, self))
        for j, (rows, rooms) in enumerate(after, 1):
            for i, (row, room) in enumerate(zip(rows, rooms, strict=True)):
                known = [(count - j, self.one[i], before[i]), (j, P[i], later[i])] if i < self.n else []
                sound = near(row, known, count, box) <= room or old.most(row) <= room
                need(sound, f"{self.message} after step {last - count + j}")
        self.add(turned(new.x), new.box, new.counts)
        self.absorb(keep)

    def absorb(self, keep: int) -> None:
        """Let the ellipsoid contain the box and old segments; the numbers t of (1) are the lengths of all."""
        segments, self.box = times(diagonal(self.n), self.box, 1), [0] * self.n
        while len(self.counts) > keep:
            count = self.counts.pop(0)
            segments += turned([x[:count] for x in self.x])
            self.x = [x[count:] for x in self.x]
        units = [(max(self.sizes) << 60) // max(s, 1) for s in self.sizes]
        sized = ([isqrt(self.M[i][i]) for i in range(self.n)], *segments)
        own, *lengths = (1 + isqrt(sum([x * x for x in map(mul, g, units)])) for g in sized)
        total = (own + sum(lengths)) << 40
        shares, x = [up(total, length) for length in lengths], turned(segments)
        added = across([list(map(mul, row, shares)) for row in x], x)
        self.M = each(lambda x, y, z: (x * up(total, own) + y >> 40) + z, self.M, added, diagonal(self.n, self.n))


class Proof:
    """The claim of a certificate; sizes are in units of the format, loops in units of 2**-loops."""

    def __init__(self, given: Any, scale: int) -> None:
        self.given, self.a, made = given, Arithmetic(given["format"], scale), given["filter"]
        self.steps, self.period, self.first = given["steps"], given["period"], given["first"]
        need(
            self.steps != 0 and min(self.steps or 1, *(given[key] for key in COUNTS)) >= 0,
            "a number of steps that is none",
        )
        self.model: Any = Kalman(self.a, made) if made["kind"] == "kalman" else None
        self.exact: Any = ExactCovariance(self.model) if self.model else None
        self.n: int = self.model.n if self.model else made["states"]
        self.m: int = self.model.m if self.model else made["inputs"]
        self.x0: Any = self.model.x0 if self.model else [0] * self.n
        self.limit(*[*given["limits"].values(), *given["derived"].values(), given["bound"]])
        lengths = [[x.bit_length() for x in xs if x] or [0] for xs in (self.b, self.X)]
        self.loops = 64 + max(max(each) - min(each) for each in lengths)
        self.one, self.caps = diagonal(self.n, 1 << self.loops), dict[int, int]()
        self.program: Any = None if self.model else self.fixed_program(**made)

    def limit(self, X: Any, V: Any, Z: Any, least_X: Any, least_V: Any, bound: Any) -> None:
        """Put the limits and the bound into units, rounded up; `most` is the bound rounded down."""
        n, m, unit = self.n, self.m, self.a.unit
        given = (X, V, Z, least_X, least_V, bound)
        need(list(map(len, given)) == [n, m, m, n, m, n], "limits or a bound of another filter")
        need(all(x is None or x >= 0 for xs in given for x in xs), "a negative limit")
        if any(x and x * unit < 2**75 for x in bound):
            raise OverflowError
        Z = [x and max(x, *(abs(Fraction(self.a.store(y), unit)) for y in (x, -x))) for x in Z]
        least = [y if x is None else min(x, y) for x, y in zip(X + V, least_X + least_V, strict=True)]
        self.derived = least != X + V
        need(not self.derived or None not in Z, "limits that do not follow from others")
        within = all(abs(x) <= y * unit for x, y in zip(self.x0, least[:n], strict=True))
        need(within, "the first estimate is beyond its limit")
        sizes: Any = [[None if x is None else -(-x * unit // 1) for x in xs] for xs in (least[:n], least[n:], Z, bound)]
        self.X, self.V, self.Z, self.b = sizes
        self.most = [x * unit // 1 for x in bound]

    def fixed_program(self, kind: str, states: int, inputs: int, operations: Any, outputs: Any, **more: Any) -> Any:
        """The operations of a filter with fixed coefficients, which must compute the recursion that the file states."""
        need(self.derived and all(map(le, self.Z, self.V)), "no limits on the inputs, or too small ones")
        c, made, sound = more["coefficients"], list[Any](), len(outputs) == states and min(outputs) >= 0
        for v, (kind, p, q) in enumerate(operations, states + inputs):
            if kind not in (MULTIPLY, ADD, SUBTRACT):
                raise NotImplementedError(f"the operation {kind!r}")
            sound = sound and type(p) is type(q) is int and 0 <= q < v and 0 <= p < (len(c) if kind == MULTIPLY else v)
            need(sound, "operations on values that are not known")
            made.append((kind, self.a.store(c[p]) if kind == MULTIPLY else p, q))
        rows, one, _ = self.values([[0] * states] * inputs, made, outputs)
        stated = [x + y for x, y in zip(more["A"], more["B"], strict=True)]
        found = [[Fraction(x, one) for x in rows[v][: states + inputs]] for v in outputs]
        need(found == stated, "the operations do not compute the recursion that the file states")
        self.first, self.period = 0, 1
        return made, outputs

    def values(self, HPhi: Any, operations: Any, outputs: Any) -> tuple[Any, int, list[int]]:
        """Factors of x and z of each value, and of x for the same function of v and x; their unit; rounding errors."""
        a, n, m, depth = self.a, self.n, self.m, [2] * (self.n + self.m)
        for kind, p, q in operations:
            depth.append(depth[q] + 1 if kind == MULTIPLY else max(depth[p], depth[q]))
        one = a.unit ** max(depth)  # so that each product is a whole number
        rows = [x + [0] * m + x for x in diagonal(n, one)]
        measured = zip(diagonal(m, one), HPhi, strict=True)
        rows += [[0] * n + z + [x * one // a.unit**2 for x in seen] for z, seen in measured]
        computed = list(map(add, self.X, self.b))
        limits = [self.b + self.V + self.X] + ([] if None in self.Z else [computed + self.Z])
        ends = {v: min(x for x, r in zip(computed, outputs, strict=True) if r == v) for v in outputs}
        off, none, errors = ([0] * (n + m) for _ in range(3))
        for v, (kind, p, q) in enumerate(operations, n + m):
            if kind == MULTIPLY:
                rows.append([p * x // a.unit for x in rows[q]])
                off.append(up(abs(p) * off[q], a.unit))
                none.append(none[q] or p == 0)
                exact = none[v] or abs(p) in a.exact
            else:
                rows.append(list(map(add if kind == ADD else sub, rows[p], rows[q])))
                off.append(off[p] + off[q])
                none.append(none[p] and none[q])
                exact = none[p] or none[q]
            most = min(up(min([size(rows[v], sizes) for sizes in limits]), one), self.caps.get(v, inf))
            errors.append(a.error(min(most + off[v], ends.get(v, inf)), bool(exact), kind != MULTIPLY))
            off[v] += errors[v]
        return rows, one, errors

    def parts(self, Phi: Any, HPhi: Any, operations: Any, outputs: Any) -> Any:
        """Loop and gain of a step, and columns of its errors, of its inputs, and of both through the exact filter."""
        n, start, (rows, one, errors) = self.n, self.n + self.m, self.values(HPhi, operations, outputs)
        effect, found = [[0] * n for _ in rows], dict[tuple[int, ...], int]()
        for i, v in enumerate(outputs):
            effect[v][i] = one
        for v, (kind, p, q) in reversed(list(enumerate(operations, start))):
            if errors[v]:  # roundings with the same effect are added
                column = max(tuple(effect[v]), tuple(-x for x in effect[v]))
                found[column] = found.get(column, 0) + errors[v]
            if kind == MULTIPLY:
                effect[q] = [x + p * y // self.a.unit for x, y in zip(effect[q], effect[v], strict=True)]
            else:
                effect[p] = list(map(add, effect[p], effect[v]))
                effect[q] = list(map(add if kind == ADD else sub, effect[q], effect[v]))
        F, K, loop = ([rows[v][part] for v in outputs] for part in map(slice, (0, n, start), (n, start, None)))
        inputs = [] if None in self.Z else times(turned(K), self.Z, one)
        loop = each(lambda x, y: x - y * one // self.a.unit, loop, Phi) if Phi else diagonal(n, 0)
        both = list(filter(any, times(turned(loop), self.X, one)))
        F = each(lambda x: (x << self.loops) // one, F)
        K = each(lambda x: (x << self.exact.bits) // one, K) if self.exact else []
        return F, K, times(found, found.values(), one), inputs, both

    def coefficients(self) -> Any:
        """The parts of each step, without end; the covariance is emulated until it recurs, as claimed."""
        given, model, known = self.given, self.model, list[Any]()
        while not model:
            yield self.parts([], [[0] * self.n] * self.m, *self.program)
        begin, end = given["repeat"], given["repeat"] + self.period
        sound = begin <= self.first and self.period > 0 and self.period % model.cycle == 0
        need(sound or self.steps, "the gain cannot repeat after such a period")
        P = kept = model.start
        for k in range(self.steps or end):
            P, *program = model.step(k, P)
            kept = P if k + 1 == begin else kept
            need(self.steps or k + 1 < end or kept == P, "the computed covariance does not recur as claimed")
            Phi, H, *_ = model.members(k)
            known.append(self.parts(Phi, across(H, turned(Phi)), *program))
            yield known[-1]
            if k < begin:
                known.clear()
        yield from cycle(known)

    def seen(self, k: int) -> Any:
        """H Phi of step k + 1 in units of 2**-loops, and what it may add to the measurements of an innovation."""
        if not (self.model and self.derived) or k == self.steps:
            return [], []
        Phi, H, *_ = self.model.members(k)
        rows = each(lambda x: (x << self.loops) // self.a.unit**2, across(H, turned(Phi)))
        return rows, [v - z - 2 * (sum(self.X) >> self.loops) - 2 for v, z in zip(self.V, self.Z, strict=True)]

    def step(self, k: int, parts: Any, gain: Any) -> Any:
        """The loop of step k + 1, and columns, slack and limits after it, of errors and of the exact filter."""
        F, K, errors, inputs, both = parts
        slack = [2 + len(errors) + 2 * self.n + 3 * self.m] * self.n
        if gain:
            more = each(sub, K, gain[0])
            both = both + times(turned(more), self.V, 1 << self.exact.bits)
            off = [size(row, self.V) + sum(self.V) for row in gain[1]]
            slack = [x + up(y, 1 << self.exact.bits) for x, y in zip(slack, off, strict=True)]
        far, near = ([x + 2 * (sum(s) >> self.loops) + 2 for x in slack] for s in (self.b, self.X))
        rows, most = self.seen(k + 1)
        return (F, errors + both, far, self.one, self.most), (F, inputs + both, near, self.one + rows, self.X + most)

    def run(self) -> None:
        """Take the first steps, and prove that all later ones remain within the limits."""
        parts, first = self.coefficients(), self.first if self.steps is None else self.steps
        states, errors = ErrorSet(self.X, self.loops, STATE, self.x0), ErrorSet(self.b, self.loops, ERROR)
        rows, most = self.seen(0)
        need(all(states.most(row) <= x << self.loops for row, x in zip(rows, most, strict=True)), STATE)
        for k in range(0, first, BLOCK):
            ahead = range(k, min(k + BLOCK, first))
            steps = [self.step(i, next(parts), self.exact and self.exact.step(i)) for i in ahead]
            for i, reach in enumerate((errors, states)[: 1 + self.derived]):
                reach.advance([step[i] for step in steps], self.given["keep"], ahead[-1] + 1)
        if self.steps is None:
            need(self.given["back"] > 0, "no step back")
            gains = self.exact.settled(first, self.period, self.given["width"]) if self.exact else [None]
            steps = [self.step(k, next(parts), gain) for k, gain in enumerate(gains, first)]
            if self.derived:
                self.remain(states, [step[1] for step in steps])
            if not self.model:
                self.cap([step[1] for step in steps])
                steps = [self.step(0, next(parts), None)]
            self.remain(errors, [step[0] for step in steps])

    def remain(self, reach: ErrorSet, steps: Any) -> None:
        """Prove that a vector remains within limits after the steps of a period, and after all later ones."""
        for phase, (*_, rows, limits) in enumerate(steps):
            found = self.later(rows, phase, steps, reach.sizes, reach, limits)
            need(all(map(le, found, limits)), f"{reach.message}, in phase {phase} of the period")

    def later(self, rows: Any, phase: int, steps: Any, most: Any, reach: Any = None, limits: Any = ()) -> Any:
        """Bound rows, in units of 2**-loops, times a vector after any step of a phase; `most` bounds earlier ones."""
        # `reach` is the set before the first of all steps; the first steps need `limits`.
        loops, sums, known = self.loops, [0] * len(rows), [(row, reach.most(row)) for row in rows] if reach else []
        box = reach.entries() if reach else []
        for lag in range(self.given["back"]):
            F, columns, slack, *_ = steps[(phase - lag) % len(steps)]
            for g in columns:
                sums = [x + abs(sum(map(mul, row, g))) for x, row in zip(sums, rows, strict=True)]
            sums = [x + size(row, slack) + sum(most) for x, row in zip(sums, rows, strict=True)]
            rows = each(lambda x: x >> loops, across(rows, turned(F)))
            if reach and lag % len(steps) == phase:
                for i, (x, row, limit) in enumerate(zip(sums, rows, limits, strict=True)):
                    room, (other, found) = (limit << loops) - x, known[i]
                    a, b = ([x * y for x, y in zip(r, box, strict=True)] for r in (row, other))
                    if near(row, [(sum(map(mul, a, b)), other, found)], sum(map(mul, b, b)) or 1, box) > room:
                        known[i] = row, reach.most(row)
                        need(known[i][1] <= room, f"{reach.message} later")
        return [up(x + size(row, most), 1 << loops) for x, row in zip(sums, rows, strict=True)]

    def cap(self, steps: Any) -> None:
        """Bound each value of a filter with fixed coefficients by all its inputs."""
        rows, one, _ = self.values([[0] * self.n] * self.m, *self.program)
        A, missed = [[(x << self.loops) // one for x in row[: self.n]] for row in rows], (sum(self.X) >> self.loops) + 1
        for v, (x, row) in enumerate(zip(self.later(A, 0, steps, self.X), rows, strict=True)):
            self.caps[v] = x + missed + up(size(row, self.b + self.Z), one)


def prove(given: Any) -> str:
    """Return the claim of a certificate as a sentence, proved; or raise NotProvedError or NotImplementedError."""
    try:
        fmt, made = given["format"], given["filter"]
        parts = {"filter": FILTERS.get(made["kind"], ()), "format": FIXED if "overflow" in fmt else FLOAT}
        content, scale = read(given, FILE | parts), 3 * fmt["precision"] + 40
        while scale < 20_000:
            try:
                Proof(content, scale).run()
                bound = [nextafter(float(x), inf) for x in content["bound"]]
                form = f"{made.get('form', 'fixed coefficients')}, {fmt}"
                when = f"{given['steps'] or 'any number of'} steps within {given['limits']}"
                return f"{given['name']!r} ({form}): after {when}, rounding has moved states by at most {bound}"
            except (OverflowError, IndexError):
                scale = scale * 3 // 2
        raise NotImplementedError("numbers need too fine a unit, or are not there")
    except (KeyError, TypeError, ValueError, ZeroDivisionError, AttributeError) as error:
        raise NotProvedError(f"the file is no certificate: {error!r}") from error


def once(pairs: Any) -> Any:
    need(len(dict(pairs)) == len(pairs), "a key occurs twice")
    return dict(pairs)


def main(arguments: Any = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gpbnb.bounds.check", description="Prove a rounding guarantee.")
    parser.add_argument("certificate", type=argparse.FileType(encoding="utf-8"), help="JSON file")
    try:
        given = json.load(parser.parse_args(arguments).certificate, object_pairs_hook=once)
        print(f"{prove(given)}.\nproved")
    except (NotProvedError, NotImplementedError) as error:
        print(f"not {'proved' if isinstance(error, NotProvedError) else 'covered'}: {error}")
        return 1
    except (ValueError, RecursionError) as error:
        parser.error(f"got a file that is not JSON: {error}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
