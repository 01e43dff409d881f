"""What decides a wordlength, measured: the steps, the range of the numbers, what an addition loses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.formats import FloatFormat, Rounding
from gpbnb.inversion.bounds import rationals, smallest_precision, true_inverse
from gpbnb.kalman.experiment import Form, emulate, log_spaced, reference
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.precision import Requirement, required_precision
from gpbnb.kalman.theory import coefficients
from gpbnb.kalman.theory import required_precision as digits_of_125
from gpbnb.kalman.year import Year


def printed_precision(k: int, n: int, m: int, goal: Fraction, size: Fraction, base: int = 2, **faults: bool) -> int:
    r"""Digits that (125) asks for when :math:`\|x_k\| = B` = size, for an error of `goal`.

    Parameters
    ----------
    goal, size : in one unit. faults : of :func:`gpbnb.kalman.theory.coefficients`, which mend (125).

    References
    ----------
    hung1984, ch. II, eq. (125) and the example of section 12.
    """
    return digits_of_125(sum(coefficients(k, n, m, **faults)), goal / size, base)


def growth(
    model: LinearModel, z: NDArray[Any], goal: float | Sequence[float], steps: Sequence[int], **options: Any
) -> tuple[Requirement, ...]:
    """What :func:`gpbnb.kalman.precision.required_precision` answers for the first few steps, and for more of them.

    Parameters
    ----------
    options : form, basis, base and rounding of that function.
    """
    return tuple(required_precision(model, k, goal, z=z[:k], **options) for k in steps)


def years_needed(runs: Sequence[Year], goal: float) -> tuple[tuple[int, int], ...]:
    """Steps, and the fewest digits of the runs with which drift (mas) and rate (mas/yr) stay within `goal` until then.

    Raises
    ------
    ValueError : runs of several bases, roundings or forms, whose digits are not to be compared.
    """
    kinds = {(run.case.model, run.case.base, run.case.rounding, run.case.form) for run in runs}
    if len(kinds) != 1:
        raise ValueError(f"got runs of {len(kinds)} kinds; needed one model, base, rounding and form")
    found: dict[int, int] = {}
    for run in runs:
        errors = np.maximum.accumulate(np.abs(np.hstack([run.drift, run.rate])).max(axis=1))
        for step, error in zip(run.steps.tolist(), errors.tolist(), strict=True):
            if error <= goal:
                found[step] = min(found.get(step, run.case.precision), run.case.precision)
    return tuple(sorted(found.items()))


class Span(NamedTuple):
    """Powers of two between which the magnitudes of numbers lie, zeros aside."""

    name: str
    least: int
    largest: int


def spans(model: LinearModel, z: NDArray[Any]) -> tuple[Span, ...]:
    """Of a filter's model, estimates, gains and covariances, after the steps that :func:`log_spaced` marks."""
    kept = reference(model, z, log_spaced(len(z), 16))
    told = np.concatenate([getattr(model, letter).ravel() for letter in ("Phi", "H", "Q", "R", "P0")])
    numbers = {"model": told, "estimate": kept.x, "gain": kept.K, "covariance": kept.P}
    result = []
    for name, values in numbers.items():
        powers = [math.frexp(abs(float(value)))[1] - 1 for value in values.ravel() if value]
        result.append(Span(name, min(powers), max(powers)))
    return tuple(result)


class Deafness(NamedTuple):
    """What a filter's last covariance has become in a format: of one state, over what it should be."""

    fmt: FloatFormat
    ratio: float
    largest_error: float


def deafness(
    model: LinearModel, z: NDArray[Any], state: int, formats: Sequence[FloatFormat], form: Form = Form.USUAL
) -> tuple[float, tuple[Deafness, ...]]:
    r"""Variance of a state at the end in some formats, over the true one, and the largest error of the first state.

    Returns
    -------
    bits : :math:`\log_2 P_{ii}/Q_{ii}` at the end: with fewer digits than that, adding Q changes nothing.
    found : for each format.
    """
    marks = log_spaced(len(z), 16)
    true = reference(model, z, marks)
    variance = float(true.P[-1, state, state])
    found = []
    for fmt in formats:
        history = emulate(model, z, fmt, form, marks, true)
        ratio = 1 + float(history.covariance[-1, state, state]) / variance
        found.append(Deafness(fmt, ratio, float(np.abs(history.state[:, 0]).max())))
    return math.log2(variance / float(model.Q[0, state, state])), tuple(found)


class Inverse(NamedTuple):
    """Bits that the inverse of a matrix needs, and what its condition lets one expect."""

    name: str
    condition: float
    expected: int
    proved: int


def inverse(name: str, matrix: NDArray[Any], goal: float, rounding: Rounding = Rounding.NEAREST) -> Inverse:
    r"""Bits by the rule of thumb :math:`\beta\,\kappa_1(A)\le` goal, and proved by
    :func:`gpbnb.inversion.bounds.smallest_precision`.
    """
    condition = _column_sum(rationals(matrix)) * _column_sum(true_inverse(matrix))
    expected = digits_of_125(condition, Fraction(goal), 2, rounding)
    proved = smallest_precision(matrix, goal, 2, rounding).fmt.precision
    return Inverse(name, float(condition), expected, proved)


def _column_sum(matrix: Any) -> Fraction:
    columns = matrix.transpose().tolist()
    return max(sum((abs(Fraction(int(e.p), int(e.q))) for e in column), Fraction(0)) for column in columns)
