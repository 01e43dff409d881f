"""The smoother with covariances and with square roots, as plain loops over fractions without the package."""

from __future__ import annotations

from fractions import Fraction

from gmpy2 import mpq

from tests.oracles import Arithmetic, square_root


class Plain(Arithmetic):
    """Matrices as lists of lists, every operation rounded once, written from the formulas of the smoother."""

    def __init__(self, base, precision, nearest):
        super().__init__(base, precision, nearest)
        self.root = lambda x: mpq(square_root(Fraction(x.numerator, x.denominator), base, precision, nearest))

    def stored(self, a):
        return [[self.fl(mpq(x)) for x in row] for row in a]

    def add(self, a, b, sign=1):
        return [[self.fl(x + sign * y) for x, y in zip(p, q, strict=True)] for p, q in zip(a, b, strict=True)]

    def product(self, *factors):
        found = factors[0]
        for each in factors[1:]:
            found = self.matmul(found, each)
        return found

    def by_covariances(self, given, z, joseph):
        forward, x, P = [], self.stored([[value] for value in given.x0]), self.stored(given.P0)
        for k, row in enumerate(z):
            Phi, H, Q, R = (self.stored(c[k % len(c)]) for c in (given.Phi, given.H, given.Q, given.R))
            V = self.add(self.product(Phi, P, turned(Phi)), Q)
            VH = self.matmul(V, turned(H))
            K = self.matmul(VH, self.inv(self.add(self.matmul(H, VH), R), pivot=False))
            W = self.add(unit(len(V)), self.matmul(K, H), -1)
            P = self.matmul(W, V)
            if joseph:
                P = self.add(self.matmul(P, turned(W)), self.product(K, R, turned(K)))
            ahead = self.matmul(Phi, x)
            innovation = self.add(self.stored([[value] for value in row]), self.matmul(H, ahead), -1)
            x = self.add(ahead, self.matmul(K, innovation))
            forward.append((Phi, V, ahead, x, P))
        found = [(x, P)]
        for k in range(len(z) - 2, -1, -1):
            (Phi, V, ahead, _, _), (_, _, _, xf, Pf) = forward[k + 1], forward[k]
            G = self.product(Pf, turned(Phi), self.inv(V, pivot=False))
            x = self.add(xf, self.matmul(G, self.add(x, ahead, -1)))
            P = self.add(Pf, self.product(G, self.add(P, V, -1), turned(G)))
            found.insert(0, (x, P))
        return found

    def factored(self, M):
        """Exact U and D, rounded: from the last column to the first."""
        rest, n = [[mpq(value) for value in row] for row in M], len(M)
        U, D = unit(n), [mpq(0)] * n
        for j in range(n - 1, -1, -1):
            D[j] = rest[j][j]
            for i in range(j):
                U[i][j] = rest[i][j] / D[j] if D[j] else mpq(0)
            for i in range(j):
                for other in range(j):
                    rest[i][other] -= U[i][j] * U[other][j] * D[j]
        return self.stored(U), [self.fl(d) for d in D]

    def root_of(self, M):
        U, D = self.factored(M)
        return [[self.fl(u * self.root(d)) for u, d in zip(row, D, strict=True)] for row in U]

    def triangle(self, W):
        """The upper triangle T of W = T times orthonormal rows, by modified Gram-Schmidt from the last row on."""
        W, n = [list(row) for row in W], len(W)
        T = [[mpq(0)] * n for _ in range(n)]
        for j in range(n - 1, -1, -1):
            T[j][j] = size = self.root(self.dot(W[j], W[j]))
            if size:
                direction = [self.fl(value / size) for value in W[j]]
                for i in range(j):
                    T[i][j] = s = self.dot(W[i], direction)
                    W[i] = [self.fl(a - self.fl(s * b)) for a, b in zip(W[i], direction, strict=True)]
        return T

    def by_roots(self, given, z):
        fl, n, forward = self.fl, len(given.x0), []
        x, S = [fl(mpq(value)) for value in given.x0], self.root_of(given.P0)
        for k, row in enumerate(z):
            Phi, H = (self.stored(c[k % len(c)]) for c in (given.Phi, given.H))
            SQ, (U, D) = self.root_of(given.Q[k % len(given.Q)]), self.factored(given.R[k % len(given.R)])
            moved = self.matmul(Phi, S)
            T = self.triangle([S[i] + [mpq(0)] * n for i in range(n)] + [moved[i] + SQ[i] for i in range(n)])
            A, B, C = (
                [row[c:d] for row in T[a:b]] for a, b, c, d in ((0, n, 0, n), (0, n, n, 2 * n), (n, 2 * n, n, 2 * n))
            )
            ahead = [self.dot(row, x) for row in Phi]
            x, S, y = ahead, C, [fl(mpq(value)) for value in row]
            for i in range(len(H) - 1, -1, -1):
                for other in range(i + 1, len(H)):
                    H[i] = [fl(a - fl(U[i][other] * b)) for a, b in zip(H[i], H[other], strict=True)]
                    y[i] = fl(y[i] - fl(U[i][other] * y[other]))
            for h, value, r in zip(H, y, D, strict=True):
                x, S = self.carlson(h, value, r, x, S)
            forward.append((A, B, C, ahead, x))
        found = [([[value] for value in x], S)]
        for k in range(len(z) - 2, -1, -1):
            A, B, C, ahead, _ = forward[k + 1]
            joined = [[fl(x[i] - ahead[i]), *S[i]] for i in range(n)]
            for i in range(n - 1, -1, -1):
                for other in range(i + 1, n):
                    joined[i] = [fl(a - fl(C[i][other] * b)) for a, b in zip(joined[i], joined[other], strict=True)]
                joined[i] = [fl(a / C[i][i]) for a in joined[i]]
            x = [fl(a + self.dot(row, [line[0] for line in joined])) for a, row in zip(forward[k][4], B, strict=True)]
            moved = self.matmul(B, [line[1:] for line in joined])
            S = self.triangle([moved[i] + A[i] for i in range(n)])
            found.insert(0, ([[value] for value in x], S))
        return found

    def carlson(self, h, z, r, x, S):
        fl, n = self.fl, len(x)
        f = [self.dot([S[i][j] for i in range(n)], h) for j in range(n)]
        a, k, new = r, [mpq(0)] * n, [list(row) for row in S]
        for j in range(n):
            if f[j]:
                before, a = a, fl(a + fl(f[j] * f[j]))
                p, q = self.root(fl(before / a)), fl(f[j] / self.root(fl(before * a)))
                for i in range(n):
                    new[i][j] = fl(fl(p * S[i][j]) - fl(q * k[i]))
                    k[i] = fl(k[i] + fl(f[j] * S[i][j]))
        y = fl(z - self.dot(h, x))
        return [fl(value + fl(fl(gain / a) * y)) for value, gain in zip(x, k, strict=True)], new


def turned(a):
    return [list(column) for column in zip(*a, strict=True)]


def unit(n):
    return [[mpq(int(i == j)) for j in range(n)] for i in range(n)]
