"""What a filter starts with in a format: the guarantee is for the filter that a user's run computes."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from oracles import rounded

from gpbnb import FixedFormat, FloatFormat, LinearModel, Rounding
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.gains import schedule
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.array_forms import ArrayForm
from gpbnb.filters.array_run import ArrayRun
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run
from gpbnb.report.gravity_probe_b.horizon import bounds_in_blocks
from gpbnb.report.wordlengths.study import companion_run

Matrix = list[list[Fraction]]


# -- one filter in plain fractions, which shares no code with the package ---------------------------------------------


def _digits(x: Any, bits: int) -> Fraction:
    return Fraction(rounded(Fraction(x), 2, bits, True))


def _factors(a: Matrix, bits: int) -> Matrix | None:
    """U with D on its diagonal, a = U D U'; None if a pivot is negative, or zero below a covariance that is not."""
    n, a = len(a), [row[:] for row in a]
    u = [[Fraction(0)] * n for _ in range(n)]
    for j in range(n - 1, -1, -1):
        d = u[j][j] = a[j][j]
        if d < 0 or (d == 0 and any(a[i][j] for i in range(j))):
            return None
        for i in range(j if d else 0):
            u[i][j] = _digits(a[i][j] / d, bits)
        for i in range(j if d else 0):
            for k in range(i + 1):
                a[k][i] = _digits(a[k][i] - _digits(u[k][j] * a[i][j], bits), bits)
    return u


def _stored(a: Matrix, bits: int) -> Matrix:
    return [[_digits(x, bits) for x in row] for row in a]


def _raised_factors(given: Matrix, bits: int) -> tuple[Matrix, Fraction]:
    """The factors of a covariance as a format stores it, and the share by which its variances as given were raised."""
    shift = Fraction(0)
    while True:
        raised = [[x * (1 + shift) if i == j else x for j, x in enumerate(row)] for i, row in enumerate(given)]
        if (found := _factors(_stored(raised, bits), bits)) is not None:
            return found, shift
        shift = 2 * shift or Fraction(1, 2**bits)


def _unit_triangle(u: Matrix) -> Matrix:
    return [[x if i < j else Fraction(int(i == j)) for j, x in enumerate(row)] for i, row in enumerate(u)]


def _ud_estimates(model: LinearModel, z: list[Fraction], bits: int) -> list[list[Fraction]]:
    """The estimates of Thornton's and Bierman's updates with one measurement, every operation rounded to nearest."""

    def fl(x: Fraction) -> Fraction:
        return _digits(x, bits)

    n = model.n
    Phi, (h,), Q, ((r,),), P0 = (each.tolist() for each in (model.Phi[0], model.H[0], model.Q[0], model.R[0], model.P0))
    Phi, h, r = _stored(Phi, bits), [fl(x) for x in h], fl(r)
    (UQ, _), (U, _) = _raised_factors(Q, bits), _raised_factors(P0, bits)
    x, found = [fl(v) for v in model.x0], []
    for measured in z:
        T, G = _unit_triangle(U), _unit_triangle(UQ)
        W = []
        for i in range(n):
            row = []
            for j in range(n):
                s = Fraction(0)
                for k in range(n):
                    s = fl(s + fl(Phi[i][k] * T[k][j]))
                row.append(s)
            W.append(row + G[i])
        D = [U[i][i] for i in range(n)] + [UQ[i][i] for i in range(n)]
        U = [[Fraction(0)] * n for _ in range(n)]
        for j in range(n - 1, -1, -1):
            C = [fl(d * w) for d, w in zip(D, W[j], strict=True)]
            for c, w in zip(C, W[j], strict=True):
                U[j][j] = fl(U[j][j] + fl(w * c))
            for i in range(j):
                s = Fraction(0)
                for c, w in zip(C, W[i], strict=True):
                    s = fl(s + fl(w * c))
                U[i][j] = s = fl(s / U[j][j]) if U[j][j] else Fraction(0)
                W[i] = [fl(w - fl(s * v)) for w, v in zip(W[i], W[j], strict=True)]
        predicted = []
        for i in range(n):
            s = Fraction(0)
            for k in range(n):
                s = fl(s + fl(Phi[i][k] * x[k]))
            predicted.append(s)
        y = fl(measured)
        for c, v in zip(h, predicted, strict=True):
            y = fl(y - fl(c * v))
        f = []
        for j in range(n):
            s = Fraction(0)
            for k in range(j):
                s = fl(s + fl(U[k][j] * h[k]))
            f.append(fl(s + h[j]))
        g = [fl(U[j][j] * f[j]) for j in range(n)]
        a, K = r, [Fraction(0)] * n
        for j in range(n):
            before = a
            if g[j]:
                a = fl(before + fl(f[j] * g[j]))
                U[j][j] = fl(fl(U[j][j] * before) / a)
                factor = -fl(f[j] / before)
                for k in range(j):
                    u = U[k][j]
                    U[k][j] = fl(u + fl(factor * K[k]))
                    K[k] = fl(K[k] + fl(g[j] * u))
            K[j] = g[j]
        x = [fl(v + fl(fl(c / a) * y)) for v, c in zip(predicted, K, strict=True)]
        found.append(x)
    return found


def _exact_estimates(model: LinearModel, z: list[Fraction], bits: int) -> list[list[Decimal]]:
    """The estimates of the textbook's filter with the stored model, one measurement, in 60 decimal digits."""

    def stored(a: Any) -> Any:
        values = [_digits(x, bits) for x in np.ravel(a)]
        return np.array([Decimal(x.numerator) / x.denominator for x in values], dtype=object).reshape(np.shape(a))

    with localcontext() as context:
        context.prec = 60
        Phi, H, Q, R, x, P = map(stored, (model.Phi[0], model.H[0], model.Q[0], model.R[0], model.x0, model.P0))
        found = []
        for measured in map(stored, z):
            V = Phi @ P @ Phi.T + Q
            K = V @ H.T / (H @ V @ H.T + R)[0, 0]
            x = Phi @ x
            x = x + K[:, 0] * (measured - H[0] @ x)
            P = V - K @ H @ V
            found.append(list(x))
        return found


# -- the guarantee is for that filter ---------------------------------------------------------------------------------


def raised_while_factored(**changes: Any) -> LinearModel:
    """Three states whose Q has rank two, and loses its definiteness while nine bits factor it."""
    G = exact([["160/101", "54/89"], ["2/101", "-38/97"], ["-151/89", "25/89"]])
    given = {
        "Phi": exact([[0, 0, 0], [0, "1/8", 0], [0, 0, "1/8"]]),
        "H": exact([["7/4", "-2", "-5/4"]]),
        "Q": G @ G.T,
        "R": exact([["1/4"]]),
        "x0": [0, 0, 0],
        "P0": np.eye(3, dtype=int),
    }
    return LinearModel(**(given | changes))


NINE = FloatFormat(2, 9)
WITHIN = limits(state=[19.6905, 1.21509, 19.40933], innovation=59.8751)


def test_the_guarantee_of_factors_that_were_raised_is_for_the_run_of_the_model_as_given() -> None:
    """An independent emulation of a constant measurement reaches 0.011478; other factors would allow 0.0097876."""
    model, z = raised_while_factored(), [Fraction(479, 8)] * 60
    _, shift = _raised_factors(model.Q[0].tolist(), 9)
    assert shift > 0
    computed, true = _ud_estimates(model, z, 9), _exact_estimates(model, z, 9)
    run = Run(model, NINE, Form.UD, range(1, 61))
    run.take(np.full((60, 1), 479 / 8))
    assert run.checkpoints().x.tolist() == computed
    errors = np.array(
        [[abs(float(Decimal(a.numerator) / a.denominator - b)) for a, b in zip(*rows, strict=True)]
         for rows in zip(computed, true, strict=True)]
    )  # fmt: skip
    sizes = np.abs(np.array(true, dtype=float))
    assert (sizes.max(axis=0) <= WITHIN.state).all()
    found = guarantee(model, NINE, WITHIN, form=Form.UD)
    assert found.for_ever
    assert errors[:, 1].max() == pytest.approx(0.011478, abs=5e-7)
    assert (errors.max(axis=0) <= found.bound).all()
    # The exact filter of a guarantee is that of an emulation: the stored model, without what factoring adds.
    history = emulate(model, np.full((60, 1), 479 / 8), NINE, Form.UD, range(1, 61))
    assert np.abs(np.abs(history.state) - errors).max() < 1e-12


def _drawn(seed: int) -> LinearModel:
    """Singular Q, P0 or both, and R nearly so, in cycles of their own."""
    rng = np.random.default_rng([7, seed])
    n, m = int(rng.integers(2, 4)), int(rng.integers(1, 3))

    def singular(size: int, rank: int) -> Any:
        G = np.array([[Fraction(int(rng.integers(-99, 100)), 97) for _ in range(rank)] for _ in range(size)])
        return G @ G.T

    R = singular(m, m) + exact(np.eye(m) * 2.0**-9)
    return LinearModel(
        Phi=exact(np.round(rng.uniform(-0.5, 0.5, (n, n)) * 64) / 64),
        H=exact(np.round(rng.uniform(-2, 2, (int(rng.integers(1, 3)), m, n)) * 8) / 8),
        Q=np.array([singular(n, n - 1) for _ in range(int(rng.integers(1, 4)))]),
        R=R,
        x0=exact(rng.uniform(-1, 1, n)),
        P0=singular(n, n - 1),
    )


def _raised_models(fmt: FloatFormat | FixedFormat, count: int) -> list[LinearModel]:
    """Models whose variances a format raises while it factors them; other factors would follow from those stored."""
    found: list[LinearModel] = []
    for seed in range(1000):
        model = _drawn(seed)
        run, other = (Run(each, fmt, Form.UD, ()) for each in (model, model.rounded(fmt)))  # type: ignore[arg-type]
        if not np.array_equal(run.UQ, other.UQ) or not np.array_equal(run.P, other.P):
            found.append(model)
        if len(found) == count:
            return found
    raise AssertionError(f"{len(found)} models")


FORMATS = [NINE, FloatFormat(2, 7, Rounding.CHOP), FloatFormat(10, 3, Rounding.UP)]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_the_coefficients_of_a_guarantee_are_those_of_the_run(fmt: FloatFormat) -> None:
    """For models whose factors are raised in cycles, and in forms without factors."""
    for model in _raised_models(fmt, 4):
        for form in (Form.UD, Form.INNOVATION):
            run = Run(model, fmt, form, range(1, 7))
            run.take(fmt.array(np.zeros((6, model.m))))
            if run.stopped or run.indefinite:
                continue
            given = schedule(model, fmt, form, 40)
            count = model.n * model.m
            assert np.array_equal(given.packed[:6, -count:].reshape(run.G.shape), run.G)


def test_bounds_in_blocks_and_companions_are_for_the_run_of_the_model_as_given(monkeypatch: Any) -> None:
    opened = []
    start = Run.__init__

    def noted(self: Run, model: LinearModel, fmt: Any, *arguments: Any, **options: Any) -> None:
        start(self, model, fmt, *arguments, **options)
        if self.form is Form.UD:
            opened.append((self.exactly(self.UQ), self.exactly(self.P)))

    (model,) = _raised_models(NINE, 1)
    user = Run(model, NINE, Form.UD, ())
    monkeypatch.setattr(Run, "__init__", noted)
    next(bounds_in_blocks(model, NINE, [limits(state=1e3, innovation=1e3)], [np.full(model.n, 1e6)], 1, Form.UD))
    companion_run(model, np.zeros((2, model.m)), NINE, Form.UD)
    assert len(opened) == 2
    for UQ, P in opened:
        assert np.array_equal(UQ, user.exactly(user.UQ))
        assert np.array_equal(P, user.exactly(user.P))
    array = ArrayRun(model, NINE, Form.UD, ())
    assert np.array_equal(array._given["UQ"][0].to_fractions(), user.exactly(user.UQ)[0])
    assert array.repairs == user.repairs == ArrayRun(model, NINE, ArrayForm.POTTER, ()).repairs


def test_a_covariance_that_must_not_be_raised_has_neither_run_nor_guarantee() -> None:
    model = raised_while_factored(repair=False)
    with pytest.raises(ValueError, match="in which Q does not stay positive semidefinite"):
        Run(model, NINE, Form.UD, ())
    with pytest.raises(ValueError, match="in which Q does not stay positive semidefinite"):
        guarantee(model, NINE, WITHIN, form=Form.UD)
    with pytest.raises(ValueError, match="in which Q does not stay positive semidefinite"):
        next(bounds_in_blocks(model, NINE, [WITHIN], [[1, 1, 1]], 10, Form.UD))
    assert guarantee(model, NINE, WITHIN, form=Form.INNOVATION).for_ever
