"""Base 10, both kernels: every pair of numbers of one and of two digits, and what products out of range leave."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import njit

from gpbnb.arithmetic.kernels import elementwise, scalar
from gpbnb.arithmetic.kernels.backends import backend
from gpbnb.arithmetic.kernels.exact import kernel
from gpbnb.arithmetic.kernels.tags import LARGEST_SHORT, Decimal, ShortDecimal
from gpbnb.arithmetic.rounding import Rounding, Rules

ROUNDING = {True: Rounding.NEAREST, False: Rounding.CHOP}
TAGS = [Decimal, ShortDecimal]


def computed(tag: Any, name: str, *components: Any) -> tuple[Any, Any]:
    m1, e1, m2, e2 = (np.ascontiguousarray(part) for part in np.broadcast_arrays(*components))
    out = np.empty(m1.size, np.int64), np.empty(m1.size, np.int64)
    gone = elementwise.ENTRIES[name](tag, m1.size, (m1.ravel(), e1.ravel()), (m2.ravel(), e2.ravel()), out)
    assert not gone
    return out


@pytest.mark.parametrize("nearest", [True, False])
@pytest.mark.parametrize("precision", [1, 2])
def test_every_pair_of_short_numbers(precision: int, nearest: bool) -> None:
    """Of either sign, with exponents up to t + 4 apart, either way; two negative ones of one digit only."""
    positive = np.arange(10 ** (precision - 1), 10**precision)
    both = np.concatenate([-positive[::-1], positive])  # backwards these are their negatives
    gaps = np.arange(-precision - 4, precision + 5)
    oracle = kernel(Rules(10, precision, ROUNDING[nearest]))
    one, results = both if precision == 1 else positive, []
    for name in ("add", "subtract", "multiply", "divide"):
        first, gap, second = np.meshgrid(one, gaps if name in ("add", "subtract") else [3], both, indexing="ij")
        if name == "subtract":  # sums with the negatives
            results = [part[..., ::-1] for part in results]
        else:
            results = np.frompyfunc(getattr(oracle, name), 4, 2)(first, gap, second, 0)
        m, e = (part.astype(np.int64).ravel() for part in results)
        for tag in TAGS:
            n, f = computed(tag(precision, nearest), name, first, gap, second, np.zeros_like(gap))
            assert np.array_equal(m, n)
            assert np.array_equal(e, f)


@pytest.mark.parametrize("nearest", [True, False])
def test_carries_and_clamped_exponents_of_eight_digits(nearest: bool) -> None:
    """Beside powers of ten and ties, at every distance of the exponents about the one where only a sign is left."""
    t = LARGEST_SHORT
    steps = np.arange(4)
    edges = np.concatenate([10 ** (t - 1) + steps, 10**t - 1 - steps, 5 * 10 ** (t - 1) + steps - 2])
    both = np.concatenate([-edges, edges])
    first, gap, second = np.meshgrid(both, np.arange(-t - 5, t + 6), both, indexing="ij")
    for name in ("add", "subtract", "multiply"):
        exact = np.frompyfunc(getattr(kernel(Rules(10, t, ROUNDING[nearest])), name), 4, 2)
        m, e = (part.astype(np.int64).ravel() for part in exact(first, gap, second, 0))
        for tag in TAGS:
            n, f = computed(tag(t, nearest), name, first, gap, second, np.zeros_like(gap))
            assert np.array_equal(m, n)
            assert np.array_equal(e, f)


@pytest.mark.parametrize("nearest", [True, False])
def test_zeros(nearest: bool) -> None:
    for tag in TAGS:
        for m, e in ((0, 0), (37, 40), (-37, -40)):
            for name in ("add", "subtract"):
                n, f = computed(tag(2, nearest), name, [m], [e], [0], [0])
                assert (n[0], f[0]) == (m, e)
            n, f = computed(tag(2, nearest), "add", [0], [0], [m], [e])
            assert (n[0], f[0]) == (m, e)
            for name, pair in (("subtract", (m, e)), ("multiply", (0, 0))):
                n, f = computed(tag(2, nearest), name, [m], [e], *([part] for part in pair))
                assert (n[0], f[0]) == (0, 0)


def test_the_kernel_of_a_precision() -> None:
    for precision in range(1, 19):
        assert type(backend(Rules(10, precision, Rounding.NEAREST)).tag) is (
            ShortDecimal if precision <= LARGEST_SHORT else Decimal
        )


@njit
def dot(fmt: Any, x: Any, y: Any) -> Any:
    return scalar.dot(fmt, x, y)


def matmul(fmt: Any, x: Any, y: Any) -> Any:
    """The product of a row and a column."""
    a, b, c = x.reshape(1, -1, 2), y.reshape(-1, 1, 2), np.empty((1, 1, 2), np.int64)
    a.flags.writeable = b.flags.writeable = False  # as arrays pass them
    elementwise.product(fmt, a, b, c)
    return tuple(c[0, 0])


HIGH, ONE, LOW, ZERO = (10, 2**60), (10, -1), (10, -(2**60)), (0, 0)


@pytest.mark.parametrize("tag", TAGS)
@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        ([ONE, ZERO], [ONE, HIGH], ONE),
        ([ONE, HIGH], [ONE, ZERO], ONE),
        ([ZERO, ZERO], [ONE, LOW], ZERO),
        ([ZERO, LOW], [ONE, ZERO], ZERO),
        ([ZERO, ONE], [LOW, ONE], ONE),
        ([ONE, HIGH], [ONE, HIGH], None),
        ([ZERO, HIGH], [ONE, HIGH], None),
        ([ZERO, LOW], [ONE, LOW], None),
    ],
)
def test_products_out_of_range_in_sums(tag: Any, x: Any, y: Any, expected: Any) -> None:
    arrays = np.array(x, np.int64), np.array(y, np.int64)
    if expected is None:
        for sum_of_products in (dot, matmul):
            with pytest.raises(OverflowError, match=r"beyond 2\*\*60"):
                sum_of_products(tag(2, True), *arrays)
    else:
        assert dot(tag(2, True), *arrays) == matmul(tag(2, True), *arrays) == expected


def test_a_product_too_small_to_hold_only_tells_its_sign_in_a_sum() -> None:
    x, y = np.array([[10, -1], [10, -(2**60)]]), np.array([[10, -1], [-10, -(2**60)]])
    for sum_of_products in (dot, matmul):
        assert sum_of_products(ShortDecimal(2, True), x, y) == (10, -1)
        assert sum_of_products(ShortDecimal(2, False), x, y) == (99, -2)
