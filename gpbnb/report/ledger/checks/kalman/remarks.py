"""The remarks of section 13 and the references of section 14."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import contraction, emulation, forms
from gpbnb.filters.kalman_step import StepModel
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.kalman import derivation, exact_step, report_bounds, smallest
from gpbnb.report.ledger.checks.kalman.example import GOAL, SIGNAL, STEP, YEAR, M, N, coefficients
from gpbnb.report.ledger.checks.kalman.registry import CHECKS, FOUR
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare
from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement


@cache
def refined() -> tuple[int, int, float]:
    """Compare small filters in four and eight digits with exact ones: bounds, violations, median of bound / error."""
    rng = np.random.default_rng(125)
    tried, violations, factors = 0, 0, []
    for fmt, second in ((FOUR, False), (FloatFormat(10, 8), True)):
        for _ in range(4):
            Phi, H = exact(rng.integers(-9, 10, (2, 2))) / 20, exact(rng.integers(1, 10, (1, 2)))
            Q, R, P = (exact(np.diag(rng.integers(1, 10, size))) / 8 for size in (2, 1, 2))
            run = truth = smallest.FilterCase(Phi, H, Q, R, exact(rng.integers(-9, 10, 2)), P, exact([0]))
            model = StepModel(*map(as_float, (Phi, H, Q, R)))
            bound = contraction.contraction_start(as_float(P), np.zeros(2), np.zeros((2, 2)))
            for _ in range(5):
                z = exact(rng.integers(-9, 10, 1))
                run, truth = run._replace(z=z), truth._replace(z=z)
                here, true = exact_step.exact_step(*run), exact_step.exact_step(*truth)
                x, _, P = smallest.rounded_step(fmt, run, second)
                P = (P + P.T) / 2
                before, K, S = as_float(run.P), as_float(here.gain), as_float(here.innovation_covariance)
                off = contraction.evaluation_errors(model, as_float(run.x), before, as_float(z), K, S, 2.0**-102)
                residuals = as_float(here.innovation), as_float(x - here.x), as_float(P - here.P)
                bound = contraction.contraction_step(bound, model, contraction.Repeated(K, S, *residuals), off)
                run, truth = run._replace(x=x, P=P), truth._replace(x=true.x, P=true.P)
                errors = np.abs(np.append(as_float(x - true.x), as_float(P - true.P)))
                bounds = np.append(contraction.state_error_bound(bound), contraction.covariance_error_bound(bound))
                tried += len(errors)
                violations += int((errors > bounds).sum())
                factors += (bounds[errors > 0] / errors[errors > 0]).tolist()
    return tried, violations, float(np.median(factors))


def as_float(entries: NDArray[Any]) -> NDArray[np.float64]:
    """Return the nearest float64 of Fractions."""
    return np.asarray(entries, dtype=object).astype(np.float64)


@CHECKS.add(*both("s13.remark-1"))
def remark_1(printed: Statement) -> Finding:
    tried, violations, factor = refined()
    return answer(
        violations == 0 and factor < 1000 and derivation.contraction().holds and derivation.recursion().holds,
        "(125) is not a bound; the contraction bound is strict, not only valid to first order: "
        f"{violations} violations in {tried} entries of small filters, with a median ratio of bound "
        f"to error of {factor:.2g}",
        note=f"see the {chapter('contraction')}, where a companion run makes the bound tight over a year",
    )


@cache
def year_again() -> bool:
    """Whether ten steps of a stored year give the stored errors when emulated again."""
    stored = year.load()[0]
    case = stored.case
    if case.fmt is None:
        raise ValueError(f"got {case.name} as the first run in year.csv; needed a run in a floating-point format")
    steps = tuple(int(step) for step in stored.steps if step <= 10)
    z = year.simulation(case.model).measurements(max(steps))
    found = emulation.emulate(year.model(case.model, case.base), z, case.fmt, case.form, steps)
    again = np.array([[float(f"{number:.6g}") for number in line] for line in found.state[:, 2:4]])
    return bool(np.array_equal(again, stored.rate[: len(steps)]))


@cache
def needed_precision(base: int) -> int | None:
    """Return the fewest stored digits from which on the drift rates meet the tolerance at all checkpoints."""
    needed = None
    for found in sorted(year.load(), key=lambda each: each.case.precision, reverse=True):
        comparable = found.case._replace(precision=0) == year.YearCase(
            year.MODELS[0], base, 0, Rounding.NEAREST, forms.Form.HUNG
        )
        if comparable:
            if found.steps[-1] != YEAR // STEP or np.abs(found.rate).max() > GOAL:
                break
            needed = found.case.precision
    return needed


@CHECKS.add(*both("s13.remark-2"))
def remark_2(printed: Statement) -> Finding:
    again, decimal, binary = year_again(), needed_precision(10), needed_precision(2)
    asked = report_bounds.precision_for_coefficient(coefficients()[1], Fraction(GOAL, SIGNAL))
    return answer(
        again and decimal is not None and binary is not None,
        f"we ran a filter of our own with {N} states and {M} measurements for a year: {decimal} "
        f"decimal digits or {binary} bits are the smallest tried precisions that keep the drift rates "
        f"within {GOAL} mas a year; the second term of (125) requires {asked} digits",
        note=f"see the {chapter('year')}; the reports print no matrices, so the noise and the time constants are our "
        "choice",
    )


def left_open(note: str) -> Finding:
    return Finding("", None, Verdict.OPEN, note)


@CHECKS.add("hung1982.III.s13.remark-3")
def remark_3(printed: Statement) -> Finding:
    return left_open("the documents do not say which other computations the data reduction needs; the book treats some")


@CHECKS.add("hung1982.III.s13.remark-4")
def remark_4(printed: Statement) -> Finding:
    return left_open("the documents do not say which method of integration was chosen")


@CHECKS.add("hung1982.III.s13.remark-5")
def remark_5(printed: Statement) -> Finding:
    return left_open("the documents do not contain the compensation data")


@CHECKS.add("hung1984.II.s14.reference-1", "hung1984.II.s14.reference-5")
def titles(printed: Statement) -> Finding:
    right = {
        "Rounding Errors in Algebraic Processes": True,
        "Introduction to Numerical Computations": True,
        "Rounding Errors in Algebraic Process": False,
        "Introduction to Numerical Computation": False,
    }
    return compare(
        printed.claims("title", right),
        ("both titles are plural: *Rounding Errors in Algebraic Processes*, *Introduction to Numerical Computations*"),
        Verdict.MISPRINT,
        otherwise_note="the final s of a title is missing",
    )


@CHECKS.add("hung1984.II.s14.reference-7")
def reference_7(printed: Statement) -> Finding:
    return compare(
        printed.claims("contract", {"NA58-34426": False, "NAS8-34426": True}),
        "NAS8-34426",
        Verdict.MISPRINT,
        otherwise_note="the author or the scan put a 5 in place of the S on the title page, as in chapter I. The "
        "date is a month after the end of the period that the report of 1982 covers",
    )
