"""Section 10 and the opening of section 11: the error of an inverse from its residue."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact
from gpbnb.report.inversion import experiment, procedure, theory
from gpbnb.report.ledger.checks.inversion.environments import FORMATS, residues
from gpbnb.report.ledger.checks.inversion.judging import holds, says, slip
from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.checks.inversion.samples import FOUR, Sample, of_example, samples
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement

EXACTLY = "exact for random matrices, however inaccurate the computed inverse is"


@CHECKS.add(*both("eq33"), *both("eq35"), *both("eq38"))
def residue_relations(printed: Statement) -> Finding:
    return compare(holds(printed, residues(False)), EXACTLY)


@CHECKS.add(*both("eq39"), *both("eq40"))
def residue_norms(printed: Statement) -> Finding:
    return compare(
        holds(printed, residues(False, sharp=True)),
        f"{EXACTLY}; the norms are equal where $A$ is a multiple of $I$",
    )


@CHECKS.add("hung1984.II.s10.line-before-42", "hung1984.II.eq42")
def changed_relations(printed: Statement) -> Finding:
    return compare(holds(printed, residues(True)), "both sides agree for random matrices and perturbations")


@CHECKS.add("hung1982.III.eq42")
def changed_relation_1982(printed: Statement) -> Finding:
    right = holds(printed, residues(True))
    return compare(
        right and printed.number("number").value == 42,
        "the equation is right; the text below cites it as (42), and (43) is the number of the next equation",
        Verdict.MISPRINT if right else Verdict.WRONG,
        otherwise_note="the scan shows the number (43) twice",
    )


@CHECKS.add(*both("s10.unnumbered-e"))
def changed_error_matrix(printed: Statement) -> Finding:
    return compare(
        holds(printed, residues(True)),
        "exact with the computed inverse; the last form drops the second-order term $A^{-1}\\Delta A\\,E$",
        note="the equation holds to first order, as the sign $\\approx$ says",
    )


@CHECKS.add(*both("eq43"))
def changed_norm(printed: Statement) -> Finding:
    return compare(
        holds(printed, residues(True, sharp=True)),
        "the inequality holds to first order in $R$ and $\\Delta A$, with equality where $A$ is a "
        "multiple of $I$; divided by $1-\\|A^{-1}\\|\\|\\Delta A\\|$, the right side is a strict "
        "bound",
        note="the inequality holds to first order, as the sign $\\approx$ before it says",
    )


@CHECKS.add(*both("eq44"))
def changed_relative_norm(printed: Statement) -> Finding:
    return slip(
        printed,
        residues(True, sharp=True),
        "epsilon == norm(E)/norm(A.inv) <= norm(R) + norm(A.inv)*norm(DeltaA)",
        "to first order, the relative error is at most the right side; the two are equal only in special cases",
        "the sign $\\le$ is meant, as in (43) and in hung1982 (44)",
    )


@CHECKS.add("hung1984.II.s10.claim-n-solutions")
def n_solutions(printed: Statement) -> Finding:
    a = samples()[0].matrix
    n = len(a)
    inverse = linalg.inv(a)
    needed = 0
    for j in range(n):
        column = linalg.solve(a, a.format.array([int(i == j) for i in range(n)]))
        needed += bool((column == inverse[:, j]).all())
    return compare(
        needed == n and says(printed, times="n times"),
        f"each of the {n} solutions equals its column of the inverse in every digit",
    )


@CHECKS.add(*both("s10.claim-partial-pivoting"))
def partial_pivoting(printed: Statement) -> Finding:
    swap = FOUR.array([[0, 1], [1, 0]])
    try:
        linalg.inv(swap)
        fails = False
    except np.linalg.LinAlgError:
        fails = True
    solved = bool((linalg.inv(swap, pivot=True) == swap).all())
    small = FOUR.array([["0.0001", 1], [1, 1]])
    without, with_pivots = (float(column_sum_norm(Sample(small, pivot).error)) for pivot in (False, True))
    needed = fails and solved and without > 100 * with_pivots
    return compare(
        says(printed, method="with partial pivoting" if needed else "without pivoting"),
        "without pivoting, the matrix with rows (0, 1), (1, 0) has no first pivot, and the relative "
        f"error for rows (.0001, 1), (1, 1) in four digits is {without:.2g}; with pivoting it is "
        f"{with_pivots:.2g}",
        note="section 11 and its flow chart omit pivoting",
    )


@CHECKS.add("hung1982.III.s10.cross-reference-to-33")
def reference_33(printed: Statement) -> Finding:
    number = printed.number("equation").value
    meant = holds(statement("hung1984.II.eq33"), residues(False))
    return compare(
        number == 33,
        "the equation to be solved $n$ times is (33); equation (29) is a chain of matrix products",
        Verdict.MISPRINT if meant else Verdict.WRONG,
        otherwise_note="(33) is meant, as hung1984 prints it",
    )


@CHECKS.add(*both("s10.claim-special-case"))
def special_case(printed: Statement) -> Finding:
    of_40, of_44 = statement("hung1984.II.eq40").relation(), statement("hung1982.III.eq44").relation()
    norms = {"norm": lambda x: x.norm()}
    general = [of_44.value({**names, **norms}, Fraction) for names in residues(True)]
    special = [
        (of_44.value({**names, **norms}, Fraction), of_40.value({**names, **norms}, Fraction))
        for names in residues(False)
    ]
    same = all(a == b for a, b in special)
    wider = any(a != names["R"].norm() for a, names in zip(general, residues(True), strict=True))
    return compare(
        says(printed, relation="a special case" if same and wider else "the general case"),
        "with $\\Delta A=0$, bound (44) equals bound (40); with any other $\\Delta A$ it is larger",
    )


@cache
def _residual_bound() -> tuple[str, bool]:
    """Whether the residual in the example of 11.4 is easy to compute and gives the tightest bound, with a text."""
    sample, _ = of_example()
    twice = FloatFormat(10, 2 * FOUR.precision)
    a, x = (twice.array(part.to_fractions()) for part in (sample.matrix, linalg.inv(sample.matrix)))
    computed = exact(a @ x - twice.array(np.eye(3, dtype=int)))
    true = theory.residual(sample.matrix, sample.reduction.solution)
    apart = column_sum_norm(computed - true) / column_sum_norm(true)
    trial = experiment.trial(sample.matrix, False, experiment.BETTER)
    tightest = min(trial.bounds, key=trial.overestimation)
    printed = float(theory.printed_first_bound(sample.inverse, true) / column_sum_norm(sample.error))
    text = (
        f"one matrix product in {twice.precision} digits gives $R$ in the example of 11.4 "
        f"{'exactly' if apart == 0 else f'to {float(apart):.0e}'}; with this $R$, the printed bounds (39) and (43) are "
        f"{printed:.3g} times the error, and the bound $\\|A^{{-1}}R\\|/(1-\\|R\\|)$, with the computed inverse, is "
        f"{trial.overestimation(tightest):.4g} times the error, the tightest of {len(trial.bounds)} bounds"
    )
    return text, apart < Fraction(1, 100) and tightest == "a posteriori" and not trial.violates(tightest)


@CHECKS.add(*both("s10.practicality-of-44"))
def practicality(printed: Statement) -> Finding:
    text, easy = _residual_bound()
    return compare(
        says(
            printed,
            residue="can easily be obtained" if easy else "cannot easily be obtained",
            parameter="do not explicitly depend",
        ),
        text,
        Verdict.WRONG,
        otherwise_note="$R$ can easily be obtained: it takes one matrix product with twice the digits. That (43) and "
        "(44) contain no β is true, because they bound the actual error rather than the largest possible error",
        root="residue-hard-to-obtain",
    )


@cache
def _two_parts() -> tuple[int, int]:
    few = samples()[::3]
    same = sum(bool((linalg.inv(s.matrix, s.pivot) == procedure.reduce(s.matrix, s.pivot).solution).all()) for s in few)
    return same, len(few)


@CHECKS.add(*both("s11.claim-two-parts"))
def two_parts(printed: Statement) -> Finding:
    same, count = _two_parts()
    return compare(
        same == count and says(printed, count="two parts"),
        "applied separately to the matrix and the columns of the identity, triangularization and "
        f"back substitution give all digits of the computed inverse in {same} of {count} cases",
        note="the transformation of the right sides belongs to the triangularization",
    )


@cache
def _largest_error() -> tuple[Fraction, Fraction]:
    """Return the largest relative error of rounding five-digit numbers to four digits, and β."""
    fmt = FORMATS[0]
    numbers = (Fraction(i) for i in range(10**fmt.precision, 2 * 10**fmt.precision))
    return max(abs(fmt.round(x) / x - 1) for x in numbers), fmt.unit_roundoff


@CHECKS.add(*both("s11.claim-one-epsilon"))
def one_epsilon(printed: Statement) -> Finding:
    worst, beta = _largest_error()
    (link,) = printed.links({"epsilon": worst, "beta": beta}, Fraction)
    return compare(
        link.symbol == "<=" and link.right * Fraction(99, 100) < link.left <= link.right,
        f"the largest relative error found for a rounding to four digits is {float(worst / beta):.4f} β",
        note=(
            "this bounds the size of each error; (48) to (60) use ε as if all roundings had the same "
            "error with the same sign"
        ),
    )
