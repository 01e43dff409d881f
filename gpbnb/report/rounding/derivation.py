"""Derive the algebra of hung1984, ch. II, sections 3-9, again; for general n by induction.

The documents drop every product of two rounding errors. A bound for general n is proved from its
recurrence: one more operation multiplies the earlier result by 1 + ε and adds its own operand.
"""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Step, errors, first_order

BETA = sp.Symbol("beta", positive=True)
N, M, J, K = sp.symbols("n m j k", integer=True, positive=True)

Errors = tuple[sp.Symbol, ...]


def one_rounding() -> tuple[Step, ...]:
    """Derive the unit roundoffs (8) and (13) from (2), and the sharper bound for rounding to nearest.

    With x = (u + v/b^t) b^e, the relative error is largest where u is smallest, at u = 1/b. There,
    rounding drops v < 1/2 or adds 1 - v <= 1/2, and chopping drops v < 1.
    """
    b, t = sp.symbols("b t", integer=True, positive=True)
    e = sp.Symbol("e", integer=True)
    unit = b ** (1 - t) / 2
    smallest, half = b ** (e - 1), b ** (e - t) / 2
    return (
        Step("(8): bound (5) divided by the smallest $|x|$ of (6)", half / smallest, unit),
        Step("(13): the same for chopping", 2 * half / smallest, b ** (1 - t)),
        Step("(14): chopping doubles the unit roundoff, in any base", b ** (1 - t) / unit, sp.Integer(2)),
        Step(
            "sharper than (8): an error of $b^{e-t}/2$ needs $|x| \\ge b^{e-1} + b^{e-t}/2$",
            half / (smallest + half),
            unit / (1 + unit),
        ),
    )


def sum_error(n: int) -> tuple[sp.Expr, Errors, Errors]:
    """Return the first-order error of the sum of n terms, the terms, and the errors of the additions."""
    x, eps = sp.symbols(f"x_1:{n + 1}"), errors(n - 1)
    total: sp.Expr = x[0]
    for term, e in zip(x[1:], eps, strict=True):
        total = (total + term) * (1 + e)
    return first_order(total, eps), x, eps


def sums() -> tuple[Step, ...]:
    """Derive the bounds for a sum of n terms, by induction over n."""
    error, x, eps = sum_error(4)
    printed = sum(x) * sum(eps) - x[2] * eps[0] - x[3] * (eps[0] + eps[1])
    first, later = N - 1, N + 1 - J
    return (
        Step("four terms, as printed before (18)", error, printed),
        Step("weight of $x_1$: one more term, one more rounding", first.subs(N, N + 1), first + 1),
        Step("weight of $x_j$, $j\\ge2$: the same", later.subs(N, N + 1), later + 1),
        Step("weight of the new term $x_{n+1}$", later.subs({N: N + 1, J: N + 1}, simultaneous=True), sp.Integer(1)),
        Step("(18), first inequality: the difference between the weight of $x_j$ and $n-1$", first - later, J - 2),
        Step("(18), second inequality: the sum of the weights", sp.Sum(J - 2, (J, 3, N)), (N - 1) * (N - 2) / 2),
    )


def quotient_error(n: int, m: int) -> tuple[sp.Expr, Errors]:
    """Return the first-order relative error of (19), and the errors of the operations in it."""
    eps = (*errors(n - 1), *errors(m, "eta"))
    return first_order(sp.Mul(*(1 + e for e in eps)), eps), eps


def dot_error(n: int) -> tuple[sp.Expr, list[sp.Expr], Errors]:
    """Return the first-order error of an inner product, the products a_j b_j, and the rounding errors.

    The errors are numbered as in section 9.1. ε_1 and ε_2 come from the first two products, ε_3 from their sum, ε_4
    from the third product, ε_5 from its addition, and so on.
    """
    products = [p * q for p, q in zip(sp.symbols(f"a_1:{n + 1}"), sp.symbols(f"b_1:{n + 1}"), strict=True)]
    eps = errors(2 * n - 1)
    total = products[0] * (1 + eps[0])
    for j in range(1, n):
        total = (total + products[j] * (1 + eps[2 * j - 1])) * (1 + eps[2 * j])
    return first_order(total, eps), products, eps


def dots() -> tuple[Step, ...]:
    """Derive the weights of an inner product of n terms: those of a sum, plus one for the product itself."""
    error, products, (e1, e2, e3, e4, e5) = dot_error(3)
    printed = products[0] * (e1 + e3 + e5) + products[1] * (e2 + e3 + e5) + products[2] * (e4 + e5)
    later = N + 2 - J
    return (
        Step("three products, as printed before (26)", error, printed),
        Step("(26), weight of $a_j b_j$, $j \\ge 2$: the weight in a sum, plus one", later, (N + 1 - J) + 1),
        Step("no weight is above $n$, written with $j = k + 1$", N, later.subs(J, K + 1), K - 1),
    )


def chains() -> tuple[Step, ...]:
    r"""Derive the norm of the error of a chain, relative to :math:`\prod\|M_j\|`, by induction.

    Step i multiplies the error so far by M_{i+1} and adds the error of this product, which is at most
    d_i β times the norm of the computed product.
    """
    d, before = sp.symbols("d s", positive=True)
    so_far = BETA * before
    return (
        Step(
            "(32): the error $\\beta s$, $s = d_1 + \\dots + d_{i-1}$, becomes $\\beta(s + d_i)$ to first order",
            so_far + d * BETA * (1 + so_far),
            BETA * (before + d) + before * d * BETA**2,
        ),
    )


def chain_shortcut() -> sp.Expr:
    """Subtract the error that (30) allows, ε' times the product, from the error of a row times a column of two entries.

    The difference is zero for all a, b only if both products have the same error, so (30) is not an identity.
    """
    error, products, _ = dot_error(2)
    return sp.factor(sp.expand(error - sp.Symbol(r"{\epsilon'}") * sum(products)))
