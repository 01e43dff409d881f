r"""Fixed-interval smoothing after Rauch, Tung and Striebel, with every operation rounded in any format.

A filter estimates the state of step k from the measurements up to k. A smoother uses all measurements of a record: it
runs the filter forwards, then corrects its estimates from the last to the first.

With covariances, let :math:`\hat x_k, P_k` be the filter's estimate and :math:`\bar x_{k+1}, V_{k+1}` its prediction
for the next step. Backwards,

.. math:: G_k = (P_k\Phi_k^T)V_{k+1}^{-1}, \quad x_k^s = \hat x_k + G_k(x_{k+1}^s - \bar x_{k+1}), \quad
    P_k^s = P_k + (G_k(P_{k+1}^s - V_{k+1}))G_k^T.

The last difference cancels digits, and so do those of the filter. With square roots :math:`P = SS^T`, one triangle
holds everything:

.. math:: \begin{pmatrix} S_k & 0 \\ \Phi_k S_k & Q_k^{1/2} \end{pmatrix} \to
    \begin{pmatrix} A_k & B_k \\ 0 & C_{k+1} \end{pmatrix}, \quad V_{k+1} = C_{k+1}C_{k+1}^T, \quad
    G_k = B_kC_{k+1}^{-1}, \quad P_k^s = A_kA_k^T + G_kP_{k+1}^sG_k^T.

References
----------
Rauch, Tung & Striebel 1965; Bierman 1977, ch. X.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gpbnb.arithmetic.algebra import Algebra, Matrix, inverse_in_order
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import digit_unit
from gpbnb.filters.factors import upper_factors
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import LinearModel, identity_in, in_columns
from gpbnb.filters.steps import (
    StepModel,
    corrected,
    gain,
    observe_carlson,
    observed,
    predict_root,
    predicted,
    root_of_factors,
    updated,
)

SMOOTHER_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.CARLSON)
"""Forms of the filter that a smoother has; the last one computes square roots, forwards and backwards."""

Each = TypeVar("Each")


class SmoothedStep(NamedTuple):
    """The smoothed estimate (n, 1), or (n,) with roots, of one step, and its covariance or root (n, n)."""

    x: Matrix
    P: Matrix


class SmoothedRecord(NamedTuple):
    """Smoothed estimates (steps, n), and their covariances, or upper triangular roots, (steps, n, n)."""

    x: FloatArray
    P: FloatArray


class RootModel(NamedTuple):
    """The matrices of one step with roots: Phi (n, n), H (m, n), a root of Q (n, n), factors of R (m, m)."""

    Phi: Matrix
    H: Matrix
    SQ: Matrix
    UR: Matrix


class _Passed(NamedTuple):
    """One step of the filter: its transition, prediction and estimate."""

    Phi: Matrix
    ahead: Matrix
    V: Matrix
    x: Matrix
    P: Matrix


class _PassedRoot(NamedTuple):
    """One step of the filter with roots; A and B correct the step before, C is the root of the prediction."""

    A: Matrix
    B: Matrix
    C: Matrix
    ahead: Matrix
    x: Matrix


def smooth_covariances(
    algebra: Algebra, form: Form, models: Sequence[StepModel], x: Matrix, P: Matrix, z: Sequence[Matrix]
) -> list[SmoothedStep]:
    """Smooth with covariances, over numbers of any kind.

    Parameters
    ----------
    algebra : how numbers of this kind are computed.
    form : Form.INNOVATION or Form.JOSEPH.
    models, z : the matrices and the measurement (m, 1) of each step.
    x (n, 1), P (n, n) : the first estimate and its covariance, before the first step.
    """
    times, rounded, passed = algebra.times, algebra.rounded, []
    for model, measured in zip(models, z, strict=True):
        V = predicted(algebra, model.Phi, P, model.Q)
        K = gain(algebra, model.H, model.R, V).K
        P = updated(algebra, form, model, V, K)
        ahead = times(model.Phi, x)
        x = corrected(algebra, model.H, K, ahead, measured)
        passed.append(_Passed(model.Phi, ahead, V, x, P))
    found = [SmoothedStep(x, P)]
    for k in range(len(passed) - 1, 0, -1):
        now, after = passed[k - 1], passed[k]
        inverse = algebra.invert(after.V, algebra.identity(len(P))).matrix
        G = times(times(now.P, after.Phi.T), inverse)
        x = rounded(now.x + times(G, rounded(x - after.ahead)))
        P = rounded(now.P + times(times(G, rounded(P - after.V)), G.T))
        found.append(SmoothedStep(x, P))
    return found[::-1]


def smooth_roots(
    models: Sequence[RootModel], x: Matrix, S: Matrix, z: Sequence[Matrix], identity: Matrix
) -> list[SmoothedStep]:
    """Smooth with upper triangular square roots, over arrays of numbers that have ``sqrt``.

    Parameters
    ----------
    models, z : the matrices and the measurement (m,) of each step.
    x (n,), S (n, n) : the first estimate and a root of its covariance, before the first step.
    identity : (n, n).
    """
    passed: list[_PassedRoot] = []
    for model, measured in zip(models, z, strict=True):
        A, B, C = _joint_root(model, S, identity)
        ahead = model.Phi @ x
        x, S, _, _ = observed(observe_carlson, model.H, model.UR, measured, ahead, C)
        passed.append(_PassedRoot(A, B, C, ahead, x))
    found = [SmoothedStep(x, S)]
    for k in range(len(passed) - 1, 0, -1):
        A, B, C, ahead, _ = passed[k]
        solved = inverse_in_order(C, np.concatenate([(x - ahead)[:, None], S], axis=1)).matrix
        x = passed[k - 1].x + B @ solved[:, 0]
        S, _ = predict_root(B, solved[:, 1:], A)
        found.append(SmoothedStep(x, S))
    return found[::-1]


def _joint_root(model: RootModel, S: Matrix, identity: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B and C of the triangle; the root of the prediction, C, has the digits of the filter alone."""
    n, zero = len(S), identity * 0
    Phi = np.concatenate([np.concatenate([identity, zero], axis=1), np.concatenate([model.Phi, identity], axis=1)])
    joint = np.concatenate([np.concatenate([S, zero], axis=1), np.concatenate([zero, model.SQ], axis=1)])
    root, _ = predict_root(Phi, joint, joint[:, :0])
    return root[:n, :n], root[:n, n:], root[n:, n:]


@dataclass(frozen=True, eq=False)
class FixedIntervalSmoother:
    r"""A Rauch–Tung–Striebel smoother for one measurement record, which can run in any format.

    A smoother is a function of a format, so :func:`gpbnb.required_precision` can find the digits that it needs, in
    floating or fixed point. It compares each run
    with a reference run that has 37 bits more than the highest precision to try. A second reference run with half as
    many extra bits again checks the first. Only errors of the estimates count; they include the errors of storing the
    model.

    Parameters
    ----------
    model : a Kalman filter without known inputs or offsets.
    z : (steps, m), or (steps,) if m = 1: measurements, NaN or masked if missing; they are rounded when a format stores
        them.
    form : "innovation" and "Joseph" compute with covariances. "square root" computes with upper triangular square
        roots, which start from exact factors of Q, R and P0; the format then stores these factors.

    Raises
    ------
    ValueError : another form; known inputs; measurements of another shape, or none; an infinite measurement.
    TypeError : the model is not a LinearModel, or measurements are not numbers.

    References
    ----------
    :mod:`gpbnb.filters.smoothing` has the formulas.

    Examples
    --------
    A random walk with a vague first estimate, smoothed once with covariances and once with square roots:

    >>> from gpbnb import BINARY32, FixedIntervalSmoother, LinearModel, required_precision
    >>> walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[10**6]])
    >>> z = [[3], [2], [float("nan")], [4]]
    >>> FixedIntervalSmoother(walk, z).run(BINARY32).x.to_float().round(3).tolist()
    [[2.993], [2.993], [3.003], [3.013]]
    >>> for form in ("innovation", "square root"):
    ...     print(required_precision(FixedIntervalSmoother(walk, z, form), 4, 0.001).digits)
    22
    11
    """

    model: LinearModel
    z: Any
    form: Form | str = Form.INNOVATION

    def __post_init__(self) -> None:
        if not isinstance(self.model, LinearModel):
            raise TypeError(f"got a model {type(self.model).__name__}; needed a LinearModel")
        if self.model.has_inputs:
            raise ValueError(
                f"got {self.model.name} with known inputs or offsets; needed none for a smoother; subtract their "
                "effect from the measurements, and add it to the estimates"
            )
        form = form_named(self.form)
        if form not in SMOOTHER_FORMS:
            raise ValueError(f'got the {form} form; needed "innovation", "Joseph" or "square root" for a smoother')
        model, filled = self.model.without_missing(in_columns(self.z, self.model.m))
        self.model.check_measurements(filled, 0)
        if not len(filled):
            raise ValueError("got no measurements; needed one step or more")
        try:
            measured = exact(filled)
        except ValueError as error:
            raise ValueError(f"measurements: {error}; write NaN where one is missing") from None
        for name, value in (("model", model), ("z", measured), ("form", form)):
            object.__setattr__(self, name, value)

    def __call__(self, fmt: FloatFormat | FixedFormat) -> FloatArray:
        """Return the smoothed estimates of all steps, (steps, n), computed in a format."""
        return self.run(fmt).x

    @stays
    def run(self, fmt: FloatFormat | FixedFormat) -> SmoothedRecord:
        """Smooth the record in a format, and return the estimates with their covariances or square roots.

        Raises
        ------
        ZeroDivisionError : an innovation covariance or a predicted covariance is singular in this format.
        OverflowError : a number leaves the range of the format.
        """
        try:
            steps = self._by_roots(fmt) if self.form is Form.CARLSON else self._by_covariances(fmt)
        except ZeroDivisionError:
            raise ZeroDivisionError(
                f"got a singular innovation covariance or predicted covariance of {self.model.name} in "
                f"{format_text(fmt)}; needed pivots other than zero; use more {digit_unit(fmt.base)}, or add a little "
                "to the diagonals of Q and P0"
            ) from None
        x: Any = np.stack([step.x.reshape(self.model.n) for step in steps])
        P: Any = np.stack([step.P for step in steps])
        return SmoothedRecord(x, P)

    def _by_covariances(self, fmt: FloatFormat | FixedFormat) -> list[SmoothedStep]:
        stored = self.model.definite_in(fmt).arrays(fmt)
        parts = [list(stored[letter]) for letter in ("Phi", "H", "Q", "R")]
        models = [StepModel(*(_member(each, k) for each in parts)) for k in range(len(self.z))]
        algebra = Algebra(cache(lambda n: identity_in(fmt, n)), operator.matmul)
        x, z = stored["x0"][:, None], list(fmt.array(self.z)[:, :, None])
        return smooth_covariances(algebra, form_named(self.form), models, x, stored["P0"], z)

    def _by_roots(self, fmt: FloatFormat | FixedFormat) -> list[SmoothedStep]:
        model = self.model
        fmt.restart()
        Phi, H = ([fmt.store(each) for each in cycle] for cycle in (model.Phi, model.H))
        SQ = [root_of_factors(fmt.store(upper_factors(each))) for each in model.Q]
        UR = [fmt.store(upper_factors(each)) for each in model.R]
        S = root_of_factors(fmt.store(upper_factors(model.P0)))
        parts = (Phi, H, SQ, UR)
        models = [RootModel(*(_member(each, k) for each in parts)) for k in range(len(self.z))]
        identity = identity_in(fmt, model.n)
        return smooth_roots(models, fmt.store(model.x0), S, list(fmt.array(self.z)), identity)


def _member(cycle: Sequence[Each], k: int) -> Each:
    return cycle[k % len(cycle)]
