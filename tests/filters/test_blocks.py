"""gpbnb.filters.blocks: filters whose blocks have formats of their own, against plain loops over fractions.

Each loop is written from the equations of its form, with the rounding of each block as a function. Nothing is taken
from the package but the answers.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from plain_nonlinear import eye, inverse, transposed

from gpbnb import BINARY32, BINARY64, FixedFormat, FloatFormat, Form, LinearModel, emulate
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.run import Run, Sums
from tests.plain_structures import floating

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
        if form is Form.UD:
            P, self.UQ = factors(model, P), factors(model, self.Q)
        self.P = blocks["covariance"].take(P)

    def step(self, z):
        """Take a step with the measurements that are not missing; the gain of the others is zero."""
        seen = [i for i, each in enumerate(z) if np.isfinite(each)]
        H, R = [self.H[i] for i in seen], [[self.R[i][j] for j in seen] for i in seen]
        z = [[self.blocks["state"].store(Fraction(float(z[i])))] for i in seen]
        K = (self.step_ud if self.form is Form.UD else self.step_with_covariance)(H, R, z)
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
        if self.form is Form.JOSEPH:
            outer = p.product(p.product(p.take(K), p.take(R)), transposed(p.take(K)))
            self.P = p.plus(p.product(p.product(W, V), transposed(W)), outer)
        else:
            self.P = p.product(W, V)
        if self.form is Form.HUNG_SECOND_GAIN:
            K = g.product(g.product(g.take(self.P), transposed(g.take(H))), g.take(inverse(self.model, R)))
            W = remaining(K)
        if self.form in (Form.HUNG, Form.HUNG_SECOND_GAIN):
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


GIVEN = {
    "Phi": [["1", "0.1", "0"], ["0", "0.9", "0.3"], ["0", "0", "0.7"]],
    "H": [["1", "0", "0.2"], ["0.5", "1", "0"]],
    "Q": [["0.01", "0.002", "0"], ["0.002", "0.03", "0"], ["0", "0", "0.02"]],
    "R": [["0.3", "0.1"], ["0.1", "0.4"]],
    "x0": ["0.3", "1", "-0.2"],
    "P0": [["1", "0.1", "0"], ["0.1", "2", "0"], ["0", "0", "0.5"]],
}
MODEL = LinearModel(*GIVEN.values())
FRACTIONS = {
    key: [Fraction(a) for a in rows] if key == "x0" else [[Fraction(a) for a in row] for row in rows]
    for key, rows in GIVEN.items()
}
Z = np.random.default_rng(8).normal(size=(12, 2))
Z[3] = Z[5, 0] = Z[8:10] = np.nan
"""Measurements, of which some are missing: rows of K H are then zero, and rows of I - K H the identity's."""


@pytest.mark.parametrize("form", list(Form), ids=str)
@pytest.mark.parametrize(
    ("base", "digits", "sums", "rounding"),
    [
        (2, {"state": 11, "gain": 7, "covariance": 24, "innovation": 9}, None, "nearest"),
        (2, {"state": 24, "gain": 30, "covariance": 9, "innovation": 53}, None, "nearest"),
        (2, {"state": 8, "gain": 12, "covariance": 16, "innovation": 10}, 20, "even"),
        (10, {"state": 4, "gain": 3, "covariance": 9, "innovation": 5}, None, "chop"),
        (10, {"state": 8, "gain": 7, "covariance": 4, "innovation": 6}, None, "nearest"),
        (10, {"state": 12, "gain": 7, "covariance": 10, "innovation": 11}, None, "even"),
        (16, {"state": 6, "gain": 5, "covariance": 3, "innovation": 13}, None, "chop"),
    ],
)
def test_each_block_computes_in_its_own_format_as_plain_loops_do(form, base, digits, sums, rounding):
    formats = {name: FloatFormat(base, each, rounding) for name, each in digits.items()}
    blocks = BlockFormats(**formats, sums=None if sums is None else FloatFormat(base, sums, rounding))
    rounds = {name: floating(base, each, rounding) for name, each in digits.items()}
    within = None if sums is None else floating(base, sums, rounding)
    slow = Filter(
        FRACTIONS,
        form,
        floating(base, max(digits.values()), rounding),
        {name: Rounds(r, r if within is None else within) for name, r in rounds.items()},
    )
    x, K, P = taken(blocks, form)
    for k, z in enumerate(Z):
        slow.step(z)
        assert (x[k].tolist(), P[k].tolist(), K[k].tolist()) == (slow.x, slow.P, slow.K)


def taken(blocks, form):
    """Estimates, gains and covariances, or factors, after each step of a run of the package."""
    model, z = MODEL.without_missing(Z)
    run = Run(model, blocks, form, range(1, len(Z) + 1))
    run.take(z)
    return run.exactly(run.X), run.exactly(run.G), run.exactly(run.C)


def test_a_covariance_in_binary64_beside_binary32_is_that_of_plain_loops():
    single, double = floating(2, 24, "even", -126), floating(2, 53, "even", -1022)
    rounds = dict.fromkeys(BLOCKS, Rounds(single, single)) | {"covariance": Rounds(double, double)}
    slow = Filter(FRACTIONS, Form.UD, double, rounds)
    blocks = BlockFormats.uniform(BINARY32).with_block("covariance", BINARY64)
    assert blocks.model == FloatFormat(2, 53, "even")
    x, _, U = taken(blocks, Form.UD)
    for k, z in enumerate(Z):
        slow.step(z)
        assert (x[k].tolist(), U[k].tolist()) == (slow.x, slow.P)


@pytest.mark.parametrize("form", list(Form), ids=str)
@pytest.mark.parametrize("fmt", [FloatFormat(2, 12), FloatFormat(2, 24, "even", -126, 127), FloatFormat(10, 6, "chop")])
def test_equal_blocks_are_one_format(form, fmt):
    for one, blocks in zip(taken(fmt, form), taken(BlockFormats.uniform(fmt), form), strict=True):
        assert one.tolist() == blocks.tolist()


def test_an_overflow_names_the_quantity_of_the_block_whose_range_it_leaves():
    narrow = FloatFormat(2, 11, "even", -14, 3)
    wide, sums = FloatFormat(2, 11, "even"), FloatFormat(2, 20, "even")
    for name, quantity in (
        ("covariance", "covariance"),
        ("innovation", "innovation covariance"),
        ("state", "estimate"),
    ):
        grown = LinearModel([["4"]], [["1"]], [["900"]], [["900"]], ["0"], [["1"]])
        run = Run(grown, BlockFormats.uniform(wide, sums).with_block(name, narrow), Form.INNOVATION, [])
        run.take(np.full((3, 1), 9.0) if name == "state" else np.zeros((3, 1)))
        assert run.stopped is not None
        assert quantity in run.reason


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"gain": FixedFormat(2, 8)}, TypeError, "got gain FixedFormat"),
        ({"gain": FloatFormat(10, 5)}, ValueError, "got base 10 for gain and 2 for state; needed one base"),
        ({"gain": FloatFormat(2, 8, "stochastic")}, ValueError, "got stochastic rounding for gain"),
        ({"gain": FloatFormat(2, 60)}, ValueError, "60 bits"),
        ({"sums": FloatFormat(2, 20)}, ValueError, "needed at least as many digits"),
    ],
)
def test_formats_that_do_not_fit_are_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        BlockFormats(**(dict.fromkeys(BLOCKS, BINARY32) | arguments))


@pytest.mark.parametrize("options", [{"sums": Sums(fmt=BINARY32)}, {"compensated": True}, {"bounded": True}])
def test_blocks_go_with_no_other_sums_and_no_bound(options):
    with pytest.raises(ValueError, match="got formats of blocks with sums, compensated, bounded or many records"):
        Run(MODEL, BlockFormats.uniform(BINARY32), Form.INNOVATION, [], **options)


def test_errors_of_a_run_with_blocks_are_those_from_the_reference():
    blocks = BlockFormats.uniform(FloatFormat(2, 40)).with_block("state", FloatFormat(2, 12))
    model, z = MODEL.without_missing(Z)
    found = emulate(model, z, blocks, checkpoint_steps=[12])
    run = Run(model, blocks, Form.INNOVATION, [12])
    run.take(z)
    difference = run.checkpoints().x[0] - found.reference.x[0]
    assert found.state[0].tolist() == pytest.approx(difference.astype(float).tolist(), rel=1e-12)
    assert found.fmt is blocks
