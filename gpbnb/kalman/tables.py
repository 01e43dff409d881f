"""Tables of the chapter on the Kalman bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from gpbnb.formats import FloatFormat
from gpbnb.kalman import smallest, theory
from gpbnb.tables import Table, digits

DOUBLE = FloatFormat(2, 53)


def example(k: int, n: int, m: int) -> Table:
    """The closing example for (125), printed and mended: coefficients, β, digits, and what IEEE double makes of it."""
    body = []
    for name, faults in theory.MENDINGS.items():
        counts = theory.coefficients(k, n, m, **faults)
        cells = [name]
        for coefficient in counts:
            cells += [
                scientific(coefficient, 5),
                scientific(Fraction(1, coefficient), 4),
                str(theory.required_precision(coefficient)),
            ]
        body.append((*cells, scientific(counts.second * DOUBLE.unit_roundoff, 2)))
    header = ("(125)", "$a$", "$\\beta = 1/a$", "digits", "$b$", "$\\beta = 1/b$", "digits", "$b\\beta$, IEEE double")
    return Table(f"the closing example, {len(body)} ways", header, tuple(body))


def slips(k: int, n: int, m: int) -> Table:
    """Each printed number of the closing example, what the printed formula gives, and what gives the printed number."""
    first, second = theory.coefficients(k, n, m)
    printed = theory.PRINTED
    wrong = theory.one_figure_slips(k, n, m, printed["first coefficient"])
    loops = sorted({a * n + b * m + c for a, b, c in wrong})
    ways = " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in wrong)
    products = [loop for loop in loops if theory.prints_as(theory.read_as_product(k, n, m, loop), printed[_SECOND])]
    values: list[tuple[str, str, str]] = [
        ("first coefficient", scientific(first, 5), f"{', '.join(map(str, loops))} times $k$, as by {ways}"),
        (
            "second coefficient",
            scientific(second, 5),
            f"with {', '.join(map(str, products))}, and times for plus: $k(3n+1)\\cdot0.5(k-1)\\cdot{products[0]}$"
            if products
            else "not found",
        ),
    ]
    for name, coefficient in (("first", first), ("second", second)):
        given = Fraction(printed[f"{name} coefficient"])
        beta = Fraction(printed[f"{name} beta"])
        follows = theory.prints_as(1 / given, printed[f"{name} beta"])
        values.append(
            (f"{name} beta", scientific(Fraction(1, coefficient), 4), _yes(follows, "one over the printed coefficient"))
        )
        exact_digits = 1 - math.log10(2 * float(beta))
        needed = theory.required_precision(1 / beta)
        values.append(
            (
                f"{name} digits",
                str(theory.required_precision(coefficient)),
                f"the printed β is that of {exact_digits:.2f} digits; it needs {needed}",
            )
        )
    body = tuple((name, f"${_typeset(printed[name])}$", value, why) for name, value, why in values)
    return Table("the printed numbers of the closing example", ("number", "printed", "formula", "what gives it"), body)


_SECOND = "second coefficient"


def goals(k: int, n: int, m: int, goal: Fraction, size: Fraction) -> Table:
    """Digits that each coefficient asks for an error of all of `size`, as in the example, and for one of `goal`.

    Parameters
    ----------
    k, n, m : of the example. goal, size : the error that is wanted and what it is an error of, in the same units.
    """
    body = []
    for name, coefficient in zip(("first", "second"), theory.coefficients(k, n, m), strict=True):
        for granted in (Fraction(1), Fraction(goal) / Fraction(size)):
            body.append(
                (
                    f"{name} term",
                    scientific(granted, 2),
                    scientific(granted * Fraction(size), 2),
                    str(theory.required_precision(coefficient, granted)),
                    str(theory.required_precision(coefficient, granted, base=2)),
                )
            )
    header = ("dominates", "error granted, relative", "in mas", "decimal digits", "bits")
    return Table("what an error of one grants", header, tuple(body))


def violations(fmts: Sequence[FloatFormat]) -> Table:
    """The scalar filter that breaks all three bounds: error over bound in several formats, both forms of (99)."""
    body = []
    for fmt in fmts:
        for name, second in (("first", False), ("second", True)):
            found = smallest.ratios(fmt, smallest.scalar(fmt), second)
            chopped = ", chopped" if fmt.rounding.value == "chop" else ""
            body.append((f"{digits(fmt)}{chopped}", name, *(f"{ratio:.3g}" for ratio in found)))
    return Table(
        f"{len(body)} runs of the smallest filter",
        ("arithmetic", "form of (99)", "error / (105)", "error / (108)", "error / (125)"),
        tuple(body),
    )


def order() -> Table:
    """In which order the four equations can be computed."""
    body = []
    for name, second in (("first", False), ("second", True)):
        found = theory.order(second)
        body.append((name, " → ".join(found) if found else "none: (99) waits for (101), and (101) for (99)"))
    return Table("the order of (98)-(101)", ("form of (99)", "order"), tuple(body))


def scientific(value: Fraction | int, figures: int) -> str:
    r"""A number as ``$2.5860\\times10^{8}$``."""
    mantissa, _, power = f"{float(value):.{figures - 1}e}".partition("e")
    return f"${mantissa}\\times10^{{{int(power)}}}$" if int(power) else f"${mantissa}$"


def _typeset(printed: str) -> str:
    mantissa, _, power = printed.partition("e")
    return rf"{mantissa}\times10^{{{power}}}" if power else mantissa


def _yes(holds: bool, what: str) -> str:
    return what if holds else f"not {what}"
