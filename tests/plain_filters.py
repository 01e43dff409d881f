"""Filters and a smoother as plain loops over exact fractions, each written from the equations of its form.

Nothing is taken from the package. Vectors are lists, and matrices lists of rows; members of a cycle are in a list, also
if there is only one.
"""

from __future__ import annotations

from gmpy2 import mpq

from tests.oracles import EXACT, ONE, ZERO, Numbers, elementary, summed, transposed, unit, with_units


class Refused(Exception):
    """The filter cannot be stored, or its factors do not become definite."""


# -- covariances that can be stored -----------------------------------------------------------------------------------


def definite(A, strictly):
    """Whether elimination meets no negative pivot, and no zero pivot beside a number that is not zero."""
    U, sound = EXACT.factors(A)
    return sound and not (strictly and any(U[i][i] == 0 for i in range(len(U))))


def raised(A, share):
    return [[mpq(x) * (1 + share) if i == j else mpq(x) for j, x in enumerate(row)] for i, row in enumerate(A)]


def shares(numbers):
    """The shares of the variances to try, each twice the last; a first one is rounded as a float64."""
    share = mpq(float(numbers.roundoff))
    while 0 < share <= mpq(1, 2):
        yield share
        share *= 2


def storable(numbers, A, strictly):
    """The covariance that is stored in place of one that would become indefinite; else the covariance itself."""
    try:
        if definite(numbers.store(A), strictly):
            return A
        for share in shares(numbers):
            candidate = numbers.store(raised(A, share))
            if definite(candidate, strictly):
                return candidate
    except OverflowError:
        pass
    return A


def storable_cycles(numbers, Q, R, P0):
    return (
        [storable(numbers, each, False) for each in Q],
        [storable(numbers, each, True) for each in R],
        storable(numbers, P0, False),
    )


# -- filters ----------------------------------------------------------------------------------------------------------

BLOCKS = ("state", "gain", "covariance", "innovation")
ROOTS = ("potter", "carlson")


class Updates:
    """Predictions and updates of covariances, or of their factors; each block takes the numbers of others."""

    def __init__(self, numbers, form, blocks=None):
        self.numbers, self.form = numbers, form.lower()
        self.state, self.gain, self.covariance, self.innovation = ((blocks or {}).get(b, numbers) for b in BLOCKS)

    def predicted(self, P, F, Q):
        p = self.covariance
        F, Q = p.store(F), p.store(Q)
        if self.form == "ud":
            return self.thornton(P, F, Q)
        if self.form in ROOTS:
            return triangle(p, [a + b for a, b in zip(p.times(F, P), Q, strict=True)])
        return p.plus(p.times(F, P, transposed(F)), Q)

    def updated(self, V, H, R):
        """The gain and the covariance."""
        p, s, g = self.covariance, self.innovation, self.gain
        VH = s.times(s.store(V), transposed(s.store(H)))
        S = s.plus(s.times(s.store(H), VH), s.store(R))
        K = g.times(g.store(VH), g.store(s.inverse(S)))
        W, own = self.reduction(K, H), p.store(K)
        P = p.times(W, V)
        if self.form == "joseph":
            P = p.plus(p.times(P, transposed(W)), p.times(own, p.store(R), transposed(own)))
        if self.form == "symmetrized":
            n, two = len(P), p.r(mpq(2))
            P = [[p.r(p.r(P[i][j] + P[j][i]) / two) for j in range(n)] for i in range(n)]
        return K, P

    def reduction(self, K, H):
        """I - K H."""
        p = self.covariance
        return p.plus(unit(len(K)), p.times(p.store(K), p.store(H)), -1)

    def thornton(self, U, F, UQ):
        """Thornton 1976: Gram-Schmidt on the rows of (F U, UQ), weighted by D and DQ, from the last row up."""
        p, r, n = self.covariance, self.covariance.r, len(U)
        W = [left + right for left, right in zip(p.times(F, with_units(U)), with_units(UQ), strict=True)]
        D, found = [each[i][i] for each in (U, UQ) for i in range(n)], [[ZERO] * n for _ in range(n)]
        for j in range(n - 1, -1, -1):
            c = [r(d * w) for d, w in zip(D, W[j], strict=True)]
            found[j][j] = d = summed(r, W[j], c)
            for i in range(j):
                found[i][j] = s = r(summed(r, W[i], c) / d) if d else ZERO
                W[i] = [r(a - r(s * b)) for a, b in zip(W[i], W[j], strict=True)]
        return found

    def observed(self, x, P, H, UR, z):
        """Estimate, factors or root, and gain after one decorrelated measurement after the other."""
        observe = {"ud": self.bierman, "potter": self.potter, "carlson": self.carlson}[self.form]
        values = decorrelated(self.state, UR, [[each] for each in z])
        rows, UR, columns = decorrelated(self.innovation, UR, self.innovation.store(H)), self.innovation.store(UR), []
        for i, (h, (y,)) in enumerate(zip(rows, values, strict=True)):
            x, P, K = observe(h, y, UR[i][i], x, P)
            columns.append(K)
        return x, P, transposed(columns)

    def bierman(self, h, y, a, x, U):
        """Bierman 1977: the update of factors by a measurement with the variance a."""
        t, s, p, g = (each.r for each in (self.state, self.innovation, self.covariance, self.gain))
        n, U = len(U), [list(row) for row in U]
        for j in range(n):
            y = t(y - t(t(h[j]) * x[j]))
        f = [s(summed(s, [s(U[k][j]) for k in range(j)], h[:j]) + h[j]) for j in range(n)]
        v = [s(s(U[j][j]) * f[j]) for j in range(n)]
        K = [ZERO] * n
        for j in range(n):
            if v[j]:
                before, a = a, s(a + s(f[j] * v[j]))
                U[j][j] = p(p(U[j][j] * p(before)) / p(a))
                factor = -p(p(f[j]) / p(before))
                for k in range(j):
                    u = U[k][j]
                    U[k][j] = p(u + p(factor * p(K[k])))
                    K[k] = g(K[k] + g(g(v[j]) * g(u)))
            K[j] = g(v[j])
        K = [g(each / g(a)) for each in K]
        return [t(each + t(t(k) * y)) for each, k in zip(x, K, strict=True)], U, K

    def potter(self, h, y, variance, x, S):
        """Potter 1963: the update of a square root."""
        numbers, r = self.numbers, self.numbers.r
        f = [numbers.dot(column, h) for column in transposed(S)]
        a, Sf = r(numbers.dot(f, f) + variance), [numbers.dot(row, f) for row in S]
        scale = r(a + numbers.root(r(variance * a)))
        S = [[r(b - r(r(c / scale) * d)) for b, d in zip(row, f, strict=True)] for row, c in zip(S, Sf, strict=True)]
        K = [r(each / a) for each in Sf]
        return self.moved(x, K, h, y), S, K

    def carlson(self, h, y, a, x, S):
        """Carlson 1973: the update of an upper triangular root."""
        numbers, r, n = self.numbers, self.numbers.r, len(x)
        f = [numbers.dot(column, h) for column in transposed(S)]
        k, new = [ZERO] * n, [list(row) for row in S]
        for j in range(n):
            if f[j]:
                before, a = a, r(a + r(f[j] * f[j]))
                p, q = numbers.root(r(before / a)), r(f[j] / numbers.root(r(before * a)))
                for i in range(n):
                    new[i][j] = r(r(p * S[i][j]) - r(q * k[i]))
                    k[i] = r(k[i] + r(f[j] * S[i][j]))
        K = [r(each / a) for each in k]
        return self.moved(x, K, h, y), new, K

    def moved(self, x, K, h, y):
        """The estimate after a measurement."""
        r = self.numbers.r
        y = r(y - self.numbers.dot(h, x))
        return [r(each + r(k * y)) for each, k in zip(x, K, strict=True)]


def decorrelated(numbers, UR, A):
    """Solve U c = A by back substitution, with the unit triangle U."""
    r, UR, C = numbers.r, numbers.store(UR), [list(row) for row in A]
    for i in range(len(C) - 1, -1, -1):
        for k in range(i + 1, len(C)):
            C[i] = [r(a - r(UR[i][k] * b)) for a, b in zip(C[i], C[k], strict=True)]
    return C


def root_of(numbers, U):
    """The upper triangular root of U D U'."""
    return [[numbers.r(a * numbers.root(U[j][j])) for j, a in enumerate(row)] for row in with_units(U)]


def triangle(numbers, W):
    """The upper triangle T of W = T times orthonormal rows, by modified Gram-Schmidt from the last row on."""
    W, n, r = [list(row) for row in W], len(W), numbers.r
    T = [[ZERO] * n for _ in range(n)]
    for j in range(n - 1, -1, -1):
        T[j][j] = size = numbers.root(numbers.dot(W[j], W[j]))
        if size:
            direction = [r(value / size) for value in W[j]]
            for i in range(j):
                T[i][j] = s = numbers.dot(W[i], direction)
                W[i] = [r(a - r(s * b)) for a, b in zip(W[i], direction, strict=True)]
    return T


class Filter(Updates):
    """A filter as a user runs it: the model as given, stored, and every operation rounded.

    Parameters
    ----------
    model : cycles of Phi, H, Q and R, then x0, P0, and cycles of B, u, b and d by their letters; exact. It is stored
        as `numbers`.
    form : "Hung", "Hung second gain", "innovation", "Joseph", "symmetrized", "UD", "Potter" or "Carlson".
    blocks : other numbers by the name of a block.
    compensated : whether the error of adding to the estimate is carried over.

    Raises
    ------
    Refused : factors of a covariance do not become definite.
    """

    def __init__(self, model, numbers, form, blocks=None, compensated=False):
        super().__init__(numbers, form, blocks)
        Phi, H, Q, R, x0, P0 = model[:6]
        Q, R, P0 = storable_cycles(numbers, Q, R, P0)
        self.Phi, self.H, self.Q, self.R = ([numbers.store(each) for each in cycle] for cycle in (Phi, H, Q, R))
        self.x, self.P = self.state.store(numbers.store([[each] for each in x0])), numbers.store(P0)
        self.stored, self.steps, self.K = (self.x, self.P, self.Q, self.R), 0, []
        self.known = {
            letter: [numbers.store(each if letter == "B" else [[a] for a in each]) for each in cycle]
            for letter, cycle in (model[6] if len(model) > 6 else {}).items()
        }
        self.increments, self.carried = [], [[ZERO] for _ in x0] if compensated else None
        if compensated:
            self.increments = [numbers.store(EXACT.plus(each, unit(len(each)), -1)) for each in Phi]
        if self.form == "hung second gain":
            if not all(map(numbers.has_positive_pivots, self.R)):
                raise Refused
            self.RI = [numbers.inverse(each) for each in self.R]
        self.factored = self.form in ("ud", *ROOTS)
        if self.factored:
            self.Q, self.R = self._factored(Q, self.Q), self._factored(R, self.R)
            (self.P,) = self._factored([P0], [self.P])
        if self.form in ROOTS:
            self.Q, self.P = [root_of(numbers, each) for each in self.Q], root_of(numbers, self.P)
        self.P = self.covariance.store(self.P)

    @classmethod
    def of(cls, given, fmt, form):
        """The filter of a model, in a format and a form of the package."""
        return cls(model_of(given), Numbers.of(fmt), form.name.lower().replace("_", " "))

    def _factored(self, cycle, stored):
        """Factors of all members; if some are indefinite, all variances as given are raised until none are."""
        found = list(map(self.numbers.factors, stored))
        for share in shares(self.numbers):
            if all(sound for _, sound in found):
                break
            found = [self.numbers.factors(self.numbers.store(raised(each, share))) for each in cycle]
        if not all(sound for _, sound in found):
            raise Refused
        return [U for U, _ in found]

    def model(self):
        """The model that was stored; variances raised for factors are not in it."""
        x, P, Q, R = self.stored
        return self.Phi, self.H, Q, R, [row[0] for row in x], P

    def step(self, z):
        """Take a step with measurements, which are stored first, and return the estimate."""
        k, t, g = self.steps, self.state, self.gain
        Phi, H, Q, R = (cycle[k % len(cycle)] for cycle in (self.Phi, self.H, self.Q, self.R))
        z, F, self.steps = t.store([[each] for each in z]), t.store(Phi), k + 1
        if "d" in self.known:
            z = t.plus(z, self.now("d"), -1)
        V = self.predicted(self.P, Phi, Q)
        if self.factored:
            x, self.P, self.K = self.observed(
                [a for (a,) in self.with_inputs(t.times(F, self.x))], V, H, R, [a for (a,) in z]
            )
            self.x = [[each] for each in x]
            return x
        K, self.P = self.updated(V, H, R)
        if self.form == "hung second gain":
            K = g.times(g.store(self.P), transposed(g.store(H)), g.store(self.RI[k % len(self.RI)]))
        self.K, own = K, t.store(K)
        if self.form.startswith("hung"):
            loop = t.times(t.store(self.reduction(K, H)), F)
            self.x = t.plus(t.times(loop, self.x), t.times(own, z))
        elif self.carried is None:
            ahead = self.with_inputs(t.times(F, self.x))
            self.innovation_found = t.plus(z, t.times(t.store(H), ahead), -1)
            self.x = t.plus(ahead, t.times(own, self.innovation_found))
        else:
            before, d = self.x, self.with_inputs(t.times(self.increments[k % len(self.increments)], self.x))
            innovation = t.plus(z, t.times(H, t.plus(before, d)), -1)
            d = t.plus(t.plus(d, t.times(own, innovation)), self.carried, -1)
            self.x = t.plus(before, d)
            self.carried = t.plus(t.plus(self.x, before, -1), d, -1)
        return [row[0] for row in self.x]

    def now(self, letter):
        cycle = self.known[letter]
        return cycle[(self.steps - 1) % len(cycle)]

    def with_inputs(self, x):
        if "B" in self.known:
            x = self.state.plus(x, self.state.times(self.now("B"), self.now("u")))
        return self.state.plus(x, self.now("b")) if "b" in self.known else x


def model_of(given):
    """A model of the package in plain lists, with its known inputs."""
    cycles = ([each.tolist() for each in getattr(given, letter)] for letter in ("Phi", "H", "Q", "R"))
    known = {letter: each.tolist() for letter in "Bubd" if (each := getattr(given, letter)) is not None}
    if "u" in known and given.u.ndim == 1:
        known["u"] = [known["u"]]
    return (*cycles, given.x0.tolist(), given.P0.tolist(), known)


class Extended(Updates):
    """An extended Kalman filter; motion and sight give a value and a Jacobian.

    Parameters
    ----------
    given : cycles of Q and R, then x0 and P0.
    angle : whether the second measurement is an angle.
    """

    def __init__(self, motion, sight, given, form, numbers, blocks=None, iterations=1, angle=True):
        super().__init__(numbers, form, blocks)
        self.motion, self.sight, self.iterations, self.angle = motion, sight, iterations, angle
        Q, R, x0, P0 = given
        self.factored = self.form in ("ud", *ROOTS)
        of_noise = numbers.exact_factors if self.factored else numbers.store
        stored = (lambda A: root_of(numbers, of_noise(A))) if self.form in ROOTS else of_noise
        self.noise, self.steps = (list(map(stored, Q)), list(map(of_noise, R))), 0
        self.P = self.covariance.store(stored(P0))
        self.x = [self.state.r(a) for (a,) in numbers.store([[each] for each in x0])]

    def step(self, z, u):
        t, r = self.state, self.state.r
        z, u = [r(mpq(each)) for each in z], [r(mpq(each)) for each in u]
        ahead, F = self.motion.plain(r, self.x, u)
        Q, R = self.noise_now()
        V, x = self.predicted(self.P, F, Q), ahead
        for i in range(self.iterations):
            expected, H = self.sight.plain(r, x, u)
            y = self.difference(z, expected)
            if i:
                moved = t.times(H, [[r(a - b)] for a, b in zip(ahead, x, strict=True)])
                y = [r(a - b) for a, (b,) in zip(y, moved, strict=True)]
            if self.factored:
                change, P, _ = self.observed([ZERO] * len(x), V, H, R, y)
            else:
                K, P = self.updated(V, H, R)
                change = [a for (a,) in t.times(t.store(K), [[a] for a in y])]
            x = [r(a + b) for a, b in zip(ahead, change, strict=True)]
        self.x, self.P = x, P

    def noise_now(self):
        self.steps += 1
        return [cycle[(self.steps - 1) % len(cycle)] for cycle in self.noise]

    def difference(self, a, b):
        r = self.state.r
        y = [r(c - d) for c, d in zip(a, b, strict=True)]
        if self.angle:
            turn = r(2 * r(elementary("atan2", ZERO, -ONE)))
            y[1] = r(y[1] - r(round(r(y[1] / turn)) * turn))
        return y


class Unscented(Extended):
    """An unscented filter with weights alpha = 1/2, beta = 2, kappa = 1."""

    def step(self, z, u):
        t, r, n = self.state, self.state.r, len(self.x)
        z, u = [r(mpq(each)) for each in z], [r(mpq(each)) for each in u]
        exactly = mpq(1, 4) * (n + 1)
        scale, center, other = r(exactly), r(1 - n / exactly + mpq(11, 4)), r(1 / (2 * exactly))
        L = transposed(t.cholesky([[r(scale * a) for a in row] for row in self.P]))
        X = [self.x, *([r(a + s * b) for a, b in zip(self.x, c, strict=True)] for s in (1, -1) for c in L)]
        Y = [self.motion.plain(r, each, u)[0] for each in X]
        Z = [self.sight.value(r, each) for each in Y]
        ahead, D = self.mean(other, Y, lambda a, b: [r(c - d) for c, d in zip(a, b, strict=True)])
        expected, E = self.mean(other, Z, self.difference)
        weighted, across = (
            [[r(a * w) for a, w in zip(column, [center, *[other] * (2 * n)], strict=True)] for column in transposed(C)]
            for C in (D, E)
        )
        Q, R = self.noise_now()
        V, S = t.plus(t.times(weighted, D), Q), t.plus(t.times(across, E), R)
        K = t.times(t.times(weighted, E), t.inverse(S))
        self.P = t.plus(V, t.times(K, S, transposed(K)), -1)
        change = t.times(K, [[a] for a in self.difference(z, expected)])
        self.x = [r(a + b) for a, (b,) in zip(ahead, change, strict=True)]

    def mean(self, weight, points, difference):
        r, parts = self.state.r, [[self.state.r(weight * a) for a in difference(p, points[0])] for p in points[1:]]
        total = parts[0]
        for part in parts[1:]:
            total = [r(a + b) for a, b in zip(total, part, strict=True)]
        mean = [r(a + b) for a, b in zip(points[0], total, strict=True)]
        return mean, [difference(each, mean) for each in points]


# -- the smoother -----------------------------------------------------------------------------------------------------


def smoothed(model, numbers, z, form):
    """Smoothed estimates as columns, and covariances or, in the form "square root", their roots."""
    return _by_roots(model, numbers, z) if form == "square root" else _by_covariances(model, numbers, z, form)


def _by_covariances(model, numbers, z, form):
    plain, forward = Filter(model, numbers, form), []
    for k, row in enumerate(z):
        Phi, Q = (cycle[k % len(cycle)] for cycle in (plain.Phi, plain.Q))
        V, ahead = plain.predicted(plain.P, Phi, Q), numbers.times(Phi, plain.x)
        plain.step(row)
        forward.append((Phi, V, ahead, plain.x, plain.P))
    x, P = plain.x, plain.P
    found = [(x, P)]
    for k in range(len(z) - 2, -1, -1):
        (Phi, V, ahead, _, _), (_, _, _, xf, Pf) = forward[k + 1], forward[k]
        G = numbers.times(Pf, transposed(Phi), numbers.inverse(V))
        x = numbers.plus(xf, numbers.times(G, numbers.plus(x, ahead, -1)))
        P = numbers.plus(Pf, numbers.times(G, numbers.plus(P, V, -1), transposed(G)))
        found.insert(0, (x, P))
    return found


def _by_roots(model, numbers, z):
    r, n, forward, update = numbers.r, len(model[4]), [], Updates(numbers, "carlson")
    x, S = [r(mpq(value)) for value in model[4]], root_of(numbers, numbers.exact_factors(model[5]))
    for k, row in enumerate(z):
        Phi, H, Q, R = (cycle[k % len(cycle)] for cycle in model[:4])
        Phi, SQ, UR = numbers.store(Phi), root_of(numbers, numbers.exact_factors(Q)), numbers.exact_factors(R)
        moved = numbers.times(Phi, S)
        T = triangle(numbers, [S[i] + [ZERO] * n for i in range(n)] + [moved[i] + SQ[i] for i in range(n)])
        A, B, C = (
            [line[c:d] for line in T[a:b]] for a, b, c, d in ((0, n, 0, n), (0, n, n, 2 * n), (n, 2 * n, n, 2 * n))
        )
        x = ahead = [numbers.dot(line, x) for line in Phi]
        S = C
        x, S, _ = update.observed(x, S, H, UR, [r(mpq(value)) for value in row])
        forward.append((A, B, C, ahead, x))
    found = [([[value] for value in x], S)]
    for k in range(len(z) - 2, -1, -1):
        A, B, C, ahead, _ = forward[k + 1]
        joined = [[r(x[i] - ahead[i]), *S[i]] for i in range(n)]
        for i in range(n - 1, -1, -1):
            for other in range(i + 1, n):
                joined[i] = [r(a - r(C[i][other] * b)) for a, b in zip(joined[i], joined[other], strict=True)]
            joined[i] = [r(a / C[i][i]) for a in joined[i]]
        x = [r(a + numbers.dot(row, [each[0] for each in joined])) for a, row in zip(forward[k][4], B, strict=True)]
        moved = numbers.times(B, [each[1:] for each in joined])
        S = triangle(numbers, [moved[i] + A[i] for i in range(n)])
        found.insert(0, ([[value] for value in x], S))
    return found
