"""A Kalman filter in rounded arithmetic and the exact filter, written from their definitions in integers alone.

Nothing is taken from the package, and nothing beyond the standard library. A number is a pair (m, e) for m * base**e,
and zero is (0, 0). Matrices are lists of rows. Members of a cycle are in a list, also if there is only one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

Number = tuple[int, int]
Matrix = list[list[Number]]
Exact = list[list[Fraction]]

ZERO = (0, 0)


class Refused(Exception):
    """The filter cannot be stored, or its factors do not become definite."""


class Arithmetic:
    """Numbers of some digits, with one of the deterministic roundings."""

    def __init__(
        self,
        base: int,
        digits: int,
        rounding: str = "nearest",
        emin: int | None = None,
        emax: int | None = None,
        subnormal: bool = True,
    ) -> None:
        self.base, self.digits, self.rounding = base, digits, rounding
        self.emin, self.emax, self.subnormal = emin, emax, subnormal
        self.limit = base**digits
        self.one = (1, 0)

    @classmethod
    def of(cls, fmt: Any) -> Arithmetic:
        """The same digits, rounding and range as a format of the package."""
        return cls(fmt.base, fmt.precision, fmt.rounding.value, fmt.emin, fmt.emax, fmt.subnormal)

    # -- rounding -------------------------------------------------------------------------------------------

    def fit(self, p: int, q: int = 1, e: int = 0) -> Number:
        """Round the result p / q * base**e of an operation, with q > 0."""
        if p == 0:
            return ZERO
        size, b, t = abs(p), self.base, self.digits
        # Move the point until the quotient has t digits before it.
        guess = int((size.bit_length() - q.bit_length()) / (b.bit_length() - 1 or 1)) - t - 2
        if b & (b - 1):
            guess = int((size.bit_length() - q.bit_length()) * 0.999 / _LOG2[b]) - t - 2
        n, d = (size * b**-guess, q) if guess < 0 else (size, q * b**guess)
        e += guess
        while n >= d * self.limit:
            d *= b
            e += 1
        while n * b < d * self.limit:
            n *= b
            e -= 1
        if self.emin is not None and self.subnormal:
            least = self.emin - t + 1
            while e < least and n:
                step = least - e
                d *= b**step
                e += step
        m, rest = divmod(n, d)
        m += self._carries(m, rest, d, p < 0)
        if m == 0:
            return ZERO
        if m == self.limit:
            m, e = m // b, e + 1
        if self.emin is not None:
            if not self.subnormal and e < self.emin - t + 1:
                return ZERO
            if e > self.emax - t + 1:
                raise OverflowError
        return (m if p > 0 else -m, e)

    def _carries(self, m: int, rest: int, unit: int, negative: bool) -> bool:
        if rest == 0 or self.rounding == "chop":
            return False
        if self.rounding == "up":
            return not negative
        if self.rounding == "down":
            return negative
        if self.rounding == "odd":
            return m % 2 == 0
        if 2 * rest == unit:
            return {"nearest": True, "even": m % 2 == 1, "half up": not negative}[self.rounding]
        return 2 * rest > unit

    # -- operations -----------------------------------------------------------------------------------------

    def store(self, x: Fraction) -> Number:
        return self.fit(x.numerator, x.denominator)

    def value(self, x: Number) -> Fraction:
        return Fraction(x[0] * self.base ** x[1]) if x[1] >= 0 else Fraction(x[0], self.base ** -x[1])

    def add(self, x: Number, y: Number) -> Number:
        if x[0] == 0:
            return y
        if y[0] == 0:
            return x
        e = min(x[1], y[1])
        return self.fit(x[0] * self.base ** (x[1] - e) + y[0] * self.base ** (y[1] - e), 1, e)

    def subtract(self, x: Number, y: Number) -> Number:
        return self.add(x, (-y[0], y[1]))

    def multiply(self, x: Number, y: Number) -> Number:
        return self.fit(x[0] * y[0], 1, x[1] + y[1])

    def divide(self, x: Number, y: Number) -> Number:
        if y[0] == 0:
            raise ZeroDivisionError
        p = x[0] if y[0] > 0 else -x[0]
        return self.fit(p, abs(y[0]), x[1] - y[1])

    # -- matrices -------------------------------------------------------------------------------------------

    def stored(self, matrix: Sequence[Sequence[Fraction]]) -> Matrix:
        return [[self.store(x) for x in row] for row in matrix]

    def values(self, matrix: Matrix) -> Exact:
        return [[self.value(x) for x in row] for row in matrix]

    def product(self, a: Matrix, b: Matrix) -> Matrix:
        """Each entry is summed from left to right."""
        return [[self.dot(row, column) for column in zip(*b, strict=True)] for row in a]

    def dot(self, row: Sequence[Number], column: Sequence[Number]) -> Number:
        total = ZERO
        for x, y in zip(row, column, strict=True):
            if x[0] and y[0]:
                total = self.add(total, self.multiply(x, y))
        return total

    def sum(self, a: Matrix, b: Matrix) -> Matrix:
        return [[self.add(x, y) for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]

    def difference(self, a: Matrix, b: Matrix) -> Matrix:
        return [[self.subtract(x, y) for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]

    def unit(self, n: int) -> Matrix:
        return [[self.one if i == j else ZERO for j in range(n)] for i in range(n)]

    def inverse(self, given: Matrix) -> Matrix:
        """Gaussian elimination without exchanges, then back substitution for the columns of the unit matrix."""
        a, m = [list(row) for row in given], len(given)
        c = self.unit(m)
        for k in range(m):
            if a[k][k][0] == 0:
                raise ZeroDivisionError
            for i in range(k + 1, m):
                factor = self.divide(a[i][k], a[k][k])
                for j in range(k + 1, m):
                    a[i][j] = self.subtract(a[i][j], self.multiply(factor, a[k][j]))
                for j in range(m):
                    c[i][j] = self.subtract(c[i][j], self.multiply(factor, c[k][j]))
        for j in range(m):
            for k in reversed(range(m)):
                s = c[k][j]
                for i in range(k + 1, m):
                    s = self.subtract(s, self.multiply(a[k][i], c[i][j]))
                c[k][j] = self.divide(s, a[k][k])
        return c

    def has_positive_pivots(self, given: Matrix) -> bool:
        """Whether elimination without exchanges meets only positive pivots."""
        a = [list(row) for row in given]
        for k in range(len(a)):
            if a[k][k][0] <= 0:
                return False
            for i in range(k + 1, len(a)):
                factor = self.divide(a[i][k], a[k][k])
                for j in range(k + 1, len(a)):
                    a[i][j] = self.subtract(a[i][j], self.multiply(factor, a[k][j]))
        return True

    def factors(self, given: Matrix) -> Matrix | None:
        """U and, on its diagonal, D, of U D U'; None if the matrix is not semidefinite in this arithmetic."""
        a, n = [list(row) for row in given], len(given)
        u, sound = [[ZERO] * n for _ in range(n)], True
        for j in reversed(range(n)):
            d = a[j][j]
            u[j][j] = d
            sound = sound and d[0] >= 0
            for i in range(j):
                if d[0] == 0:
                    sound = sound and a[i][j][0] == 0
                else:
                    u[i][j] = self.divide(a[i][j], d)
            if d[0] != 0:
                for i in range(j):
                    for k in range(i + 1):
                        a[k][i] = self.subtract(a[k][i], self.multiply(u[k][j], a[i][j]))
        return u if sound else None

    @property
    def roundoff(self) -> Fraction:
        step = Fraction(1, self.base ** (self.digits - 1))
        return step / 2 if self.rounding in ("nearest", "even") else step


_LOG2 = {3: 1.5849625007211563, 10: 3.321928094887362}


class Model(NamedTuple):
    """Phi, H, Q and R as lists of members of a cycle, x0 and P0; exact."""

    Phi: list[Exact]
    H: list[Exact]
    Q: list[Exact]
    R: list[Exact]
    x0: list[Fraction]
    P0: Exact

    @classmethod
    def of(cls, given: Any) -> Model:
        """A model of the package in plain lists."""
        cycles = ([matrix.tolist() for matrix in getattr(given, letter)] for letter in ("Phi", "H", "Q", "R"))
        return cls(*cycles, given.x0.tolist(), given.P0.tolist())


# -- storing ----------------------------------------------------------------------------------------------------------


def definite(matrix: Exact, strictly: bool) -> bool:
    """Whether elimination meets no negative pivot, and no zero pivot beside a number that is not zero."""
    a, n = [list(row) for row in matrix], len(matrix)
    for j in range(n):
        pivot = a[j][j]
        if pivot < 0 or (pivot == 0 and (strictly or any(a[i][j] for i in range(j + 1, n)))):
            return False
        for i in range(j + 1, n):
            if pivot:
                share = a[i][j] / pivot
                for k in range(j + 1, n):
                    a[i][k] -= share * a[j][k]
    return True


def raised(matrix: Exact, share: Fraction) -> Exact:
    return [[x * (1 + share) if i == j else x for j, x in enumerate(row)] for i, row in enumerate(matrix)]


def shares(fmt: Arithmetic) -> Iterator[Fraction]:
    """The shares of the variances to try, each twice the last; a first one is rounded as a float64."""
    share = Fraction(float(fmt.roundoff))
    while share <= Fraction(1, 2):
        yield share
        share *= 2


def storable(fmt: Arithmetic, matrix: Exact, strictly: bool) -> Exact:
    """The covariance that is stored in place of one that would become indefinite; else the covariance itself."""

    def stored(candidate: Exact) -> Exact:
        return fmt.values(fmt.stored(candidate))

    try:
        if definite(stored(matrix), strictly):
            return matrix
        for share in shares(fmt):
            candidate = stored(raised(matrix, share))
            if definite(candidate, strictly):
                return candidate
    except OverflowError:
        pass
    return matrix


class Filter:
    """A filter as a user runs it: the model as given, stored, and every operation rounded.

    Parameters
    ----------
    form : "hung", "hung second gain", "innovation", "joseph" or "ud".

    Raises
    ------
    Refused : factors of a covariance do not become definite.
    """

    def __init__(self, given: Model, fmt: Arithmetic, form: str) -> None:
        self.fmt, self.form = fmt, form
        Q = [storable(fmt, each, False) for each in given.Q]
        R = [storable(fmt, each, True) for each in given.R]
        P0 = storable(fmt, given.P0, False)
        self.Phi, self.H, self.Q, self.R = (
            [fmt.stored(each) for each in cycle] for cycle in (given.Phi, given.H, Q, R)
        )
        self.x: Matrix = [[fmt.store(each)] for each in given.x0]
        self.P = fmt.stored(P0)
        self.K: Matrix = []
        self.steps = 0
        if form == "hung second gain":
            try:
                self.RI = [fmt.inverse(each) for each in self.R]
            except ZeroDivisionError:
                raise Refused from None
            for each in self.R:
                if not fmt.has_positive_pivots(each):
                    raise Refused
        if form == "ud":
            self.UQ, self.UR = self._factored(Q, self.Q), self._factored(R, self.R)
            (self.U,) = self._factored([P0], [self.P])

    @classmethod
    def of(cls, given: Any, fmt: Arithmetic, form: Any) -> Filter:
        """The filter of a model and in a form of the package."""
        return cls(Model.of(given), fmt, form.name.lower().replace("_", " "))

    def _factored(self, cycle: list[Exact], stored: list[Matrix]) -> list[Matrix]:
        """Factors of all members; if some are indefinite, all variances as given are raised until none are."""
        found = [each for given in stored if (each := self.fmt.factors(given)) is not None]
        for share in shares(self.fmt):
            if len(found) == len(cycle):
                return found
            higher = [self.fmt.stored(raised(each, share)) for each in cycle]
            found = [each for given in higher if (each := self.fmt.factors(given)) is not None]
        if len(found) == len(cycle):
            return found
        raise Refused

    def model(self) -> Model:
        """The stored model of the exact filter, before the first step; variances raised for factors are not in it."""
        cycles = ([self.fmt.values(each) for each in cycle] for cycle in (self.Phi, self.H, self.Q, self.R))
        return Model(*cycles, [self.fmt.value(row[0]) for row in self.x], self.fmt.values(self.P))

    # -- steps ----------------------------------------------------------------------------------------------

    def step(self, z: Sequence[Fraction]) -> list[Fraction]:
        """Take a step with measurements, which are stored first, and return the estimate."""
        fmt, k = self.fmt, self.steps
        column = [[fmt.store(each)] for each in z]
        (self._step_ud if self.form == "ud" else self._step)(k, column)
        self.steps += 1
        return [fmt.value(row[0]) for row in self.x]

    def _step(self, k: int, z: Matrix) -> None:
        fmt = self.fmt
        Phi, H = self.Phi[k % len(self.Phi)], self.H[k % len(self.H)]
        Q, R = self.Q[k % len(self.Q)], self.R[k % len(self.R)]
        HT = transposed(H)
        V = fmt.sum(fmt.product(fmt.product(Phi, self.P), transposed(Phi)), Q)
        PHt = fmt.product(V, HT)
        S = fmt.sum(fmt.product(H, PHt), R)
        K = fmt.product(PHt, fmt.inverse(S))
        W = fmt.difference(fmt.unit(len(Phi)), fmt.product(K, H))
        if self.form == "joseph":
            first = fmt.product(fmt.product(W, V), transposed(W))
            self.P = fmt.sum(first, fmt.product(fmt.product(K, R), transposed(K)))
        else:
            self.P = fmt.product(W, V)
        if self.form == "hung second gain":
            K = fmt.product(fmt.product(self.P, HT), self.RI[k % len(self.RI)])
            W = fmt.difference(fmt.unit(len(Phi)), fmt.product(K, H))
        if self.form.startswith("hung"):
            self.x = fmt.sum(fmt.product(fmt.product(W, Phi), self.x), fmt.product(K, z))
        else:
            predicted = fmt.product(Phi, self.x)
            innovation = fmt.difference(z, fmt.product(H, predicted))
            self.x = fmt.sum(predicted, fmt.product(K, innovation))
        self.K = K

    def _step_ud(self, k: int, z: Matrix) -> None:
        fmt = self.fmt
        Phi, H = self.Phi[k % len(self.Phi)], self.H[k % len(self.H)]
        UQ, UR = self.UQ[k % len(self.UQ)], self.UR[k % len(self.UR)]
        self._predict(Phi, UQ)
        self.x = fmt.product(Phi, self.x)
        rows, values = self._decorrelated(UR, H), self._decorrelated(UR, z)
        columns = [self._observe(rows[i], values[i][0], UR[i][i]) for i in range(len(rows))]
        self.K = transposed(columns)

    def _decorrelated(self, UR: Matrix, a: Matrix) -> Matrix:
        """Solve U c = a by back substitution, with the unit triangle U."""
        fmt, m = self.fmt, len(a)
        c = [[ZERO] * len(a[0]) for _ in a]
        for j in range(len(a[0])):
            for i in reversed(range(m)):
                s = a[i][j]
                for k in range(i + 1, m):
                    s = fmt.subtract(s, fmt.multiply(UR[i][k], c[k][j]))
                c[i][j] = s
        return c

    def _predict(self, Phi: Matrix, UQ: Matrix) -> None:
        """Thornton 1976: Gram-Schmidt on the rows of (Phi U, UQ), weighted by D and DQ, from the last row up."""
        fmt, n = self.fmt, len(Phi)
        left, right = fmt.product(Phi, with_units(self.U)), with_units(UQ)
        W = [[*left[i], *right[i]] for i in range(n)]
        D = [*(self.U[i][i] for i in range(n)), *(UQ[i][i] for i in range(n))]
        U = [[ZERO] * n for _ in range(n)]
        for j in reversed(range(n)):
            C = [fmt.multiply(d, w) for d, w in zip(D, W[j], strict=True)]
            d = fmt.dot(W[j], C)
            U[j][j] = d
            for i in range(j):
                s = fmt.divide(fmt.dot(W[i], C), d) if d[0] else ZERO
                U[i][j] = s
                W[i] = [fmt.subtract(a, fmt.multiply(s, b)) for a, b in zip(W[i], W[j], strict=True)]
        self.U = U

    def _observe(self, h: list[Number], z: Number, r: Number) -> list[Number]:
        """Bierman 1977: the update by one measurement; returns its gain."""
        fmt, n, U = self.fmt, len(h), self.U
        y = z
        for j in range(n):
            y = fmt.subtract(y, fmt.multiply(h[j], self.x[j][0]))
        f = [fmt.add(fmt.dot([U[k][j] for k in range(j)], h[:j]), h[j]) for j in range(n)]
        g = [fmt.multiply(U[j][j], f[j]) for j in range(n)]
        a, gain = r, [ZERO] * n
        for j in range(n):
            if g[j][0]:
                before = a
                a = fmt.add(before, fmt.multiply(f[j], g[j]))
                if a[0] == 0:
                    raise ZeroDivisionError
                U[j][j] = fmt.divide(fmt.multiply(U[j][j], before), a)
                minus, size = fmt.divide(f[j], before)
                factor = (-minus, size)
                for k in range(j):
                    u = U[k][j]
                    U[k][j] = fmt.add(u, fmt.multiply(factor, gain[k]))
                    gain[k] = fmt.add(gain[k], fmt.multiply(g[j], u))
            gain[j] = g[j]
        for j in range(n):
            gain[j] = fmt.divide(gain[j], a)
            self.x[j] = [fmt.add(self.x[j][0], fmt.multiply(gain[j], y))]
        return gain


def transposed(a: Sequence[Sequence[Number]]) -> Matrix:
    return [list(column) for column in zip(*a, strict=True)]


def with_units(a: Matrix) -> Matrix:
    """The unit triangle above the diagonal of a matrix."""
    n = len(a)
    return [[a[i][j] if i < j else (1, 0) if i == j else ZERO for j in range(n)] for i in range(n)]


# -- the exact filter -------------------------------------------------------------------------------------------------


def times(a: Exact, b: Exact) -> Exact:
    return [
        [sum((x * y for x, y in zip(row, column, strict=True)), Fraction(0)) for column in zip(*b, strict=True)]
        for row in a
    ]


def turned(a: Exact) -> Exact:
    return [list(column) for column in zip(*a, strict=True)]


def plus(a: Exact, b: Exact, sign: int = 1) -> Exact:
    return [[x + sign * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]


def exact_inverse(a: Exact) -> Exact:
    """The inverse of a matrix of one or two rows."""
    if len(a) == 1:
        return [[1 / a[0][0]]]
    (p, q), (r, s) = a
    determinant = p * s - q * r
    return [[s / determinant, -q / determinant], [-r / determinant, p / determinant]]


class ExactFilter:
    """The filter without rounding; its estimate and innovation after each step are Fractions."""

    def __init__(self, given: Model) -> None:
        self.given, self.P, self.steps = given, given.P0, 0
        self.x: Exact = [[each] for each in given.x0]
        self.innovation: list[Fraction] = []

    def step(self, z: Sequence[Fraction]) -> list[Fraction]:
        k, given = self.steps, self.given
        Phi, H, Q, R = (cycle[k % len(cycle)] for cycle in given[:4])
        V = plus(times(times(Phi, self.P), turned(Phi)), Q)
        PHt = times(V, turned(H))
        K = times(PHt, exact_inverse(plus(times(H, PHt), R)))
        self.P = plus(V, times(K, turned(PHt)), -1)
        predicted = times(Phi, self.x)
        innovation = plus([[each] for each in z], times(H, predicted), -1)
        self.x = plus(predicted, times(K, innovation))
        self.innovation = [row[0] for row in innovation]
        self.steps += 1
        return [row[0] for row in self.x]
