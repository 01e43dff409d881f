"""Filter runs: every digit against filters on Fractions, written anew here."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import oracles
import pytest
from small_filter import FORMATS, FORMATS_OF_ALL_FORMS, STEPS, measurements, model, run

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.gravity_probe_b.model import gravity_probe_b
from gpbnb.report.kalman import smallest

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


class Slow:
    """Filters on lists of Fractions, each operation rounded by the oracle; exact if there is no format."""

    def __init__(self, given, fmt):
        self.given = given
        arithmetic = oracles.Arithmetic(fmt.base, fmt.precision, fmt.rounding is NEAREST) if fmt else None
        self.fl = arithmetic.fl if arithmetic else lambda x: x
        self.arithmetic = arithmetic
        self.x = [[self.fl(v)] for v in given.x0]
        self.P = self.held(given.P0)

    def held(self, matrix):
        return [[self.fl(v) for v in row] for row in matrix]

    def times(self, *matrices):
        result = matrices[0]
        for other in matrices[1:]:
            columns = list(zip(*other, strict=True))
            rows = []
            for row in result:
                products = [[self.fl(p * q) for p, q in zip(row, column, strict=True)] for column in columns]
                rows.append([self.total(each) for each in products])
            result = rows
        return result

    def total(self, terms):
        s = terms[0]
        for term in terms[1:]:
            s = self.fl(s + term)
        return s

    def plus(self, a, b, sign=1):
        return [[self.fl(p + sign * q) for p, q in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]

    def inverse(self, S):
        if self.arithmetic:
            return self.arithmetic.inv(S, pivot=False)
        (a, b), (c, d) = S
        return [[d / (a * d - b * c), -b / (a * d - b * c)], [-c / (a * d - b * c), a / (a * d - b * c)]]

    def step(self, k, z, form):
        Phi, H, Q, R = (
            self.held(each[k % len(each)]) for each in (self.given.Phi, self.given.H, self.given.Q, self.given.R)
        )
        Pt, Ht = transposed(Phi), transposed(H)
        z = [[self.fl(v)] for v in z]
        identity = [[Fraction(int(i == j)) for j in range(len(Phi))] for i in range(len(Phi))]
        predicted = self.plus(self.times(Phi, self.P, Pt), Q)
        PH = self.times(predicted, Ht)
        self.K = self.times(PH, self.inverse(self.plus(self.times(H, PH), R)))
        W = self.plus(identity, self.times(self.K, H), -1)
        if form is Form.JOSEPH:
            noise = self.times(self.K, R, transposed(self.K))
            self.P = self.plus(self.times(W, predicted, transposed(W)), noise)
        else:
            self.P = self.times(W, predicted)
        if form is Form.HUNG_SECOND_GAIN:
            self.K = self.times(self.P, Ht, self.inverse(R))
            W = self.plus(identity, self.times(self.K, H), -1)
        if form in (Form.HUNG, Form.HUNG_SECOND_GAIN):
            self.x = self.plus(self.times(W, Phi, self.x), self.times(self.K, z))
        else:
            ahead = self.times(Phi, self.x)
            self.x = self.plus(ahead, self.times(self.K, self.plus(z, self.times(H, ahead), -1)))


def transposed(matrix):
    return [list(column) for column in zip(*matrix, strict=True)]


# The second gain takes long to compile. Its loops are the same for all formats, so five formats are enough.
@pytest.mark.parametrize(
    ("fmt", "form"),
    [
        (fmt, form)
        for fmt in FORMATS
        for form in (Form.HUNG, Form.HUNG_SECOND_GAIN, Form.INNOVATION, Form.JOSEPH)
        if form is not Form.HUNG_SECOND_GAIN or fmt in FORMATS_OF_ALL_FORMS
    ],
)
def test_every_digit_is_that_of_a_filter_on_fractions(fmt, form):
    given, z = model(), measurements()
    checkpoints = run(fmt, form).checkpoints()
    slow = Slow(given, fmt)
    assert checkpoints.steps == tuple(range(1, STEPS + 1))
    for k in range(STEPS):
        slow.step(k, [Fraction(float(v)) for v in z[k]], form)
        assert [[v] for v in checkpoints.x[k]] == slow.x
        assert checkpoints.K[k].tolist() == slow.K
        assert checkpoints.P[k].tolist() == slow.P


class SlowUD:
    """Thornton's and Bierman's recursions, from Bierman 1977, ch. V and VI, on Fractions; each operation rounded."""

    def __init__(self, given, fmt):
        self.given, self.fl = given, oracles.Arithmetic(fmt.base, fmt.precision, fmt.rounding is NEAREST).fl
        self.n = given.n
        self.U, self.D = self.factors(given.P0)
        self.x = [self.fl(v) for v in given.x0]

    def held(self, matrix):
        return [[self.fl(v) for v in row] for row in matrix]

    def factors(self, matrix):
        fl, a = self.fl, self.held(matrix)
        n = len(a)
        U, D = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)], [Fraction(0)] * n
        for j in reversed(range(n)):
            D[j] = a[j][j]
            for i in range(j):
                U[i][j] = fl(a[i][j] / D[j])
            for i in range(j):
                for k in range(i + 1):
                    a[k][i] = fl(a[k][i] - fl(U[k][j] * a[i][j]))
        return U, D

    def dot(self, terms):
        s = terms[0]
        for term in terms[1:]:
            s = self.fl(s + term)
        return s

    def step(self, k, z):
        fl, n, given = self.fl, self.n, self.given
        Phi, H = self.held(given.Phi[k % len(given.Phi)]), self.held(given.H[k % len(given.H)])
        UQ, DQ = self.factors(given.Q[k % len(given.Q)])
        UR, DR = self.factors(given.R[k % len(given.R)])
        # Thornton: orthogonalise the rows of (Phi U, UQ), weighed by (D, DQ), the last one first.
        W = [[self.dot([fl(Phi[i][p] * self.U[p][j]) for p in range(n)]) for j in range(n)] + UQ[i] for i in range(n)]
        weights = self.D + DQ
        for j in reversed(range(n)):
            c = [fl(d * w) for d, w in zip(weights, W[j], strict=True)]
            self.D[j] = self.dot([fl(w * v) for w, v in zip(W[j], c, strict=True)])
            for i in range(j):
                s = fl(self.dot([fl(w * v) for w, v in zip(W[i], c, strict=True)]) / self.D[j])
                self.U[i][j] = s
                W[i] = [fl(a - fl(s * b)) for a, b in zip(W[i], W[j], strict=True)]
        self.x = [self.dot([fl(Phi[i][j] * self.x[j]) for j in range(n)]) for i in range(n)]
        # Of two measurements with R = UR DR UR', the first less UR[0][1] times the second is not correlated with it.
        u = UR[0][1]
        rows = [[fl(a - fl(u * b)) for a, b in zip(*H, strict=True)], H[1]]
        seen = [fl(fl(z[0]) - fl(u * fl(z[1]))), fl(z[1])]
        self.gains = [self.observe(h, y, r) for h, y, r in zip(rows, seen, DR, strict=True)]

    def observe(self, h, z, r):
        fl, n = self.fl, self.n
        y = z
        for j in range(n):
            y = fl(y - fl(h[j] * self.x[j]))
        f = [self.dot([fl(self.U[i][j] * h[i]) for i in range(j)] + [h[j]]) for j in range(n)]
        g = [fl(d * v) for d, v in zip(self.D, f, strict=True)]
        a, gain = r, [Fraction(0)] * n
        for j in range(n):
            before, a = a, fl(a + fl(f[j] * g[j]))
            self.D[j] = fl(fl(self.D[j] * before) / a)
            factor = -fl(f[j] / before)
            for i in range(j):
                u = self.U[i][j]
                self.U[i][j] = fl(u + fl(factor * gain[i]))
                gain[i] = fl(gain[i] + fl(g[j] * u))
            gain[j] = g[j]
        gain = [fl(v / a) for v in gain]
        self.x = [fl(v + fl(w * y)) for v, w in zip(self.x, gain, strict=True)]
        return gain


@pytest.mark.parametrize("fmt", FORMATS_OF_ALL_FORMS)
def test_every_digit_of_the_factors_is_that_of_bierman_on_fractions(fmt):
    z = measurements()
    found, slow = run(fmt, Form.UD), SlowUD(model(), fmt)
    triangles, gains = found.exactly(found.C), found.exactly(found.G)
    for k in range(STEPS):
        slow.step(k, [Fraction(float(v)) for v in z[k]])
        assert found.exactly(found.X)[k, :, 0].tolist() == slow.x
        assert triangles[k].diagonal().tolist() == slow.D
        assert np.triu(triangles[k], 1).tolist() == np.triu(np.array(slow.U, dtype=object), 1).tolist()
        assert gains[k].T.tolist() == slow.gains


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("fmt", [FloatFormat(10, 4), FloatFormat(2, 6, CHOP)])
def test_the_smallest_filters_come_out_of_the_emulation_too(fmt, second):
    """The chapter's counterexamples were found in exact arithmetic, on rounded Fractions."""
    form = Form.HUNG_SECOND_GAIN if second else Form.HUNG
    for case in (smallest.scalar(fmt), smallest.scalar(fmt, z=1), smallest.correlated()):
        if case.P.shape == (2, 2) and fmt.base == 2:
            continue  # its numbers are decimal
        given = LinearModel(case.Phi, case.H, case.Q, case.R, case.x, case.P)
        checkpoints = run(fmt, form, given, np.array([case.z] * 3, dtype=object)).checkpoints()
        for k in range(3):
            x, K, P = smallest.rounded_step(fmt, case, second)
            case = case._replace(x=x, P=P)
            assert (checkpoints.x[k] == x).all()
            assert (checkpoints.K[k] == K).all()
            assert (checkpoints.P[k] == P).all()


def test_a_year_of_gravity_probe_b_begins_like_the_exact_filter():
    """Three steps of ten states, in every digit: the model of the book, not a small one."""
    fmt = FloatFormat(2, 24)
    given = gravity_probe_b().rounded(FloatFormat(2, 14))
    z = np.array([[12.0, -7.0], [30.0, 4.0], [-5.0, 9.0]])
    slow, checkpoints = Slow(given, fmt), run(fmt, Form.HUNG, given, z).checkpoints()
    for k in range(3):
        slow.step(k, [Fraction(float(v)) for v in z[k]], Form.HUNG)
        assert [[v] for v in checkpoints.x[k]] == slow.x
        assert checkpoints.P[k].tolist() == slow.P


def test_the_parts_of_a_double_double_are_added_exactly():
    given = LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1]])
    parts = np.array([[1.5, 2.0**-70], [2.0**-60, -(2.0**-130)], [3.0, 0.0]])
    found = Run(given, None, Form.INNOVATION, ()).exactly(parts)
    assert found.tolist() == [Fraction(3, 2) + Fraction(1, 2**70), Fraction(2**70 - 1, 2**130), 3]
