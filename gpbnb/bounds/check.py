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

    (4) The exact step of a covariance, E(P) = V - V H' (H V H' + R)^-1 H V with V = Phi P Phi' + Q, is the least of
    (I - KH) V (I - KH)' + K R K' over all K. So it keeps the order of symmetric matrices: if A <= P <= B, then
    E(A) <= E(P) <= E(B), if H V H' + R is definite for A. If some steps lead A and B back between A and B, covariances
    stay there. The gain is E(P) H' R^-1. With D = E(B) - E(A) and row c_j of R^-1 H, its entry i, j differs from that
    of A by at most the square root of D_ii times c_j D c_j', by the inequality of Cauchy and Schwarz.

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
from collections.abc import Iterator
from copy import copy
from fractions import Fraction
from functools import reduce
from itertools import combinations, combinations_with_replacement, cycle, islice, repeat
from math import inf, isqrt, lcm, nextafter
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
                m += beyond > 0 or (beyond == 0 and (self.rounding == "nearest" or m & 1))
            elif self.rounding != "chop":
                m += {"up": n > 0, "down": n < 0, "odd": not m & 1}[self.rounding]
        need(m * p <= self.largest, "a computed number exceeds the largest of the format")
        return 0 if m * p < self.normal else m * p if n > 0 else -m * p

    def store(self, x: Fraction) -> int:
        return int(self.fit(x.numerator * self.unit, x.denominator))

    def add(self, x: Any, y: Any, sign: int = 1) -> Any:
        return self.fit(x + sign * y) if x and y else x + sign * y

    def multiply(self, x: Any, y: Any) -> Any:
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

    def __init__(self, a: Arithmetic, depth: int, ends: Any, caps: Any, *sizes: Any) -> None:
        self.a, self.unit, self.one, self.ends, self.caps = a, a.unit, a.unit**depth, ends, caps
        self.sizes, self.start = [list(each) for each in sizes], [0] * len(sizes)

    def rounded(self, value: Any, aligned: bool, end: Any) -> Any:
        """Round a value that is at most `end`, and at most any start and the sizes of its inputs and roundings."""
        sums = [up(sum([abs(f) * sizes[i] for i, f in value.items()]), self.one) for sizes in self.sizes]
        error = self.a.error(min(*map(add, sums, self.start), end), aligned)
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

    def multiply(self, x: Any, y: Any, end: Any = inf) -> Any:
        """A number times a value."""
        value = {i: x * f // self.unit for i, f in y.items()} if x else {}
        return self.rounded(value, False, end) if value and abs(x) not in self.a.exact else value

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


class Linear:
    """Operations with fixed coefficients, which must compute the recursion that the file states."""

    cycle, start = 1, None

    def __init__(self, a: Arithmetic, **given: Any) -> None:
        self.n, self.m, self.outputs = n, m, outputs = given["states"], given["inputs"], given["outputs"]
        c, self.operations, sound = given["coefficients"], list[Any](), len(outputs) == n and min(outputs) >= 0
        for v, (kind, p, q) in enumerate(given["operations"], n + m):
            if kind not in (MULTIPLY, ADD, SUBTRACT):
                raise NotImplementedError(f"the operation {kind!r}")
            sound = sound and type(p) is type(q) is int and 0 <= q < v and 0 <= p < (len(c) if kind == MULTIPLY else v)
            need(sound, "operations on values that are not known")
            self.operations.append((kind, a.store(c[p]) if kind == MULTIPLY else p, q))
        self.depth = 1 + len(self.operations)
        self.x0, self.stated = [0] * n, list(map(add, given["A"], given["B"]))

    def step(self, k: int, P: Any, step: RoundedStep, x: Any, v: Any) -> Any:
        """No covariance; the states after a step; all values but the first, and no exact loop."""
        values, ends = [value for (value,) in x + v], dict[int, int]()
        for output, limit in zip(self.outputs, step.ends, strict=True):
            ends[output] = min(limit, ends.get(output, limit))
        for i, (kind, p, q) in enumerate(self.operations):
            step.start[2:], end = step.caps[i : i + 1], ends.get(len(values), inf)
            if kind == MULTIPLY:
                values.append(step.multiply(p, values[q], end))
            else:
                values.append(step.add(values[p], values[q], 1 if kind == ADD else -1, end))
        found = [[Fraction(values[v].get(i, 0), step.one) for i in range(self.n + self.m)] for v in self.outputs]
        need(found == self.stated, "the operations do not compute the recursion that the file states")
        return None, [[values[v]] for v in self.outputs], [[x] for x in values[self.n + self.m :]], []


def whole(a: Any) -> tuple[Any, int]:
    """A matrix of fractions as one of integers, and their denominator."""
    den = lcm(*(x.denominator for row in a for x in row))
    return each(lambda x: int(x * den), a), den


class ExactCovariance:
    """Matrices A and B below and above the exact covariance, in units of 2**-bits."""

    def __init__(self, model: Any) -> None:
        self.n, self.unit, (P0,) = model.n, model.a.unit, model.stored[4]
        variances = [c[i][i] for c in (*model.stored[2], *model.stored[3], P0) for i in range(len(c)) if c[i][i]]
        self.bits = 160 + 2 * max(0, *((self.unit // x).bit_length() for x in variances))
        self.members = list[Any]()
        for Phi, H, Q, R in map(model.members, range(model.cycle)):
            factors = across(ExactArithmetic().inverse(R)[0], turned(H))
            scaled = [each(lambda x: x * self.unit << self.bits, c) for c in (Q, R)]
            self.members.append((Phi, H, *scaled, *whole(factors)))
        self.wide = diagonal(self.n, -self.n), diagonal(self.n, self.n)  # for entries that are rounded down
        self.ends = [each(lambda x, y: (x << self.bits) // self.unit + y, P0, wide) for wide in self.wide]

    def moved(self, k: int, P: Any, wide: Any) -> Any:
        """The covariance after step k + 1, rounded."""
        Phi, H, Q, R, *_ = self.members[k % len(self.members)]
        V = each(lambda x, q, y: (x + q) // self.unit**2 + y, around(Phi, P), Q, wide)
        W = across(V, H)
        inverse, positive = ExactArithmetic().inverse(each(add, across(H, turned(W)), R))
        need(positive, "an innovation covariance is not definite")
        T, den = whole(inverse)
        return each(lambda x, y, z: (x * den - y) // den + z, V, around(W, T), wide)

    def step(self, k: int) -> tuple[Any, Any]:
        """Take step k + 1; return the gain of A, rounded down, and a bound of its distance from the exact one."""
        A, B = self.ends = [self.moved(k, *each) for each in zip(self.ends, self.wide, strict=True)]
        *_, rows, den = self.members[k % len(self.members)]
        D = each(sub, B, A)
        seen = [around([row], D)[0][0] for row in rows]
        far = [[up(isqrt(D[i][i] * x) + 1, den) + 1 for x in seen] for i in range(self.n)]
        return each(lambda x: x // den, across(A, rows)), far

    def gains(self, first: int, period: int, width: Any) -> Iterator[Any]:
        """Gains of the first steps, and of all later ones, which repeat, with bounds of their distances."""
        yield from map(self.step, range(first))
        need([*map(len, width)] == [self.n] * self.n, "no interval of the exact covariance")
        width = each(lambda x: int(x * 2**self.bits // 1), width)
        low, gains = each(lambda x, w: x - w // 2, self.ends[0], width), list[Any]()
        high = each(add, low, width)
        for phases in (period, 0):
            inside = definite(each(sub, self.ends[0], low)) and definite(each(sub, high, self.ends[1]))
            need(inside, "the exact covariance was not shown to settle")
            self.ends = [low, high]
            gains += map(self.step, range(first, first + phases))
        yield from gains


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
        self.limits, self.counts = [x << loops for x in sizes + seen], [1] if start else []
        self.x = [list(start[i : i + 1]) for i in range(self.n)]
        self.M, self.box, self.one = diagonal(self.n, 0), [0] * self.n, diagonal(self.n, 1 << loops)

    def image(self, row: Any, start: int = 0) -> list[int]:
        """A row, in units of 2**-loops, times each segment."""
        total = [start] * len(self.x[0])
        for f, x in zip(row, self.x, strict=True):
            total = list(map(add, total, map(mul, repeat(f), x))) if f else total
        return total

    def most(self, row: Any) -> int:
        """The largest size of a row, in units of 2**-loops, times the vector."""
        return sum(map(abs, self.image(row))) + size(row, self.box) + isqrt(max(0, around([row], self.M)[0][0])) + 1

    def through(self, rows: Any, F: Any) -> Any:
        return each(lambda x: x >> self.loops, across(rows, turned(F)))

    def move(self, F: Any) -> None:
        """Take the image of the set, and round its numbers."""
        moved, loops = [self.image(row, 1 << self.loops - 1) for row in F], self.loops
        self.x = [[s >> loops for s in x] for x in moved]
        self.box = [up(size(row, self.box), 1 << loops) + len(moved[0]) for row in F]
        self.M = each(lambda x, y: (x >> 2 * loops) + y, around(F, self.M), diagonal(self.n, self.n))

    def add(self, columns: Any, slack: Any, counts: list[int]) -> None:
        """Add a box, and the columns of as many steps as there are counts."""
        self.counts, self.box = self.counts + counts, list(map(add, self.box, slack))
        self.x = [x + [g[i] for g in columns] for i, x in enumerate(self.x)]

    def advance(self, steps: Any, keep: int) -> None:
        """Take some steps; some rows must be within limits before each, and the entries after it."""
        rows, one, whole, old, before = self.one, self.one, len(steps), copy(self), [*map(self.most, self.one)]
        P = reduce(lambda rows, step: self.through(step[0], rows), steps, one)
        self.absorb(keep)
        self.move(P)
        after, box = [*map(self.most, one)], [up(x, 1 << self.loops) for x in before]
        new = ErrorSet(self.sizes, [], self.loops, "")
        for j, (F, columns, slack, seen) in enumerate(steps, 1):
            for row, far, limit in zip(seen, self.through(seen, rows), self.limits[self.n :], strict=False):
                need(old.most(far) + new.most(row) <= limit, f"{self.message} before step {self.steps + j}")
            new.move(F)
            new.add(columns, slack, [len(columns)])
            rows = self.through(F, rows)
            for i, row in enumerate(rows):
                room, ends = self.limits[i] - new.most(one[i]), [(whole - j, one[i], before[i]), (j, P[i], after[i])]
                within = near(row, ends, whole, box) <= room or old.most(row) <= room
                need(within, f"{self.message} after step {self.steps + j}")
        self.steps += whole
        self.add(turned(new.x), new.box, new.counts)

    def absorb(self, keep: int) -> None:
        """Let the ellipsoid contain the box and old segments; the numbers t of (1) are the lengths of all."""
        old, self.counts = sum(self.counts[:-keep] if keep else self.counts), self.counts[-keep:] if keep else []
        segments = [*times(diagonal(self.n), self.box, 1), *turned([x[:old] for x in self.x])]
        self.x, self.box = [x[old:] for x in self.x], [0] * self.n
        units = [(max(self.sizes) << 60) // max(s, 1) for s in self.sizes]
        sized = ([isqrt(self.M[i][i]) for i in range(self.n)], *segments)
        own, *lengths = (1 + isqrt(sum([x * x for x in map(mul, g, units)])) for g in sized)
        total = (own + sum(lengths)) << 40
        shares, x = [up(total, length) for length in lengths], turned(segments)
        added = across([list(map(mul, row, shares)) for row in x], x)
        self.M = each(lambda x, y, z: (x * up(total, own) + y >> 40) + z, self.M, added, diagonal(self.n, self.n))

    def later(self, steps: Any, phase: int, back: int) -> Any:
        """Prove that the vector is within limits after all steps of a phase; bound it, and rows before them."""
        loops, rows, sums, known, period = self.loops, self.one, [0] * self.n, list[Any](), len(steps)
        box = [up(self.most(row), 1 << loops) for row in self.one]
        for lag in range(back):
            F, columns, slack, seen = steps[(phase - lag) % period]
            effects = [sum([abs(sum(map(mul, row, g))) for g in columns]) + size(row, slack) for row in rows]
            sums, rows = [x + y + sum(self.sizes) for x, y in zip(sums, effects, strict=True)], self.through(rows, F)
            if not lag:
                rows, sums = rows + seen, sums + [0] * len(seen)
            if lag % period == phase:
                known = known or [(row, self.most(row)) for row in rows]
                for i, (row, x, limit) in enumerate(zip(rows, sums, self.limits, strict=False)):
                    a, b = (list(map(mul, r, box)) for r in (row, known[i][0]))
                    if near(row, [(sum(map(mul, a, b)), *known[i])], sum(map(mul, b, b)) or 1, box) > limit - x:
                        known[i] = row, self.most(row)
                        need(known[i][1] <= limit - x, f"{self.message} later")
        found = [x + size(row, self.sizes) for x, row in zip(sums, rows, strict=True)]
        need(all(map(le, found, self.limits)), f"{self.message}, in phase {phase} of the period")
        return [up(x, 1 << loops) for x in found]


class Proof:
    """The claim of a certificate; sizes are in units of the format, loops in units of 2**-loops."""

    def __init__(self, given: Any, scale: int) -> None:
        self.given, self.a, made = given, Arithmetic(given["format"], scale), given["filter"]
        self.steps, self.period = given["steps"], given["period"]
        self.first = given["first"] if self.steps is None else self.steps
        counts = [given[key] for key in COUNTS]
        need(self.steps != 0 and min(self.first, *counts) >= 0, "a number of steps that is none")
        self.model: Any = (Kalman if made["kind"] == "kalman" else Linear)(self.a, **made)
        self.n, self.m = self.model.n, self.model.m
        self.exact: Any = made["kind"] == "kalman" and ExactCovariance(self.model)
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
        sound = self.exact or (self.derived and all(map(le, self.Z, self.V)))
        need(sound, "no limits on the inputs, or too small ones")
        self.b = [x * unit // 1 for x in bound]

    def parts(self, k: int, P: Any, caps: Any) -> tuple[Any, Any]:
        """The covariance after step k + 1; its loop, its gain, and columns of errors, measurements and the state."""
        n, m, computed = self.n, self.m, list(map(add, self.X, self.b))
        first, none = 2 * n + m, [0] * n
        known = [] if None in self.Z else [computed + self.Z + none, self.b + self.Z + none][: 1 + bool(caps)]
        step = RoundedStep(self.a, self.model.depth, computed, caps, self.b + self.V + self.X, *known)
        x, v = [[{i: step.one, n + m + i: step.one}] for i in range(n)], [[{n + j: step.one}] for j in range(m)]
        P, made, seen, Phi = self.model.step(k, P, step, x, v)
        columns = [[value.get(i, 0) for (value,) in made] for i in range(len(step.sizes[0]))]
        found = dict[tuple[int, ...], int]()
        for column, error in zip(columns[first:], step.sizes[0][first:], strict=True):  # equal effects are added
            key = max(tuple(column), tuple(-x for x in column))
            found[key] = found.get(key, 0) + error
        F = each(lambda x: (x << self.loops) // step.one, turned(columns[:n]))
        seen = [[(row.get(i, 0) << self.loops) // step.one for i in range(n + m, first)] for (row,) in seen]
        K = each(lambda x: (x << self.exact.bits) // step.one, turned(columns[n : n + m])) if self.exact else []
        inputs = times(columns[n : n + m], self.Z, step.one) if self.derived else []
        Phi = each(lambda x: x * step.one // self.a.unit, turned(Phi)) if Phi else columns[:n]
        both = list(filter(any, times(each(sub, columns[n + m : first], Phi), self.X, step.one)))
        return P, (F, K, times(found, found.values(), step.one), inputs, both, seen if self.derived else [])

    def coefficients(self, caps: Any) -> Any:
        """The parts of each step, without end; the covariance is emulated until it recurs, as claimed."""
        given, model, known = self.given, self.model, list[Any]()
        begin, end = given["repeat"], given["repeat"] + self.period
        sound = begin <= self.first and self.period > 0 and self.period % model.cycle == 0
        need(sound or self.steps, "the gain cannot repeat after such a period")
        P = kept = model.start
        for k in range(self.steps or end):
            kept = P if k == begin else kept
            P, parts = self.parts(k, P, caps)
            need(self.steps or k + 1 < end or kept == P, "the computed covariance does not recur as claimed")
            known += [parts] if k >= begin else []
            yield parts
        yield from cycle(known)

    def moves(self, caps: Any = ()) -> Any:
        """Yield, for each step, loop, columns, slack and rows before it, of the error and of the exact filter."""
        exact = self.exact
        gains = exact.gains(self.first, self.period, self.given["width"]) if exact else repeat(None)
        for (F, K, errors, inputs, both, seen), gain in zip(self.coefficients(caps), gains, strict=False):
            slack = [2 + len(errors) + 2 * self.n + 3 * self.m] * self.n
            if gain:
                both = both + times(turned(each(sub, K, gain[0])), self.V, 1 << exact.bits)
                off = [size(row, self.V) + sum(self.V) for row in gain[1]]
                slack = [x + up(y, 1 << exact.bits) for x, y in zip(slack, off, strict=True)]
            far, near = ([x + 2 * (sum(s) >> self.loops) + 2 for x in slack] for s in (self.b, self.X))
            yield (F, errors + both, far, []), (F, inputs + both, near, seen)

    def run(self) -> None:
        """Take the first steps, and prove that all later ones remain within the limits."""
        sets = [ErrorSet(self.b, [], self.loops, "the error may exceed its bound")]
        if self.derived:
            rooms = [v - z - 2 * self.missed for v, z in zip(self.V, self.Z, strict=True)] if self.exact else []
            message = "a state or an innovation may exceed its limit"
            sets.append(ErrorSet(self.X, rooms, self.loops, message, self.model.x0))
        moves, back = self.moves(), self.given["back"]
        for k in range(0, self.first, BLOCK):
            steps = turned(islice(moves, min(BLOCK, self.first - k)))
            for reach, block in zip(sets, steps, strict=False):
                reach.advance(block, self.given["keep"])
        if self.steps is None:
            need(back > 0, "no step back")
            errors, states = turned(islice(moves, self.period))
            caps = [sets[1].later(states, phase, back) for phase in range(self.period)] if self.derived else []
            if not self.exact:  # limits of states limit all values, and these the roundings
                errors, _ = turned(islice(self.moves([x + self.missed for x in caps[0][self.n :]]), 1))
            for phase in range(self.period):
                sets[0].later(errors, phase, back)


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
