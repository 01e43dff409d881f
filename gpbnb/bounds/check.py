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
    g_j'/t_j), with s = t + sum t_j, for any t, t_j > 0, by the inequality of Cauchy and Schwarz.

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
    base (in a format with a range: with 0 and +-1) and sums with zero are exact.

    Not covered: stochastic rounding; known inputs; gains that never repeat; limited values; fused operations; other
    orders of sums. For fixed coefficients, the file also states x' = Ax + Bz, which the operations must compute.
"""

from __future__ import annotations

import argparse
import json
import re
from bisect import bisect_right
from fractions import Fraction
from itertools import product, repeat
from math import gcd, inf, isqrt, lcm, nextafter
from operator import add, mul, sub
from typing import Any

KIND, ORDER = "rounding guarantee 1", "each product and sum rounded once, sums from left to right"
NUMBERS = ("repeat", "period", "first", "back", "keep")
KEYS = {"certificate", "name", "filter", "format", "order", "limits", "steps", "derived", "bound", "width", *NUMBERS}
LIMITS = {"state", "innovation", "measurement"}
RULES = {"base", "precision", "rounding"}
FORMATS = (RULES | {"fraction_bits", "overflow"}, RULES | {"emin", "emax", "subnormal", "largest"})
FILTERS = {
    "kalman": {"kind", "form", "repair", "repaired", "Phi", "H", "Q", "R", "x0", "P0"},
    "linear": {"kind", "states", "inputs", "operations", "outputs", "coefficients", "A", "B"},
}
INNOVATION = "a state or an innovation may exceed its limit"
MULTIPLY, ADD, SUBTRACT = "multiply", "add", "subtract"
NUMBER = re.compile(r"-?[0-9]{1,4000}([./][0-9]{1,4000})?", re.ASCII)
ROUNDINGS = ("nearest", "even", "chop", "up", "down", "odd")
FORMS = ("innovation", "joseph", "hung", "hung second gain", "ud")


class NotProvedError(Exception):
    """A claim that is wrong, or that this program cannot prove."""


def need(truth: Any, message: str) -> None:
    if not truth:
        raise NotProvedError(message)


def at_most(found: Any, limits: Any, message: str) -> None:
    need(all(x <= y for x, y in zip(found, limits, strict=True)), message)


def whole(*numbers: Any) -> bool:
    return all(type(x) is int for x in numbers)


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


class Arithmetic:
    """Numbers of a format as integers, in units of base**-scale; each operation is rounded once."""

    def __init__(self, given: Any, scale: int) -> None:
        b, t = self.base, self.digits = given["base"], given["precision"]
        need(whole(b, t) and b > 1 and t > 0, "a base or a precision that is no whole number")
        self.unit, self.low, self.rounding = b**scale, b ** (t - 1), given["rounding"]
        self.powers = [b**k for k in range(2 * scale + t + 2)]
        self.tops, self.exact = [b**t * p for p in self.powers], set(self.powers)
        self.nearest, self.fixed = self.rounding in ("nearest", "even"), "overflow" in given
        self.finest, self.normal = 0, 0
        self.largest, self.lowest = inf, inf
        if self.fixed:
            known = whole(given["fraction_bits"]) and given["overflow"] in ("raise", "saturate", "wrap")
            need(known, "an unknown fixed-point format")
            self.finest = scale - given["fraction_bits"]
            if self.finest < 0:
                raise OverflowError
            self.lowest = b ** (t + self.finest)
            self.largest = self.lowest - b**self.finest
        elif given["emin"] is None:
            sound = given["emax"] is None and given["subnormal"] is True and given["largest"] is None
            need(sound, "a range without its least exponent")
        else:
            need(whole(given["emin"], given["emax"]) and type(given["subnormal"]) is bool, "a range that is none")
            if scale < 2 * t + 2 - given["emin"]:
                raise OverflowError
            least, most = scale + given["emin"], scale + given["emax"]
            self.finest, self.normal = (least - t + 1, 0) if given["subnormal"] else (0, b**least)
            nines = (b**t - 1) * b ** (most - t + 1)
            largest = nines if given["largest"] is None else exactly(given["largest"]) * self.unit
            sound = least <= most and b**most <= largest <= nines and largest % b ** (most - t + 1) == 0
            need(sound, "the largest number is not one")
            self.largest = self.lowest = int(largest)

    def last_place(self, q: int) -> int:
        """The exponent of the last digit of a number of q units."""
        if self.fixed or q < self.low:
            return self.finest
        return max(self.finest, q.bit_length() - self.digits if self.base == 2 else bisect_right(self.tops, q))

    def error(self, most: int) -> int:
        """The largest error of rounding results of at most so many units."""
        need(most <= self.largest, "a number of a step may exceed the largest")
        return max(self.normal, up(self.powers[self.last_place(max(most - 1, 0))], 1 + self.nearest))

    def fit(self, n: int, d: int = 1) -> int:
        """Round n / d units."""
        q, r = (abs(n), 0) if d == 1 else divmod(abs(n), d)
        if r and q < self.low and not self.finest and not self.fixed:
            if self.normal:
                return 0
            raise OverflowError
        e = self.last_place(q)
        p = self.powers[e]
        m, rest = (q >> e, q & p - 1) if self.base == 2 else divmod(q, p)
        if rest or r:
            if self.nearest:
                beyond = 2 * (rest * d + r) - p * d
                m += beyond > 0 or (beyond == 0 and (self.rounding == "nearest" or m & 1))
            elif self.rounding != "chop":
                m += {"up": n > 0, "down": n < 0, "odd": not m & 1}[self.rounding]
        m = m * p if n > 0 else -m * p
        need(-self.lowest <= m <= self.largest, "a computed number exceeds the largest of the format")
        return m if abs(m) >= self.normal else 0

    def store(self, x: Fraction) -> int:
        return self.fit(x.numerator * self.unit, x.denominator)

    def add(self, x: int, y: int) -> int:
        return self.fit(x + y) if x and y else x + y

    def multiply(self, x: int, y: int) -> int:
        return self.fit(x * y, self.unit) if x and y else 0

    def divide(self, x: int, y: int) -> int:
        need(y, "the computed covariance divides by zero")
        return self.fit(x * self.unit if y > 0 else -x * self.unit, abs(y)) if x else 0

    def dot(self, row: Any, column: Any) -> int:
        total = 0
        for x, y in zip(row, column, strict=True):
            if x and y:
                total = self.add(total, self.fit(x * y, self.unit))
        return total

    def product(self, a: Any, b: Any) -> Any:
        return [[self.dot(row, column) for column in turned(b)] for row in a]

    def complement(self, K: Any, H: Any) -> Any:
        """I - KH."""
        KH = self.product(K, H)
        return each(lambda x, y: self.add(x, -y), diagonal(len(KH), self.unit), KH)

    def shorter(self, a: Any, i: int, factor: int, k: int, first: int = 0) -> None:
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


def definite(given: Any, strictly: bool = False) -> bool:
    """Whether a matrix of exact numbers is symmetric and positive semidefinite or, strictly, definite."""
    n, a = len(given), each(Fraction, given)
    for j in range(n):
        if a[j][j] < 0 or (a[j][j] == 0 and (strictly or any(a[i][j] for i in range(j + 1, n)))):
            return False
        for i in range(j + 1, n if a[j][j] else 0):
            share = a[i][j] / a[j][j]
            a[i] = [x - share * y for x, y in zip(a[i], a[j], strict=True)]
    return given == turned(given)


class Stored:
    """The model as a format stores it; variances are raised until stored covariances and their factors are definite."""

    def __init__(self, a: Arithmetic, given: Any) -> None:
        roundoff = Fraction(1, a.base ** (a.digits - 1) * (1 + a.nearest))
        least = Fraction(2.0**-58 if a.fixed else float(roundoff))
        count = int(1 / least).bit_length() - 1 if given["repair"] else 0
        self.shares, self.a, self.form = [0, *(least * 2**k for k in range(count))], a, given["form"]
        given = given | {key: exactly(given[key]) for key in ("Phi", "H", "Q", "R", "x0", "P0")}
        Q, R = ([self.sound(c, strictly) for c in given[key]] for key, strictly in (("Q", False), ("R", True)))
        P0, stored = self.sound(given["P0"], False), lambda cycle: [each(a.store, c) for c in cycle]
        self.Phi, self.H, self.Q, self.R, (self.P0,) = map(stored, (given["Phi"], given["H"], Q, R, [P0]))
        self.n, self.m, self.x0 = n, m, x0 = len(P0), len(R[0]), [a.store(x) for x in given["x0"]]
        sizes = ((self.Phi, n, n), (self.H, m, n), (self.Q, n, n), (self.R, m, m), ([P0], n, n), ([[x0]], 1, n))
        fits = all([*map(len, c)] == [columns] * rows for cycle, rows, columns in sizes for c in cycle)
        need(fits and type(given["repair"]) is bool, "matrices that do not fit together")
        self.cycle = lcm(*(len(x) for x in (self.Phi, self.H, self.Q, self.R)))
        sound = all(map(definite, [*self.Q, self.P0])) and all(definite(c, True) for c in self.R)
        need(sound, "a stored covariance is not definite, so there is no exact filter")
        self.start, self.RI = self.P0, [a.inverse(c) for c in self.R if self.form == "hung second gain"]
        need(all(positive for _, positive in self.RI), "R loses its definiteness when it is inverted")
        self.step = self.factor_step if self.form == "ud" else self.covariance_step
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
        return c

    def factored(self, cycle: Any) -> Any:
        for share in self.shares:
            found = [self.a.factors(self.raised(c, share)) for c in cycle]
            if None not in found:
                return found
        raise NotProvedError("factors of a covariance are not definite in this format, so no filter runs")

    def members(self, k: int) -> Any:
        """Phi, H, Q and R of step k + 1."""
        return [c[k % len(c)] for c in (self.Phi, self.H, self.Q, self.R)]

    def covariance_step(self, k: int, P: Any) -> tuple[Any, list[int]]:
        """The next covariance, or its factors, and the coefficients of the operations of step k + 1."""
        a, (Phi, H, Q, R) = self.a, self.members(k)
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
        rows = (*a.product(W, Phi), *K) if self.form.startswith("hung") else (*Phi, *H, *K)
        return P, [x for row in rows for x in row]

    def factor_step(self, k: int, U: Any) -> tuple[Any, list[int]]:
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
        above = [[x if i < j else 0 for j, x in enumerate(row)] for i, row in enumerate(UR)]
        return U, [x for row in (*Phi, *above, *h, *turned(gains)) for x in row]


def operations_of(form: str, n: int, m: int) -> tuple[list[Any], list[int]]:
    """The operations of a step, whose coefficients are in the order above, and the values that become the states."""
    made: list[Any] = []

    def emit(kind: str, a: int, b: int) -> int:
        made.append((kind, a, b))
        return n + m + len(made) - 1

    def sums(first: int, rows: int, values: list[int]) -> list[int]:
        found = []
        for c in range(first, first + rows * len(values), len(values)):
            total = emit(MULTIPLY, c, values[0])
            for j, v in enumerate(values[1:], c + 1):
                total = emit(ADD, total, emit(MULTIPLY, j, v))
            found.append(total)
        return found

    z, u = list(range(n, n + m)), sums(0, n, list(range(n)))
    if form == "ud":
        U, H, K = n * n, n * n + m * m, n * n + m * m + m * n
        for i, r in product(reversed(range(m)), range(m)):
            z[i] = emit(SUBTRACT, z[i], emit(MULTIPLY, U + i * m + r, z[r])) if r > i else z[i]
        for i, y in enumerate(z):
            for j in range(n):
                y = emit(SUBTRACT, y, emit(MULTIPLY, H + i * n + j, u[j]))
            u = [emit(ADD, u[j], emit(MULTIPLY, K + j * m + i, y)) for j in range(n)]
        return made, u
    if form.startswith("hung"):
        v = sums(n * n, n, z)
    else:
        seen = sums(n * n, m, u)
        v = sums(n * n + m * n, n, [emit(SUBTRACT, x, y) for x, y in zip(z, seen, strict=True)])
    return made, [emit(ADD, x, y) for x, y in zip(u, v, strict=True)]


def adjugate(given: Any) -> tuple[Any, int]:
    """The adjugate and the determinant of a positive definite integer matrix, by Bareiss' exact elimination."""
    n, last = len(given), 1
    a = [list(row) + [int(i == j) for j in range(n)] for i, row in enumerate(given)]
    for k in range(n):
        pivot = a[k][k]
        need(pivot > 0, "an innovation covariance is not definite")
        for i in range(n):
            if i != k:
                a[i] = [(pivot * x - a[i][k] * y) // last for x, y in zip(a[i], a[k], strict=True)]
        last = pivot
    return [row[n:] for row in a], last


class ExactCovariance:
    """A matrix A below the exact covariance P, and D for which P is below A + D, in units of 2**-bits."""

    def __init__(self, stored: Stored) -> None:
        variances = [c[i][i] for c in (*stored.Q, *stored.R, stored.P0) for i in range(len(c)) if c[i][i]]
        self.members, self.n, unit = list[Any](), stored.n, stored.a.unit
        self.bits = bits = 160 + 2 * max(0, *((unit // x).bit_length() for x in variances))
        entries = [x for cycle in (stored.Phi, stored.H, stored.Q, stored.R) for c in cycle for row in c for x in row]
        common = gcd(unit, *entries)
        self.unit = unit // common
        for given in map(stored.members, range(stored.cycle)):
            Phi, H, Q, R = (each(lambda x: x // common, c) for c in given)
            scaled = [each(lambda x, p=p: x * self.unit**p << bits, c) for c, p in ((Q, 1), (R, 3))]
            self.members.append((turned(Phi), Phi, H, turned(H), across(H, turned(Phi)), *scaled))
        self.low = each(lambda x, y: (x << bits) // unit - y, stored.P0, diagonal(self.n, self.n))
        self.width = diagonal(self.n, 2 * self.n)

    def step(self, k: int) -> tuple[Any, Any]:
        """Take step k + 1; return the gain of A, rounded down, and a bound of its distance from that of P."""
        PhiT, Phi, H, HT, HPhi, Q, R = self.members[k % len(self.members)]
        n, m, unit, bits = self.n, len(H), self.unit, self.bits
        V = each(add, around(Phi, self.low), Q)
        W = across(H, V)
        T, det = adjugate(each(add, across(W, H), R))
        WT = turned(W)
        X = across(WT, T)
        F = across(each(sub, diagonal(n, det), across(X, HT)), PhiT)
        seen = around(HPhi, self.width)
        below, square = det * unit**2, (det * unit) ** 2
        self.low = each(lambda x, y, z: (x * det - y) // below - z, V, across(X, WT), diagonal(n, n))
        self.width = each(lambda x, y: x // square + y, around(F, self.width), diagonal(n, 3 * n))
        T = [up(T[j][j] * unit**4 << 2 * bits, det) for j in range(m)]
        by = sum(isqrt(up(seen[t][t] * T[t], unit**4)) + 1 for t in range(m))
        roots = [[isqrt(self.width[i][i] * x) + 1 for x in T] for i in range(n)]
        return each(lambda x: (x * unit << bits) // det, X), each(lambda x: up(x * by, 1 << bits) + 1, roots)

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


class Effects:
    """Loops and disturbances of steps; sizes are in units of the format, loops in units of 2**-loops."""

    def __init__(self, a: Arithmetic, operations: Any, outputs: Any, limits: Any, b: list[int], bits: int) -> None:
        self.a, self.operations, self.outputs, self.n, self.b, self.bits = a, operations, outputs, len(outputs), b, bits
        (self.X, self.V, self.Z), self.known, self.caps = limits, {}, {}  # type: ignore[var-annotated]
        both = list(map(add, self.X, b))
        self.sizes = [b + self.V + self.X] + ([] if None in self.Z else [both + self.Z])
        self.ends = {v: min(x for x, r in zip(both, outputs, strict=True) if r == v) for v in outputs}
        self.m, lengths = len(self.V), [[x.bit_length() for x in xs if x] or [0] for xs in (b, self.X)]
        self.loops = 64 + max(max(each) - min(each) for each in lengths)
        self.depth = [2] * (self.n + self.m)
        for kind, p, q in operations:
            self.depth.append(self.depth[q] + 1 if kind == MULTIPLY else max(self.depth[p], self.depth[q]))
        self.most = max(self.depth)
        self.unit = [a.unit**k for k in range(self.most + 1)]

    def rows(self, c: list[int], HPhi: Any) -> Any:
        """Factors of x and z of each value, and of x for the same function of v and x, in base**-(scale depth)."""
        n, m, unit = self.n, self.m, self.unit
        rows = [x + [0] * m + x for x in diagonal(n, unit[2])]
        rows += [[0] * n + z + x for z, x in zip(diagonal(m, unit[2]), HPhi, strict=True)]
        for kind, p, q in self.operations:
            if kind == MULTIPLY:
                rows.append([c[p] * x for x in rows[q]])
                continue
            left, right = (unit[self.depth[len(rows)] - self.depth[r]] for r in (p, q))
            right = right if kind == ADD else -right
            rows.append([left * x + right * y for x, y in zip(rows[p], rows[q], strict=True)])
        return rows

    def roundings(self, c: list[int], rows: Any) -> list[int]:
        """The largest rounding error of each operation."""
        a, n, m = self.a, self.n, self.m
        off, none, errors = [0] * len(rows), [False] * len(rows), []
        for v, (kind, p, q) in enumerate(self.operations, n + m):
            most = up(min([size(rows[v], sizes) for sizes in self.sizes]), self.unit[self.depth[v]])
            most = min(most, self.caps.get(v, most))
            if kind == MULTIPLY:
                off[v], none[v] = up(abs(c[p]) * off[q], a.unit), none[q] or not c[p]
                exact = none[v] or (abs(c[p]) in a.exact if a.largest == inf else abs(c[p]) == a.unit)
            else:
                off[v], none[v], exact = off[p] + off[q], none[p] and none[q], none[p] or none[q] or a.fixed
            most = min(most + off[v], self.ends.get(v, inf))
            error = a.error(most)
            errors.append(error if most and not exact else 0)
            off[v] += errors[-1]
        return errors

    def columns(self, c: list[int], errors: list[int]) -> dict[tuple[int, ...], int]:
        """The effects of roundings on the result, each with the sum of the sizes of all roundings that share it."""
        n, first, unit, depth = self.n, self.n + self.m, self.unit, self.depth
        effect, found = [[0] * n for _ in depth], dict[tuple[int, ...], int]()
        for i, v in enumerate(self.outputs):
            effect[v][i] += unit[self.most - depth[v]]
        for v, (kind, p, q) in reversed(list(enumerate(self.operations, first))):
            g = effect[v]
            for r, sign in ((q, 1),) if kind == MULTIPLY else ((p, 1), (q, 1 if kind == ADD else -1)):
                by = c[p] if kind == MULTIPLY else sign * unit[depth[v] - depth[r]]
                effect[r] = [x + by * y for x, y in zip(effect[r], g, strict=True)]
            if errors[v - first]:
                column = tuple(x * unit[depth[v]] for x in g)
                column = max(column, tuple(-x for x in column))
                found[column] = found.get(column, 0) + errors[v - first]
        return found

    def fixed(self, c: list[int], Phi: Any, HPhi: Any) -> Any:
        """What steps with the same coefficients share: loop, gain, and columns of errors, of inputs and of both."""
        n, first, unit, rows = self.n, self.n + self.m, self.unit[self.most], self.rows(c, HPhi)
        whole = [[x * self.unit[self.most - self.depth[v]] for x in rows[v]] for v in self.outputs]
        K, loop = ([row[part] for row in whole] for part in (slice(n, first), slice(first, None)))
        errors = [[x * h // unit for x in g] for g, h in self.columns(c, self.roundings(c, rows)).items()]
        inputs = [] if None in self.Z else [[x * s // unit for x in g] for g, s in zip(turned(K), self.Z, strict=True)]
        both = []
        if Phi:
            loop = each(lambda x, y: x - y * self.unit[self.most - 1], loop, Phi)
            both = [[x * s // unit for x in g] for g, s in zip(turned(loop), self.X, strict=True)]
        loops = [[(x << self.loops) // unit for x in row[:n]] for row in whole]
        return loops, each(lambda x: (x << self.bits) // unit, K), errors, inputs, list(filter(any, both))

    def step(self, k: int, c: list[int], Phi: Any = None, HPhi: Any = None, gain: Any = None) -> Any:
        """The loop of step k + 1, and columns and slack of its errors and of the exact filter's states."""
        known = self.known.get(k)
        if not known or known[0] != c:
            known = self.known[k] = c, *self.fixed(c, Phi, HPhi or [[0] * self.n] * self.m)
        _, loops, K, errors, inputs, both = known
        slack = [2 + len(errors) + 2 * self.n + 3 * self.m] * self.n
        if gain:
            more = each(sub, K, gain[0])
            both = both + [[x * s >> self.bits for x in g] for g, s in zip(turned(more), self.V, strict=True)]
            off = [size(row, self.V) + sum(self.V) for row in gain[1]]
            slack = [x + up(y, 1 << self.bits) for x, y in zip(slack, off, strict=True)]
        slacks = [[x + (sum(s) >> self.loops) for x in slack] for s in (self.b, self.X)]
        return loops, (errors + both, slacks[0]), (inputs + both, slacks[1])


class ErrorSet:
    """A set that contains an error or a state: segments of the last steps, and an ellipsoid for all before."""

    def __init__(self, sizes: Any, keep: int, start: Any = None) -> None:
        self.n, self.keep = len(sizes), keep
        self.counts, self.x = ([1], [[v] for v in start]) if start else ([], [[] for _ in sizes])
        self.M, self.weights = diagonal(self.n, 0), [(max(sizes) << 60) // max(s, 1) for s in sizes]

    def advance(self, F: Any, loops: int, segments: Any, slack: Any) -> None:
        """Move the set by the loop F, and add segments and a box."""
        n, total = self.n, len(self.x[0])
        moved = [self.moved(row, 1 << loops - 1) for row in F]
        self.x = [[s >> loops for s in x] + [g[i] for g in segments] for i, x in enumerate(moved)]
        self.counts.append(len(segments))
        self.M = each(lambda x, y: (x >> 2 * loops) + y, around(F, self.M), diagonal(n, n))
        boxes = [[(s + total) * x for x in row] for s, row in zip(slack, diagonal(n), strict=True)]
        while len(self.counts) > self.keep:
            count = self.counts.pop(0)
            boxes += turned([x[:count] for x in self.x])
            self.x = [x[count:] for x in self.x]
        self.absorb(boxes)

    def moved(self, row: Any, start: int = 0) -> list[int]:
        total = [start] * len(self.x[0])
        for f, x in zip(row, self.x, strict=True):
            total = list(map(add, total, map(mul, repeat(f), x))) if f else total
        return total

    def absorb(self, segments: Any) -> None:
        """Let the ellipsoid contain more segments; the numbers t of (1) are the lengths of all."""
        own, *lengths = (self.length(g) for g in ([isqrt(self.M[i][i]) for i in range(self.n)], *segments))
        total = (own + sum(lengths)) << 40
        shares, x = [up(total, length) for length in lengths], turned(segments)
        added = across([list(map(mul, row, shares)) for row in x], x)
        self.M = each(lambda x, y, z: (x * up(total, own) + y >> 40) + z, self.M, added, diagonal(self.n, self.n))

    def length(self, segment: Any) -> int:
        return 1 + isqrt(sum([x * x for x in map(mul, segment, self.weights)]))

    def most(self, row: Any = None) -> Any:
        """The largest size of each entry, or of a row times the vector."""
        if row is None:
            return [sum(map(abs, x)) + isqrt(self.M[i][i]) + 1 for i, x in enumerate(self.x)]
        return sum(map(abs, self.moved(row))) + isqrt(max(0, around([row], self.M)[0][0])) + 1


def exactly(given: Any) -> Any:
    """Replace texts in nested lists by the numbers that they hold."""
    if isinstance(given, list):
        return [exactly(x) for x in given]
    need(given is None or (isinstance(given, str) and NUMBER.fullmatch(given)), f"got {given!r} for a number")
    return None if given is None else Fraction(given)


class Proof:
    """The claim of a certificate; numbers of the format are in units of base**-scale."""

    def __init__(self, given: Any, scale: int) -> None:
        numbers = [given[key] for key in NUMBERS]
        need(whole(*numbers) and min(numbers) >= 0, "a number that is not whole, or negative")
        self.given, self.steps = given, given["steps"]
        need(self.steps is None or (whole(self.steps) and self.steps > 0), "no number of steps")
        self.a = a = Arithmetic(given["format"], scale)
        made = given["filter"]
        self.stored: Any = Stored(a, made) if made["kind"] == "kalman" else None
        self.exact: Any = ExactCovariance(self.stored) if self.stored else None
        if self.stored:
            n, m, self.x0 = self.stored.n, self.stored.m, self.stored.x0
            operations, outputs = operations_of(made["form"], n, m)
            self.emulate()
        else:
            n, m, operations, outputs = (made[key] for key in ("states", "inputs", "operations", "outputs"))
            c, sound = made["coefficients"], whole(n, m, *outputs) and len(outputs) == n and min(outputs) >= 0
            for v, (kind, p, q) in enumerate(operations, n + m):
                if kind not in (MULTIPLY, ADD, SUBTRACT):
                    raise NotImplementedError(f"the operation {kind!r}")
                sound = sound and whole(p, q) and 0 <= q < v and 0 <= p < (len(c) if kind == MULTIPLY else v)
            need(sound, "operations on values that are not known")
            self.x0, self.first, self.period, self.repeat = [0] * n, 0, 1, 0
            self.c = [[a.store(x) for x in exactly(c)]]
        self.limit(n, m)
        bits = self.exact.bits if self.exact else 0
        self.effects = e = Effects(a, operations, outputs, (self.X, self.V, self.Z), self.b, bits)
        if not self.stored:
            need(self.derived, "no limits on the inputs")
            at_most(self.Z, self.V, "an input may exceed its limit")
            rows = e.rows(self.c[0], [[0] * n] * m)
            found = [[Fraction(x, e.unit[e.depth[v]]) for x in rows[v][: n + m]] for v in outputs]
            stated = [x + y for x, y in zip(exactly(made["A"]), exactly(made["B"]), strict=True)]
            need(found == stated, "the operations do not compute the recursion that the file states")

    def limit(self, n: int, m: int) -> None:
        """Read the limits and the bound, in units, rounded up; `most` is the bound rounded down."""
        given, unit = self.given, self.a.unit
        X, V, Z = (exactly(given["limits"][key]) for key in ("state", "innovation", "measurement"))
        bound, *others = map(exactly, (given["bound"], given["derived"]["state"], given["derived"]["innovation"]))
        fits = list(map(len, (bound, X, V, Z, *others))) == [n, n, m, m, n, m]
        need(fits and None not in bound, "limits or a bound of another filter")
        need(all(x is None or x >= 0 for xs in (X, V, Z, bound, *others) for x in xs), "a negative limit or bound")
        if any(x and x * unit < 2**75 for x in bound):
            raise OverflowError
        Z = [x and max(x, *(abs(Fraction(self.a.store(y), unit)) for y in (x, -x))) for x in Z]
        least: Any = each(lambda x, y: y if x is None else min(x, y), [X + V], [others[0] + others[1]])[0]
        self.derived = least != X + V
        need(not self.derived or None not in Z, "limits that do not follow from others")
        at_most([Fraction(abs(x), unit) for x in self.x0], least[:n], "the first estimate is beyond its limit")
        sizes: Any = [[None if x is None else -(-x * unit // 1) for x in xs] for xs in (least[:n], least[n:], Z, bound)]
        self.X, self.V, self.Z, self.b = sizes
        self.most = [x * unit // 1 for x in bound]

    def emulate(self) -> None:
        """Emulate the covariance until it recurs, as claimed, or for the number of steps."""
        self.repeat, self.period, self.first = (self.given[key] for key in ("repeat", "period", "first"))
        sound = 0 <= self.repeat <= self.first and self.period > 0 and self.period % self.stored.cycle == 0
        need(sound or self.steps is not None, "the gain cannot repeat after such a period")
        P, kept, self.c = self.stored.start, self.stored.start, []
        for k in range(self.repeat + self.period if self.steps is None else self.steps):
            P, c = self.stored.step(k, P)
            kept = P if k + 1 == self.repeat else kept
            self.c.append(c)
        need(self.steps is not None or kept == P, "the computed covariance does not recur as claimed")

    def step(self, k: int, gain: Any = None) -> Any:
        if not self.stored:
            return self.effects.step(0, self.c[0])
        c = self.c[k if k < len(self.c) else self.repeat + (k - self.repeat) % self.period]
        Phi, H = self.stored.members(k)[:2]
        return self.effects.step(k % self.stored.cycle, c, Phi, across(H, turned(Phi)), gain)

    def seen(self, k: int) -> Any:
        """H Phi of step k + 1 in units of 2**-loops, and what it may add to the measurements of an innovation."""
        if not (self.stored and self.derived):
            return [], []
        Phi, H = self.stored.members(k)[:2]
        loops = self.effects.loops
        rows = each(lambda x: (x << loops) // self.a.unit**2, across(H, turned(Phi)))
        return rows, [v - z - (sum(self.X) >> loops) - 1 for v, z in zip(self.V, self.Z, strict=True)]

    def run(self) -> None:
        errors, loops = ErrorSet(self.b, self.given["keep"]), self.effects.loops
        states = ErrorSet(self.X, self.given["keep"], self.x0)
        for k in range(self.first if self.steps is None else self.steps):
            self.check_innovation(states, k)
            F, far, near = self.step(k, self.exact and self.exact.step(k))
            errors.advance(F, loops, *far)
            at_most(errors.most(), self.most, f"the error may exceed its bound after step {k + 1}")
            if self.derived:
                states.advance(F, loops, *near)
                at_most(states.most(), self.X, f"a state may exceed its limit after step {k + 1}")
        if self.steps is None:
            self.check_innovation(states, self.first)
            self.for_ever(errors, states)

    def check_innovation(self, states: ErrorSet, k: int) -> None:
        rows, most = self.seen(k)
        at_most([states.most(row) for row in rows], [x << self.effects.loops for x in most], INNOVATION)

    def for_ever(self, errors: ErrorSet, states: ErrorSet) -> None:
        first, n = self.first, len(self.b)
        gains = self.exact.settled(first, self.period, exactly(self.given["width"])) if self.exact else [None]
        one, steps = diagonal(n, 1 << self.effects.loops), [self.step(first + p, gain) for p, gain in enumerate(gains)]
        need(self.given["back"] > 0, "no step back")
        for p in range(self.period if self.derived else 0):
            extra, most = self.seen(first + p + 1)
            limits = self.X + most
            found = self.after_many(one + extra, p, [(F, *near) for F, _, near in steps], self.X, states, limits)
            at_most(found, limits, INNOVATION)
        if not self.stored:
            self.cap(steps)
            steps = [self.step(0)]
        for p in range(self.period):
            found = self.after_many(one, p, [(F, *far) for F, far, _ in steps], self.b, errors, self.most)
            at_most(found, self.most, f"the error may exceed its bound, in phase {p} of the period")

    def after_many(self, rows: Any, phase: int, steps: Any, most: Any, reach: Any = None, limits: Any = ()) -> Any:
        """Bound rows, in units of 2**-loops, times a vector after any step of a phase; `most` bounds earlier ones."""
        # `reach` is the set before the first of all steps; the first steps need `limits`.
        loops, sums, box = self.effects.loops, [0] * len(rows), reach.most() if reach else None
        for lag in range(self.given["back"]):
            F, columns, slack = steps[(phase - lag) % len(steps)]
            for g in columns:
                sums = [x + abs(sum(map(mul, row, g))) for x, row in zip(sums, rows, strict=True)]
            sums = [x + size(row, slack) + sum(most) for x, row in zip(sums, rows, strict=True)]
            rows = each(lambda x: x >> loops, across(rows, turned(F)))
            if reach and lag % len(steps) == phase:
                for x, row, limit in zip(sums, rows, limits, strict=True):
                    room = (limit << loops) - x
                    need(size(row, box) <= room or reach.most(row) <= room, "a bound may be exceeded later")
        return [up(x + size(row, most), 1 << loops) for x, row in zip(sums, rows, strict=True)]

    def cap(self, steps: Any) -> None:
        """Bound each number of a step of a filter with fixed coefficients by all its inputs."""
        e, n, loops = self.effects, len(self.b), self.effects.loops
        rows, depth = e.rows(self.c[0], [[0] * n] * e.m)[n + e.m :], e.depth[n + e.m :]
        A = [[(x << loops) // e.unit[d] for x in row[:n]] for row, d in zip(rows, depth, strict=True)]
        found, missed = self.after_many(A, 0, [(F, *near) for F, _, near in steps], self.X), (sum(self.X) >> loops) + 1
        for v, (x, row, d) in enumerate(zip(found, rows, depth, strict=True), n + e.m):
            e.caps[v] = x + missed + up(size(row, self.b + self.Z), e.unit[d])
        e.known.clear()


def prove(given: Any) -> str:
    """Return the claim of a certificate as a sentence, proved; or raise NotProvedError or NotImplementedError."""
    try:
        fmt, made, known = given["format"], given["filter"], given["certificate"] == KIND and given["order"] == ORDER
        parts = (given, made, fmt, given["limits"], given["derived"])
        keys = (KEYS, FILTERS.get(made["kind"], set()), FORMATS["overflow" not in fmt], LIMITS, LIMITS)
        unknown = {key for part, names in zip(parts, keys, strict=True) for key in part if key not in names}
        form = made.get("form", "ud")
        if not known or unknown or form not in FORMS or fmt["rounding"] not in ROUNDINGS:
            raise NotImplementedError(", ".join(sorted(unknown)) or f"{fmt['rounding']} rounding, or the kind or form")
        scale = 3 * fmt["precision"] + 40
        while scale < 20_000:
            try:
                Proof(given, scale).run()
                bound = [nextafter(float(x), inf) for x in exactly(given["bound"])]
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
