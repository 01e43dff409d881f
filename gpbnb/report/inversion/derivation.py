"""Derive the algebra of hung1984, ch. II, sections 10-11, again: for 3 × 3 as printed, and for every n.

Matrices are symbols that do not commute, so a step holds for every n. Where entries matter, a step concerns the entry
(i, j) of any matrix, and sums over the stages of elimination follow by induction.
"""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step, errors, first_order, over, together, unevaluated

EPSILON = sp.Symbol("epsilon")
N, J, K = sp.symbols("n j k", integer=True, positive=True)

#: Symbols of the matrices A, its change Δ, L, A_T, the changes in (91) and (92), and the columns u, x, r and h.
A, DELTA, L, A_T = sp.symbols(r"A \Delta L A_T", commutative=False)
A_TILDE, DELTA_A, B_TILDE, DELTA_B = sp.symbols(r"\tilde{A} {\Delta\!A} \tilde{b} {\Delta\!b}", commutative=False)
X_HAT, X, H_HAT, H, ERROR, B, D_X = sp.symbols(r"\hat{x} x \hat{h} h E b {\Delta\!x}", commutative=False)


def minus(expression: sp.Expr) -> sp.Expr:
    """Negate an expression without expanding it."""
    return sp.Mul(-1, expression, evaluate=False)


# -- first approach, (33)-(44) --------------------------------------------------------------------


def first_approach() -> Derivation:
    r"""Derive the error of a solution from its residual, (34)-(42); u = A h by (33)."""
    residual = A * H_HAT - A * H
    changed = (A + DELTA) * H_HAT - A * H
    inverse = A**-1
    matrix_residual = (A + DELTA) * (inverse + ERROR) - 1
    return Derivation(
        (
            Step("(35), from $r = A\\hat h - u$ and $u = Ah$", inverse * unevaluated(residual), H_HAT - H),
            Step(
                "(38): the same for all columns; the $\\hat h_j$ are the columns of $A^{-1}+E$",
                inverse * unevaluated(A * ERROR),
                ERROR,
            ),
            Step(
                "(42), from $r = (A+\\Delta)\\hat h - u$",
                inverse * unevaluated(changed) - inverse * DELTA * H_HAT,
                H_HAT - H,
            ),
            Step(
                "before (43), from $R = (A+\\Delta)(A^{-1}+E) - I$: exact with the computed inverse $A^{-1}+E$",
                inverse * unevaluated(matrix_residual) - inverse * DELTA * unevaluated(inverse + ERROR),
                ERROR,
            ),
            Step(
                "what $\\approx$ drops, of second order",
                inverse * DELTA * unevaluated(inverse + ERROR) - inverse * DELTA * inverse,
                inverse * DELTA * ERROR,
            ),
        )
    )


def first_approach_norms() -> Derivation:
    r"""Derive the norms of (39)-(44) and their strict forms.

    Let a = ‖A⁻¹‖, ρ = ‖R‖, d = ‖Δ‖, e = ‖E‖, and x = ‖X‖ for the computed inverse X. A norm e with
    e ≤ f + q e and q < 1 is at most the solution of e = f + q e.
    """
    a, rho, d, x = sp.symbols("a rho d x", positive=True)
    printed = a * rho + a**2 * d
    strict = printed / (1 - a * d)
    posterior = x * rho / (1 - rho)
    return Derivation(
        (
            Step("(44): (43) divided by $a$", over(printed, a), rho + a * d),
            Step(
                "(43) to every order: $e = a\\rho + a d\\,(a + e)$ has this solution",
                together(a * rho, a * d * (a + strict)),
                strict,
            ),
            Step(
                "from the computed inverse alone: $e = (x + e)\\,\\rho$, since $E = A^{-1}R$ and $a \\le x + e$",
                unevaluated(x + posterior) * rho,
                posterior,
            ),
        )
    )


# -- one step of the triangularization, (46)-(52) -------------------------------------------------


class Entry(NamedTuple):
    """An entry before and after an elimination step, the exact product that is subtracted, and three errors."""

    old: sp.Symbol
    new: sp.Symbol
    product: sp.Expr
    errors: tuple[sp.Symbol, ...]
    computed: sp.Expr


def entry() -> Entry:
    r"""Carry one entry through one step: division, multiplication and subtraction, each with its own error.

    The result is :math:`\bigl(a(0) - p\,(1+\epsilon_1)(1+\epsilon_2)\bigr)(1+\epsilon_3)` with :math:`p = a(0) - a(1)`.
    """
    old, new = sp.symbols("a(0) a(1)")
    eps = errors(3)
    product = old - new
    return Entry(old, new, product, eps, (old - product * (1 + eps[0]) * (1 + eps[1])) * (1 + eps[2]))


def entry_error() -> sp.Expr:
    """Return the first-order error of :func:`entry`; each rounding error can have either sign."""
    found = entry()
    return first_order(found.computed, found.errors)


def printed_entry_error() -> sp.Expr:
    r"""Return the form of (47), :math:`3\epsilon\,a(1) - 2\epsilon\,a(0)`, with one ε for all three roundings."""
    found = entry()
    return 3 * EPSILON * found.new - 2 * EPSILON * found.old


def one_step() -> Derivation:
    """Derive the error of one elimination step: as printed, with an error for each rounding, and its bounds."""
    old, new, product, (e1, e2, e3), _ = entry()
    p, w, size = sp.symbols("p w u", nonnegative=True)
    done, exact = sp.symbols(r"\hat{a} p")
    before = done / (1 + e3) + exact * (1 + e1) * (1 + e2)  # a(0), from computed values
    return Derivation(
        (
            Step(
                "(47) with one $\\epsilon$ for all, as printed",
                together(old * (1 + EPSILON), minus(unevaluated(product) * (1 + 3 * EPSILON))),
                new + 3 * EPSILON * new - 2 * EPSILON * old,
            ),
            Step(
                "the same with a separate error for each rounding",
                entry_error(),
                together(new * unevaluated(e1 + e2 + e3), minus(old * unevaluated(e1 + e2))),
            ),
            Step(
                "where $3a(1) = 2a(0)$, (47) is zero and the error is not",
                entry_error().subs({old: 3 * new / 2}),
                over(new * (2 * e3 - e1 - e2), sp.Integer(2)),
            ),
            Step(
                "its bound $|a(1)| + 2|p|$ is at most that of (61): let $|p| = |a(0)| + |a(1)| - w$, $w\\ge0$",
                3 * size + 2 * unevaluated(p + w - size),
                size + 2 * p,
                2 * w,
            ),
            Step(
                "to every order, $a(0)$ written with the computed $\\hat a(1)$: its error",
                together(done, minus(before - exact)),
                together(over(done * e3, 1 + e3), minus(exact * unevaluated((1 + e1) * (1 + e2) - 1))),
            ),
        )
    )


# -- all steps, (53)-(64): a change of A ----------------------------------------------------------


def reductions() -> Derivation:
    r"""Show by induction that the errors of all steps, (59), add up to a change of the given matrix.

    :math:`l_{ik} = \hat a_{ik}(k-1)/\hat a_{kk}(k-1)` is not rounded, and ã_ij(k) is the error that step k adds to
    :math:`\hat a_{ij}(k-1) - l_{ik}\hat a_{kj}(k-1)`. Then :math:`s(r) = \sum_{k\le r} l_{ik}\hat a_{kj}(k-1)`.
    """
    a, change = sp.Function(r"\hat{a}"), sp.Function(r"\tilde{a}")
    total, r = sp.Function(r"\tilde{s}"), sp.Symbol("r", integer=True, nonnegative=True)
    row, column, product = sp.symbols(r"\hat{a}_{ij}(k-1) \hat{a}_{ij}(k) l_{ik}\hat{a}_{kj}(k-1)")
    so_far = a(0) - a(r) + total(r)
    return Derivation(
        (
            Step(
                "one step; in brackets its $\\tilde a_{ij}(k)$",
                together(row, -column, unevaluated(column - row + product)),
                product,
            ),
            Step(
                "$s(r) = a(0) - \\hat a(r) + \\tilde s(r)$ with $\\tilde s(r) = \\tilde a(1)+\\dots+\\tilde a(r)$, "
                "from $r$ to $r+1$",
                together(unevaluated(so_far), unevaluated(a(r) - a(r + 1) + change(r + 1))),
                together(a(0) - a(r + 1), unevaluated(total(r) + change(r + 1))),
            ),
            Step(
                "entry $(i,j)$ of $L\\hat A_T$: the last product, of $r = \\min(i,j)-1$, is $\\hat a_{ij}(r)$ itself",
                together(unevaluated(so_far), a(r)),
                a(0) + total(r),
            ),
        )
    )


class Stages(NamedTuple):
    """Elimination with free symbols for computed entries: L, A_T, A and the sum of the changes, each (n, n)."""

    lower: sp.Matrix
    upper: sp.Matrix
    given: sp.Matrix
    change: sp.Matrix


def stages(n: int) -> Stages:
    r"""Eliminate an n × n matrix in n - 1 steps, with a separate symbol for each entry of each stage.

    The change in step k is its error, the difference from the exact step; (53) sums these changes over k.
    """
    given = sp.Matrix(n, n, lambda i, j: sp.Symbol(f"a_{i + 1}{j + 1}"))
    lower, change, now = sp.eye(n), sp.zeros(n, n), given
    for k in range(1, n):
        quotients = [now[i, k - 1] / now[k - 1, k - 1] if i >= k else sp.Integer(0) for i in range(n)]
        exact = sp.Matrix(n, n, lambda i, j, now=now, q=quotients, k=k: now[i, j] - q[i] * now[k - 1, j])
        computed = sp.Matrix(
            n,
            n,
            lambda i, j, now=now, k=k: (
                now[i, j] if i < k else sp.Integer(0) if j < k else sp.Symbol(rf"\hat{{a}}_{{{i + 1}{j + 1}}}({k})")
            ),
        )
        for i in range(k, n):
            lower[i, k - 1] = quotients[i]
        change += computed - exact
        now = computed
    return Stages(lower, now, given, change.applyfunc(sp.simplify))


# -- the two systems, (65)-(68) and (91)-(97) -----------------------------------------------------


def perturbed_system() -> Derivation:
    r"""Derive the error of the solution of a perturbed system, (67)-(68).

    A x = b; (A + Δ) x̂ = b + Δb; Δx = x̂ - x.
    """
    hat = A + DELTA
    solved = X + D_X
    change = hat * solved - A * X  # Δb
    return Derivation(
        (
            Step(
                "(68), exact with $A^{-1}$ and the computed solution",
                A**-1 * together(unevaluated(change), minus(DELTA * solved)),
                D_X,
            ),
            Step(
                "(68), exact with $\\hat A^{-1} = (A+\\Delta)^{-1}$ and the true solution, cleared of the inverse",
                together(unevaluated(change), minus(DELTA * X)),
                hat * D_X,
            ),
            Step(
                "(68) as printed, with $\\hat A^{-1}$ and the computed solution, lacks "
                "$\\hat A^{-1}\\Delta\\,\\Delta x$, of second order",
                together(unevaluated(change), minus(DELTA * solved)),
                together(hat * D_X, minus(DELTA * D_X)),
            ),
        )
    )


def two_systems() -> Derivation:
    r"""Show that (91) and (92) add changes of two systems: Ã, b̃ of the given one, and ΔA, Δb of the triangular one.

    In :math:`L A_T = A + \tilde A` and :math:`L b_T = b + \tilde b`, all but L is computed. The computed solution
    satisfies :math:`(A_T + \Delta A)\hat x = b_T + \Delta b` exactly.
    """
    upper, right = L**-1 * unevaluated(A + A_TILDE), L**-1 * unevaluated(B + B_TILDE)
    in_a = together(B_TILDE + L * DELTA_B, minus((A_TILDE + L * DELTA_A) * X_HAT))
    in_t = together(L**-1 * B_TILDE + DELTA_B, minus((L**-1 * A_TILDE + DELTA_A) * X_HAT))
    return Derivation(
        (
            Step(
                "(91) corrected: the matrix whose exact solution was computed",
                L * unevaluated(upper + DELTA_A),
                A + A_TILDE + L * DELTA_A,
            ),
            Step("(92) corrected: its right-hand side", L * unevaluated(right + DELTA_B), B + B_TILDE + L * DELTA_B),
            Step(
                "term missing from (91)", together(A_TILDE + L * DELTA_A, minus(A_TILDE + DELTA_A)), (L - 1) * DELTA_A
            ),
            Step(
                "the same as a change of the triangular matrix $L^{-1}A$",
                together(upper, DELTA_A, minus(L**-1 * A)),
                L**-1 * A_TILDE + DELTA_A,
            ),
            Step("either way, (94) is the same", A**-1 * in_a, A**-1 * L * unevaluated(in_t)),
        )
    )


def transfer_cost() -> Derivation:
    r"""Bound the increase that L can cause in the absolute values of (91), at most a factor (n + 3)/2.

    Entry (i, j) of :math:`|L||\Delta A|` has terms :math:`(n-j+3)\beta|l_{ik}\hat a_{kj}|`, and to first order
    :math:`|l_{ik}\hat a_{kj}| = |\hat a_{ij}(k)| + |\hat a_{ij}(k-1)| - w` with w ≥ 0.
    """
    new, old, w = sp.symbols("v u w", nonnegative=True)
    m = sp.Symbol("m", integer=True, nonnegative=True)
    return Derivation(
        (
            Step(
                "each absolute value in (59) bounds two products, $u = |\\hat a(k-1)|$, $v = |\\hat a(k)|$",
                3 * new + 2 * old,
                2 * unevaluated(new + old - w),
                new + 2 * w,
            ),
            Step("the largest weight of (87), where $j = 2 + m$", N + 1, (N - J + 3).subs(J, 2 + m), m),
            Step(
                "so including $L$ increases the bound by at most this factor",
                together(1, over(N + 1, sp.Integer(2))),
                over(N + 3, sp.Integer(2)),
            ),
        )
    )


def inverse_norms() -> Derivation:
    """Derive (96), (97) and their strict form from (95), with x = ‖X‖, c = ‖E‖ and the norm e of the error."""
    x, c = sp.symbols("x c", positive=True)
    strict = x * c / (1 - c)
    return Derivation(
        (
            Step("(97): (96) divided by $x$", over(x * c, x), c),
            Step(
                "(96) to every order: $e = (x + e)\\,c$, since $\\|A^{-1}\\| \\le x + e$, has this solution",
                unevaluated(x + strict) * c,
                strict,
            ),
            Step("term missing from (96), relative to (96)", over(strict - x * c, x * c), c / (1 - c)),
        )
    )


# -- back substitution, (69)-(90) -----------------------------------------------------------------


class BackRow(NamedTuple):
    """One row of back substitution: the computed a_kk x̂_k, its coefficients, and all errors."""

    value: sp.Expr
    right: sp.Symbol
    products: tuple[sp.Expr, ...]
    errors: tuple[sp.Symbol, ...]


def back_row(terms: int) -> BackRow:
    r"""Return the computed a_kk x̂_k of a row with `terms` = n - k entries right of the diagonal, from left to right.

    Each term requires a multiplication and a subtraction; the division comes last. The other x̂ were computed before.
    """
    right = sp.Symbol("b")
    a, x = sp.symbols(f"a_1:{terms + 1}"), sp.symbols(rf"\hat{{x}}_1:{terms + 1}")
    eps = errors(2 * terms + 1)
    value: sp.Expr = right
    for i in range(terms):
        value = (value - a[i] * x[i] * (1 + eps[2 * i])) * (1 + eps[2 * i + 1])
    products = tuple(p * q for p, q in zip(a, x, strict=True))
    return BackRow(value * (1 + eps[-1]), right, products, eps)


def back_row_weights(terms: int) -> tuple[int, tuple[int, ...]]:
    """Count the roundings of the right side and of each product in the expression of :func:`back_row`."""
    row = back_row(terms)
    error = sp.Poly(first_order(row.value, row.errors), *sorted(row.value.free_symbols - set(row.errors), key=str))

    def count(term: sp.Expr) -> int:
        return len([e for e in row.errors if sp.expand(error.coeff_monomial(term)).coeff(e) != 0])

    return count(row.right), tuple(count(product) for product in row.products)


def back_substitution_weights() -> Derivation:
    """Derive the weights (85)-(88) for every n, the numbers of roundings that b_k and a_kj pass through in row k."""
    return Derivation(
        (
            Step("(86): $n-k$ subtractions and the division", together(N - K, 1), N - K + 1),
            Step("(85): product, subtraction, $n-j$ more, and the division", together(1, 1, N - J, 1), N - J + 3),
            Step(
                "one more row and column, the last: each weight grows by one",
                together(N - J + 3, 1),
                (N - J + 3).subs(N, N + 1),
            ),
            Step(
                "(89) of 1982 prints $2n-j$, which is too large by this difference; it is zero only for $n=3$",
                together(2 * N - J, minus(N - J + 3)),
                N - 3,
            ),
        )
    )


class Triangle(NamedTuple):
    """The 3 × 3 system (69): its entries, true solution, right sides A x, and the solution computed with one ε."""

    a: sp.Matrix
    x: tuple[sp.Symbol, ...]
    b: tuple[sp.Expr, ...]
    computed: tuple[sp.Expr, ...]


def triangle() -> Triangle:
    """Solve (69) by back substitution in three rows, with one ε for all roundings as printed, without omissions."""
    a = sp.Matrix(3, 3, lambda i, j: sp.Symbol(f"a_{i + 1}{j + 1}") if i <= j else sp.Integer(0))
    x = sp.symbols("x_1:4")
    b = tuple(a @ sp.Matrix(x))
    y3 = b[2] * (1 + EPSILON) / a[2, 2]
    y2 = second_row(a, b[1], y3) / a[1, 1]
    return Triangle(a, x, b, (first_row(a, b[0], y2, y3) / a[0, 0], y2, y3))


def second_row(a: sp.Matrix, b: sp.Expr, third: sp.Expr) -> sp.Expr:
    """Return a_22 x̂_2 as computed with one ε from a given x̂_3."""
    e = 1 + EPSILON
    return (b - a[1, 2] * third * e) * e * e


def first_row(a: sp.Matrix, b: sp.Expr, second: sp.Expr, third: sp.Expr) -> sp.Expr:
    """Return a_11 x̂_1 as computed with one ε from given x̂_2 and x̂_3."""
    e = 1 + EPSILON
    return ((b - a[0, 1] * second * e) * e - a[0, 2] * third * e) * e * e


def linear(expression: sp.Expr) -> sp.Expr:
    """Return the part of an expression that is linear in the single ε of the documents."""
    return first_order(expression, (EPSILON,))


def printed_75() -> sp.Expr:
    """Return the first-order error of x̂_2, (75)."""
    a, (_, _, x3), b, _ = triangle()
    return EPSILON * (2 * unevaluated(b[1]) - 4 * a[1, 2] * x3) / a[1, 1]


def printed_before_78() -> sp.Expr:
    """Return the first-order error of x̂_1, printed before (78)."""
    a, (_, x2, x3), b, _ = triangle()
    a12, a13, a22, a23 = a[0, 1], a[0, 2], a[1, 1], a[1, 2]
    inside = (
        3 * unevaluated(b[0])
        - 4 * a12 * x2
        - 2 * a12 / a22 * unevaluated(b[1])
        + 4 * a12 * a23 / a22 * x3
        - 4 * a13 * x3
    )
    return EPSILON * inside / a[0, 0]


def back_substitution() -> Derivation:
    """Derive (72)-(79): three rows with one ε; b_1 and b_2 are expressed by the true solution."""
    a, x, _, (y1, y2, _) = triangle()
    s2, s3 = sp.symbols(r"\hat{x}_2:4")
    b1, b2, b3 = sp.symbols("b_1:4")
    e = 1 + EPSILON
    return Derivation(
        (
            Step("(72)-(74): the last row", a[2, 2] * unevaluated(b3 * e / a[2, 2]), b3 * e),
            Step("(75): error of $\\hat x_2$, to first order", linear(y2 - x[1]), printed_75()),
            Step(
                "(77) with nothing dropped: $a_{22}\\hat x_2$; to first order the powers are $1+2\\epsilon$, "
                "$1+3\\epsilon$",
                second_row(a, b2, s3),
                together(b2 * e**2, minus(a[1, 2] * e**3 * s3)),
            ),
            Step("error of $\\hat x_1$, before (78), to first order", linear(y1 - x[0]), printed_before_78()),
            Step(
                "(79) with nothing dropped: $a_{11}\\hat x_1$; the powers are the weights $3$, $4$ and $3$",
                first_row(a, b1, s2, s3),
                together(b1 * e**3, minus(a[0, 1] * e**4 * s2), minus(a[0, 2] * e**3 * s3)),
            ),
        )
    )
