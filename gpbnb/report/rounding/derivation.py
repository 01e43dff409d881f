"""Derive the algebra of hung1984, ch. II, sections 3-9, again; for general n by induction.

The documents drop every product of two rounding errors. A bound for general n is proved from its
recurrence: one more operation multiplies the earlier result by 1 + ε and adds its own operand.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step, errors, first_order, over, together, unevaluated

BETA = sp.Symbol("beta", positive=True)
N, M, J, K = sp.symbols("n m j k", integer=True, positive=True)


# -- one rounding, (4)-(14) -----------------------------------------------------------------------


def one_rounding() -> Derivation:
    """Derive the unit roundoffs (8) and (13) from (2), and the sharper bound for rounding to nearest.

    With x = (u + v/b^t) b^e, the relative error is largest where u is smallest, at u = 1/b. There,
    rounding drops v < 1/2 or adds 1 - v <= 1/2, and chopping drops v < 1.
    """
    b = sp.Symbol("b", integer=True, positive=True)
    t = sp.Symbol("t", integer=True, positive=True)
    e = sp.Symbol("e", integer=True)
    unit = b ** (1 - t) / 2
    smallest = b ** (e - 1)
    half = b ** (e - t) / 2
    return Derivation(
        (
            Step("(8): bound (5) divided by the smallest $|x|$ of (6)", over(half, smallest), unit),
            Step("(13): the same for chopping", over(b ** (e - t), smallest), b ** (1 - t)),
            Step("(14): chopping doubles the unit roundoff, in any base", over(b ** (1 - t), unit), sp.Integer(2)),
            Step(
                "sharper than (8): an error of $b^{e-t}/2$ needs $|x| \\ge b^{e-1} + b^{e-t}/2$",
                over(half, smallest + half),
                over(unit, 1 + unit),
            ),
        )
    )


# -- sums, (17)-(18) ------------------------------------------------------------------------------


def rounded_sum(n: int) -> tuple[sp.Expr, tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
    """Return the computed sum of n terms with an error in each addition, the terms, and the errors."""
    x, eps = sp.symbols(f"x_1:{n + 1}"), errors(n - 1)
    total: sp.Expr = x[0]
    for term, e in zip(x[1:], eps, strict=True):
        total = (total + term) * (1 + e)
    return total, x, eps


def sum_error(n: int) -> tuple[sp.Expr, tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
    """Return the first-order error of the sum of n terms; see :func:`rounded_sum`."""
    total, x, eps = rounded_sum(n)
    return first_order(total, eps), x, eps


def printed_sum_error(n: int) -> sp.Expr:
    r"""The form behind (18): :math:`s\sum\epsilon_i - \sum_{j\ge3} x_j(\epsilon_1+\dots+\epsilon_{j-2})`."""
    _, x, eps = rounded_sum(n)
    tail = sum((x[j - 1] * sum(eps[: j - 2]) for j in range(3, n + 1)), start=sp.Integer(0))
    return sum(x) * sum(eps) - tail


def sums() -> Derivation:
    """Derive the bounds for a sum of n terms, by induction over n."""
    first, later = N - 1, N + 1 - J
    return Derivation(
        (
            Step("four terms, as printed before (18)", sum_error(4)[0], printed_sum_error(4)),
            Step(
                "weight of $x_1$: one more term, one more rounding",
                first.subs(N, N + 1),
                together(first, 1),
            ),
            Step(
                "weight of $x_j$, $j\\ge2$: the same",
                later.subs(N, N + 1),
                together(later, 1),
            ),
            Step(
                "weight of the new term $x_{n+1}$",
                together(later.subs(N, N + 1) + J, sp.Mul(-1, N + 1, evaluate=False)),
                sp.Integer(1),
            ),
            Step(
                "(18), first inequality: the difference between the weight of $x_j$ and $n-1$",
                first,
                together(later, J - 2),
            ),
            Step(
                "(18), second inequality: the sum of the weights",
                sp.Sum(J - 2, (J, 3, N)),
                (N - 1) * (N - 2) / 2,
            ),
        )
    )


# -- products, (19)-(20), and roundings on top of each other --------------------------------------


def product_operations() -> sp.Expr:
    """Derive the number of roundings for n factors over m divisors, each divided by separately: n + m - 1."""
    return sp.expand((N - 1) + M)


def quotient_error(n: int, m: int) -> tuple[sp.Expr, tuple[sp.Symbol, ...]]:
    """Return the first-order relative error of (19), and the errors of the operations in it."""
    eps, eta = errors(n - 1), errors(m, "eta")
    factor = sp.Mul(*(1 + e for e in (*eps, *eta)))
    return first_order(factor, (*eps, *eta)), (*eps, *eta)


# -- matrix sums, (23)-(25) -----------------------------------------------------------------------


# -- inner products and matrix products, (26)-(28) ------------------------------------------------


def dot_error(n: int) -> tuple[sp.Expr, list[sp.Expr], tuple[sp.Symbol, ...]]:
    """Return the first-order error of an inner product, the products a_j b_j, and the rounding errors.

    The errors are numbered as in section 9.1. ε_1 and ε_2 come from the first two products, ε_3 from their sum, ε_4
    from the third product, ε_5 from its addition, and so on.
    """
    a, b = sp.symbols(f"a_1:{n + 1}"), sp.symbols(f"b_1:{n + 1}")
    products = [p * q for p, q in zip(a, b, strict=True)]
    eps = errors(2 * n - 1)
    total = products[0] * (1 + eps[0])
    for j in range(1, n):
        total = (total + products[j] * (1 + eps[2 * j - 1])) * (1 + eps[2 * j])
    return first_order(total, eps), products, eps


def roundings_of(error: sp.Expr, term: sp.Expr, eps: Sequence[sp.Symbol]) -> int:
    """Count how many of the errors `eps` multiply `term` in a first-order error."""
    coefficient = (
        sp.expand(error).coeff(term)
        if term.is_Symbol
        else sp.Poly(error, *sorted(term.free_symbols, key=str)).coeff_monomial(term)
    )
    return sum(1 for e in eps if sp.expand(coefficient).coeff(e) == 1)


def dots() -> Derivation:
    """Derive the weights of an inner product of n terms: those of a sum, plus one for the product itself."""
    error, products, eps = dot_error(3)
    e1, e2, e3, e4, e5 = eps
    printed = products[0] * (e1 + e3 + e5) + products[1] * (e2 + e3 + e5) + products[2] * (e4 + e5)
    return Derivation(
        (
            Step("three products, as printed before (26)", error, printed),
            Step("(26), weight of $a_1 b_1$: the weight in a sum, plus one", N, together(N - 1, 1)),
            Step("(26), weight of $a_j b_j$, $j \\ge 2$: the same", N + 2 - J, together(N + 1 - J, 1)),
            Step(
                "no weight is above $n$, written with $j = k + 1$",
                N,
                (N + 2 - J).subs(J, K + 1),
                K - 1,
            ),
        )
    )


# -- chains, (29)-(32), and the two examples ------------------------------------------------------


def chains() -> Derivation:
    r"""Derive the norm of the error of a chain, relative to :math:`\prod\|M_j\|`, by induction.

    Step i multiplies the error so far by M_{i+1} and adds the error of this product, which is at most
    d_i β times the norm of the computed product.
    """
    d, before = sp.symbols("d s", positive=True)
    so_far = unevaluated(BETA * before)
    return Derivation(
        (
            Step(
                "(32): the error $\\beta s$, $s = d_1 + \\dots + d_{i-1}$, becomes $\\beta(s + d_i)$ to first order",
                so_far + d * BETA * (1 + so_far),
                BETA * (before + d) + before * d * BETA**2,
            ),
        )
    )


def chain_shortcut() -> sp.Expr:
    """Subtract the error that (30) allows, ε' times the product, from the error of a row times a column of two entries.

    The difference is zero for all a, b only if both products have the same error, so (30) is not an identity.
    """
    error, products, _ = dot_error(2)
    shared = sp.Symbol(r"{\epsilon'}")
    return sp.factor(sp.expand(error - shared * sum(products)))
