"""Linear algebra in t-digit arithmetic, with a documented order of operations for each result.

The order matters, because another order gives other digits. This module uses the order of hung1984, ch. II. All
operands and results are FloatArrays of one format. If the backend of the operands has compiled loops, elimination runs
in :mod:`gpbnb.arithmetic.kernels.matrices`; the loops here work for every format and exponent and give the same
digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import lifted
from gpbnb.arithmetic.kernels.backends import Looped
from gpbnb.arithmetic.kernels.selection import check_order
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.rounding import Order, Rounding, digit_unit

_MOST_PRODUCTS = 1_000_000  # that pairwise and blocked sums form at once


class LU(NamedTuple):
    """Triangular factors of a matrix with its rows in the order `permutation`."""

    lower: FloatArray
    upper: FloatArray
    permutation: NDArray[np.intp]


def dot(
    x: FloatArray,
    y: FloatArray,
    order: Order = "left",
    fused: bool = False,
    block: int = 32,
    sums: NumberFormat | None = None,
) -> FloatArray:
    r"""Inner product, summed from left to right unless `order` says otherwise.

    .. math:: \mathrm{fl}(\dots\mathrm{fl}(\mathrm{fl}(x_1 y_1) + \mathrm{fl}(x_2 y_2)) + \dots)

    Parameters
    ----------
    x, y : (n,) vectors of one format.
    order, fused, block, sums : as in :func:`matmul`.

    Returns
    -------
    A single number; zero for n = 0.

    Raises
    ------
    TypeError : an operand is not a FloatArray.
    ValueError : the operands are not two vectors of the same length and format.

    References
    ----------
    hung1984, ch. II, section 9.1.
    """
    _check(x, "x", 1)
    _check(y, "y", 1)
    return matmul(x, y, order, fused, block, sums)


def matmul(
    a: FloatArray,
    b: FloatArray,
    order: Order = "left",
    fused: bool = False,
    block: int = 32,
    sums: NumberFormat | None = None,
) -> FloatArray:
    """Matrix product, by default the same as ``a @ b``; each entry is :func:`dot` of a row and a column.

    Parameters
    ----------
    a, b : (..., m, n) and (..., n, p), or a vector (n,) on either side.
    order : order of the additions. "left": from left to right. "pairwise": the sum of the first half plus the sum of
        the second half, each formed in the same way; the first half is the shorter one. "blocked": sums of `block`
        products from left to right, then these sums from left to right, as in the inner loops of optimized BLAS.
    fused : whether each product is added by a fused multiply-add, which rounds once; not with "pairwise", where
        products are not added to sums.
    block : number of products in a block.
    sums : the format in which products and sums are computed; each entry is then rounded once into the format of the
        operands. Tensor cores, for example, sum bfloat16 products in binary32, and signal processors use a long
        accumulator.

    Raises
    ------
    TypeError : an operand is not a FloatArray, or `sums` is not a format.
    ValueError : inner dimensions or formats differ; an unknown order; a block below 1; "pairwise" together with
        `fused`; `sums` of another base or with fewer digits than the operands.

    References
    ----------
    hung1984, ch. II, section 9.2; hung1982, ch. III, (27).
    """
    _check(a, "a")
    _check(b, "b")
    check_order(order, fused, block)
    if sums is not None:
        a.operand(b)
        if not hasattr(sums, "check_compiled"):
            raise TypeError(f"sums: got {sums!r}; needed a FloatFormat or a FixedFormat")
        if sums.base != a.format.base or sums.precision < a.format.precision:
            raise ValueError(
                f"sums: got {sums} with operands in {a.format}; needed the same base and at least as many digits"
            )
        with lifted():
            return a.format.array(matmul(sums.array(a), sums.array(b), order, fused, block))
    n = a.shape[-1] if a.ndim else 0
    if not b.ndim or n == 0 or (order == "left" and not fused) or n != b.shape[max(b.ndim - 2, 0)]:
        return a @ b  # this error also names shapes that do not fit
    a.operand(b)
    rows = a if a.ndim > 1 else a[np.newaxis, :]
    columns = b if b.ndim > 1 else b[:, np.newaxis]
    c = _sum_of_products(rows, columns, order, fused, block)
    if a.ndim == 1:
        c = c[..., 0, :]
    return c if b.ndim > 1 else c[..., 0]


def _sum_of_products(rows: FloatArray, columns: FloatArray, order: Order, fused: bool, block: int) -> FloatArray:
    size = math.prod(np.broadcast_shapes(rows.shape[:-2], columns.shape[:-2])) * rows.shape[-2] * columns.shape[-1]
    # Random roundings come in the order of the loops below.
    ordered = rows.backend.records or rows.format.rounding is not Rounding.STOCHASTIC
    if rows.shape[-1] * size <= _MOST_PRODUCTS and order != "left" and ordered:
        axes = max(rows.ndim, columns.ndim)
        left, right = (x.reshape((1,) * (axes - x.ndim) + x.shape) for x in (rows, columns))
        left = left[..., np.newaxis].moved(lambda a: np.moveaxis(a, -2, 0))
        right = right[..., np.newaxis, :, :].moved(lambda a: np.moveaxis(a, -2, 0))
        return _pairwise(left * right) if order == "pairwise" else _blocked(left, right, fused, block)

    def factors(k: int) -> tuple[FloatArray, FloatArray]:
        return rows[..., :, k, np.newaxis], columns[..., np.newaxis, k, :]

    def product(k: int) -> FloatArray:
        left, right = factors(k)
        return left * right

    def from_left(first: int, end: int) -> FloatArray:
        s = product(first)
        for k in range(first + 1, end):
            left, right = factors(k)
            s = left.multiply_add(right, s) if fused else s + left * right
        return s

    def pairwise(first: int, end: int) -> FloatArray:
        if end - first == 1:
            return product(first)
        middle = (first + end) // 2
        return pairwise(first, middle) + pairwise(middle, end)

    n = rows.shape[-1]
    if order == "pairwise":
        return pairwise(0, n)
    step = n if order == "left" else block
    total, *others = (from_left(first, min(first + step, n)) for first in range(0, n, step))
    for partial in others:
        total = total + partial
    return total


def _pairwise(terms: FloatArray) -> FloatArray:
    """Sum along the first axis, the first half plus the second, each formed in the same way; all of a depth at once."""
    depths = [np.array([len(terms)])]  # lengths of the parts
    while depths[-1].max() > 1:
        halves = np.stack([depths[-1] // 2, depths[-1] - depths[-1] // 2], axis=1).ravel()
        depths.append(halves[halves > 0])
    for lengths in reversed(depths[:-1]):
        first = np.cumsum(np.minimum(lengths, 2)) - np.minimum(lengths, 2)  # place of a part's first half
        whole, split = first[lengths == 1], first[lengths > 1]
        found = terms[split] + terms[split + 1]
        if len(whole):
            order = np.argsort(np.concatenate([split, whole]), kind="stable")
            found = _joined(found, terms[whole])[order]
        terms = found
    return terms[0]


def _blocked(left: FloatArray, right: FloatArray, fused: bool, block: int) -> FloatArray:
    """Sum products along the first axis, from left to right within blocks, of which all take a step at once."""
    sums = left[::block] * right[::block]
    for k in range(1, min(block, len(left))):
        x, y = left[k::block], right[k::block]  # of the blocks that have this product: all, or all but the last
        shorter = sums[: len(x)]
        shorter = x.multiply_add(y, shorter) if fused else shorter + x * y
        sums = shorter if len(x) == len(sums) else _joined(shorter, sums[len(x) :])
    return sums.sum(0)


def lu(a: FloatArray, pivot: bool = False) -> LU:
    r"""Gaussian elimination, one column after the other.

    For k = 1 … n − 1 and each row i > k:
    :math:`m_{ik} = -\mathrm{fl}(a_{ik}/a_{kk})`, then for each j > k
    :math:`a_{ij} \leftarrow \mathrm{fl}(a_{ij} + \mathrm{fl}(m_{ik} a_{kj}))`.

    Parameters
    ----------
    a : (n, n).
    pivot : whether to use partial pivoting: among rows k and below, the row with the largest :math:`|a_{ik}|`, or the
        first of several equal ones, is swapped into row k.

    Returns
    -------
    lower, upper : (n, n); `lower` has ones on its diagonal and holds :math:`-m_{ik}`.
    permutation : (n,); the factors are those of ``a[permutation]``.

    Raises
    ------
    TypeError : `a` is not a FloatArray.
    ValueError : `a` is not a square matrix.
    OverflowError : the format does not hold the number 1.
    numpy.linalg.LinAlgError : a pivot is zero.

    References
    ----------
    hung1984, ch. II, (45)-(58).
    """
    _square(a)
    _identity(a, "ones on the diagonal of the lower factor")
    return _lu(a, pivot)


def _holds_one(fmt: Any) -> bool:
    """Whether a format has the number 1, as Q15 has not."""
    try:
        return bool(fmt.round(1) == 1)
    except OverflowError:
        return False


def _identity(a: FloatArray, what: str) -> FloatArray:
    if not (a.backend.records or _holds_one(a.format)):
        raise OverflowError(
            f"got {a.format!r}, which does not hold the number 1; needed it for {what}: take a bit before the point"
        )
    return a.format.array(np.eye(len(a), dtype=int))


def _lu(a: FloatArray, pivot: bool) -> LU:
    """Factor a matrix; in a format without the number 1, the diagonal of the lower factor is 0."""
    n, one = len(a), int(a.backend.records or _holds_one(a.format))
    if (compiled := _factored(a, pivot)) is not None:
        factors, order = compiled
        identity = a.format.array(one * np.eye(n, dtype=int))
        lower = cast(FloatArray, np.where(np.tri(n, k=-1, dtype=bool), factors, identity))
        return LU(lower, cast(FloatArray, np.triu(cast(Any, factors))), order)
    order = np.arange(n)
    work = a
    uppers: list[FloatArray] = []
    multipliers = [a.format.array([])] * n  # row i: its multipliers so far
    for k in range(n):
        if pivot:
            work, order, multipliers = _swap_largest(work, order, multipliers, k)
        head = work[0]
        uppers.append(head)
        if head.backend.records:
            _ = 0 / head[0]  # so that a run of the tape stops at a pivot of zero
        elif head[0] == 0:
            raise np.linalg.LinAlgError(_zero_pivot(k, n, pivot, a.format.base))
        if k == n - 1:
            break
        ratio = work[1:, 0] / head[0]
        for i in range(k + 1, n):
            multipliers[i] = _joined(multipliers[i], ratio[i - k - 1 : i - k])
        work = work[1:, 1:] + (-ratio)[:, np.newaxis] * head[1:]
    zeros, diagonal = a.format.array([0] * n), a.format.array([one])
    lowers = [_joined(row, diagonal, zeros[i + 1 :]) for i, row in enumerate(multipliers)]
    return LU(_rows(lowers), _rows([_joined(zeros[:i], row) for i, row in enumerate(uppers)]), order)


def solve(a: FloatArray, b: FloatArray, pivot: bool = False) -> FloatArray:
    r"""Solve a x = b by elimination and back substitution.

    The right-hand side is reduced with the matrix,
    :math:`b_i \leftarrow \mathrm{fl}(b_i + \mathrm{fl}(m_{ik} b_k))` for k = 1 … n − 1; then from
    the last row up :math:`x_k = ((b_k - a_{k,k+1} x_{k+1}) - a_{k,k+2} x_{k+2} - \dots)/a_{kk}`,
    from left to right, each operation rounded.

    Parameters
    ----------
    a : (n, n).
    b : (n,) or (n, p), a column for each right-hand side.
    pivot : as in :func:`lu`.

    Returns
    -------
    x : of the shape of `b`.

    Raises
    ------
    TypeError : `a` or `b` is not a FloatArray.
    ValueError : shapes do not fit, or formats differ.
    numpy.linalg.LinAlgError : a pivot is zero.

    References
    ----------
    hung1984, ch. II, (45)-(90).
    """
    n = _square(a)
    _check(b, "b")
    if b.ndim not in (1, 2) or b.shape[0] != n:
        raise ValueError(f"b: got shape {b.shape} with a of shape {a.shape}; needed ({n},) or ({n}, p)")
    columns = b if b.ndim == 2 else b[:, np.newaxis]
    if (compiled := _solved(a, columns, pivot)) is not None:
        return compiled if b.ndim == 2 else compiled[:, 0]
    lower, upper, order = _lu(a, pivot)
    columns = columns[order]
    reduced = []
    for k in range(n):
        reduced.append(columns[0])
        columns = columns[1:] + (-lower[k + 1 :, k])[:, np.newaxis] * columns[0]
    x: list[FloatArray] = []  # x_{k+1} ... x_n
    for k in reversed(range(n)):
        rest = reduced[k]
        for j, solved in enumerate(x, start=k + 1):
            rest = rest - upper[k, j] * solved
        x.insert(0, rest / upper[k, k])
    solution = _rows(x)
    return solution if b.ndim == 2 else solution[:, 0]


def inv(a: FloatArray, pivot: bool = False) -> FloatArray:
    """Invert a matrix: :func:`solve` for each column of the identity.

    Parameters
    ----------
    a : (n, n).
    pivot : as in :func:`lu`.

    Raises
    ------
    TypeError : `a` is not a FloatArray.
    ValueError : `a` is not a square matrix.
    OverflowError : the format does not hold the number 1.
    numpy.linalg.LinAlgError : a pivot is zero.

    References
    ----------
    hung1984, ch. II, (33) and (93).
    """
    _square(a)
    return solve(a, _identity(a, "the columns of the identity"), pivot)


def det(a: FloatArray) -> FloatArray:
    r"""Determinant: the pivots of ``lu(a, pivot=True)``, multiplied from left to right, with the sign of the row order.

    A column without a pivot gives zero.

    Parameters
    ----------
    a : (n, n).

    Returns
    -------
    A single number.

    Raises
    ------
    TypeError : `a` is not a FloatArray.
    ValueError : `a` is not a square matrix.

    Examples
    --------
    >>> from gpbnb import BINARY32, linalg
    >>> float(linalg.det(BINARY32.array([[1, 2], [4, 4]])))
    -4.0
    """
    n = _square(a)
    try:
        _, upper, order = _lu(a, pivot=True)
    except np.linalg.LinAlgError:
        return cast(FloatArray, np.zeros_like(cast(Any, a[0, 0])))
    found = cast(FloatArray, np.diagonal(cast(Any, upper))).prod()
    swaps = sum(int((order[:i] > order[i]).sum()) for i in range(n))
    return -found if swaps % 2 else found


def cholesky(a: FloatArray) -> FloatArray:
    r"""Cholesky's lower triangular L of a symmetric A = L Lᵀ, one column after the other.

    For k = 1 … n: :math:`l_{kk} = \mathrm{fl}(\sqrt{s_{kk}})` and :math:`l_{ik} = \mathrm{fl}(s_{ik}/l_{kk})` for
    i > k, where
    :math:`s_{ik} = (a_{ik} - l_{i1} l_{k1}) - l_{i2} l_{k2} - \dots - l_{i,k-1} l_{k,k-1}` from left to right,
    each operation rounded. Entries above the diagonal are not read.

    Parameters
    ----------
    a : (n, n).

    Raises
    ------
    TypeError : `a` is not a FloatArray.
    ValueError : `a` is not a square matrix.
    numpy.linalg.LinAlgError : the matrix is not positive definite in this format.

    References
    ----------
    Golub & Van Loan 2013, algorithm 4.2.1.

    Examples
    --------
    >>> from gpbnb import BINARY32, linalg
    >>> linalg.cholesky(BINARY32.array([[4, 2], [2, 5]])).to_float()
    array([[2., 0.],
           [1., 2.]])
    """
    n = _square(a)
    zeros = a.format.array([0] * n)
    rest, columns = a, []
    for k in range(n):
        pivot = rest[0, 0]
        if not pivot > 0:
            raise np.linalg.LinAlgError(
                f"got a pivot {pivot} in column {k + 1} of {n}; needed one above zero: the matrix is not positive "
                f"definite in this format; use more {digit_unit(a.format.base)}, or another matrix"
            )
        root = pivot.sqrt()
        below = rest[1:, 0] / root
        columns.append(_joined(zeros[:k], root.reshape(1), below))
        rest = rest[1:, 1:] - below[:, np.newaxis] * below[np.newaxis, :]
    return _rows(columns).T


NUMPY: dict[str, Callable[..., Any]] = {
    "cholesky": lambda x, a: cholesky(x.operand(a)),
    "det": lambda x, a: det(x.operand(a)),
    "inv": lambda x, a: inv(x.operand(a), pivot=True),
    "solve": lambda x, a, b: solve(x.operand(a), x.operand(b), pivot=True),
}
"""Functions of ``np.linalg`` for arrays of a format, with partial pivoting where LAPACK has it."""


def _factored(a: FloatArray, pivot: bool) -> tuple[FloatArray, NDArray[np.intp]] | None:
    """Return both factors in one array and the order of the rows; None if the backend cannot compute them."""
    backend = a.backend
    if not isinstance(backend, Looped):
        return None
    entries = a.components  # which derivatives do not have, and so are refused
    if (found := backend.factored(entries, pivot)) is None:
        return None
    factors, order, column = found
    if column >= 0:
        raise np.linalg.LinAlgError(_zero_pivot(column, len(a), pivot, a.format.base))
    return type(a).from_components(backend, factors, a.format), order


def _solved(a: FloatArray, b: FloatArray, pivot: bool) -> FloatArray | None:
    """Return solutions for the columns of b (n, p); None if the backend cannot compute them."""
    backend = a.backend
    if not isinstance(backend, Looped) or b.backend is not backend:
        return None
    entries = b.components  # which derivatives do not have, and so are refused
    if (compiled := _factored(a, pivot)) is None:
        return None
    factors, order = compiled
    found = backend.solved(factors.components, tuple(each[order] for each in entries))
    return None if found is None else type(a).from_components(backend, found, a.format)


def _joined(*components: FloatArray) -> FloatArray:
    return cast(FloatArray, np.concatenate(components))


def _rows(rows: list[FloatArray]) -> FloatArray:
    return cast(FloatArray, np.stack(rows))


def _swap_largest(
    work: FloatArray, order: NDArray[np.intp], multipliers: list[FloatArray], k: int
) -> tuple[FloatArray, NDArray[np.intp], list[FloatArray]]:
    # Sizes as numbers that are not positive, which fixed point has for its lowest number, too.
    minus = [each if each < 0 else -each for each in work[:, 0]]
    largest = 0
    for i in range(1, len(work)):
        if minus[i] < minus[largest]:
            largest = i
    if largest == 0:
        return work, order, multipliers
    rows = np.arange(len(work))
    rows[[0, largest]] = largest, 0
    order, multipliers = order.copy(), list(multipliers)
    order[[k, k + largest]] = order[[k + largest, k]]
    multipliers[k], multipliers[k + largest] = multipliers[k + largest], multipliers[k]
    return work[rows], order, multipliers


def _zero_pivot(k: int, n: int, pivot: bool, base: int) -> str:
    cure = (
        f"the matrix is singular in this format; use more {digit_unit(base)}, or another matrix"
        if pivot or k == n - 1
        else "try pivot=True; if that fails too, the matrix is singular in this format"
    )
    return f"got a zero pivot in column {k + 1} of {n}; needed one other than zero; {cure}"


def _check(x: object, name: str, ndim: int | None = None) -> None:
    if not isinstance(x, FloatArray):
        raise TypeError(f"{name}: got {type(x).__name__}; needed a FloatArray; write fmt.array({name})")
    if ndim is not None and x.ndim != ndim:
        raise ValueError(f"{name}: got shape {x.shape}; needed {ndim} axis, (n,)")


def _square(a: FloatArray) -> int:
    _check(a, "a")
    if a.ndim != 2 or a.shape[0] != a.shape[1] or not a.size:
        raise ValueError(f"a: got shape {a.shape}; needed a square matrix (n, n), n at least 1")
    return a.shape[0]
