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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np

from gpbnb.arithmetic.algebra import algebra_of
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import digit_unit
from gpbnb.filters.factors import upper_factors
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import LinearModel, check_one, in_columns
from gpbnb.filters.repeating import RepeatedStep
from gpbnb.filters.steps import (
    StepModel,
    StepTaken,
    filtered,
    filtered_root,
    root_of_factors,
    smoothed,
    smoothed_root,
)

SMOOTHER_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.CARLSON)
"""Forms of the filter that a smoother has; the last one computes square roots, forwards and backwards."""


class SmoothedRecord(NamedTuple):
    """Smoothed estimates (steps, n), and their covariances, or upper triangular roots, (steps, n, n)."""

    x: FloatArray
    P: FloatArray


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
            x, P = self._smoothed(fmt)
        except ZeroDivisionError:
            raise ZeroDivisionError(
                f"got a singular innovation covariance or predicted covariance of {self.model.name} in "
                f"{format_text(fmt)}; needed pivots other than zero; use more {digit_unit(fmt.base)}, or add a little "
                "to the diagonals of Q and P0"
            ) from None
        return SmoothedRecord(x.reshape(len(x), self.model.n), P)

    def _smoothed(self, fmt: FloatFormat | FixedFormat) -> tuple[FloatArray, FloatArray]:
        """Run the filter forwards and the smoother backwards."""
        roots, join = self.form is Form.CARLSON, cast(Any, np.concatenate)
        (start, cycles), z = self._factored(fmt) if roots else self._stored(fmt), fmt.array(self.z)
        check_one(fmt)
        forwards = RepeatedStep(self._forwards, [fmt], start, cycles).take(z if roots else z[:, :, None])
        found = zip(*((*each.states, *each.gain) for each in forwards), strict=True)
        x, P, *passed = (join(each)[::-1] for each in found)
        Phi = cycles[0][[(len(z) - 1 - k) % len(cycles[0]) for k in range(len(cycles[0]))]]
        own = (x[1:], *(() if roots else (P[1:],)), *(each[:-1] for each in passed))
        backwards = RepeatedStep(self._backwards, [fmt], (x[0], P[0]), [Phi])
        steps = [each.states for each in backwards.take(*own)]
        ends = zip((x[:1], P[:1]), *steps, strict=True)
        x, P = (join(each)[::-1] for each in ends)
        return x, P

    def _stored(self, fmt: FloatFormat | FixedFormat) -> tuple[tuple[FloatArray, ...], list[FloatArray]]:
        stored = self.model.definite_in(fmt).arrays(fmt)
        return (stored["x0"][:, None], stored["P0"]), [stored[letter] for letter in ("Phi", "H", "Q", "R")]

    def _factored(self, fmt: FloatFormat | FixedFormat) -> tuple[tuple[FloatArray, ...], list[FloatArray]]:
        model, stack = self.model, cast(Any, np.stack)
        fmt.restart()
        Phi, H = (stack([fmt.store(each) for each in cycle]) for cycle in (model.Phi, model.H))
        SQ = stack([root_of_factors(fmt.store(upper_factors(each))) for each in model.Q])
        UR = stack([fmt.store(upper_factors(each)) for each in model.R])
        S = root_of_factors(fmt.store(upper_factors(model.P0)))
        return (fmt.store(model.x0), S), [Phi, H, SQ, UR]

    def _forwards(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        (fmt,), (x, P), (z, Phi, H, Q, R) = formats, states, given
        if self.form is Form.CARLSON:
            identity = fmt.array(np.eye(self.model.n, dtype=int))
            x, P, *kept = filtered_root(Phi, H, Q, R, x, P, z, identity)
        else:
            x, P, *kept = filtered(algebra_of(fmt), form_named(self.form), StepModel(Phi, H, Q, R), x, P, z)
        return StepTaken((x, P), tuple(kept), True)

    def _backwards(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        (fmt,), (*kept, Phi) = formats, given
        if self.form is Form.CARLSON:
            return StepTaken(smoothed_root(*kept, *states), (), True)
        return StepTaken(smoothed(algebra_of(fmt), Phi, kept[:2], *kept[2:], *states), (), True)
