"""Numbers that other tools publish, beside ours for the same program and inputs.

Each published number comes with the file in which it stands. A program without a published number, or one that a bound
of this package does not cover, is listed with the reason.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guess import gains
from gpbnb.bounds.system import output_errors
from gpbnb.filters.program import recorded
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem
from gpbnb.report.display.tables import Table, short
from gpbnb.report.guarantees.published import fixif_longitudinal

SINGLE, DOUBLE = FloatFormat(2, 24, Rounding.EVEN), FloatFormat(2, 53, Rounding.EVEN)


LAGS = 2**16
"""Terms of a peak gain that are added one by one; the others are bounded."""


class PublishedNumber(NamedTuple):
    """One row: a program, what is bounded, why a number is missing or differs, the source, and both numbers, if any."""

    program: str
    quantity: str
    note: str
    source: str
    published: float | None = None
    ours: float | None = None


def second_order_filter() -> LinearSystem:
    """The second-order filter of Fluctuat's examples, S = 0.7 E - 1.3 E0 + 1.1 E1 + 1.4 S0 - 0.7 S1, from rest."""
    b, a = ["0.7", "-1.3", "1.1"], [1, "-1.4", "0.7"]
    return LinearSystem.from_coefficients(b, a, "direct form I", name="second-order filter")


def lead_lag() -> LinearSystem:
    """The controller of FPBench's lead-lag system; its input is the clamped deviation, within 1, its output xc1.

    The operations have the order of the program: inner parentheses first, and xc1 uses the new xc0.
    """

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        first = c[0] * x[0] + (c[1] * x[1] + c[2] * u[0])
        second = c[3] * first + (c[4] * x[1] + c[5] * u[0])
        return [first, second, second]

    program = recorded(step, 3, 1, 6, 1, ["xc0", "xc1", "y"])
    return LinearSystem.from_filter(LinearFilter(program, exact(["0.499", "-0.05", 1, "0.010", 1, 0]), "lead-lag"))


def peak_gain(A: Any, B: Any, C: Any, D: Any = None) -> NDArray[np.float64]:
    r"""Return the worst-case peak gain :math:`|D| + \sum_{l\ge0}|CA^lB|`, (p, m), in float64."""
    A, B, C = (exact(each).astype(np.float64) for each in (A, B, C))
    direct = 0.0 if D is None else np.abs(exact(D).astype(np.float64))
    return np.asarray(gains(A, B, C, None, LAGS)[len(A) :] + direct)


def error_coefficients(A: Any, B: Any, C: Any, D: Any, largest_input: float) -> NDArray[np.float64]:
    r"""Return FixIF's coefficients, the effect on the output of a unit in the last place of each state and output.

    .. math:: E_j = \mathrm{WCPG}(\text{error in } x_j \to y)\cdot 2^{\lceil\log_2\max|x_j|\rceil}

    The output error is at most the sum of :math:`E_j 2^{-w_j}` for w_j bits, up to factors due to the rounding. There
    are n + 1 of them, that of the output last. Source: Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020);
    FixIF's example files.
    """
    unit = np.eye(len(exact(A)), dtype=int)
    sizes = largest_input * np.append(peak_gain(A, B, unit)[:, 0], peak_gain(A, B, C, D)[:, 0])
    exponents = np.ceil(np.log2(sizes))
    return np.append(peak_gain(A, unit, C)[0], 1.0) * 2.0**exponents


def _fixif() -> float:
    """Return the largest of the error coefficients for which FixIF prints numbers."""
    given = fixif_longitudinal()
    ours = error_coefficients(given["A"], given["B"], given["C"], given["D"], given["input_bound"])
    return float(ours[int(np.argmax(given["published_E"]))])


def _largest_output(system: LinearSystem) -> float:
    return float(peak_gain(system.A, system.B, system.C, system.D)[0, 0])


OURS: dict[str, Callable[[], float]] = {
    "tree": lambda: float(output_errors(LinearSystem.sum(1024, "tree"), DOUBLE, 1.0)[0]),
    "second-order output": lambda: _largest_output(second_order_filter()),
    "second-order rounding": lambda: float(output_errors(second_order_filter(), DOUBLE, 1.0)[0]),
    "FixIF": _fixif,
    "lead-lag": lambda: float(output_errors(lead_lag(), SINGLE, 1.0)[0]),
}
"""Our numbers, by their names in ``published.csv``."""


@cache
def rows() -> tuple[PublishedNumber, ...]:
    """Return the rows of the table."""
    with Path(__file__).with_name("published.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))[1:]
    return tuple(
        PublishedNumber(
            program, quantity, note, source, float(published) if published else None, OURS[ours]() if ours else None
        )
        for program, quantity, note, source, published, ours in lines
    )


def table() -> Table:
    """Tabulate published numbers beside ours."""
    header = ("program, inputs and quantity", "published; ours", "remark and source")
    body = []
    for each in rows():
        numbers = ["none" if number is None else short(number, 6) for number in (each.published, each.ours)]
        pair = "none" if numbers == ["none", "none"] else "; ".join(numbers)
        body.append((f"{each.program}: {each.quantity}", pair, f"{each.note}; source: {each.source}"))
    return Table("published numbers and ours", header, tuple(body))
