r"""Theory: bounds on the errors of sums, products, inner products and matrix products.

Bounds named ``printed_…`` are those of the documents; the others are derived in
:mod:`gpbnb.report.rounding.derivation`. ``beta`` is the unit roundoff β, ``FloatFormat.unit_roundoff``.
All values are exact: entries are Fractions, and so are the bounds.

A first-order bound omits terms in β². A strict bound, built from
:math:`\gamma_n = n\beta/(1-n\beta)`, omits nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import gamma, gamma_probabilistic
from gpbnb.arithmetic.rational import column_sum_norm, exact, integers

# -- sums: errors in the units of the terms -------------------------------------------------------


def sum_weights(n: int) -> list[int]:
    """Count the roundings that each of n terms passes through when they are added from left to right.

    The first two terms pass through all n - 1 roundings, the j-th term through n + 1 - j.
    """
    return [n - 1] * min(n, 1) + [n + 1 - j for j in range(2, n + 1)]


def printed_sum_bound_1982(x: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`(n-1)\beta\,|s|`, :math:`s = \sum x_j`; hung1982, ch. III, (18)."""
    terms = exact(x)
    return (len(terms) - 1) * beta * abs(_total(terms))


def printed_sum_bound(x: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta\,[(n-1)|s| + \sum_{j\ge3}(j-2)|x_j|]`; hung1984, ch. II, (18)."""
    terms = exact(x)
    tail = sum((j - 2) * abs(terms[j - 1]) for j in range(3, len(terms) + 1))
    return beta * ((len(terms) - 1) * abs(_total(terms)) + tail)


def printed_sum_bound_coarse(x: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta\,[(n-1)|s| + \tfrac12(n-1)(n-2)\max|x_j|]`; hung1984, ch. II, (18)."""
    terms = exact(x)
    n = len(terms)
    largest = max(abs(terms), default=Fraction(0))
    return beta * ((n - 1) * abs(_total(terms)) + Fraction((n - 1) * (n - 2), 2) * largest)


def sum_bound(x: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta \sum_j w_j |x_j|` with :func:`sum_weights`; to first order."""
    terms = exact(x)
    return beta * sum(
        (w * abs(term) for w, term in zip(sum_weights(len(terms)), terms, strict=True)),
        start=Fraction(0),
    )


def strict_sum_bound(x: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\sum_j \gamma_{w_j} |x_j|` with :func:`sum_weights`; to every order.

    The computed sum is :math:`\sum_j x_j \prod (1+\epsilon_i)`, where the ε_i are the errors
    of the roundings that x_j passes through.
    """
    terms = exact(x)
    return sum(
        (gamma(w, beta) * abs(term) for w, term in zip(sum_weights(len(terms)), terms, strict=True)),
        start=Fraction(0),
    )


def probabilistic_sum_factor(n: int, beta: Fraction, failure: float = 0.01) -> float:
    r"""Bound on the error of a sum of n terms, about √n β, as a multiple of :math:`\sum_j |x_j|`.

    If rounding errors are independent with mean zero, the bound fails at most with the probability `failure`.
    Each of the n terms, with at most n - 1 roundings, gets an equal share of this probability.
    """
    return gamma_probabilistic(n - 1, beta, failure / n)


# -- products and quotients: relative errors ------------------------------------------------------


def printed_product_bound(n: int, m: int, beta: Fraction) -> Fraction:
    r"""Bound as :math:`(n+m+1)\beta`, for n factors over m divisors; hung1984, ch. II, (20)."""
    return (n + m + 1) * beta


def product_bound(n: int, m: int, beta: Fraction) -> Fraction:
    r"""Bound as :math:`(n+m-1)\beta`, to first order; hung1982, ch. III, (20)."""
    return (n + m - 1) * beta


def strict_product_bound(n: int, m: int, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\gamma_{n+m-1}`, to every order; Higham 2002, Lemma 3.1."""
    return gamma(n + m - 1, beta)


# -- inner and matrix products --------------------------------------------------------------------


def dot_weights(n: int) -> list[int]:
    """Count the roundings of each product in an inner product of length n: n, n, n - 1, ..., 2.

    These are the diagonal entries of D in hung1982, ch. III, section 9.2.
    """
    return [w + 1 for w in sum_weights(n)]


def dot_bound(a: Any, b: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta\{n|a_1b_1| + \sum_{j\ge2}(n+2-j)|a_jb_j|\}`; hung1984, ch. II, (26)."""
    products = abs(_products(a, b))
    return beta * sum((w * p for w, p in zip(dot_weights(len(products)), products, strict=True)), start=Fraction(0))


def strict_dot_bound(a: Any, b: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\gamma_n |a|^T|b|`, to every order; Higham 2002, (3.5)."""
    products = abs(_products(a, b))
    return gamma(len(products), beta) * _total(products)


def relative_dot_bound(a: Any, b: Any, beta: Fraction) -> Fraction:
    r"""Bound on the relative error of an inner product, which the documents omit.

    .. math:: \frac{|\tilde I|}{|I|} \le
        \gamma_n \frac{|a|^T|b|}{|a^Tb|}

    The quotient is the condition number of the inner product. It states by how much a relative change of the entries
    of one vector may be amplified in the result.
    """
    value = abs(_total(_products(a, b)))
    if value == 0:
        raise ZeroDivisionError("got an inner product of zero; needed a nonzero one; use strict_dot_bound")
    return strict_dot_bound(a, b, beta) / value


def chain_bound(matrices: Sequence[Any], beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta\,(\sum d_i)\prod\|M_j\|`; hung1984, ch. II, (32), or (28) for two factors.

    `matrices` are M_1 ... M_N, multiplied from left to right. d_i is the number of columns of
    M_i. The norm is the largest column sum, (22).
    """
    return beta * sum(interfaces(matrices)) * _norm_product(matrices)


def strict_chain_bound(matrices: Sequence[Any], beta: Fraction) -> Fraction:
    r"""Bound as :math:`\gamma_{\sum d_i} \prod\|M_j\|`; to every order.

    An entry of the product is a sum over paths, each with one entry from every factor. A path passes through at
    most :math:`\sum d_i` roundings.
    """
    return gamma(sum(interfaces(matrices)), beta) * _norm_product(matrices)


def printed_chain_claim(matrices: Sequence[Any], beta: Fraction) -> Fraction:
    r"""Norm of the error according to (31), :math:`\beta\,(\sum d_i)\,\|M_1\cdots M_N\|`."""
    return beta * sum(interfaces(matrices)) * column_sum_norm(product(matrices))


def printed_example_bound(a: Any, b: Any, c: Any, d: Any, beta: Fraction) -> Fraction:
    r"""Bound of the error of ABC + D as :math:`\beta[(1+m+r)\|ABC\| + \|D\|]`.

    m and r are the interface dimensions; both are n for square matrices.
    """
    abc = product([a, b, c])
    return beta * ((1 + sum(interfaces([a, b, c]))) * column_sum_norm(abc) + column_sum_norm(d))


def example_bound(a: Any, b: Any, c: Any, d: Any, beta: Fraction) -> Fraction:
    r"""The corrected bound of ABC + D, :math:`\beta[(m+r)\|A\|\|B\|\|C\| + \|ABC + D\|]`; to first order."""
    result = product([a, b, c]) + exact(d)
    return chain_bound([a, b, c], beta) + beta * column_sum_norm(result)


def strict_example_bound(a: Any, b: Any, c: Any, d: Any, beta: Fraction) -> Fraction:
    r"""Bound of ABC + D to every order, :math:`(1+\beta)\gamma_{m+r}\|A\|\|B\|\|C\| + \beta\|ABC + D\|`."""
    result = product([a, b, c]) + exact(d)
    return (1 + beta) * strict_chain_bound([a, b, c], beta) + beta * column_sum_norm(result)


def matrix_sum_bound(a: Any, b: Any, beta: Fraction) -> Fraction:
    r"""Bound as :math:`\beta\|A+B\|`, to every order; hung1984, ch. II, (24)."""
    return beta * column_sum_norm(exact(a) + exact(b))


# -- exact values ---------------------------------------------------------------------------------


def product(matrices: Sequence[Any]) -> NDArray[Any]:
    """Return the exact product of matrices."""
    result, unit = integers(exact(matrices[0]))
    for matrix in matrices[1:]:
        counts, its_unit = integers(exact(matrix))
        result, unit = result @ counts, unit * its_unit
    return np.asarray(result * unit)


def interfaces(matrices: Sequence[Any]) -> list[int]:
    """Interface dimensions d_1 ... d_{N-1} of a product of N matrices; hung1984, ch. II, (29)."""
    return [np.shape(matrix)[1] for matrix in matrices[:-1]]


def _norm_product(matrices: Sequence[Any]) -> Fraction:
    result = Fraction(1)
    for matrix in matrices:
        result *= column_sum_norm(matrix)
    return result


def _products(a: Any, b: Any) -> NDArray[Any]:
    return np.asarray(exact(a) * exact(b))


def _total(terms: NDArray[Any]) -> Fraction:
    return sum(terms, start=Fraction(0))
