"""The numerical example of section 11.4: Table 1 in every reading.

The report gives a matrix, three wordlengths and six numbers. It does not state the meaning of a wordlength in "places
after decimal point", the norm, or which quantities were computed with how many digits. This module computes each number
in every plausible way, with exact errors, and compares it with the printed one.

Source: hung1984, ch. II, section 11.4; hung1982, ch. III, section 11.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import inverse_in_order
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import rounding_text
from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import procedure
from gpbnb.report.inversion.procedure import NORMS

#: The matrix, as printed.
MATRIX = (("3.235", "-1.234", "3.256"), ("1.023", "-5.235", "0.921"), ("1.336", "2.120", "-8.235"))

#: The printed numbers of Table 1, places after the decimal point and the two columns of error norms.
PLACES = (3, 5, 8)
PRINTED = {"bound": ("3.706e-2", "3.706e-4", "3.706e-7"), "error": ("7.782e-5", "4.530e-7", "4.672e-10")}

Matrix = NDArray[Any]
Rounder = Callable[[Matrix], Matrix]

# -- what a wordlength may be ---------------------------------------------------------------------


@dataclass(frozen=True)
class Wordlength:
    """A reading of "places after decimal point".

    Parameters
    ----------
    kind : "t = places", as in the significand .ddd of (1); "t = places + 1", as in d.ddd, or more; "fixed point", every
        number rounded to that many decimals.
    rounding : to nearest or chopped.
    """

    kind: str
    rounding: Rounding

    def format(self, places: int) -> FloatFormat:
        """Floating-point format; for fixed point, the format with the same unit roundoff for numbers near 1."""
        more = 1 if self.kind == "fixed point" else int(self.kind.partition("+")[2] or 0)
        return FloatFormat(10, places + more, self.rounding)

    def rounder(self, places: int) -> Rounder:
        """Function that rounds each number of an array; in fixed point, half away from zero or towards zero."""
        if self.kind != "fixed point":
            return np.vectorize(self.format(places).round, otypes=[object])
        half, units = Fraction(1, 2) if self.rounding is Rounding.NEAREST else 0, 10**places

        def fixed(x: Fraction) -> Fraction:
            return Fraction(math.floor(abs(x) * units + half), units) * (1 if x > 0 else -1)

        return np.vectorize(fixed, otypes=[object])

    def __str__(self) -> str:
        return f"{self.kind}, {rounding_text(self.rounding)}"


KINDS = ("t = places", "t = places + 1", "fixed point")
WORDLENGTHS = tuple(Wordlength(kind, rounding) for kind, rounding in product(KINDS, Rounding.documented()))

# -- ways to invert, with a rounding after each operation -----------------------------------------


def gauss_jordan(a: Matrix, fl: Rounder) -> Matrix:
    """Invert by Gauss-Jordan: divide each row by its pivot and subtract multiples of it from all others."""
    n = len(a)
    rows = np.hstack([a, exact(np.eye(n, dtype=int))])
    for k in range(n):
        rows[k] = fl(rows[k] / rows[k, k])
        others = np.arange(n) != k
        rows[others] = fl(rows[others] - fl(rows[others, k, np.newaxis] * rows[k]))
    return rows[:, n:]


#: Elimination and back substitution are in the order of section 11; pivoting would change nothing here. The last one
#: gives the most accurate inverse of a wordlength.
METHODS: dict[str, Callable[[Matrix, Rounder], Matrix]] = {
    "elimination": lambda a, fl: np.asarray(inverse_in_order(a, exact(np.eye(len(a), dtype=int)), fl).matrix),
    "Gauss-Jordan": gauss_jordan,
    "rounded once": lambda a, fl: fl(inverse_of(a)),
}


# -- readings -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PrintedColumn:
    """One reading of a column of Table 1 and its three numbers.

    Parameters
    ----------
    column : "bound" or "error".
    wordlength, detail : the wordlength of the reading, and everything else in words.
    norm : one of :data:`gpbnb.report.inversion.procedure.NORMS`.
    relative : whether the values are divided by the norm of the inverse.
    values : one value for each of :data:`PLACES`.
    """

    column: str
    wordlength: Wordlength
    detail: str
    norm: str
    relative: bool
    values: tuple[float, ...]

    @property
    def distance(self) -> float:
        """Largest factor between a number and the printed one; 1 for equality."""
        ratios = [v / float(p) for v, p in zip(self.values, PRINTED[self.column], strict=True)]
        return max(max(r, 1 / r) if r else math.inf for r in ratios)

    @property
    def same_digits(self) -> bool:
        """Whether all values have the same four digits and differ only in their exponents."""
        return len({f"{v:.3e}".split("e")[0] for v in self.values}) == 1


def agree(value: float | Fraction, printed: str) -> bool:
    """Whether a value, rounded or chopped to the printed digits, agrees with the printed number."""
    low, high = interval(printed)
    return bool(low <= Fraction(value) < high)


@cache
def interval(printed: str) -> tuple[Fraction, Fraction]:
    """Return the interval of the numbers that round or chop to the printed one."""
    digits, _, exponent = printed.partition("e")
    unit = Fraction(10) ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return Fraction(printed) - unit / 2, Fraction(printed) + unit


def matrix() -> Matrix:
    """Return the exact matrix of the example."""
    return exact(np.array(MATRIX))


@cache
def bound_readings() -> tuple[PrintedColumn, ...]:
    """Compute every reading of the column "By proposed method".

    The readings combine two wordlengths, rounded or chopped; quantities computed in that wordlength or with a unit
    roundoff of :math:`10^{-50}`; all :func:`~gpbnb.report.inversion.procedure.readings` of the procedure in every norm;
    and the absolute bound (96) or the relative bound (97).
    """
    result = []
    for wordlength in WORDLENGTHS[:4]:
        formats = [wordlength.format(places) for places in PLACES]
        for source in ("its own digits", "more digits"):
            computing = formats if source == "its own digits" else [FloatFormat(10, 50)] * 3
            reductions = [procedure.as_floats(procedure.reduce(fmt.array(MATRIX))) for fmt in computing]
            all_outcomes = [
                procedure.evaluate_all(reduction, float(fmt.unit_roundoff), procedure.readings())
                for reduction, fmt in zip(reductions, formats, strict=True)
            ]
            for outcomes in zip(*all_outcomes, strict=True):
                reading = outcomes[0].reading
                detail = f"{str(reading).removesuffix(f', {reading.norm}')}, {source}"
                for relative in (False, True):
                    values = tuple(float(o.relative_bound if relative else o.bound) for o in outcomes)
                    result.append(PrintedColumn("bound", wordlength, detail, reading.norm, relative, values))
    return tuple(result)


@cache
def error_readings() -> tuple[PrintedColumn, ...]:
    """Compute every reading of the column "Actual value".

    The readings combine three wordlengths, rounded or chopped; three ways to invert; the error against the inverse of
    the given matrix, or of the stored matrix if three digits cannot hold the given one; every norm; and absolute or
    relative errors.
    """
    given = matrix()
    result = []
    for wordlength, (method, invert) in product(WORDLENGTHS, METHODS.items()):
        rounders = [wordlength.rounder(places) for places in PLACES]
        stored = [fl(given) for fl in rounders]
        computed = [invert(a, fl) for a, fl in zip(stored, rounders, strict=True)]
        references = {"given": [given] * 3} | ({"stored": stored} if (stored[0] != given).any() else {})
        for reference, matrices in references.items():
            true = [inverse_of(a) for a in matrices]
            for (name, norm), relative in product(NORMS.items(), (False, True)):
                values = tuple(
                    float(norm(x - t)) / (float(norm(t)) if relative else 1)
                    for x, t in zip(computed, true, strict=True)
                )
                detail = f"{method}, against the matrix as {reference}"
                result.append(PrintedColumn("error", wordlength, detail, name, relative, values))
    return tuple(result)


class Agreements(NamedTuple):
    """Result of a search: readings tried, values that agree with the print in each digit, and the closest reading."""

    column: str
    readings: int
    agreements: int
    closest: PrintedColumn


def search(column: str) -> Agreements:
    """Compare every reading of a column, "bound" or "error", with the print."""
    found = bound_readings() if column == "bound" else error_readings()
    agreements = sum(agree(v, p) for one in found for v, p in zip(one.values, PRINTED[column], strict=True))
    return Agreements(column, len(found), agreements, min(found, key=lambda one: one.distance))


@cache
def claims() -> dict[str, int]:
    """Count the readings for which each sentence about Table 1 holds.

    Whether a bound is conservative is tested against the error of elimination with the same wordlength and norm, both
    absolute or both relative.
    """
    read, errors = bound_readings(), {}
    for one in error_readings():
        if one.detail == "elimination, against the matrix as given":
            errors[one.wordlength, one.norm, one.relative] = one.values
    conservative = (
        all(v >= e for v, e in zip(one.values, errors[one.wordlength, one.norm, one.relative], strict=True))
        for one in read
    )
    return {
        "the bound decreases with the wordlength": sum(all(a > b for a, b in pairwise(one.values)) for one in read),
        "all bounds have the same digits": sum(one.same_digits for one in read),
        "the bounds are above the errors": sum(conservative),
    }
