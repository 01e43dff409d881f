"""Numbers that other tools publish, beside ours for the same program and inputs.

Each published number comes with the file in which it stands. A program without a published number, or one that a bound
of this package does not cover, is listed with the reason.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.linear import error_coefficients, peak_gain
from gpbnb.bounds.system import output_errors
from gpbnb.filters.program import Builder
from gpbnb.filters.system import LinearFilter, LinearSystem
from gpbnb.report.display.tables import Table, short
from gpbnb.report.guarantees.published import fixif_longitudinal

SINGLE, DOUBLE = FloatFormat(2, 24, Rounding.EVEN), FloatFormat(2, 53, Rounding.EVEN)


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
    build = Builder(3, 1)
    xc0, xc1, _ = build.states
    (yc,) = build.inputs
    first = build.add(build.multiply(0, xc0), build.add(build.multiply(1, xc1), build.multiply(2, yc)))
    second = build.add(build.multiply(3, first), build.add(build.multiply(4, xc1), build.multiply(5, yc)))
    program = build.finish([first, second, second], 6, 1, ["xc0", "xc1", "y"])
    return LinearSystem.from_filter(LinearFilter(program, exact(["0.499", "-0.05", 1, "0.010", 1, 0]), "lead-lag"))


_FPBENCH = "FPBench, benchmarks"

NOT_COMPARABLE = (
    PublishedNumber(
        "PID and odometry loops",
        "rounding error",
        "no error is printed; the PID loop starts from a given state, where our bounds start from rest, and the "
        "odometry loop multiplies states",
        f"{_FPBENCH}: salsa.fpcore, PID and Odometry",
    ),
    PublishedNumber(
        "filter x ← 3x/4 - y/8",
        "rounding error",
        "no error is printed; the loop has no input and starts from a given state",
        f"{_FPBENCH}: apron.fpcore, Filter",
    ),
    PublishedNumber(
        "filters of Roux",
        "rounding error",
        "we found his proofs in Coq, but no filter with its printed number",
        "Roux, Application: Impact of floating-point rounding errors on a Lyapunov stability proof",
    ),
    PublishedNumber(
        "filters of FixIF 2015",
        "worst-case peak gain",
        "the examples use random filters or binary files, and the repository contains no printed results",
        "fixif/examples, TC2018",
    ),
    PublishedNumber(
        "Kalman filters of VerFilter",
        "probability that a variance is not positive",
        "the repository has the program, but neither a model nor a number",
        "VerFilter, by A. Evangelidis",
    ),
)
"""Programs of which no printed error can be compared with a bound of ours."""


@cache
def rows() -> tuple[PublishedNumber, ...]:
    """Return the rows of the table."""
    given, second = fixif_longitudinal(), second_order_filter()
    coefficients = given["published_E"]
    most = coefficients.index(max(coefficients))
    ours = error_coefficients(given["A"], given["B"], given["C"], given["D"], given["input_bound"])
    return (
        PublishedNumber(
            "sum of 1024 numbers within 1, as a tree",
            "rounding error, binary64",
            "SATIRE charges a unit roundoff for storing a number; storing a number within 1 costs at most half of that",
            "Satire, README.md, Reduction_1024",
            1.2505552149377763e-12,
            float(output_errors(LinearSystem.sum(1024, "tree"), DOUBLE, 1.0)[0]),
        ),
        PublishedNumber(
            "second-order filter of Fluctuat, inputs within 1, from rest",
            "largest output, exact",
            "Pilat finds an invariant ellipse; a peak gain is exact",
            "Frama-C, plug-in Pilat, a test with the option -pilat-degree 2",
            8.70578,
            float(peak_gain(second.A, second.B, second.C, second.D).high[0, 0]),
        ),
        PublishedNumber(
            "second-order filter of Fluctuat, inputs within 1, from rest",
            "rounding for ever, binary64",
            "the example prints no number",
            "Fluctuat, example of a second-order filter with DBETWEEN(-1.0, 1.0)",
            None,
            float(output_errors(second, DOUBLE, 1.0)[0]),
        ),
        PublishedNumber(
            "aircraft's longitudinal controller",
            f"FixIF's coefficient of state {most + 1}",
            "all eleven coefficients agree in each printed digit",
            "fixif/examples, ARITH26 (2019)",
            coefficients[most],
            float(ours[most]),
        ),
        PublishedNumber(
            "lead-lag controller, deviation clamped to 1",
            "rounding for ever, binary32",
            "FPBench has the program and its inputs, but no error",
            f"{_FPBENCH}: salsa.fpcore, Lead-lag System",
            None,
            float(output_errors(lead_lag(), SINGLE, 1.0)[0]),
        ),
        *NOT_COMPARABLE,
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
