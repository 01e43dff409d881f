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
    g_j'/t_j), with s = t + sum t_j, for any t, t_j > 0, by the inequality of Cauchy and Schwarz. Segments of g + h
    and g - h contain those of g and h, since pg + qh = (p + q)/2 (g + h) + (p - q)/2 (g - h), with factors of at most
    1. Two old steps are merged in this way, with the smaller of the two in the ellipsoid. The largest size m(r) of
    r e over a set is a seminorm of the row r, so m(r) <= sum |c_j| m(r_j) + |r - sum c_j r_j| b for any rows r_j, if
    |e| <= b. Steps are taken in blocks: after j steps, e is P_j e_0 plus the effects of their own w, for the product
    P_j of loops; r P_j is near (1 - j/J) r + (j/J) r P_J, so only the end of a block moves the set. Within a block,
    |e_j| <= |F'_j| |e_{j-1}| + |w_j| bounds these effects; where that is too large, they are added one by one.

    (2) For a row C_0, any rows C_1, ..., C_L with 1 <= L <= k, and R_l = C_l F'_{k-l} - C_{l+1}, telescoping gives
    exactly C_0 e_k = sum_{l<L} (C_l w_{k-l} + R_l e_{k-l-1}) + C_L e_{k-L}. If |e_j| <= b for all j < k, then
    |C_0 e_k| <= sum (|C_l w_{k-l}| + |R_l| b) + |C_L| b; or fewer terms meet the set of (1). If that is at most b_i
    for each unit row and phase, then |e_k| <= b for all k, by induction; see proof/guarantee.v. Here C_{l+1} is
    C_l F', rounded down in its last place, so that R_l is at most one unit of it. Phases whose steps are nearly alike
    are taken as one, with the mean F' and G of them all, and with what theirs differ from these in w.

    (3) A computed covariance that recurs after a whole number of the model's cycles recurs for ever, with all
    coefficients.

    (4) The exact step of a covariance, E(P) = V - V H' (H V H' + R)^-1 H V with V = Phi P Phi' + Q, is the least of
    (I - KH) V (I - KH)' + K R K' over all K. So it keeps the order of symmetric matrices: if A <= P <= B, then
    E(A) <= E(P) <= E(B), if H V H' + R is definite for A. If a cycle leads A and B back between A and B, covariances
    stay there. The gain is E(P) H' R^-1. With D = E(B) - E(A) and row c_j of R^-1 H, its entry i, j differs from the
    mean of those of A and B by at most half the square root of D_ii times c_j D c_j', by Cauchy and Schwarz.

    (5) A result within M is rounded by at most h(M): half a unit in the last place of M, or a whole one unless to
    nearest. M holds the exact filter's limits, b, and earlier roundings of the step. For the last operation of
    state i, M <= |x_i| + b_i, as condition (2) without its rounding h gives b_i - h. Products with powers of the
    base (in a format with a range: with 0 and +-1) and sums with zero are exact. So are sums whose last place is that
    of the smallest numbers: all those of fixed point, which is a format with a single exponent.

    (6) For fixed coefficients, the file states x' = Ax + Bz, which the operations must compute with coefficients as
    stored or as given. In the second case errors also obey e' = F'e + (F' - A)x + (K' - B)z + K'(z' - z), with z' the
    stored input. A vector y' = Fy + w is followed for L steps by (2): |y_k - P y_(k-L)| <= T for a P near F^L.
    If that holds for P and T after L steps, |y_k - P^2 y_(k-2L)| <= T + |P| T after 2L. So |y| <= T + |P| Y after i + L
    steps if |y| <= Y after i, for any number of steps; and for all steps once P is small. A rounding in words is half a
    unit of the data or the sums, or a whole one, if it drops a bit; limits of none are for inputs without an overflow.

    Not covered: covariances rounded at random, gains that never repeat, known inputs, limited values, other orders.
"""

from __future__ import annotations

import argparse
import json
import re
from bisect import bisect_right
from collections.abc import Iterator
from fractions import Fraction
from functools import reduce
from itertools import combinations, combinations_with_replacement, cycle, islice, repeat
from math import inf, isqrt, lcm, nextafter
from operator import add, mul, sub
from typing import Any

# What a file looks like: a tuple lists words, a list holds any number of entries, and a set stands for one or none.
KNOWN, VECTOR, CYCLE = [{Fraction}], [Fraction], [[[Fraction]]]
LIMITS = {"state": KNOWN, "innovation": KNOWN}
NEAREST = ("nearest", "even", "half up")
RULES = {"base": int, "precision": int, "rounding": (*NEAREST, "chop", "up", "down", "odd", "stochastic")}
FIXED = RULES | {"fraction_bits": int, "overflow": ("raise", "saturate", "wrap")}
FLOAT = RULES | {"emin": {int}, "emax": {int}, "subnormal": bool, "largest": {Fraction}}
FORMS = ("innovation", "joseph", "hung", "hung second gain", "ud")
MODEL = {"Phi": CYCLE, "H": CYCLE, "Q": CYCLE, "R": CYCLE, "x0": VECTOR, "P0": [VECTOR]}
OPERATIONS = {"operations": [list], "wide": [bool], "outputs": [int], "coefficients": VECTOR, "stored": VECTOR}
RECURSION = {"exact": ("as given", "as stored"), "A": [VECTOR], "B": [VECTOR]}
FILTERS = {
    "kalman": {"kind": str, "form": FORMS, "repair": bool, "repaired": [str]} | MODEL,
    "linear": {"kind": str, "states": int, "inputs": int} | OPERATIONS | RECURSION,
}
FILE = {
    "certificate": ("rounding guarantee 2",),
    "name": str,
    "order": ("each product and sum rounded once, sums from left to right",),
    "bound": VECTOR,
    "steps": {int},
    "back": int,
}
STAY = {"below": [VECTOR], "above": [VECTOR]}
COUNTS = {"repeat": int, "period": int, "phases": int, "first": int, "keep": int}
FILES = {
    "kalman": FILE | COUNTS | STAY | {"limits": LIMITS | {"measurement": KNOWN}, "derived": LIMITS},
    "linear": FILE | {"limits": {"measurement": KNOWN}, "derived": {"state": VECTOR}},
}
NUMBER = re.compile(r"-?[0-9]{1,4000}([./][0-9]{1,4000})?", re.ASCII)
MULTIPLY, ADD, SUBTRACT = "multiply", "add", "subtract"
LARGER, DERIVED = "the error may exceed its bound", "a state or an innovation may exceed its limit"
BLOCK, PEAK = 8, 128  # steps that are taken together, for speed; bits of the shares in (6)


class NotProvedError(Exception):
    """A claim that is wrong, or that cannot be proved; with the shares of its bounds and its limits that are needed."""

    shares: Any = ((), ())


def need(truth: Any, message: str, shares: Any = ((), ())) -> None:
    if not truth:
        error = NotProvedError(message)
        error.shares = shares
        raise error


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


def scaled(columns: Any, sizes: Any, unit: int = 0) -> Any:
    """Columns times sizes; rounded down to whole numbers of units, if there is one."""
    return [[x * s // unit if unit else x * s for x in g] for g, s in zip(columns, sizes, strict=True)]


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


class Arithmetic:
    """Numbers of a format as integers, in units of base**-scale; each operation is rounded once."""

    def __init__(self, given: Any, scale: int) -> None:
        b, t = self.base, self.digits = given["base"], given["precision"]
        need(b > 1 and t > 0, "a base or a precision that is none")
        self.unit, self.low, self.rounding, self.scale = b**scale, b ** (t - 1), given["rounding"], scale
        self.wraps = given.get("overflow") == "wrap"
        powers = self.powers = [b**k for k in range(2 * scale + t + 2)]
        self.tops, self.exact = [b**t * p for p in powers], set(powers)
        self.nearest, self.fixed = self.rounding in NEAREST, "overflow" in given
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
        place = self.finest if q < self.low else max(self.finest, bisect_right(self.tops, q))
        if place >= len(self.powers):
            raise OverflowError
        return place

    def error(self, most: int, aligned: bool) -> int:
        """The largest error of rounding results of at most so many units; sums have no digit below the finest."""
        need(most <= self.largest, "a number of a step may exceed the largest")
        place = self.last_place(max(most - 1, 0))
        if not most or (aligned and self.finest and place == self.finest):
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
                m += beyond > 0 if beyond else {"nearest": True, "even": m & 1, "half up": n > 0}[self.rounding]
            elif self.rounding != "chop":
                m += {"up": n > 0, "down": n < 0, "odd": not m & 1, "stochastic": True}[self.rounding]
        need(m * p <= self.largest, "a computed number exceeds the largest of the format")
        return 0 if m * p < self.normal else m * p if n > 0 else -m * p

    def store(self, x: Fraction) -> int:
        return int(self.fit(x.numerator * self.unit, x.denominator))

    def add(self, x: Any, y: Any, sign: int = 1) -> Any:
        return self.fit(x + sign * y) if x and y else x + sign * y

    def multiply(self, x: Any, y: Any) -> Any:
        if x == self.unit or y == self.unit:
            return y if x == self.unit else x
        return self.fit(x * y, self.unit) if x and y else 0

    def divide(self, x: Any, y: Any) -> Any:
        need(y, "the computed covariance divides by zero")
        return self.fit(x * self.unit if y > 0 else -x * self.unit, abs(y)) if x else 0

    def dot(self, row: Any, column: Any) -> Any:
        return reduce(self.add, map(self.multiply, row, column), 0)

    def product(self, a: Any, b: Any) -> Any:
        return [[self.dot(row, column) for column in turned(b)] for row in a]

    def sum(self, a: Any, b: Any, sign: int = 1) -> Any:
        return each(lambda x, y: self.add(x, y, sign), a, b)

    def shorter(self, a: Any, i: int, factor: Any, k: int, first: int = 0) -> None:
        """Subtract a multiple of row k from row i, from a column on."""
        pair = zip(a[i][first:], a[k][first:], strict=True)
        a[i][first:] = [self.add(x, self.multiply(factor, y), -1) for x, y in pair]

    def inverse(self, given: Any) -> Any:
        """Eliminate without exchanges and substitute back; return also whether all pivots are positive."""
        m, a = len(given), list(map(add, given, diagonal(len(given), self.unit)))
        for k, i in combinations(range(m), 2):
            self.shorter(a, i, self.divide(a[i][k], a[k][k]), k, k + 1)
        for k in reversed(range(m)):
            for i in range(k + 1, m):
                self.shorter(a, k, a[k][i], i, m)
            a[k][m:] = [self.divide(x, a[k][k]) for x in a[k][m:]]
        return [row[m:] for row in a], all(a[i][i] > 0 for i in range(m))

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
            for k, i in combinations_with_replacement(range(j if d else 0), 2):
                a[k][i] = self.add(a[k][i], self.multiply(u[k][j], a[i][j]), -1)
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


class RoundedStep(ExactArithmetic):
    """The same algorithms with values of a step: their factors, in units of 1 / one, of its inputs and roundings.

    Inputs are the error of the last estimate, the innovation, and the state of the exact filter.
    """

    def __init__(self, a: Arithmetic, depth: int, ends: Any, *sizes: Any) -> None:
        self.a, self.unit, self.one, self.ends = a, a.unit, a.unit**depth, ends
        self.sizes = [list(each) for each in sizes]

    def rounded(self, value: Any, aligned: bool, end: Any) -> Any:
        """Round a value that is at most `end`, and at most any sum of the sizes of its inputs and roundings."""
        sums = [up(sum([abs(f) * sizes[i] for i, f in value.items()]), self.one) for sizes in self.sizes]
        error = self.a.error(min(*sums, end), aligned)
        if error:
            value[len(self.sizes[0])] = self.one
            for sizes in self.sizes:
                sizes.append(error)
        return value

    def add(self, x: Any, y: Any, sign: int = 1, end: Any = inf) -> Any:
        value = dict(x or {})
        for i, f in y.items():
            value[i] = value.get(i, 0) + sign * f
        return self.rounded(value, True, end) if x and y else value

    def multiply(self, x: Any, y: Any) -> Any:
        """A number times a value."""
        value = {i: x * f // self.unit for i, f in y.items()} if x else {}
        return self.rounded(value, False, inf) if value and abs(x) not in self.a.exact else value

    def last(self, x: Any, y: Any) -> Any:
        """The sums that are the new states."""
        return [[self.add(p, q, 1, end)] for (p,), (q,), end in zip(x, y, self.ends, strict=True)]


class Kalman:
    """The model as a format stores it; variances are raised until stored covariances and their factors are definite."""

    def __init__(self, a: Arithmetic, form: str, repair: bool, **given: Any) -> None:
        roundoff = Fraction(1, a.base ** (a.digits - 1) * (1 + a.nearest))
        least = Fraction(2.0**-58 if a.fixed else float(roundoff))
        count = int(1 / least).bit_length() - 1 if repair else 0
        self.shares, self.a, self.form = [0, *(least * 2**k for k in range(count))], a, form
        Phi, H, Q, R, x0, P0 = (given[key] for key in ("Phi", "H", "Q", "R", "x0", "P0"))
        self.n, self.m = n, m = len(P0), len(R[0])
        self.depth = 3 * m  # the most products with coefficients in a row
        sizes = ((Phi, n, n), (H, m, n), (Q, n, n), (R, m, m), ([P0], n, n), ([[x0]], 1, n))
        fits = all([*map(len, c)] == [columns] * rows for given, rows, columns in sizes for c in given)
        need(fits, "matrices that do not fit together")
        Q, (P0,), R = ([self.sound(c, strictly) for c in cs] for cs, strictly in ((Q, False), ([P0], False), (R, True)))
        self.stored = [[each(a.store, c) for c in given] for given in (Phi, H, Q, R, [P0])]
        self.x0, self.start, self.cycle = [a.store(x) for x in x0], self.stored[4][0], lcm(*map(len, self.stored))
        self.RI = [a.inverse(c) for c in self.stored[3] if form == "hung second gain"]
        need(all(positive for _, positive in self.RI), "R loses its definiteness when it is inverted")
        if form == "ud":
            self.UQ, self.UR, (self.start,) = map(self.factored, (Q, R, [P0]), (False, True, False))

    def raised(self, c: Any, share: Any) -> Any:
        return [[self.a.store(x * (1 + share) if i == j else x) for j, x in enumerate(row)] for i, row in enumerate(c)]

    def sound(self, c: Any, strictly: bool) -> Any:
        need(definite(c, strictly), "a covariance of the model is not symmetric and definite")
        for share in self.shares:
            stored = each(lambda x: Fraction(x, self.a.unit), self.raised(c, share))
            if definite(stored, strictly):
                return stored if share else c
        raise NotProvedError("a stored covariance is not definite, so there is no exact filter")

    def factored(self, given: Any, strictly: bool) -> Any:
        for share in self.shares:
            found = [self.a.factors(self.raised(c, share)) for c in given]
            if None not in found and not (strictly and any(not u[i][i] for u in found for i in range(len(u)))):
                return found
        raise NotProvedError("factors of a covariance are not definite in this format, so no filter runs")

    def members(self, k: int) -> Any:
        """Phi, H, Q and R of step k + 1."""
        return [c[k % len(c)] for c in self.stored[:4]]

    def step(self, k: int, P: Any, step: RoundedStep, x: Any, v: Any) -> Any:
        """The next covariance, or its factors; the states after step k + 1; its measurements, and Phi."""
        a, (Phi, H, Q, R) = self.a, self.members(k)
        for (value,), row in zip(v, across(H, turned(Phi)), strict=True):  # v, and what was predicted
            value |= {self.n + self.m + i: f * step.one // a.unit**2 for i, f in enumerate(row)}
        z = [list(row) for row in v]  # decorrelated in place
        if self.form == "ud":
            return *self.factor_step(k, P, step, step.product(Phi, x), z), v, Phi
        V = a.sum(a.product(a.product(Phi, P), turned(Phi)), Q)
        PHt = a.product(V, turned(H))
        K = a.product(PHt, a.inverse(a.sum(a.product(H, PHt), R))[0])
        W = a.sum(diagonal(self.n, a.unit), a.product(K, H), -1)
        P = a.product(W, V)
        if self.form == "joseph":
            P = a.sum(a.product(P, turned(W)), a.product(a.product(K, R), turned(K)))
        if self.form == "hung second gain":
            K = a.product(a.product(P, turned(H)), self.RI[k % len(self.RI)][0])
            W = a.sum(diagonal(self.n, a.unit), a.product(K, H), -1)
        x = step.product(a.product(W, Phi) if self.form.startswith("hung") else Phi, x)
        if not self.form.startswith("hung"):
            z = step.sum(z, step.product(H, x), -1)
        return P, step.last(x, step.product(K, z)), v, Phi

    def factor_step(self, k: int, U: Any, step: RoundedStep, x: Any, z: Any) -> Any:
        """Thornton's prediction, then Bierman's update by one decorrelated measurement after the other."""
        a, n, m, (Phi, H, _, _) = self.a, self.n, self.m, self.members(k)
        UQ, UR, h = self.UQ[k % len(self.UQ)], self.UR[k % len(self.UR)], [list(row) for row in H]
        D = [u[i][i] for u in (U, UQ) for i in range(n)]
        one = [[[x if i < j else a.unit * (i == j) for j, x in enumerate(r)] for i, r in enumerate(u)] for u in (U, UQ)]
        W, U = list(map(add, a.product(Phi, one[0]), one[1])), diagonal(n, 0)
        for j in reversed(range(n)):
            C = list(map(a.multiply, D, W[j]))
            U[j][j] = a.dot(W[j], C)
            for i in range(j):
                U[i][j] = a.divide(a.dot(W[i], C), U[j][j]) if U[j][j] else 0
                a.shorter(W, i, U[i][j], j)
        for i in reversed(range(m)):
            for r in range(i + 1, m):
                a.shorter(h, i, UR[i][r], r)
                step.shorter(z, i, UR[i][r], r)
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
            for c, (value,) in zip(h[i], x, strict=True):
                z[i] = [step.add(z[i][0], step.multiply(c, value), -1)]
            terms = step.product([[a.divide(c, alpha)] for c in K], [z[i]])
            x = step.sum(x, terms) if i < m - 1 else step.last(x, terms)
        return U, x


def peaks(F: Any, columns: Any, rows: Any, sizes: Any, steps: int | None, back: int) -> tuple[list[int], list[Any]]:
    """Bound a vector, and rows times it, after at most some steps, each of which adds columns to F times it; see (6).

    The vector is 0 at first, and within `sizes` in all earlier steps. The bounds are shares, in units of 2**-PEAK, of
    the sizes and of the rows' sizes, which are returned as well. Rows C_l of (2) start with the d unit rows C, and are
    rounded towards zero, so that they end. A row r of size 1 has the rows r C_l, and its R_l are r times those of C, so
    at most d units as well.
    """
    d, one, lags = len(F), 1 << PEAK, 1 << max(back - 1, 0).bit_length()
    wholes = [size(row, sizes) or Fraction(1) for row in rows]
    share = lambda row, by, whole: [int(x * y * one // whole) for x, y in zip(row, by, strict=True)]  # noqa: E731
    loop = turned([share(row, sizes, whole) for row, whole in zip(F, sizes, strict=True)])
    G = [[int(x * one // y) for x, y in zip(g, sizes, strict=True)] for g in columns if any(g)]
    C, R = diagonal(d, one), [share(row, sizes, whole) for row, whole in zip(rows, wholes, strict=True)]
    sums, rest, most = [d] * (d + len(R)), 0 if steps is None else steps % lags, list[int]()
    for lag in range(lags if steps is None else min(steps, lags)):
        most = sums[:d] if lag == rest else most
        if any(map(any, C)):
            effects, lost = across(C, G), [(len(G) + d) * sum(map(abs, c)) for c in C]
            if R:
                effects += each(lambda x: x >> PEAK, across(R, turned(effects)))
                lost += [(size(r, lost) >> PEAK) + len(G) + 1 for r in R]
            sums = [x + (sum(map(abs, e)) + y >> PEAK) + d + 2 for x, e, y in zip(sums, effects, lost, strict=True)]
            C = [[x >> PEAK if x > 0 else -(-x >> PEAK) for x in c] for c in across(C, loop)]
    if steps is not None and steps <= lags:
        return sums, wholes
    blocks, P, T = None if steps is None else steps // lags, C, sums[:d]
    while True:  # |y_k - P y_(k-j)| <= T for all k, where j doubles
        norm = max(sum(map(abs, row)) for row in P)
        need(norm < one << 4 * PEAK, "errors grow without end")
        after = lambda most: [(size(row, most) >> PEAK) + 1 + t for row, t in zip(P, T, strict=True)]  # noqa: B023, E731
        if blocks is None and norm < one >> 30:
            most = after([one] * d)
            break
        if blocks is not None:
            most = after(most) if blocks & 1 else most
            blocks >>= 1
            if not blocks:
                break
        P, T = each(lambda x: x >> PEAK, across(P, turned(P))), [x + d for x in after(T)]
        need(blocks is not None or max(T) < one << 4 * PEAK, "errors do not decay")
    left = [size(c, most) for c in C] + [size(c, most) >> PEAK for c in across(R, turned(C))]
    return [x + (y >> PEAK) + 1 for x, y in zip(sums, left, strict=True)], wholes


class Linear:
    """The claim about operations with fixed coefficients: their states differ by at most b from an exact recursion.

    The recursion is x' = Ax + Bz, as the file states it. The operations must compute it, with their coefficients as
    given or as stored. With coefficients as given, it also has the inputs as given.
    """

    def __init__(self, given: Any, scale: int) -> None:
        fmt, made = given["format"], given["filter"]
        self.words = "data" in fmt
        formats = [fmt[key] for key in ("data", "sums", "coefficients")] if self.words else [fmt] * 3
        self.a, self.sums, kept = (Arithmetic(each, scale) for each in formats)
        a = self.a
        self.n, self.m, self.outputs = n, m, outputs = made["states"], made["inputs"], made["outputs"]
        c, wide, sound = made["coefficients"], made["wide"], len(outputs) == n and min(outputs) >= 0
        for v, (kind, p, q) in enumerate(made["operations"], n + m):
            if kind not in (MULTIPLY, ADD, SUBTRACT):
                raise NotImplementedError(f"the operation {kind!r}")
            sound = sound and type(p) is type(q) is int and 0 <= q < v and 0 <= p < (len(c) if kind == MULTIPLY else v)
            need(sound, "operations on values that are not known")
        stored = [*outputs, *(q for kind, _, q in made["operations"] if kind == MULTIPLY)]
        kept_wide = any(v >= n + m and wide[v - n - m] for v in stored)
        sound = not self.words or ({each["base"] for each in formats} == {2} and not kept_wide)
        need(sound, "words with another base, or states or factors that are not stored")
        self.operations = list(zip(made["operations"], wide, strict=True))
        exactly = {Fraction(1), Fraction(-1)} if self.words else set()  # nothing is multiplied
        self.c = [x if x in exactly else Fraction(kept.store(x), kept.unit) for x in c]
        if kept.rounding == "stochastic":  # the file states what was drawn, which is next to the given numbers
            self.c, near = made["stored"], [up(abs(x).numerator * a.unit, x.denominator) for x in c]
            sound = all(kept.store(x) == x * a.unit for x in self.c)
            far = [abs(x - y) * a.unit for x, y in zip(c, self.c, strict=True)]
            sound = sound and all(x <= a.error(max(y, 1), False) for x, y in zip(far, near, strict=True))
            need(sound, "stored coefficients that are not those given")
        self.rows, self.as_given = self.values(self.c), made["exact"] == "as given"
        exact = self.values(c) if self.as_given else self.rows
        self.A, self.B = made["A"], made["B"]
        dense = [[exact[v].get(i, Fraction(0)) for i in range(n + m)] for v in outputs]
        need(max(outputs) < len(exact) and dense == list(map(add, self.A, self.B)), "operations of another recursion")
        self.steps, self.back, Z = given["steps"], given["back"], given["limits"]["measurement"]
        need(self.steps is None or self.steps > 0, "a number of steps that is none")
        need(0 < self.back <= 2**20, "no step back, or too many")
        self.b, self.X = given["bound"], given["derived"]["state"]
        sizes, self.whole = [len(Z), len(self.b), len(self.X)], any(x is not None for x in Z)
        if not self.whole and self.words and not self.as_given:  # in words, roundings do not depend on sizes
            Z = [Fraction(0)] * m
        need(sizes == [m, n, n] and all(x is not None and x >= 0 for x in Z), "limits or a bound of another filter")
        need(all(x is not None and x > 0 for x in self.b + self.X), "a bound or a limit that is not positive")
        units = [up(x.numerator * a.unit, x.denominator) for x in Z]
        self.storing = [Fraction(a.error(x, False), a.unit) * self.as_given for x in units]
        self.kept = [max(x, *(abs(Fraction(a.store(y), a.unit)) for y in (x, -x))) for x in Z]
        self.Z = Z if self.as_given else self.kept

    def values(self, c: Any) -> list[dict[int, Fraction]]:
        """Each value as a linear function of the states and the inputs."""
        rows = [{i: Fraction(1)} for i in range(self.n + self.m)]
        for (kind, p, q), _ in self.operations:
            if kind == MULTIPLY:
                rows.append({i: c[p] * x for i, x in rows[q].items()} if c[p] else {})
            else:
                row = dict(rows[p])
                for i, x in rows[q].items():
                    row[i] = row.get(i, 0) + (x if kind == ADD else -x)
                rows.append(row)  # what cancels leaves roundings, so it is not zero
        return rows

    def effects(self) -> list[tuple[Fraction, ...]]:
        """The effect of an error of each value on the states after a step."""
        found = [[Fraction(0)] * self.n for _ in self.rows]
        for i, v in enumerate(self.outputs):
            found[v][i] += 1
        for v, ((kind, p, q), _) in reversed([*enumerate(self.operations, self.n + self.m)]):
            if any(found[v]):
                factor = self.c[p] if kind == MULTIPLY else 1 if kind == ADD else -1
                found[q] = [x + factor * y for x, y in zip(found[q], found[v], strict=True)]
                if kind != MULTIPLY:
                    found[p] = list(map(add, found[p], found[v]))
        return list(map(tuple, found))

    def sizes(self) -> list[Any]:
        """The largest size of each value, before it is rounded, without the roundings of its step."""
        n, split = self.n, [([row.get(i, 0) for i in range(self.n)], row) for row in self.rows]
        different = [row for row in {tuple(x): x for x, _ in split}.values() if sum(map(bool, row)) > 1]
        inputs = scaled(turned(self.B), self.Z)
        shares, wholes = peaks(self.A, inputs, different, self.X, self.steps, self.back)
        most = [Fraction(x, 1 << PEAK) for x in shares[:n]]
        need(max(most) <= 1, "a state may exceed its limit", ((), most))
        caps = {tuple(r): Fraction(s, 1 << PEAK) * w for r, s, w in zip(different, shares[n:], wholes, strict=True)}
        found = []
        for row, whole in split:
            seen = sum([abs(c) * self.kept[j - n] for j, c in whole.items() if j >= n])
            found.append(caps.get(tuple(row), size(row, self.X)) + size(row, self.b) + seen)
        return found

    def errors(self) -> list[Any]:
        """The largest rounding error of each value."""
        sizes, first = self.sizes(), self.n + self.m
        before, found, unit = [Fraction(0)] * first, [Fraction(0)] * first, self.a.unit
        bits = [self.a.scale - self.a.finest] * first if self.words else []
        ends = dict[int, Any]()
        for v, x, b in zip(self.outputs, self.X, self.b, strict=True):
            ends[v] = min(x + b, ends.get(v, inf))
        for v, ((kind, p, q), wide) in enumerate(self.operations, first):
            moved = abs(self.c[p]) * before[q] if kind == MULTIPLY else before[p] + before[q]
            most = up(*(min(sizes[v] + moved, ends.get(v, inf)) * unit).as_integer_ratio())
            if self.words:
                error, needed = self.word(kind, p, q, wide, most, bits)
                bits.append(needed)
            else:
                none = not self.rows[v] or (kind != MULTIPLY and not (self.rows[p] and self.rows[q]))
                error = self.a.error(most, kind != MULTIPLY)
                if none or (kind == MULTIPLY and abs(self.c[p]) * unit in self.a.exact):
                    error = 0
            found.append(Fraction(error, unit))
            before.append(moved + found[-1])
        return found

    def word(self, kind: str, p: int, q: int, wide: bool, most: int, bits: Any) -> tuple[int, int]:
        """The largest error of a result in words, and the bits after its point."""
        error, needed = 0, max(bits[q], bits[p] if kind != MULTIPLY else 0)
        if kind == MULTIPLY:
            c = self.c[p]
            needed = needed + c.denominator.bit_length() - (c.numerator & -c.numerator).bit_length() if c else 0
        for a, used in ((self.sums, True), (self.a, not wide)):
            if used:
                need(not self.whole or most <= a.largest or (wide and a.wraps), "a number may overflow")
                if needed > a.scale - a.finest:
                    needed = a.scale - a.finest
                    error += up(a.powers[a.finest], 1 + a.nearest)
                    most += error
        return error, needed

    def run(self) -> None:
        """Bound the errors by those of roundings, of storing inputs and of storing coefficients."""
        n, effects, groups = self.n, self.effects(), dict[Any, Any]()
        for effect, error in zip(effects, self.errors(), strict=True):
            key = max(effect, tuple(-x for x in effect))
            groups[key] = groups.get(key, 0) + error
        stored = [[self.rows[v].get(i, Fraction(0)) for i in range(n + self.m)] for v in self.outputs]
        A, B = [row[:n] for row in stored], [row[n:] for row in stored]
        columns = scaled(groups, groups.values()) + scaled(turned(B), self.storing)
        shares, _ = peaks(A, columns, [], self.b, self.steps, self.back)
        if (A, B) != (self.A, self.B):
            both = list(map(add, A, each(sub, A, self.A))) + [[0] * n + row for row in self.A]
            inputs = scaled(turned(each(sub, B, self.B) + self.B), self.Z)
            more, _ = peaks(both, inputs, [], self.b + self.X, self.steps, self.back)
            shares = list(map(add, shares, more))
        need(max(shares) <= 1 << PEAK, LARGER, ([Fraction(x, 1 << PEAK) for x in shares], ()))


def inverse(given: Any) -> tuple[Any, int]:
    """The inverse of a definite matrix of integers, as one of integers and their denominator, by Bareiss."""
    a, m, last = list(map(add, given, diagonal(len(given)))), len(given), 1
    for k in range(m):
        pivot = a[k][k]
        need(pivot > 0, "a covariance of measurements or innovations is not definite")
        for i in range(m):
            if i != k:
                factor = a[i][k]
                a[i] = [(pivot * x - factor * y) // last for x, y in zip(a[i], a[k], strict=True)]
        last = pivot
    return [row[m:] for row in a], last


class ExactCovariance:
    """Matrices A and B below and above the exact covariance, in units of 2**-bits."""

    def __init__(self, model: Any) -> None:
        self.n, self.unit, (P0,) = model.n, model.a.unit, model.stored[4]
        variances = [c[i][i] for c in (*model.stored[2], *model.stored[3], P0) for i in range(len(c)) if c[i][i]]
        self.bits = 160 + 2 * max(0, *((self.unit // x).bit_length() for x in variances))
        self.members = list[Any]()
        for Phi, H, Q, R in map(model.members, range(model.cycle)):
            RI, den = inverse(R)
            scaled = [each(lambda x: x * self.unit << self.bits, c) for c in (Q, R)]
            self.members.append((Phi, H, *scaled, across(RI, turned(H)), den))
        self.wide = diagonal(self.n, -self.n), diagonal(self.n, self.n)  # for entries that are rounded down
        self.ends = [each(lambda x, y: (x << self.bits) // self.unit + y, P0, wide) for wide in self.wide]

    def moved(self, k: int, P: Any, wide: Any) -> Any:
        """The covariance after step k + 1, rounded."""
        Phi, H, Q, R, *_ = self.members[k % len(self.members)]
        V = each(lambda x, q, y: (x + q) // self.unit**2 + y, around(Phi, P), Q, wide)
        W = across(V, H)
        T, den = inverse(each(add, across(H, turned(W)), R))
        return each(lambda x, y, z: (x * den - y) // den + z, V, around(W, T), wide)

    def step(self, k: int) -> tuple[Any, Any]:
        """Take step k + 1; return the mean gain of A and B, rounded down, and how far the exact one may be from it."""
        A, B = self.ends = [self.moved(k, *each) for each in zip(self.ends, self.wide, strict=True)]
        *_, rows, den = self.members[k % len(self.members)]
        D = each(sub, B, A)
        seen = [around([row], D)[0][0] for row in rows]
        far = [[up(isqrt(D[i][i] * x) + 1, 2 * den) + 1 for x in seen] for i in range(self.n)]
        return each(lambda x: x // (2 * den), across(each(add, A, B), rows)), far

    def gains(self, first: int, below: Any, above: Any) -> Iterator[Any]:
        """Gains of the first steps, and of all later ones, where covariances are so far from the last; without end."""
        yield from map(self.step, range(first))
        need([*map(len, below + above)] == [self.n] * 2 * self.n, "no interval of the exact covariance")
        below, above = (each(lambda x: int(x * 2**self.bits // 1), far) for far in (below, above))
        low, high, gains = each(sub, self.ends[0], below), each(add, self.ends[0], above), list[Any]()
        for phases in (len(self.members), 0):
            inside = definite(each(sub, self.ends[0], low)) and definite(each(sub, high, self.ends[1]))
            need(inside, "the exact covariance was not shown to settle")
            self.ends = [low, high]
            gains += map(self.step, range(first, first + phases))
        yield from cycle(gains)


def near(row: Any, known: Any, whole: int, box: Any) -> int:
    """Bound the largest size of a row by those of others, times shares of `whole`, and of their difference."""
    rest = [whole * x for x in row]
    for share, other, _ in known:
        rest = [x - share * y for x, y in zip(rest, other, strict=True)]
    return up(sum(abs(share) * most for share, _, most in known) + size(rest, box), whole)


class ErrorSet:
    """A set that contains an error or a state: segments of the last steps, a box, and an ellipsoid for all before."""

    def __init__(self, sizes: Any, seen: Any, loops: int, message: str, start: Any = ()) -> None:
        self.sizes, self.loops, self.message, self.n, self.steps = sizes, loops, message, len(sizes), 0
        self.limits, self.groups = [x << loops for x in sizes + seen], [(1, 1)] if start else []
        self.shares, self.beyond = [Fraction(0)] * len(self.limits), ""
        self.units = [(max(sizes) << 60) // max(s, 1) for s in sizes]
        self.x = [list(start[i : i + 1]) for i in range(self.n)]
        self.M, self.box, self.one = diagonal(self.n, 0), [0] * self.n, diagonal(self.n, 1 << loops)

    def claim(self, i: int, most: int, where: str) -> None:
        """Compare a row with its limit. If it is not far beyond, go on, so that a failure says what all rows need."""
        if most > self.limits[i]:
            self.beyond = self.beyond or f"{self.message}{where}"
            need(most < 2 * self.limits[i], self.beyond)
            self.shares[i] = max(self.shares[i], Fraction(most, self.limits[i]))

    def image(self, row: Any) -> list[int]:
        """A row, in units of 2**-loops, times each segment."""
        total = [0] * len(self.x[0])
        for f, x in zip(row, self.x, strict=True):
            total = list(map(add, total, map(mul, repeat(f), x))) if f else total
        return total

    def most(self, row: Any) -> int:
        """The largest size of a row, in units of 2**-loops, times the vector."""
        return sum(map(abs, self.image(row))) + size(row, self.box) + isqrt(max(0, around([row], self.M)[0][0])) + 1

    def through(self, rows: Any, F: Any) -> Any:
        return each(lambda x: x >> self.loops, across(rows, turned(F)))

    def effects(self, rows: Any, steps: Any) -> tuple[list[int], Any]:
        """Bound what some steps add to rows times the vector; return also the rows before the steps, rounded down."""
        sums, lost = [0] * len(rows), sum(self.sizes)
        for F, columns, slack, _ in reversed(steps):
            added = [sum([abs(sum(map(mul, row, g))) for g in columns]) + size(row, slack) + lost for row in rows]
            sums, rows = list(map(add, sums, added)), self.through(rows, F)
        return sums, rows

    def advance(self, steps: Any, keep: int) -> None:
        """Take some steps; some rows must be within limits before each, and the entries after it."""
        self.absorb(keep)
        one, whole, loops, lost = self.one, len(steps), self.loops, sum(self.sizes)
        P, columns, box, groups = one, list[Any](), [0] * self.n, list[Any]()
        for F, own, slack, _ in reversed(steps):
            columns = [[sum(map(mul, row, g)) >> loops for row in P] for g in own] + columns
            box = [x + up(size(row, slack) + lost, 1 << loops) + len(own) for x, row in zip(box, P, strict=True)]
            P, groups = self.through(P, F), [(len(own), 1), *groups]
        before, after = [*map(self.most, one)], [*map(self.most, P)]
        sizes, rows, added = [up(x, 1 << loops) for x in before], one, [0] * self.n
        known = [(0, row, x) for row, x in zip(one, before, strict=True)]
        for j, (F, own, slack, seen) in enumerate(steps, 1):
            for i, row in enumerate(seen, self.n):
                (effect,), (far,) = self.effects([row], steps[: j - 1])
                self.claim(i, self.most(far) + effect, f" before step {self.steps + j}")
            rows, new = self.through(F, rows), [sum(map(abs, x)) + y for *x, y in zip(*own, slack, strict=True)]
            added = [up(size(row, added), 1 << loops) + x for row, x in zip(F, new, strict=True)]
            for i, row in enumerate(rows):
                k, *last = known[i]
                ends = [(whole - j, *last), (j - k, P[i], after[i])]
                if near(row, ends, whole - k, sizes) + (added[i] << loops) > self.limits[i]:
                    (effect,), (far,) = self.effects([one[i]], steps[:j])
                    known[i] = j, far, self.most(far)
                    self.claim(i, known[i][2] + effect, f" after step {self.steps + j}")
        moved = list(map(self.image, P))
        self.x = [[s >> loops for s in x] + [g[i] for g in columns] for i, x in enumerate(moved)]
        self.box = [up(size(row, self.box), 1 << loops) + len(moved[0]) + x for row, x in zip(P, box, strict=True)]
        self.M = each(lambda x, y: (x >> 2 * loops) + y, around(P, self.M), diagonal(self.n, self.n))
        self.steps, self.groups = self.steps + whole, self.groups + groups

    def pairs(self, keep: int) -> Any:
        """Add columns of steps that are alike, as they are old; return segments that contain what this leaves out."""
        columns, merged, left, groups, at = turned(self.x), list[Any](), list[Any](), list[Any](), 0
        age, box = sum(steps for _, steps in self.groups), self.box
        waiting = self.groups[::-1]
        while waiting:
            count, steps = waiting.pop()
            age -= steps
            old = columns[at : at + count]
            if waiting and waiting[-1][0] == count and (steps + waiting[-1][1]) * keep <= age - waiting[-1][1]:
                more = waiting.pop()[1]
                age, steps = age - more, steps + more
                for i, (g, h) in enumerate(zip(old, columns[at + count : at + 2 * count], strict=True)):
                    both = sorted([list(map(add, g, h)), list(map(sub, g, h))], key=lambda x: size(x, self.units))
                    old[i], box = both[1], [x + abs(y) for x, y in zip(box, both[0], strict=True)]
                at += count
            at += count
            if steps * keep * 16 <= age:
                left += old
            else:
                merged += old
                groups.append((count, steps))
        self.x, self.groups, self.box = turned(merged) if merged else [[] for _ in self.x], groups, [0] * self.n
        return scaled(diagonal(self.n), box, 1) + left

    def absorb(self, keep: int) -> None:
        """Let the ellipsoid contain the box and old segments; the numbers t of (1) are the lengths of all."""
        segments = self.pairs(keep)
        sized = ([isqrt(self.M[i][i]) for i in range(self.n)], *segments)
        own, *lengths = (1 + isqrt(sum([x * x for x in map(mul, g, self.units)])) for g in sized)
        total = (own + sum(lengths)) << 40
        shares, x = [up(total, length) for length in lengths], turned(segments)
        added = across([list(map(mul, row, shares)) for row in x], x)
        self.M = each(lambda x, y, z: (x * up(total, own) + y >> 40) + z, self.M, added, diagonal(self.n, self.n))

    def hull(self, steps: Any) -> Any:
        """A step in the middle of some, whose slack contains what they differ from it."""
        most, middle = max(len(columns) for _, columns, *_ in steps), lambda *x: (max(x) + min(x)) >> 1
        alike = [(F, columns + [[0] * self.n] * (most - len(columns)), slack) for F, columns, slack, _ in steps]
        F, columns, slack = each(middle, *(F for F, *_ in alike)), each(middle, *(g for _, g, _ in alike)), [0] * self.n
        for G, others, wider in alike:
            off = [sum(map(abs, x)) for x in turned(each(sub, others, columns))] or [0] * self.n
            off = [x + (size(row, self.sizes) >> self.loops) + 1 for x, row in zip(off, each(sub, G, F), strict=True)]
            slack = list(map(max, slack, map(add, off, wider)))
        return F, columns, slack, steps[0][3]

    def later(self, steps: Any, phase: int, back: int) -> None:
        """Prove that the vector, and rows before them, are within limits after all steps of a phase."""
        rows, sums, known, period = self.one, [0] * self.n, list[Any](), len(steps)
        box = [up(self.most(row), 1 << self.loops) for row in self.one]
        for lag in range(back):
            step = steps[(phase - lag) % period]
            effects, rows = self.effects(rows, [step])
            sums = list(map(add, sums, effects))
            if not lag:
                rows, sums = rows + step[3], sums + [0] * len(step[3])
            if lag % period == phase:
                known = known or [(row, self.most(row)) for row in rows]
                for i, (row, x, limit) in enumerate(zip(rows, sums, self.limits, strict=False)):
                    a, b = (list(map(mul, r, box)) for r in (row, known[i][0]))
                    if near(row, [(sum(map(mul, a, b)), *known[i])], sum(map(mul, b, b)) or 1, box) > limit - x:
                        known[i] = row, self.most(row)
                        self.claim(i, known[i][1] + x, " later")
        for i, (x, row) in enumerate(zip(sums, rows, strict=True)):
            self.claim(i, x + size(row, self.sizes), f", in phase {phase} of the period")


class Filter:
    """The claim of a certificate; sizes are in units of the format, loops in units of 2**-loops."""

    def __init__(self, given: Any, scale: int) -> None:
        self.given, self.a, made = given, Arithmetic(given["format"], scale), given["filter"]
        self.steps, self.period = given["steps"], given["period"]
        self.first = given["first"] if self.steps is None else self.steps
        counts = [given[key] for key in (*COUNTS, "back")]
        need(self.steps != 0 and min(self.first, *counts) >= 0, "a number of steps that is none")
        self.model = Kalman(self.a, **made)
        self.n, self.m, self.exact = self.model.n, self.model.m, ExactCovariance(self.model)
        self.limit(*[*given["limits"].values(), *given["derived"].values(), given["bound"]])
        lengths = [[x.bit_length() for x in xs if x] or [0] for xs in (self.b, self.X)]
        self.loops = 64 + max(max(each) - min(each) for each in lengths)
        self.missed = (sum(self.X) >> self.loops) + 1

    def limit(self, X: Any, V: Any, Z: Any, least_X: Any, least_V: Any, bound: Any) -> None:
        """Put the limits into units, rounded up, and the bound, rounded down."""
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
        within = all(abs(x) <= y * unit for x, y in zip(self.model.x0, least[:n], strict=True))
        need(within, "the first estimate is beyond its limit")
        sizes: Any = [[None if x is None else -(-x * unit // 1) for x in xs] for xs in (least[:n], least[n:], Z)]
        self.X, self.V, self.Z = sizes
        self.b = [x * unit // 1 for x in bound]

    def parts(self, k: int, P: Any) -> tuple[Any, Any]:
        """The covariance after step k + 1; its loop, its gain, and columns of errors, measurements and the state."""
        n, m, computed = self.n, self.m, list(map(add, self.X, self.b))
        first, none = 2 * n + m, [0] * n
        known = [] if None in self.Z else [computed + self.Z + none]
        step = RoundedStep(self.a, self.model.depth, computed, self.b + self.V + self.X, *known)
        x, v = [[{i: step.one, n + m + i: step.one}] for i in range(n)], [[{n + j: step.one}] for j in range(m)]
        P, made, seen, Phi = self.model.step(k, P, step, x, v)
        columns = [[value.get(i, 0) for (value,) in made] for i in range(len(step.sizes[0]))]
        found = dict[tuple[int, ...], int]()
        for column, error in zip(columns[first:], step.sizes[0][first:], strict=True):  # equal effects are added
            key = max(tuple(column), tuple(-x for x in column))
            found[key] = found.get(key, 0) + error
        F = each(lambda x: (x << self.loops) // step.one, turned(columns[:n]))
        seen = [[(row.get(i, 0) << self.loops) // step.one for i in range(n + m, first)] for (row,) in seen]
        K = each(lambda x: (x << self.exact.bits) // step.one, turned(columns[n : n + m]))
        inputs = scaled(columns[n : n + m], self.Z, step.one) if self.derived else []
        Phi = each(lambda x: x * step.one // self.a.unit, turned(Phi))
        both = list(filter(any, scaled(each(sub, columns[n + m : first], Phi), self.X, step.one)))
        return P, (F, K, scaled(found, found.values(), step.one), inputs, both, seen if self.derived else [])

    def coefficients(self) -> Any:
        """The parts of each step, without end; the covariance is emulated until it recurs, as claimed."""
        given, model, known = self.given, self.model, list[Any]()
        begin, end = given["repeat"], given["repeat"] + self.period
        sound = begin <= self.first and self.period > 0 and self.period % model.cycle == 0
        need(sound or self.steps, "the gain cannot repeat after such a period")
        P = kept = model.start
        for k in range(self.steps or end):
            kept = P if k == begin else kept
            P, parts = self.parts(k, P)
            need(self.steps or k + 1 < end or kept == P, "the computed covariance does not recur as claimed")
            known += [parts] if k >= begin else []
            yield parts
        yield from cycle(known)

    def moves(self) -> Any:
        """Yield, for each step, loop, columns, slack and rows before it, of the error and of the exact filter."""
        exact = self.exact
        gains = exact.gains(self.first, self.given["below"], self.given["above"])
        for (F, K, errors, inputs, both, seen), (gain, far) in zip(self.coefficients(), gains, strict=False):
            both = both + scaled(turned(each(sub, K, gain)), self.V, 1 << exact.bits)
            off = [size(row, self.V) + sum(self.V) for row in far]
            slack = [2 + len(errors) + 2 * self.n + 3 * self.m + up(x, 1 << exact.bits) for x in off]
            far, near = ([x + 2 * (sum(s) >> self.loops) + 2 for x in slack] for s in (self.b, self.X))
            yield (F, errors + both, far, []), (F, inputs + both, near, seen)

    def run(self) -> None:
        """Take the first steps, and prove that all later ones remain within the limits."""
        sets = [ErrorSet(self.b, [], self.loops, LARGER)]
        if self.derived:
            rooms = [v - z - 2 * self.missed for v, z in zip(self.V, self.Z, strict=True)]
            sets.append(ErrorSet(self.X, rooms, self.loops, DERIVED, self.model.x0))
        moves, k, keep, back = self.moves(), 0, self.given["keep"], self.given["back"]
        while k < self.first:  # longer blocks where sets have more segments
            block = min(max(BLOCK, isqrt(min(k, 2000))), self.first - k)
            for reach, steps in zip(sets, turned(islice(moves, block)), strict=False):
                reach.advance(steps, keep)
            k += block
        if self.steps is None:
            need(back > 0, "no step back")
            phases, repeated = self.given["phases"], turned(islice(moves, self.period))
            need(phases and self.period % phases == phases % self.model.cycle == 0, "phases that are none")
            for reach, steps in zip(sets, repeated, strict=False):
                alike = [reach.hull(steps[phase::phases]) for phase in range(phases)]
                for phase in range(phases):
                    reach.later(alike, phase, back)
        for reach in sets:
            need(not reach.beyond, reach.beyond, (sets[0].shares, sets[1].shares if self.derived else ()))


def prove(given: Any) -> str:
    """Return the claim of a certificate as a sentence, proved; or raise NotProvedError or NotImplementedError."""
    try:
        fmt, made = given["format"], given["filter"]
        kind = read(made["kind"], ("kalman", "linear"), "kind")
        words = ("data", "sums", "coefficients") if "data" in fmt and kind == "linear" else ()
        formats = [fmt[key] for key in words] or [fmt]
        shapes = [FIXED if "overflow" in each else FLOAT for each in formats]
        shape = dict(zip(words, shapes, strict=True)) if words else shapes[0]
        content = read(given, FILES[kind] | {"filter": FILTERS[kind], "format": shape})
        if kind == "kalman" and fmt["rounding"] == "stochastic":
            raise NotImplementedError("stochastic rounding of a covariance")
        scale = 3 * max(each["precision"] for each in formats) + 40
        proof: Any = Filter if kind == "kalman" else Linear
        while scale < 20_000:
            try:
                proof(content, scale).run()
                bound = [nextafter(float(x), inf) for x in content["bound"]]
                form = f"{made.get('form', 'fixed coefficients')}, {fmt}"
                when = f"{given['steps'] or 'any number of'} steps within {given['limits']}"
                return f"{given['name']!r} ({form}): after {when}, rounding has moved states by at most {bound}"
            except OverflowError:
                scale = scale * 3 // 2
        raise NotImplementedError("numbers need too fine a unit")
    except (LookupError, TypeError, ValueError, ZeroDivisionError, AttributeError) as error:
        raise NotProvedError(f"the file is no certificate: {error!r}") from error


def once(pairs: Any) -> Any:
    need(len(dict(pairs)) == len(pairs), "a key occurs twice")
    return dict(pairs)


def main(arguments: Any = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gpbnb.bounds.check", description="Prove a rounding guarantee.")
    parser.add_argument("certificate", type=argparse.FileType(encoding="utf-8"), help="JSON file")
    try:
        with parser.parse_args(arguments).certificate as file:
            given = json.load(file, object_pairs_hook=once)
        print(f"{prove(given)}.\nproved")
    except (NotProvedError, NotImplementedError) as error:
        print(f"not {'proved' if isinstance(error, NotProvedError) else 'covered'}: {error}")
        return 1
    except KeyboardInterrupt:
        parser.exit(130, f"{parser.prog}: interrupted\n")
    except (ValueError, RecursionError) as error:
        parser.error(f"got a file that is not JSON: {error}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
