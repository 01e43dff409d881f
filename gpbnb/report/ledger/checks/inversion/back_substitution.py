"""Section 11.2: rounding errors of the back substitution."""

from __future__ import annotations

import itertools
import operator
import re
from fractions import Fraction
from functools import cache

import numpy as np
import sympy as sp

from gpbnb.arithmetic.rational import column_sum_norm, inverse_of
from gpbnb.report.inversion import procedure, theory
from gpbnb.report.ledger.checks.inversion.environments import Elimination, runs, substitutions, weights
from gpbnb.report.ledger.checks.inversion.first_order import EPSILON
from gpbnb.report.ledger.checks.inversion.judging import Names, corrected, holds, says, slip
from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.checks.inversion.samples import of_example, samples
from gpbnb.report.ledger.checks.inversion.triangularization import ONE_EPSILON
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement

COUNTED = "to first order; each coefficient is a number of roundings, and each rounding has its own error"


def general() -> tuple[Names, ...]:
    return (*substitutions(4), *substitutions(5))


def displayed() -> tuple[Names, ...]:
    """Return symbols for so many rows that each row and column of a printed matrix with dots is another one."""
    return (*substitutions(5), *substitutions(6))


@CHECKS.add(*both("s11-2.line-before-68"))
def before_68(printed: Statement) -> Finding:
    return slip(
        printed,
        general(),
        "(A_hat - DeltaA)*(x_hat - Deltax) == b_hat - Deltab",
        "$(\\hat A-\\Delta A)(\\hat x-\\Delta x)=\\hat b-\\Delta b$ is $Ax=b$ written with hats",
        "the parentheses around $\\hat x-\\Delta x$ are missing; hung1982 prints them",
    )


@CHECKS.add(*both("eq68"))
def perturbed_solution(printed: Statement) -> Finding:
    return compare(
        holds(printed, general()),
        "correct to first order; exact with $A^{-1}$ and $\\hat x$, or with $\\hat A^{-1}$ and $x$",
        note=(
            "the printed form mixes the two exact forms and so omits the second-order term $\\hat "
            "A^{-1}\\Delta A\\,\\Delta x$"
        ),
    )


@CHECKS.add(
    *both("eq71"),
    "hung1982.III.s11-2.x-1-line",
    *both("s11-2.x-3-line"),
    *both("s11-2.x-2-line"),
)
def rows(printed: Statement) -> Finding:
    return compare(
        holds(printed, substitutions(3)),
        "the equations are the rows of (69); they hold exactly for random triangular systems",
    )


@CHECKS.add(
    *(key for number in (72, 73, 74, 75, 76, 78, 79, 82) for key in both(f"eq{number}")),
    *both("s11-2.x-1-line.2"),
    *both("s11-2.x-1-expanded"),
)
def rounded_rows(printed: Statement) -> Finding:
    return compare(
        holds(printed, substitutions(3)),
        "rounding every operation of the row gives the same, to first order",
        note=COUNTED,
    )


@CHECKS.add("hung1982.III.eq80")
def assembled_1982(printed: Statement) -> Finding:
    return compare(
        holds(printed, substitutions(3)),
        "rounding every operation gives the same, to first order",
        note="the scan does not show whether the vector has hats; we use those of (79)",
    )


@CHECKS.add(*both("s11-2.claim-approximations"))
def approximations(printed: Statement) -> Finding:
    links = [link for names in substitutions(3) for link in printed.links(names, Fraction)]
    agrees = all(link.symbol == "≈" and EPSILON * link.left == EPSILON * link.right for link in links)
    return compare(agrees, "multiplied by ε, as in (78), the two sides agree to first order")


@CHECKS.add(*both("eq77"))
def second_equation(printed: Statement) -> Finding:
    return slip(
        printed,
        substitutions(3),
        "a[2,2]*x_hat[2] + a[2,3]*(1 + 3*epsilon)*x_hat[3] == b[2]*(1 + 2*epsilon); a_hat[2,2] == a[2,2]; "
        "a_hat[2,3] == a[2,3]*(1 + 3*epsilon); b_hat[2] == b[2]*(1 + 2*epsilon)",
        ("the equation holds to first order with $\\hat x_3$; with $x_3$, the sides differ by $a_{23}x_3\\epsilon$"),
        "$\\hat x_3$ is meant, as hung1982 prints it",
    )


@CHECKS.add("hung1984.II.s11-2.x-1-line")
def first_row_with_hats(printed: Statement) -> Finding:
    return slip(
        printed,
        substitutions(3),
        "x[1] == 1/a[1,1]*(b[1] - a[1,2]*x[2] - a[1,3]*x[3])",
        "without hats the line is (71a) and exact; with hats it differs from $x_1$ to first order",
        ("the hats belong to the next line, which gives the computed value; the line for $x_2$, above (75), has none"),
    )


@CHECKS.add("hung1984.II.eq80")
def assembled(printed: Statement) -> Finding:
    return slip(
        printed,
        substitutions(3),
        printed.form.replace("[x[", "[x_hat["),
        "the equation holds to first order with $\\hat x_1,\\hat x_2,\\hat x_3$",
        "the entries of the vector lack hats, although the vector is labelled $\\hat x$",
    )


@CHECKS.add(*both("eq81"))
def factored_three(printed: Statement) -> Finding:
    return slip(
        printed,
        substitutions(3),
        "DeltaA == [[0, 4*epsilon*a[1,2], 3*epsilon*a[1,3]], [0, 0, 3*epsilon*a[2,3]], [0, 0, 0]] == "
        "[[0, a[1,2], a[1,3]], [0, 0, a[2,3]], [0, 0, 0]]*[[0, 0, 0], [0, 4, 0], [0, 0, 3]]*epsilon",
        "$A_D\\,\\mathrm{diag}(0,4,3)\\,\\epsilon$",
        "the second form lacks the factor $\\epsilon$ of the first",
    )


# -- from line to line ----------------------------------------------------------------------------


_UNKNOWN = {"74": 3, "77": 2, "79": 1}
"""The component of x̂ for which an equation can be solved."""


def _numbers(phrase: str) -> list[str]:
    return re.findall(r"\((\d+)", phrase)


def _cited(printed: Statement, number: str, part: int = 1) -> tuple[sp.Expr, sp.Expr]:
    """Return the left and the last side of an equation of the same document, as it should read."""
    relation = intended(f"{printed.document}.{printed.chapter}.eq{number}").relation(part)
    return relation.sides[0].value({"matrix": sp.Matrix}), relation.value({"matrix": sp.Matrix})


@CHECKS.add(*(key for number in (74, 77, 79) for key in both(f"s11-2.claim-substitution-{number}")))
def substitution(printed: Statement) -> Finding:
    number = printed.id[-2:]
    replaced = dict(
        _cited(printed, each) for each in (["73"] if number == "74" else _numbers(printed.says("equations")))
    )
    left, right = _cited(printed, "71", "abc".index(printed.says("line")[-2]) + 1)
    unknown, epsilon = sp.Symbol(f"x_hat[{_UNKNOWN[number]}]"), sp.Symbol("epsilon")
    by_substitution, stated = (
        sp.solve(a - b, unknown) for a, b in ((left.subs(replaced), right), _cited(printed, number))
    )
    difference = by_substitution[0] - stated[0] if by_substitution else sp.Integer(1)
    first_order = [difference.subs(epsilon, 0), difference.diff(epsilon).subs(epsilon, 0)]
    return compare(
        all(sp.simplify(each) == 0 for each in first_order),
        f"solved for $\\hat x_{_UNKNOWN[number]}$, the result agrees with ({number}) to first order",
        note="(77) is meant with $\\hat x_3$" if printed.id == "hung1984.II.s11-2.claim-substitution-77" else "",
    )


@CHECKS.add(*both("s11-2.claim-single-equation"))
def put_together(printed: Statement) -> Finding:
    left, right = _cited(printed, "80")
    rows = {sp.expand(row) for row in left - right}
    cited = {sp.expand(a - b) for a, b in (_cited(printed, number) for number in _numbers(printed.says("equations")))}
    return compare(rows == cited, "the three rows of (80) are the three equations")


# -- n rows ---------------------------------------------------------------------------------------


_LESS = {"<=": operator.le, "<": operator.lt}


def _piecewise(diagonal: Relation | None, off: Relation, where: Relation) -> bool:
    """Whether a formula with index ranges gives every entry its true value exactly once, and names no other entries."""
    if not all(rule.equates for rule in (diagonal, off) if rule):
        return False
    for names in general():
        n = int(names["n"])
        for k, j in itertools.product(range(2 * n + 2), repeat=2):
            here = {**names, "k": Fraction(k), "j": Fraction(j)}
            inside = all(
                _LESS.get(link.symbol, operator.gt)(link.left, link.right) for link in where.links(here, Fraction)
            )
            if not 1 <= min(k, j) <= max(k, j) <= n:
                if inside:
                    return False
                continue
            rules = [off] * inside + [diagonal] * (diagonal is not None and k == j)
            true = off.links(here, Fraction)[0].left
            if len(rules) > 1 or (not rules and true != Fraction(0)):
                return False
            if any(link.left != link.right for rule in rules if rule for link in rule.links(here, Fraction)):
                return False
    return True


@CHECKS.add(*both("eq85"))
def weights_of_the_matrix(printed: Statement) -> Finding:
    diagonal, off, where = (printed.relation(i) for i in (1, 2, 3))
    return compare(
        _piecewise(diagonal, off, where),
        "$1\\le k<j\\le n$ is right for $n=4$ and 5; with $k\\le j$ each diagonal entry would have two values",
        Verdict.MISPRINT if _piecewise(diagonal, off, Relation("1 <= k < j <= n")) else Verdict.WRONG,
        note=COUNTED,
        otherwise_note="$k<j$ is meant, as printed in (87) and in hung1982",
    )


@CHECKS.add(*both("eq87"))
def weights_of_the_change(printed: Statement) -> Finding:
    return compare(
        _piecewise(None, printed.relation(1), printed.relation(2)),
        "the roundings were counted in rows of up to four products",
        note=COUNTED,
    )


@CHECKS.add(*both("eq86"), *both("eq88"))
def weights_of_the_right_side(printed: Statement) -> Finding:
    each = [{**names, "k": Fraction(k)} for names in general() for k in range(1, int(names["n"]) + 1)]
    return compare(holds(printed, each), "the roundings were counted in rows of up to four products", note=COUNTED)


@cache
def _generalizes() -> tuple[int, int]:
    """Count the runs of 3 and 4 rows in which each row stays within its counts of roundings, and all runs."""
    kept = count = 0
    for n in (3, 4):
        of_matrix, of_right = weights(n)
        for run, _, beta in runs(n):
            upper, right = (run.part(run.stages[1][-1], side).value for side in (False, True))
            again = Elimination(upper, right, run.rounded)
            x = np.array([[cell.value for cell in row] for row in again.solution], dtype=object)
            allowed = (abs(upper) * of_matrix.value) @ abs(x) + of_right.value @ abs(right)
            kept += bool((abs(right - upper @ x) <= beta * (1 + 10 * beta) * allowed).all())
            count += 1
    return kept, count


@CHECKS.add(*both("s11-2.claim-generalization"))
def generalization(printed: Statement) -> Finding:
    kept, count = _generalizes()
    return compare(
        says(printed, verb="can be obtained" if kept == count else "cannot be obtained"),
        f"for {kept} of {count} triangular systems of 3 and 4 rows, the computed solution solves "
        "exactly a system whose entries are perturbed by at most these numbers of roundings",
        note="the counts hold for subtraction from left to right; each row and each right side has its own errors",
    )


@CHECKS.add("hung1984.II.eq89")
def factored(printed: Statement) -> Finding:
    return slip(
        printed,
        displayed(),
        printed.form.replace("A_D*M_A", "A_D*M_A*epsilon"),
        "the first form is (87); the second is $A_DM_A\\,\\epsilon$",
        "the second form lacks the factor $\\epsilon$ of the first; hung1982 has β there",
    )


@CHECKS.add("hung1982.III.eq89-first-form")
def first_form_1982(printed: Statement) -> Finding:
    (three, right_three), (four, right) = (
        [weights(n)[0, 1:].tolist() for weights in (theory.printed_weights_1982, theory.back_substitution_weights)]
        for n in (3, 4)
    )
    return compare(
        holds(printed, displayed()),
        f"$2n-j$ {'is right for $n=3$ alone' if three == right_three else 'is wrong'}; for $n=4$ it gives "
        f"{', '.join(map(str, four))} in place of {', '.join(map(str, right))}",
        Verdict.INCONSISTENT,
        otherwise_note=(
            "the count contradicts (87), the second form of the same equation, and its own last entries "
            "4 and 3; hung1984 corrects it"
        ),
    )


@CHECKS.add("hung1982.III.eq89-factored-form")
def factored_1982(printed: Statement) -> Finding:
    counted = holds(printed, [names for names in displayed() if names["epsilon"] == EPSILON])
    return compare(
        holds(printed, displayed()),
        "the weights are those of (87), but β stands for $\\epsilon$, so the equation fails where "
        "$\\epsilon$ is negative; $|\\Delta A|\\le|A_D|M_A\\beta$ holds",
        Verdict.WRONG if counted else Verdict.INCONSISTENT,
        otherwise_note="this step is the reason why (49), (52)–(54), (59) and (60) are wrong; hung1984 has "
        "neither β nor $\\epsilon$ there",
        root=ONE_EPSILON,
    )


@CHECKS.add(*both("eq90"))
def right_side_inequality(printed: Statement) -> Finding:
    meant = corrected(printed, printed.form.replace("<= M_b*b*beta", "; abs(Deltab) <= M_b*abs(b)*beta"))
    return compare(
        holds(printed, displayed()),
        "the inequality fails where $\\epsilon$ or an entry of $b$ is negative; $|\\Delta b|\\le M_b|b|\\beta$ holds",
        Verdict.WRONG if holds(meant, displayed()) else Verdict.INCONSISTENT,
        otherwise_note="the absolute-value bars are missing on both sides, and (95) subtracts $\\delta A\\,\\hat x$ "
        "from $\\Delta b$ as if the signs were known",
        root=ONE_EPSILON,
    )


# -- claims in words ------------------------------------------------------------------------------


@CHECKS.add(*both("s11-2.claim-transformed"))
def backward(printed: Statement) -> Finding:
    kept, count = _generalizes()
    return compare(
        says(printed, verb="has been transformed to" if kept == count else "cannot be transformed to"),
        f"in {kept} of {count} cases the computed solution solves exactly a system perturbed within "
        "the counts of (85) and (86), as the theorem of Oettli and Prager shows",
    )


@cache
def _perturbed_inverse() -> tuple[float, bool, bool]:
    sample, _ = of_example()
    change = theory.perturbation(sample.reduction, sample.beta, signed=False, transfer=True).matrix
    hat = inverse_of(sample.reduction.stages[0] + change)
    computed = sample.reduction.solution
    apart = column_sum_norm(hat - computed) / column_sum_norm(computed)
    second_order = apart <= 2 * theory.bound(sample.reduction, sample.beta) / column_sum_norm(computed)
    return float(apart), bool((hat == computed).all()), bool(second_order)


@CHECKS.add(*both("s11-2.claim-computed"))
def computed_inverse(printed: Statement) -> Finding:
    apart, same, second_order = _perturbed_inverse()
    return compare(
        says(printed, verb="are computed" if same else "are not both computed"),
        "in the example of 11.4 with four digits, the inverse of the perturbed matrix differs from "
        f"the computed inverse by {apart:.1e} in norm",
        Verdict.MISPRINT if second_order else Verdict.WRONG,
        otherwise_note="$\\hat A$ is unknown, and one system gives only one column; the computed inverse can "
        "replace $\\hat A^{-1}$, with an error of second order",
    )


@cache
def _left_alone() -> tuple[int, int, int]:
    """Count samples in which elimination leaves the triangular factor, or the full matrix, as is, and all samples."""
    triangular = full = 0
    few = samples()[::3]
    for sample in few:
        upper = procedure.triangularize(sample.matrix, sample.pivot).upper
        triangular += all(bool((stage == upper).all()) for stage in procedure.triangularize(upper).stages)
        full += all(
            bool((stage == sample.matrix).all()) for stage in procedure.triangularize(sample.matrix, True).stages
        )
    return triangular, full, len(few)


@CHECKS.add(*both("s11-2.claim-only-back-substitution"))
def only_back_substitution(printed: Statement) -> Finding:
    triangular, full, count = _left_alone()
    return compare(
        says(printed, form="upper triangular" if triangular == count > full else "full"),
        (f"elimination does not change {triangular} of {count} triangular systems and {full} of {count} full systems"),
    )
