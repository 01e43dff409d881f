"""Tables of the chapter on why (125) fails."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from gpbnb.arithmetic.formats import FloatFormat, prints_as
from gpbnb.arithmetic.named import arithmetic
from gpbnb.report.display.tables import Table, scientific, short
from gpbnb.report.kalman import report_bounds, smallest
from gpbnb.report.kalman.ensembles import Summary
from gpbnb.report.kalman.independent import FirstStep, ModelShare

DOUBLE = FloatFormat(2, 53)


def example(k: int, n: int, m: int) -> Table:
    """Tabulate the closing example for (125), printed and corrected: coefficients, β, digits, error in IEEE double."""
    body = []
    for name, faults in report_bounds.CORRECTIONS.items():
        for term, coefficient in zip(("first", "second"), report_bounds.coefficients(k, n, m, **faults), strict=True):
            body.append(
                (
                    name,
                    term,
                    scientific(coefficient, 5),
                    scientific(Fraction(1, coefficient), 4),
                    str(report_bounds.precision_for_coefficient(coefficient)),
                    scientific(coefficient * DOUBLE.unit_roundoff, 2),
                )
            )
    header = ("(125)", "term", "coefficient", "$\\beta$ = 1 / coefficient", "decimal digits", "error in IEEE double")
    return Table(f"the closing example, {len(report_bounds.CORRECTIONS)} ways", header, tuple(body))


def misprints(k: int, n: int, m: int) -> Table:
    """Tabulate each printed number of the closing example, the value by the formula, and the likely origin."""
    first, second = report_bounds.coefficients(k, n, m)
    printed = report_bounds.PRINTED
    wrong = report_bounds.one_digit_misprints(k, n, m, printed["first coefficient"])
    loops = sorted({a * n + b * m + c for a, b, c in wrong})
    ways = " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in wrong)
    products = [loop for loop in loops if prints_as(report_bounds.read_as_product(k, n, m, loop), printed[_SECOND])]
    values: list[tuple[str, str, str]] = [
        (
            "first coefficient",
            scientific(first, 5),
            f"{', '.join(map(str, loops))} times $k$, from a factor {ways}",
        ),
        (
            "second coefficient",
            scientific(second, 5),
            f"{', '.join(map(str, products))} as above, and × in place of +: $k(3n+1)\\cdot0.5(k-1)\\cdot{products[0]}$"
            if products
            else "not found",
        ),
    ]
    for name, coefficient in (("first", first), ("second", second)):
        given = Fraction(printed[f"{name} coefficient"])
        beta = Fraction(printed[f"{name} beta"])
        follows = prints_as(1 / given, printed[f"{name} beta"])
        values.append(
            (
                f"{name} beta",
                scientific(Fraction(1, coefficient), 4),
                _yes(follows, "1 divided by the printed coefficient"),
            )
        )
        exact_digits = 1 - math.log10(2 * float(beta))
        needed = report_bounds.precision_for_coefficient(1 / beta)
        values.append(
            (
                f"{name} digits",
                str(report_bounds.precision_for_coefficient(coefficient)),
                f"the printed β corresponds to {exact_digits:.2f} digits, so {needed} are needed",
            )
        )
    body = tuple((name, f"${_typeset(printed[name])}$", value, why) for name, value, why in values)
    header = ("number", "printed", "formula", "explanation")
    return Table("the printed numbers of the closing example", header, body, quoted=("printed", "formula"))


_SECOND = "second coefficient"


def tolerances(k: int, n: int, m: int, tolerance: Fraction | int, size: Fraction | int) -> Table:
    """Tabulate digits that each coefficient requires for an error of `size`, as in the example, and `tolerance`.

    Parameters
    ----------
    k, n, m : values of the example.
    tolerance, size : allowed error, and size of the quantity, in the same units.
    """
    body = []
    for name, coefficient in zip(("first", "second"), report_bounds.coefficients(k, n, m), strict=True):
        for allowed in (Fraction(1), Fraction(tolerance) / Fraction(size)):
            body.append(
                (
                    name,
                    scientific(allowed, 2),
                    scientific(allowed * Fraction(size), 2),
                    str(report_bounds.precision_for_coefficient(coefficient, allowed)),
                    str(report_bounds.precision_for_coefficient(coefficient, allowed, base=2)),
                )
            )
    header = ("dominant term", "allowed error, relative", "allowed error (mas)", "decimal digits", "bits")
    return Table("digits for an error of 1 and for the tolerance", header, tuple(body))


def violations(fmts: Sequence[FloatFormat]) -> Table:
    """Tabulate error / bound for the scalar filter that violates all bounds, by format and form of (99)."""
    body = []
    for fmt in fmts:
        for name, second in (("first", False), ("second", True)):
            found = smallest.ratios(fmt, smallest.scalar(fmt), second)
            body.append((arithmetic(fmt), name, *(short(ratio, 3) for ratio in found)))
    return Table(
        f"{len(body)} runs of the smallest filter",
        ("arithmetic", "form of (99)", "error / (105)", "error / (108)", "error / (125)"),
        tuple(body),
    )


def order() -> Table:
    """Tabulate the order in which the four equations can be computed."""
    body = []
    for name, second in (("first", False), ("second", True)):
        found = report_bounds.order(second)
        body.append(
            (name, " → ".join(found) if found else "none: (99) needs the result of (101), and (101) that of (99)")
        )
    return Table("the order of (98)-(101)", ("form of (99)", "order"), tuple(body))


def largest_violating_noise(fmts: Sequence[FloatFormat]) -> Table:
    """Tabulate the largest R, for a variance of 1, with which the scalar filter violates each bound."""
    body = []
    for fmt in fmts:
        for name, second in (("first", False), ("second", True)):
            found = smallest.largest_violating_noise(fmt, second)
            cells = (f"{float(found[each]):.3g}" if each in found else "none" for each in smallest.Ratios._fields)
            body.append((arithmetic(fmt), name, *cells))
    header = ("arithmetic", "form of (99)", "$R$ for (105)", "$R$ for (108)", "$R$ for (125)")
    return Table(f"the largest noise that breaks a bound, {len(body)} ways", header, tuple(body))


def trials(found: Sequence[Summary]) -> Table:
    """Tabulate, for each kind of random filters and for all, the violations and the largest error / bound."""
    body = []
    kinds = list(dict.fromkeys(each.kind for each in found))
    for name, group in [(kind, [each for each in found if each.kind == kind]) for kind in kinds] + [
        ("all", list(found))
    ]:
        count = sum(each.trials for each in group)
        cells = []
        for bound in ("105", "108", "125"):
            violated = sum(getattr(each, f"violations_{bound}") for each in group)
            largest = max(getattr(each, f"worst_{bound}") for each in group)
            cells += [f"{100 * violated / count:.1f} %", short(largest)]
        largest = max(max(each.state, each.gain, each.covariance) for each in group)
        violated = sum(each.contraction_violations for each in group)
        compared = sum(each.compared for each in group)
        logarithm = sum(each.compared * math.log(each.typical) for each in group if each.compared)
        typical = short(math.exp(-logarithm / compared)) if compared else ""
        body.append((name, str(count), *cells, str(violated), f"{largest:.3f}", typical))
    header = (
        "models",
        "runs",
        *(f"({bound}) {what}" for bound in (105, 108, 125) for what in ("violated", "largest error / bound")),
        "contraction bound violated",
        "contraction bound, largest error / bound",
        "contraction bound / error, typical",
    )
    return Table(f"{sum(each.trials for each in found)} random filters", header, tuple(body))


def _typeset(printed: str) -> str:
    mantissa, _, power = printed.partition("e")
    return rf"{mantissa}\times10^{{{power}}}" if power else mantissa


def _yes(holds: bool, what: str) -> str:
    return what if holds else f"not {what}"


def first_steps(found: Sequence[FirstStep]) -> Table:
    """Tabulate models that exceed (105) in their first step, by kind, with the 95 % limits of the probability."""
    rows = [(each.kind, str(each.models), str(each.exceeded), f"{each.low:.2f} to {each.high:.2f}") for each in found]
    return Table(
        "models that exceed (105) in their first step",
        ("kind", "models", "models that exceed (105)", "probability"),
        tuple(rows),
    )


def shares_by_form(found: Sequence[ModelShare]) -> Table:
    """Tabulate the mean share of formats in which random models exceed a bound, with its 95 % interval by model."""
    rows = [
        (
            str(each.form),
            f"({each.bound})",
            str(each.models),
            f"{100 * each.share:.0f} %",
            f"{100 * each.low:.0f} to {100 * each.high:.0f} %",
        )
        for each in found
    ]
    head = ("form", "bound", "models", "mean share of formats", "95 % interval by model")
    return Table("random models that exceed a bound", head, tuple(rows))
