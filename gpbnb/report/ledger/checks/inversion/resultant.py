"""Section 11.3: the resultant error of the inverse and the flow chart."""

from __future__ import annotations

from functools import cache

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.report.inversion import experiment, procedure, theory
from gpbnb.report.ledger.checks.inversion.environments import factored_errors, inverses
from gpbnb.report.ledger.checks.inversion.judging import corrected, holds, says, slip
from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.checks.inversion.samples import of_example
from gpbnb.report.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, load_statements, statement

TWO_SYSTEMS = "two-systems-added"


@cache
def _left_out() -> tuple[float, float]:
    """Return the share that (91) and (92) omit, as norms of sizes, in the example of 11.4."""
    sample, _ = of_example()
    whole, bare = (theory.perturbation(sample.reduction, sample.beta, False, transfer) for transfer in (True, False))
    parts = [column_sum_norm(w - b) / column_sum_norm(w) for w, b in zip(whole, bare, strict=True)]
    return float(parts[0]), float(parts[1])


#: Matrices whose errors exceed the bound of the printed procedure, by (96) and by the last box of its chart.
COUNTEREXAMPLES = {
    "(96)": ([[-1, 94], [-48, 10]], FloatFormat(10, 3), False),
    "chart": ([[-95, -15, 84], [53, 62, 75], [-43, 48, 162]], FloatFormat(10, 6), True),
}


@cache
def counterexample(form: str) -> tuple[experiment.InverseTrial, str]:
    """Return a matrix whose error exceeds one form of the printed bound, and the name of the bound."""
    rows, fmt, pivot = COUNTEREXAMPLES[form]
    name = str(procedure.Reading(form=form))
    return experiment.trial(fmt.array(rows), pivot, [name, str(procedure.Reading(False, form)), "corrected"]), name


@cache
def exceeded() -> str:
    """Return the factors by which the errors of the counterexamples exceed the printed bound."""
    texts = []
    for form in COUNTEREXAMPLES:
        trial, name = counterexample(form)
        if not trial.violates(name):
            raise ArithmeticError(
                f"got a counterexample to {form} whose error is within the bound; needed an error above the bound"
            )
        rows = ", ".join("(" + ", ".join(f"{float(x):g}" for x in row) + ")" for row in trial.matrix.to_float())
        texts.append(
            f"for the matrix with rows {rows} and condition number {trial.condition:.3g}, inverted in "
            f"{trial.matrix.format.precision} digits {'with' if trial.pivot else 'without'} pivoting, "
            f"the error is {trial.ratio(name):.2g} times "
            f"{'the bound in the last box of the chart' if form == 'chart' else 'bound (96)'}"
        )
    return "; ".join(texts)


NO_SUM = (
    "$\\tilde A$ and $\\tilde b$ perturb the given system, but $\\Delta A$ and $\\Delta b$ perturb "
    "the triangular one, so they must be multiplied by $L$ before they can be added. In a bound on "
    "absolute values, $L$ adds a factor of at most $(n+3)/2$"
)


def _sum_text() -> str:
    matrix, right = _left_out()
    return (
        "$\\delta A=\\tilde A+L\\,\\Delta A$, $\\delta b=\\tilde b+L\\,\\Delta b$, derived for every "
        f"$n$; in the example of 11.4 the printed sums omit {matrix:.0%} of the size of $\\delta A$ "
        f"and {right:.0%} of that of $\\delta b$"
    )


def with_l(printed: Statement) -> Statement:
    """Return (91) or (92) with the errors of back substitution multiplied by L."""
    return corrected(printed, printed.form.replace("+ DeltaA", "+ L*DeltaA").replace("+ Deltab", "+ L*Deltab"))


@CHECKS.add(*both("eq91"), *both("eq92"))
def resultant_perturbations(printed: Statement) -> Finding:
    return compare(
        holds(printed, inverses()),
        _sum_text(),
        Verdict.WRONG if holds(with_l(printed), inverses()) else Verdict.INCONSISTENT,
        otherwise_note=NO_SUM,
        root=TWO_SYSTEMS,
    )


@CHECKS.add(*both("s11-3.claim-two-sets"))
def two_sets(printed: Statement) -> Finding:
    sums = holds(statement("hung1984.II.eq91"), inverses())
    return compare(
        says(printed, verb="are given by the sums" if sums else "are not given by the sums"),
        _sum_text(),
        otherwise_note=NO_SUM,
        root=TWO_SYSTEMS,
    )


@CHECKS.add(*both("eq93"), *both("eq94"))
def resultant_error(printed: Statement) -> Finding:
    return compare(
        holds(printed, inverses()),
        "right to first order, if $\\delta A$ and $\\delta b_j$ belong to the system that was solved",
        note="each column has its own $\\Delta A$; with $A^{-1}$ in place of $\\hat A^{-1}$ the equation is exact",
    )


@CHECKS.add(*both("eq95"))
def resultant_errors(printed: Statement) -> Finding:
    return compare(
        holds(printed, inverses()),
        "each column is (94), which is right to first order",
        note="the equation needs the $\\delta A$ and $\\delta b_j$ of the system that was solved",
    )


@CHECKS.add(*both("s11-3.claim-similar-to-68"))
def similar_to_68(printed: Statement) -> Finding:
    environments = [
        {
            **names,
            "Deltax": names["deltax"](names["j"]),
            "Deltab": names["deltab"](names["j"]),
            "DeltaA": names["deltaA"],
            "x_hat": names["x_hat"](names["j"]),
        }
        for names in inverses()
    ]
    similar = holds(statement("hung1984.II.eq68"), environments)
    return compare(
        says(printed, way="similar to" if similar else "different from"),
        "equation (68) becomes (94) if the resultant perturbations replace those of the back substitution",
    )


FOLLOWS = (
    "the bound follows from (95), but $E$ is evaluated with (59), (60) and (91), which are wrong. "
    "Evaluated in this way, the bound fails: "
)


@CHECKS.add(*both("eq96"))
def error_norm(printed: Statement) -> Finding:
    return compare(
        holds(printed, factored_errors()),
        (
            "the norm of a product is at most the product of the norms; the two are equal where $\\hat "
            "A$ is a multiple of $I$"
        ),
        note=FOLLOWS + exceeded(),
    )


@CHECKS.add("hung1984.II.eq97")
def relative_error_norm(printed: Statement) -> Finding:
    return slip(
        printed,
        factored_errors(),
        "epsilon == norm(delta(A.inv))/norm(A_hat.inv) <= norm(E)",
        "$\\epsilon=\\|\\delta(A^{-1})\\|/\\|\\hat A^{-1}\\|\\le\\|E\\|$, by (96)",
        "the signs $\\le$ and $=$ are interchanged",
    )


@cache
def terms_of_96() -> tuple[float, float, float]:
    """Return the norms of error, computed inverse and bracket of (95) in the example of 11.4."""
    sample, error = of_example()
    bracket = theory.bracket(sample.reduction, theory.perturbation(sample.reduction, sample.beta))
    return error, float(column_sum_norm(sample.reduction.solution)), float(column_sum_norm(bracket))


@CHECKS.add("hung1984.II.s11-3.claim-e-defined")
def letter_e(printed: Statement) -> Finding:
    error, inverse, bracket = terms_of_96()
    shown = {
        "(95)": "E" in statement("hung1984.II.eq95").form,
        "(36)": error <= inverse * error,
        "the bracket of (95)": error <= inverse * bracket,
    }
    return compare(
        shown[printed.says("place")],
        "the scan defines one $E$ earlier, in (36): the error itself. With this $E$, (96) would say "
        f"that $\\|\\hat A^{{-1}}\\|$ is at least 1, but in the example of 11.4 it is {inverse:.2f}. "
        f"With the bracket of (95) as $E$, (96) says that {error:.1e} is at most "
        f"{inverse * bracket:.1e}",
        Verdict.MISPRINT if error <= inverse * bracket else Verdict.WRONG,
        otherwise_note="$E$ means the bracket of (95), whose letter this scan does not show; the scan of hung1982 "
        "shows a D below the bracket. As printed, $E$ has two meanings",
    )


@CHECKS.add("hung1982.III.s11-3.claim-d-defined")
def letter_d(printed: Statement) -> Finding:
    error, inverse, bracket = terms_of_96()
    below_27 = 3.0  # the norm of the D below (27), for n = 3
    shown = {
        "(95)": "D" in statement("hung1982.III.eq95").form and error <= inverse * bracket,
        "(27)": bracket >= below_27,
    }
    return compare(
        shown[printed.says("place")],
        "with the bracket of (95) as $D$, (96) says that the error in the example of 11.4, "
        f"{error:.1e}, is at most {inverse * bracket:.1e}; with the $D$ below (27), whose norm is "
        f"$n$, at most {inverse * below_27:.2g}",
        note="the letter $D$ has two more meanings, below (27) and in the examples of 9.2",
    )


def operations(n: int) -> tuple[int, int]:
    """Count the multiplications and divisions for the inverse, and for its bound (96)."""
    reduce = sum((n - k) * (1 + (n - k) + n) for k in range(1, n))
    solve = n * sum(n - k + 1 for k in range(1, n + 1))
    sums = 2 * sum((n - k) ** 2 + (n - k) * n for k in range(1, n))  # by 3 and by 2, (59) and (60)
    return reduce + solve, sums + n * (n - 1) // 2 + n * n + n**3 + 1  # (89), (90), (95), (96)


@CHECKS.add(*both("s11-3.computation"))
def computation(printed: Statement) -> Finding:
    three, twenty = operations(3), operations(20)
    much = min(three[1] / three[0], twenty[1] / twenty[0]) > 1
    return compare(
        says(printed, amount="a good deal of computation" if much else "little computation"),
        f"for $n=3$ the bound takes {three[1]} multiplications and the inverse {three[0]}; for $n=20$ "
        f"they take {twenty[1]:,} and {twenty[0]:,}",
        note="the bound takes more computation than the inverse itself",
    )


@CHECKS.add("hung1982.III.s11-3.figure-iii-1")
def flow_chart_1982() -> Finding:
    right = holds(with_l(statement("hung1984.II.eq91")), inverses())
    return unverifiable(
        "the texts of the boxes follow (59), (60) and (89) to (95). One box calls $\\tilde A$ the error in $A_T$; "
        f"by (91) it is {'an error in $A$, which the derivation confirms' if right else 'not derived'}",
        (
            "the scan shows the texts of most boxes, but no arrows, and it has lost the box that "
            "generates the bracket of (95)"
        ),
    )


@CHECKS.add("hung1984.II.s11-3.figure-number")
def number_of_the_chart(printed: Statement) -> Finding:
    figures = [e for e in load_statements() if e.document == "hung1984" and e.kind == "figure"]
    chapters = list(dict.fromkeys(e.chapter for e in figures if e.item.startswith("Figure III-1")))
    return compare(
        printed.says("chapter") == printed.chapter,
        f"both chapters {' and '.join(chapters)} have a Figure III-1",
        Verdict.MISPRINT,
        otherwise_note="Figure II-1 is meant: in hung1982, from which it was taken, this was chapter III",
    )
