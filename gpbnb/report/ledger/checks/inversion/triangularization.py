"""Section 11.1: rounding errors of the triangularization."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.report.ledger.checks.inversion.environments import FORMATS, eliminations, runs
from gpbnb.report.ledger.checks.inversion.first_order import FirstOrder, matrix
from gpbnb.report.ledger.checks.inversion.judging import COMMON, corrected, holds, says, slip
from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.checks.inversion.worst_case import bounds_errors
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation, Undefined
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement

ONE_EPSILON = "one-signed-epsilon"
COUNTED = (
    "to first order; each rounding has its own ε: a multiple of ε is a number of roundings, as in "
    "$(\\epsilon_1+\\epsilon_2+\\epsilon_3)\\,a(1)-(\\epsilon_1+\\epsilon_2)\\,a(0)$"
)


@CHECKS.add(*(key for name in ("a-1", "b-1", "a-2", "b-2") for key in both(f"s11-1.{name}-definition")))
def blocks(printed: Statement) -> Finding:
    return compare(
        holds(printed, eliminations(3)),
        "the matrices hold exactly the entries that the step changes, and zeros elsewhere",
    )


@CHECKS.add(
    *both("eq46"),
    *both("s11-1.a-22-1-definition"),
    *both("eq50"),
    *both("s11-1.a-33-2-definition"),
    *both("s11-1.b-3-2-definition"),
)
def exact_steps(printed: Statement) -> Finding:
    agrees = holds(printed, eliminations(3))
    return compare(
        agrees,
        (
            "the equations are those of an elimination step, for random matrices: the multiplier makes "
            "the entry below the pivot zero"
        ),
    )


@CHECKS.add(
    *(key for name in ("a22", "a23", "a32", "a33") for key in both(f"s11-1.unnumbered-{name}-1")),
    *both("s11-1.a-33-2"),
    "hung1982.III.s11-1.b-i-1",
    "hung1982.III.s11-1.b-3-2",
)
def rounded_steps(printed: Statement) -> Finding:
    return compare(
        holds(printed, eliminations(3)), "three roundings per entry give the same, to first order", note=COUNTED
    )


@CHECKS.add(*both("eq47"))
def errors_of_the_first_step(printed: Statement) -> Finding:
    found = slip(
        printed,
        eliminations(3),
        "a_tilde[1,j](1) == 0; a_tilde[i,1](1) == 0; a_tilde[i,j](1) == a[i,j](1)*(3*epsilon) - a[i,j](0)*(2*epsilon)",
        "three roundings per entry give $3\\epsilon\\,a_{ij}(1)-2\\epsilon\\,a_{ij}(0)$",
        "the second (1) is a misprint for (0): hung1982 itself has (0) in (48), and hung1984 corrects it",
    )
    return Finding(found.recomputed, found.agrees, found.verdict, found.note or COUNTED)


@CHECKS.add("hung1984.II.s11-1.b-i-1-definition")
def right_side_definition(printed: Statement) -> Finding:
    return slip(
        printed,
        eliminations(3),
        "b[i](1) == b[i](0) + m[i,1]*b[1](0) == b[i](0) - a[i,1](0)/a[1,1](0)*b[1](0)",
        "$b_i(0)+m_{i1}b_1(0)=b_i(0)-\\frac{a_{i1}(0)}{a_{11}(0)}b_1(0)$",
        "there are two misprints: the sign of $m_{i1}$, which already contains the minus sign of "
        "(46), and $b_i(0)$ for $b_1(0)$ in the product; the last line below is right with $b_1(0)$",
    )


@CHECKS.add("hung1984.II.s11-1.b-i-1")
def right_side_step(printed: Statement) -> Finding:
    return slip(
        printed,
        eliminations(3),
        "b_hat[i](1) == fl(b[i](1)) == b[i](0)*(1 + epsilon) - a[i,1](0)/a[1,1](0)*b[1](0)*(1 + 3*epsilon) == "
        "b[i](1) + epsilon*b[i](0) - 3*epsilon*(a[i,1](0)/a[1,1](0))*b[1](0) == "
        "b[i](1) + 3*epsilon*b[i](1) - 2*epsilon*b[i](0)",
        "the last form follows with $b_1(0)$ in the product",
        "$b_i(0)$ is a misprint for $b_1(0)$ in the product, in two lines; hung1982 prints $b_1(0)$",
    )


@CHECKS.add("hung1984.II.s11-1.b-3-2")
def right_side_second_step(printed: Statement) -> Finding:
    return slip(
        printed,
        eliminations(3),
        "b_hat[3](2) == fl(b[3](2)) == b_hat[3](1)*(1 + epsilon) - "
        "a_hat[3,2](1)/a_hat[2,2](1)*b_hat[2](1)*(1 + 3*epsilon) == "
        "b[3](2) + 3*epsilon*b[3](2) - 2*epsilon*b_hat[3](1)",
        "the result is $b_3(2)+3\\epsilon b_3(2)-2\\epsilon\\hat b_3(1)$, without a hat on the first $b_3(2)$",
        "with the printed hat the error would be zero; hung1982 has no hat there",
    )


@CHECKS.add(*both("s11-1.matrix-after-first-step"))
def after_the_first_step(printed: Statement) -> Finding:
    return slip(
        printed,
        eliminations(3),
        "A_hat(1) == [[a[1,1](0), a[1,2](0), a[1,3](0)], [0, a_hat[2,2](1), a_hat[2,3](1)], "
        "[0, a_hat[3,2](1), a_hat[3,3](1)]]; b_hat_underline(1) == [[b[1](0)], [b_hat[2](1)], [b_hat[3](1)]]",
        (
            "the first row is unchanged, the first column is zero below the diagonal, and every other "
            "entry is that of stage 1"
        ),
        "two entries have (0) in place of (1), which hung1984 corrects",
    )


# -- claims in words ------------------------------------------------------------------------------


@CHECKS.add(*both("s11-1.claim-available"))
def available(printed: Statement) -> Finding:
    computed = exact = count = 0
    for (run, _, _), fmt in zip(
        runs(3), [fmt for fmt in FORMATS for _ in range(len(runs(3)) // len(FORMATS))], strict=True
    ):
        for true, new in zip(run.stages[0][1].value[1:, 1:].flat, run.stages[1][1].value[1:, 1:].flat, strict=True):
            computed += fmt.round(new) == new
            exact += fmt.round(true) == true
            count += 1
    return compare(
        says(printed, hat="is available" if computed == count > 2 * exact else "is not available"),
        f"after the first step {computed} of {count} entries of $\\hat A$ are floating-point numbers "
        f"of the format, but only {exact} entries of $A$; in (48) the two differ by a term of second "
        "order",
    )


@cache
def _compounded() -> tuple[int, int, int]:
    """Count runs with L Â_T = A + Ã(1) + Ã(2) exactly, and runs in which the errors of step 1 change step 2."""
    adds = changes = 0
    for run, _, _ in runs(3):
        upper = run.part(run.stages[1][-1], False)
        first, second = run.errors(False)[1:]
        adds += run.lower * upper == run.part(run.stages[0][0], False) + first + second
        given_matrix = run.stages[0][0].value[:, :3]
        leading = given_matrix[0, 0] * given_matrix[1, 1] - given_matrix[0, 1] * given_matrix[1, 0]
        determinant = sum(
            given_matrix[0, i]
            * (
                given_matrix[1, (i + 1) % 3] * given_matrix[2, (i + 2) % 3]
                - given_matrix[1, (i + 2) % 3] * given_matrix[2, (i + 1) % 3]
            )
            for i in range(3)
        )
        changes += run.stages[0][2].value[2, 2] != determinant / leading
    return adds, changes, len(runs(3))


@CHECKS.add(*both("s11-1.claim-compounded"))
def compounded(printed: Statement) -> Finding:
    adds, changes, count = _compounded()
    return compare(
        adds == count and says(printed, verb="will be compounded to" if changes > count / 2 else "will not affect"),
        f"errors of the first step change the exact result of the second step in {changes} of {count} "
        f"eliminations; $L\\hat A_T-A=\\tilde A(1)+\\tilde A(2)$ holds exactly in {adds}",
        note=(
            "expressed as perturbations of the given matrix, the errors of the steps simply add up, so "
            "(53) may add them"
        ),
    )


@CHECKS.add(*both("s11-1.claim-upper-triangular"))
def upper_triangular(printed: Statement) -> Finding:
    first = set()
    for n in (3, 4):
        for run, _, _ in runs(n):
            cleared = [not np.tril(stage.value[:, :n] != 0, -1).any() for stage in run.stages[1]]
            first.add(n - cleared.index(True))
    return compare(
        first == {1} and says(printed, step="(n-1)", form="upper triangular"),
        f"the entries below the diagonal become zero only with step $n-1$, in {2 * len(runs(3))} eliminations",
    )


# -- one ε for all roundings: (48)-(60) -----------------------------------------------------------


@cache
def _within(relation: Relation, n: int) -> int:
    """Count the runs in which the printed right side, with β for ε, allows the errors that occur."""
    count = 0
    for _, names, _ in runs(n):
        links = relation.links({**COMMON, **names}, Fraction)
        count += abs(links[0].left) <= abs(links[-1].right)
    return count


@cache
def _sizes_hold(n: int) -> int:
    return sum(
        bool((abs(sum(e.value for e in run.errors(right))) <= beta * run.sizes(right)).all())
        for run, _, beta in runs(n)
        for right in (False, True)
    )


def _counts(printed: Statement) -> bool:
    """Whether a printed chain counts the roundings, with ε for β; a chain of absolute values does not."""
    try:
        return holds(printed, eliminations(3))
    except Undefined:
        return False


@CHECKS.add(
    *both("eq48"),
    *both("eq49"),
    *both("eq51"),
    *both("eq52"),
    *both("eq53"),
    *both("eq54"),
    *both("eq59"),
    *both("eq60"),
)
def one_sign(printed: Statement) -> Finding:
    relations = [part for part in printed.parts if isinstance(part, Relation)]
    with_beta = [each for each in relations if "beta" in each.text]
    rest = "; ".join(each.text for each in relations if each not in with_beta)
    follows = not rest or holds(corrected(printed, rest), eliminations(3))
    if not with_beta:
        return compare(follows, "three roundings per entry give the same, to first order", note=COUNTED)
    sizes = (3, 4) if "n-1" in printed.form.replace(" ", "") else (3,)
    if follows and all(bounds_errors(each, sizes) for each in with_beta):
        return compare(True, "the right side is the largest possible error of each entry, to first order", note=COUNTED)
    exact_count = _counts(printed)
    counted = exact_count or _counts(
        corrected(printed, printed.form.replace("2*b_hat_underline[2](2)", "2*b_hat_underline[2](1)"))
    )
    within = min(_within(relation, 3) for relation in relations)
    count = len(runs(3))
    besides = (
        "; also, $\\hat b_2(2)$ in the middle is a misprint for $\\hat b_2(1)$" if not exact_count and counted else ""
    )
    return compare(
        False,
        f"the errors exceed the right side in {count - within} of {count} eliminations, half of which "
        "are chosen so that $3a(1)$ and $2a(0)$ nearly cancel; the sums of absolute values, "
        f"$3|\\cdot|+2|\\cdot|$, bound all errors in {_sizes_hold(3)} of {2 * count} cases",
        Verdict.WRONG if counted else Verdict.INCONSISTENT,
        otherwise_note="three roundings have three different errors, "
        "$\\epsilon_3a(1)-(\\epsilon_1+\\epsilon_2)(a(0)-a(1))$: with β for each ε the terms "
        f"$3a(1)$ and $2a(0)$ can cancel, but the errors do not{besides}",
        root=ONE_EPSILON,
    )


@CHECKS.add("hung1984.II.eq61", *both("eq62"))
def norms(printed: Statement) -> Finding:
    of_matrix = "A_tilde" in printed.form
    name, part = ("A_tilde", "A_hat") if of_matrix else ("b_tilde_underline", "b_hat_underline")
    environments = [names for n in (3, 4) for _, names, _ in runs(n)]
    extra = "; also, the sum runs over $i$ but its terms contain $k$" if of_matrix else ""
    meant = f"norm({name}) <= beta*Sum(3*norm({part}[k](k)) + 2*norm({part}[k](k-1)), (k,1,n-1))"
    return compare(
        bounds_errors(printed.relation(), (2, 3, 4)),
        f"with $\\le$ the line is a bound in all {len(environments)} eliminations and an equality in none",
        Verdict.MISPRINT if holds(corrected(printed, meant), environments, sharp=False) else Verdict.WRONG,
        otherwise_note="the sign $\\le$ is meant. The line correctly adds absolute values and is a bound to first "
        f"order, but the procedure of 11.3 does not use it{extra}",
    )


# -- shapes ---------------------------------------------------------------------------------------


@CHECKS.add(*both("eq58"))
def partial_matrix(printed: Statement) -> Finding:
    def changed(j: int, k: int) -> FirstOrder:
        error = names["A_tilde"](j).slope != 0
        return matrix([[Fraction(int(error.any(axis=axis).sum())) for axis in (1, 0)]])

    (names, *_) = eliminations(4)
    shapes = [
        {"n": Fraction(4), "j": Fraction(j), "i": Fraction(i), "k": Fraction(j), "A": changed,
         "block": lambda *shape: matrix([list(shape)])}
        for j in (1, 2) for i in (1, 2)
    ]  # fmt: skip
    same = [each for each in shapes if each["i"] == each["j"]]
    meant = corrected(printed, "A[j](k) == block(n - i, n - i)")
    scan = "; the scan shows $(n-1)$ in one of the two factors" if "n - 1" in printed.form else ""
    return compare(
        holds(printed, shapes),
        "step $i$ changes a block of $n-i$ rows and columns, which $A_i$ contains",
        Verdict.MISPRINT if holds(meant, same) else Verdict.WRONG,
        otherwise_note=f"the same index has two names: $j$ on the left and $i$ in the block{scan}",
    )


@CHECKS.add(*both("eq63"))
def triangular_matrix(printed: Statement) -> Finding:
    inside = [{**names, "k": Fraction(k)} for n in (5, 6) for names in eliminations(n) for k in range(3, n)]
    meant = printed.form.replace("a_hat[2,k](0)", "a_hat[2,k](1)").replace("a_hat[2,n](0)", "a_hat[2,n](1)")
    return slip(
        printed,
        inside,
        meant.replace("a_hat[k,n](0)", "a_hat[k,n](k-1)"),
        "row $k$ of $\\hat A_T$ is row $k$ of $\\hat A(k-1)$, also off the diagonal",
        (
            "to the right of the diagonal, (0) is printed for $(k-1)$; the diagonal is correct, and "
            "nothing later uses the superscripts"
        ),
    )


@CHECKS.add(*both("eq64"))
def triangular_right_side(printed: Statement) -> Finding:
    each = [{**names, "k": Fraction(k)} for names in eliminations(4) for k in (1, 2, 3, 4)]
    whole = all(
        names["b_hat_T_underline"] == names["b_hat_underline"](3)
        and [row[0] for row in names["b_hat_T_underline"].tolist()] == [names["b_hat"](k, k - 1) for k in (1, 2, 3, 4)]
        for names in eliminations(4)
    )
    return compare(whole and holds(printed, each), "for $n=4$, entry $k$ keeps its value from step $k-1$ on")
