"""Filters whose blocks have formats of their own, as plain loops over fractions.

Each loop is written from the equations of its form, with the rounding of each block as a function. Nothing is taken
from the package but the names of the forms.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tests.plain_nonlinear import eye, inverse, transposed

ZERO = Fraction(0)


class Rounds(NamedTuple):
    """The rounding of stored results, and of sums of products, in a block."""

    store: object
    sums: object

    def product(self, A, B):
        """Products of rows and columns, summed from left to right; exact zeros and factors of one change nothing."""
        assert self.take(A) == A, "a block multiplies only numbers of its format"
        assert self.take(B) == B

        def entry(row, column):
            total = None
            for a, b in zip(row, column, strict=True):
                p = self.sums(a * b)
                total = p if total is None else self.sums(total + p)
            return self.store(total)

        return [[entry(row, column) for column in zip(*B, strict=True)] for row in A]

    def take(self, A):
        return [[self.store(a) for a in row] for row in A]

    def plus(self, A, B, sign=1):
        assert self.take(A) == A, "a block adds only numbers of its format"
        assert self.take(B) == B
        return [[self.store(a + sign * b) for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]


class Filter:
    """A filter in a form, with roundings by block; `model` rounds the model."""

    def __init__(self, given, form, model, blocks):
        self.form, self.blocks = form, blocks
        self.Phi, self.H, self.Q, self.R = (
            [[model(a) for a in row] for row in given[k]] for k in ("Phi", "H", "Q", "R")
        )
        self.model = model
        self.x = [[blocks["state"].store(model(a))] for a in given["x0"]]
        P = [[model(a) for a in row] for row in given["P0"]]
        if form == "UD":
            P, self.UQ = factors(model, P), factors(model, self.Q)
        self.P = blocks["covariance"].take(P)

    def step(self, z):
        """Take a step with the measurements that are not missing; the gain of the others is zero."""
        seen = [i for i, each in enumerate(z) if np.isfinite(each)]
        H, R = [self.H[i] for i in seen], [[self.R[i][j] for j in seen] for i in seen]
        z = [[self.blocks["state"].store(Fraction(float(z[i])))] for i in seen]
        K = (self.step_ud if self.form == "UD" else self.step_with_covariance)(H, R, z)
        self.K = [[row[seen.index(i)] if i in seen else ZERO for i in range(len(self.H))] for row in K]

    def step_with_covariance(self, H, R, z):
        """Predict, and update unless every measurement is missing; return the gain."""
        p, s, g, x = (self.blocks[name] for name in ("covariance", "innovation", "gain", "state"))
        V = transposed(
            p.plus(
                p.product(p.take(self.Phi), transposed(p.product(p.take(self.Phi), self.P))),
                transposed(p.take(self.Q)),
            )
        )
        if not z:
            self.x, self.P = x.product(x.take(self.Phi), self.x), V
            return [[] for _ in V]
        PHt = transposed(s.product(s.take(H), transposed(s.take(V))))
        S = s.plus(s.product(s.take(H), PHt), s.take(R))
        K = g.product(g.take(PHt), g.take(inverse(s.store, S)))

        def remaining(K):
            return p.plus(eye(len(self.Phi)), p.product(p.take(K), p.take(H)), -1)

        W = remaining(K)
        if self.form == "Joseph":
            outer = p.product(p.product(p.take(K), p.take(R)), transposed(p.take(K)))
            self.P = p.plus(p.product(p.product(W, V), transposed(W)), outer)
        else:
            self.P = p.product(W, V)
        if self.form == "Hung second gain":
            K = g.product(g.product(g.take(self.P), transposed(g.take(H))), g.take(inverse(self.model, R)))
            W = remaining(K)
        if self.form.startswith("Hung"):
            u, v = x.product(x.product(x.take(W), x.take(self.Phi)), self.x), x.product(x.take(K), z)
        else:
            u = x.product(x.take(self.Phi), self.x)
            v = x.product(x.take(K), x.plus(z, x.product(x.take(H), u), -1))
        self.x = x.plus(u, v)
        return K

    def step_ud(self, H, R, z):
        """Thornton's prediction and Bierman's update; return the gains of one measurement after the other."""
        p, s, g, x = (self.blocks[name].store for name in ("covariance", "innovation", "gain", "state"))
        n, m, UR, gains = len(self.Phi), len(z), factors(self.model, R), []
        UQ = self.blocks["covariance"].take(self.UQ)
        unit = [[self.P[i][j] if i < j else Fraction(i == j) for j in range(n)] for i in range(n)]
        W = [
            left + [UQ[i][j] if i < j else Fraction(i == j) for j in range(n)]
            for i, left in enumerate(self.blocks["covariance"].product(self.blocks["covariance"].take(self.Phi), unit))
        ]
        D, U = [self.P[i][i] for i in range(n)] + [UQ[i][i] for i in range(n)], [[ZERO] * n for _ in range(n)]
        for j in range(n - 1, -1, -1):
            c, d = [p(D[k] * W[j][k]) for k in range(2 * n)], ZERO
            for k in range(2 * n):
                d = p(d + p(W[j][k] * c[k]))
            U[j][j] = d
            for i in range(j):
                total = ZERO
                for k in range(2 * n):
                    total = p(total + p(W[i][k] * c[k]))
                U[i][j] = p(total / d)
                W[i] = [p(a - p(U[i][j] * b)) for a, b in zip(W[i], W[j], strict=True)]
        self.x = self.blocks["state"].product(self.blocks["state"].take(self.Phi), self.x)
        y = decorrelated(x, self.blocks["state"].take(UR), z)
        UR = self.blocks["innovation"].take(UR)
        rows = decorrelated(s, UR, self.blocks["innovation"].take(H))
        for i in range(m):
            h, e = rows[i], y[i][0]
            for j in range(n):
                e = x(e - x(x(h[j]) * self.x[j][0]))
            f, G = [], []
            for j in range(n):
                total = ZERO
                for k in range(j):
                    total = s(total + s(s(U[k][j]) * h[k]))
                f.append(s(total + h[j]))
                G.append(s(s(U[j][j]) * f[j]))
            a, K = UR[i][i], [ZERO] * n
            for j in range(n):
                before = a
                if G[j]:
                    a = s(before + s(f[j] * G[j]))
                    U[j][j] = p(p(U[j][j] * p(before)) / p(a))
                    factor = -p(p(f[j]) / p(before))
                    for k in range(j):
                        u = U[k][j]
                        U[k][j] = p(u + p(factor * p(K[k])))
                        K[k] = g(K[k] + g(g(G[j]) * g(u)))
                K[j] = g(G[j])
            for j in range(n):
                K[j] = g(K[j] / g(a))
                self.x[j][0] = x(self.x[j][0] + x(x(K[j]) * e))
            gains.append(K)
        self.P = U
        return [[gain[j] for gain in gains] for j in range(n)]


def factors(r, A):
    """U D U' = A, with D on the diagonal."""
    n, A = len(A), [row[:] for row in A]
    U = [[ZERO] * n for _ in range(n)]
    for j in range(n - 1, -1, -1):
        U[j][j] = A[j][j]
        for i in range(j):
            U[i][j] = r(A[i][j] / A[j][j]) if A[j][j] else ZERO
        for i in range(j):
            for k in range(i + 1):
                A[k][i] = r(A[k][i] - r(U[k][j] * A[i][j]))
    return U


def decorrelated(r, UR, A):
    C = [row[:] for row in A]
    for j in range(len(A[0]) if A else 0):
        for i in range(len(A) - 1, -1, -1):
            for k in range(i + 1, len(A)):
                C[i][j] = r(C[i][j] - r(UR[i][k] * C[k][j]))
    return C
