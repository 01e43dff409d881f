"""Extended and unscented Kalman filters, and steps of systems, as plain loops over fractions.

The loops are written from the equations of each form, with an explicit rounding after each operation. Elementary
functions come from mpmath, with 300 bits, and are rounded once. Nothing is taken from the package.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil, floor, isqrt

import mpmath
import numpy as np

PRECISE = mpmath.mp.clone()
PRECISE.prec = 300


def of_mpmath(r, function, *arguments):
    """The value of a function of mpmath, rounded once."""
    value = getattr(PRECISE, function)(*(PRECISE.mpf(a.numerator) / a.denominator for a in map(Fraction, arguments)))
    sign, mantissa, exponent, _ = value._mpf_
    return r((-1) ** sign * Fraction(int(mantissa)) * Fraction(2) ** exponent)


class PlainMatrices:
    """Matrices of fractions as lists of rows, with every operation rounded."""

    def __init__(self, r):
        self.r = r

    def times(self, A, B):
        def entry(row, column):
            total = self.r(row[0] * column[0])
            for a, b in zip(row[1:], column[1:], strict=True):
                total = self.r(total + self.r(a * b))
            return total

        return [[entry(row, column) for column in zip(*B, strict=True)] for row in A]

    def plus(self, A, B, sign=1):
        return [[self.r(a + sign * b) for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]

    def take(self, A):
        return [[self.r(a) for a in row] for row in A]


def transposed(A):
    return [list(row) for row in zip(*A, strict=True)]


def eye(n):
    return [[Fraction(i == j) for j in range(n)] for i in range(n)]


def inverse(r, A):
    """Elimination without exchanges, each operation rounded."""
    m, A, C = len(A), [row[:] for row in A], eye(len(A))
    for k in range(m):
        for i in range(k + 1, m):
            f = r(A[i][k] / A[k][k])
            A[i] = [*A[i][: k + 1], *(r(A[i][j] - r(f * A[k][j])) for j in range(k + 1, m))]
            C[i] = [r(c - r(f * d)) for c, d in zip(C[i], C[k], strict=True)]
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            C[k] = [r(c - r(A[k][i] * d)) for c, d in zip(C[k], C[i], strict=True)]
        C[k] = [r(c / A[k][k]) for c in C[k]]
    return C


def factors(A):
    """Exact factors U D U' of a covariance; D is on the diagonal."""
    n, A, U = len(A), [row[:] for row in A], [[Fraction(0)] * len(A) for _ in A]
    for j in range(n - 1, -1, -1):
        U[j][j] = d = A[j][j]
        for i in range(j):
            U[i][j] = A[i][j] / d if d else Fraction(0)
        for i in range(j):
            for k in range(j):
                A[i][k] -= U[i][j] * U[k][j] * d
    return U


class Ranges:
    """A vehicle that measures range and bearing of a beacon, with its Jacobians written out."""

    def __init__(self, beacon):
        self.beacon = beacon

    def emulated(self, x, u=None):
        a, b = (x.format.array(each) - x[i] for i, each in enumerate(self.beacon))
        return np.stack([np.hypot(a, b), np.arctan2(b, a)])

    def plain(self, r, x, u):
        a, b = self.ahead(r, x)
        (c, bearing), s = self.value(r, x), r(r(a * a) + r(b * b))
        rest = [Fraction(0)] * (len(x) - 2)
        H = [[r(-a / c), r(-b / c), *rest], [r(b / s), r(-a / s), *rest]]
        return [c, bearing], H

    def value(self, r, x):
        a, b = self.ahead(r, x)
        return [of_mpmath(r, "hypot", a, b), of_mpmath(r, "atan2", b, a)]

    def ahead(self, r, x):
        return [r(r(Fraction(each)) - x[i]) for i, each in enumerate(self.beacon)]


class Moving:
    """States x and y, moved by known velocities u."""

    n = 2

    def emulated(self, x, u):
        return x + u

    def plain(self, r, x, u):
        return [r(a + b) for a, b in zip(x, u, strict=True)], eye(2)


class Turning:
    """States x, y and heading, moved by a distance and a turn."""

    n = 3

    def emulated(self, x, u):
        return np.stack([x[0] + u[0] * np.cos(x[2]), x[1] + u[0] * np.sin(x[2]), x[2] + u[1]])

    def plain(self, r, x, u):
        c, s = of_mpmath(r, "cos", x[2]), of_mpmath(r, "sin", x[2])
        F = eye(3)
        F[0][2], F[1][2] = r(u[0] * -s), r(u[0] * c)
        return [r(x[0] + r(u[0] * c)), r(x[1] + r(u[0] * s)), r(x[2] + u[1])], F


class Coasting:
    """States x, y and two velocities, for steps of 0.1 s; the inputs are not used."""

    n = 4

    def emulated(self, x, u):
        dt = x.format.array("0.1")
        return np.stack([x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3]])

    def plain(self, r, x, u):
        dt = r(Fraction(1, 10))
        F = eye(4)
        F[0][2] = F[1][3] = dt
        return [r(x[0] + r(dt * x[2])), r(x[1] + r(dt * x[3])), x[2], x[3]], F


class PlainFilter:
    """An extended Kalman filter in plain loops."""

    def __init__(self, motion, sight, given, form, r, blocks=None, iterations=1):
        self.motion, self.sight, self.form, self.iterations = motion, sight, form, iterations
        blocks = blocks or {}
        self.state, self.gain, self.covariance, self.innovation = (
            PlainMatrices(blocks.get(name, r)) for name in ("state", "gain", "covariance", "innovation")
        )
        self.r = self.state.r
        Q, R, x0, P0 = given
        self.x = [self.r(r(a)) for a in x0]
        if form == "UD":
            Q, R, P0 = map(factors, (Q, R, P0))
        self.Q, self.R = ([[r(a) for a in row] for row in each] for each in (Q, R))
        self.P = self.covariance.take([[r(a) for a in row] for row in P0])

    def step(self, z, u):
        r = self.r
        z, u = [r(Fraction(each)) for each in z], [r(Fraction(each)) for each in u]
        ahead, F = self.motion.plain(r, self.x, u)
        V = self.predicted(self.covariance.take(F))
        x = ahead
        for i in range(self.iterations):
            expected, H = self.sight.plain(r, x, u)
            y = [r(a - b) for a, b in zip(z, expected, strict=True)]
            y[1] = self.wrapped(y[1])
            if i:
                moved = [[r(a - b)] for a, b in zip(ahead, x, strict=True)]
                y = [r(a - b[0]) for a, b in zip(y, self.state.times(H, moved), strict=True)]
            x, P = self.updated(ahead, V, H, y)
        self.x, self.P = x, P

    def wrapped(self, y):
        r = self.r
        turn = r(2 * of_mpmath(r, "atan2", 0, -1))
        return r(y - r(round(r(y / turn)) * turn))

    def predicted(self, F):
        p = self.covariance
        if self.form == "UD":
            return self.thornton(F)
        return p.plus(p.times(p.times(F, self.P), transposed(F)), p.take(self.Q))

    def updated(self, ahead, V, H, y):
        if self.form == "UD":
            return self.bierman(ahead, V, H, y)
        p, s, g = self.covariance, self.innovation, self.gain
        VH = s.times(s.take(V), transposed(s.take(H)))
        S = s.plus(s.times(s.take(H), VH), s.take(self.R))
        K = g.times(g.take(VH), g.take(inverse(s.r, S)))
        own = p.take(K)
        W = p.plus(eye(len(V)), p.times(own, p.take(H)), -1)
        P = p.times(W, V)
        if self.form == "Joseph":
            P = p.plus(p.times(P, transposed(W)), p.times(p.times(own, p.take(self.R)), transposed(own)))
        step = self.state.times(self.state.take(K), [[a] for a in y])
        return [self.r(a + b[0]) for a, b in zip(ahead, step, strict=True)], P

    def thornton(self, F):
        r, n = self.covariance.r, len(self.P)
        unit = [[self.P[i][j] if i < j else Fraction(i == j) for j in range(n)] for i in range(n)]
        Q = self.covariance.take(self.Q)
        noise = [[Q[i][j] if i < j else Fraction(i == j) for j in range(n)] for i in range(n)]
        W = [a + b for a, b in zip(self.covariance.times(F, unit), noise, strict=True)]
        D = [self.P[i][i] for i in range(n)] + [Q[i][i] for i in range(n)]
        U = [[Fraction(0)] * n for _ in range(n)]

        def dot(a, b):
            total = Fraction(0)
            for left, right in zip(a, b, strict=True):
                total = r(total + r(left * right))
            return total

        for j in range(n - 1, -1, -1):
            c = [r(d * w) for d, w in zip(D, W[j], strict=True)]
            U[j][j] = dot(W[j], c)
            for i in range(j):
                U[i][j] = r(dot(W[i], c) / U[j][j]) if U[j][j] else Fraction(0)
                W[i] = [r(a - r(U[i][j] * b)) for a, b in zip(W[i], W[j], strict=True)]
        return U

    def bierman(self, ahead, U, H, y):
        s, p, g, r = self.innovation.r, self.covariance.r, self.gain.r, self.r
        n, m, U = len(U), len(y), [row[:] for row in U]

        def without_correlation(one, columns):
            rows = [list(row) for row in columns]
            for i in range(m - 1, -1, -1):
                for k in range(i + 1, m):
                    rows[i] = [one(a - one(one(self.R[i][k]) * b)) for a, b in zip(rows[i], rows[k], strict=True)]
            return rows

        rows = without_correlation(s, self.innovation.take(H))
        values = [row[0] for row in without_correlation(r, [[each] for each in y])]
        change = [Fraction(0)] * n
        for h, value, i in zip(rows, values, range(m), strict=True):
            for j in range(n):
                value = r(value - r(r(h[j]) * change[j]))
            f = []
            for j in range(n):
                total = Fraction(0)
                for k in range(j + 1):
                    total = s(total + s(s(U[k][j]) * h[k] if k < j else h[j]))
                f.append(total)
            v = [s(s(U[j][j]) * f[j]) for j in range(n)]
            a, K = s(self.R[i][i]), []
            for j in range(n):
                before, a = a, s(a + s(f[j] * v[j]))
                column = [U[k][j] for k in range(j)]
                if v[j]:
                    U[j][j] = p(p(U[j][j] * p(before)) / p(a))
                    factor = -p(p(f[j]) / p(before))
                    for k in range(j):
                        U[k][j] = p(U[k][j] + p(factor * p(K[k])))
                for k in range(j):
                    K[k] = g(K[k] + g(g(v[j]) * g(column[k])))
                K.append(g(v[j]))
            K = [g(each / g(a)) for each in K]
            change = [r(c + r(r(k) * value)) for c, k in zip(change, K, strict=True)]
        return [r(a + b) for a, b in zip(ahead, change, strict=True)], U


class PlainUnscented(PlainFilter):
    """An unscented filter in plain loops, with weights alpha = 1/2, beta = 2, kappa = 1."""

    def step(self, z, u):
        r, n = self.r, len(self.x)
        z, u = [r(Fraction(each)) for each in z], [r(Fraction(each)) for each in u]
        exactly = Fraction(1, 4) * (n + 1)
        scale, center, other = r(exactly), r(1 - n / exactly + Fraction(11, 4)), r(1 / (2 * exactly))
        L = self.root([[r(scale * a) for a in row] for row in self.P])
        X = [self.x]
        X += [[r(a + b) for a, b in zip(self.x, column, strict=True)] for column in transposed(L)]
        X += [[r(a - b) for a, b in zip(self.x, column, strict=True)] for column in transposed(L)]
        Y = [self.motion.plain(r, each, u)[0] for each in X]
        Z = [self.sight.value(r, each) for each in Y]
        ahead, D = self.mean(other, Y, lambda a, b: [r(c - d) for c, d in zip(a, b, strict=True)])
        expected, E = self.mean(other, Z, self.difference)
        weights = [center, *[other] * (2 * n)]
        plain = self.state
        weighted = [[r(a * w) for a, w in zip(column, weights, strict=True)] for column in transposed(D)]
        V = plain.plus(plain.times(weighted, D), self.Q)
        across = [[r(a * w) for a, w in zip(column, weights, strict=True)] for column in transposed(E)]
        S = plain.plus(plain.times(across, E), self.R)
        K = plain.times(plain.times(weighted, E), inverse(r, S))
        y = self.difference(z, expected)
        self.P = plain.plus(V, plain.times(plain.times(K, S), transposed(K)), -1)
        change = plain.times(K, [[a] for a in y])
        self.x = [r(a + b[0]) for a, b in zip(ahead, change, strict=True)]

    def difference(self, a, b):
        y = [self.r(c - d) for c, d in zip(a, b, strict=True)]
        return [y[0], self.wrapped(y[1])]

    def mean(self, weight, points, difference):
        r, total = self.r, None
        for point in points[1:]:
            part = [r(weight * a) for a in difference(point, points[0])]
            total = part if total is None else [r(a + b) for a, b in zip(total, part, strict=True)]
        mean = [r(a + b) for a, b in zip(points[0], total, strict=True)]
        return mean, [difference(each, mean) for each in points]

    def root(self, A):
        r, n = self.r, len(A)
        L = [[Fraction(0)] * n for _ in range(n)]
        for j in range(n):
            rest = [A[i][j] for i in range(n)]
            for k in range(j):
                rest = [r(a - r(L[i][k] * L[j][k])) for i, a in enumerate(rest)]
            if rest[j] < 0:
                raise ValueError("the square root of a negative number")
            L[j][j] = of_mpmath(r, "sqrt", rest[j])
            for i in range(j + 1, n):
                L[i][j] = r(rest[i] / L[j][j]) if L[j][j] else Fraction(0)
        return L


# -- steps of systems -------------------------------------------------------------------------------------------------


def root(x):
    """The square root of a fraction, or a neighbour that every rounding to fewer than 200 bits takes for it."""
    scale = 1 << 200
    whole, rest = divmod(x.numerator * scale**2, x.denominator)
    found = isqrt(whole)
    exact = not rest and found**2 == whole
    return Fraction(found, scale) if exact else Fraction(2 * found + 1, 2 * scale)


def of_sign(x, sign):
    return abs(x) if sign >= 0 else -abs(x)


def limits(x, low, high):
    return min(max(x, Fraction(low)), Fraction(high))


OPERATIONS = [
    (lambda a, b, c: a + b, lambda r, a, b, c: r(a + b)),
    (lambda a, b, c: a - b * c, lambda r, a, b, c: r(a - r(b * c))),
    (lambda a, b, c: a / (abs(b) + 1), lambda r, a, b, c: r(a / r(r(abs(b)) + 1))),
    (lambda a, b, c: np.sqrt(abs(a)), lambda r, a, b, c: r(root(r(abs(a))))),
    (
        lambda a, b, c: np.fmod(a, b * b + 1),
        lambda r, a, b, c: r(of_sign(abs(a) % r(r(b * b) + 1), a)),
    ),
    (lambda a, b, c: a % 2, lambda r, a, b, c: r(a - 2 * floor(a / 2))),
    (lambda a, b, c: np.where(a < b, c, -a), lambda r, a, b, c: c if a < b else r(-a)),
    (lambda a, b, c: np.where((a <= b) ^ (b > c), a, b), lambda r, a, b, c: a if (a <= b) != (b > c) else b),
    (
        lambda a, b, c: np.where(~((a == b) | (c != a)) & (c >= 0), abs(c), 0),
        lambda r, a, b, c: r(abs(c)) if a != b and c == a and c >= 0 else Fraction(0),
    ),
    (lambda a, b, c: np.where((a > 0) == (b > 0), b, c), lambda r, a, b, c: b if (a > 0) == (b > 0) else c),
    (lambda a, b, c: np.clip(a, -1, 2), lambda r, a, b, c: limits(a, -1, 2)),
    (lambda a, b, c: np.minimum(np.maximum(a, b), 1), lambda r, a, b, c: min(max(a, b), Fraction(1))),
    (lambda a, b, c: np.maximum(-1, np.minimum(2, a)) + c, lambda r, a, b, c: r(limits(a, -1, 2) + c)),
    (
        lambda a, b, c: np.floor(a) / 2 + np.ceil(b) / 4,
        lambda r, a, b, c: r(r(r(Fraction(floor(a))) / 2) + r(r(Fraction(ceil(b))) / 4)),
    ),
    (lambda a, b, c: np.rint(a) - np.trunc(b), lambda r, a, b, c: r(r(Fraction(round(a))) - r(Fraction(int(b))))),
    (
        lambda a, b, c: np.sign(a) * np.copysign(b, c),
        lambda r, a, b, c: r(((a > 0) - (a < 0)) * r(of_sign(b, c))),
    ),
]
"""Operations on arrays of a format, and on fractions with a rounding."""


def drawn(seed):
    """A step with random operations on states, inputs and constants, and the same step in fractions."""
    steps = np.random.default_rng(seed).integers(0, 1000, (25, 4)).tolist()

    def step(fmt, x, u):
        known = [*x, *u, *fmt.array(["0.7", "-1.5", 0, 1])]
        for kind, *choice in steps:
            operands = (known[each % len(known)] for each in choice)
            known.append(OPERATIONS[kind % len(OPERATIONS)][0](*operands))
        return [np.clip(each, -4, 4) for each in known[-3:]], known[-8:-3]

    def plain(r, x, u):
        known = [*x, *u, *map(r, (Fraction(7, 10), Fraction(-3, 2), Fraction(0), Fraction(1)))]
        for kind, *choice in steps:
            operands = (known[each % len(known)] for each in choice)
            known.append(OPERATIONS[kind % len(OPERATIONS)][1](r, *operands))
        return [limits(each, -4, 4) for each in known[-3:]], known[-8:-3]

    return step, plain
