"""Rounded rotations, emulated digit by digit: by recursion, and directly from each angle."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.lanes import repeatable
from gpbnb.interrupts import slices
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.theory import INTERVAL


class Rotation(NamedTuple):
    """The error of a rotation (cos nδ, sin nδ) computed in a format after some samples n."""

    step: NDArray[np.int64]
    size: NDArray[np.float64]

    def drift_error(self, drift: float) -> float:
        """Return the largest error in mas of a ramp of `drift` mas a year that is derolled with this rotation."""
        return float(np.max(self.size * self.step * (drift * INTERVAL / YEAR)))


@cache
def _exact_turn(n: int, period: float) -> tuple[Fraction, Fraction]:
    """Return cosine and sine of n steps, to 60 digits."""
    turns = n * Fraction(INTERVAL) / Fraction(period) % 1
    with mpmath.workdps(60):
        angle = 2 * mpmath.mpf(turns.numerator) / turns.denominator
        return _fraction(mpmath.cospi(angle)), _fraction(mpmath.sinpi(angle))


def _fraction(x: Any) -> Fraction:
    sign, mantissa, exponent, _ = x._mpf_
    return Fraction(-int(mantissa) if sign else int(mantissa)) * Fraction(2) ** exponent


def _compared(period: float, steps: Any, values: Any) -> Rotation:
    """Return the errors of computed pairs (m, 2) of exact Fractions."""
    errors = []
    for n, (c, s) in zip(steps, values, strict=True):
        cosine, sine = _exact_turn(int(n), period)
        # z e^{-inδ} - 1, without cancellation
        errors.append(complex((c - cosine) * cosine + (s - sine) * sine, (s - sine) * cosine - (c - cosine) * sine))
    return Rotation(np.asarray(steps), np.abs(np.array(errors)))


def recursion(fmt: FloatFormat, period: float, steps: Sequence[int]) -> Rotation:
    """Rotate by the angle of one sample repeatedly, with every operation rounded: the recursive deroll of (7)."""
    marks = np.asarray(steps, dtype=np.int64)
    if marks.ndim != 1 or not len(marks) or marks[0] < 0 or np.any(np.diff(marks) <= 0):
        raise ValueError(f"got steps {steps!r}; needed numbers of samples that ascend from 0 or later")
    backend = fmt.backend
    if not isinstance(backend, Compiled):
        raise ValueError(f"got {fmt}; needed base 2, 10 or 16 and at most 53 bits, 18 or 13 digits; take fewer")
    step = repeatable(_turned, ((2,), (2,)))
    loop = step.loop(fmt)
    loop.states, angle = (backend.pack(fmt.array(x).components) for x in ([1, 0], list(_exact_turn(1, period))))
    loop.hold(step.given[1], angle)
    found = []
    for gap in np.diff(marks, prepend=0).tolist():
        for part in slices(gap, len(loop.rows)):
            loop.take(part.start, part.stop - part.start)
        found.append(loop.states.reshape(angle.shape))
    return _compared(period, marks, FloatArray.from_packed(np.stack(found), fmt).to_fractions())


def _turned(state: Any, angle: Any) -> Any:
    (c, s), (a, b) = state, angle
    return np.stack([c * a - s * b, s * a + c * b])


def direct(fmt: FloatFormat, period: float, steps: Sequence[int]) -> Rotation:
    """Compute cosine and sine of a rounded roll rate times a rounded time, each rounded to a format."""
    marks = np.asarray(steps, dtype=np.int64)
    rate = fmt.array(theory.roll_rate(period))
    values = []
    for n in marks:
        angle = Fraction((rate * fmt.array(int(n) * Fraction(INTERVAL))).to_fractions())
        with mpmath.workdps(60):
            x = mpmath.mpf(angle.numerator) / angle.denominator
            values.append([fmt.round(_fraction(mpmath.cos(x))), fmt.round(_fraction(mpmath.sin(x)))])
    return _compared(period, marks, values)
