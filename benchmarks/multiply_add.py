"""Multiply-adds, two roundings each: a million in 8 and 17 decimal digits, fewer in binary128 and decimal128."""

from __future__ import annotations

import decimal
from collections.abc import Callable
from typing import Any

import gmpy2
import mpmath
import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic import named
from gpbnb.arithmetic.formats import FloatFormat

COUNT, WIDE_COUNT = 1_000_000, 100_000
REACH = {8: 8, 17: 4}


def measure_wide() -> list[Row]:
    """Times in significands of two words, beside lists of numbers of ``decimal`` and of MPFR with the same digits."""
    table = []
    integers = [np.random.default_rng(k).integers(1, 2**53, WIDE_COUNT).tolist() for k in range(3)]
    of_decimal, of_mpfr = decimal.Context(prec=34), gmpy2.context(precision=113)
    decimals = [[of_decimal.divide(n, 3**30) for n in row] for row in integers]
    mpfrs = [[of_mpfr.div(gmpy2.mpfr(n), 3**30) for n in row] for row in integers]

    def with_decimal() -> list[decimal.Decimal]:
        with decimal.localcontext(of_decimal):
            return [x * y + z for x, y, z in zip(*decimals, strict=True)]

    def with_mpfr() -> list[Any]:
        with of_mpfr:
            return [x * y + z for x, y, z in zip(*mpfrs, strict=True)]

    for fmt, peer, work, least in (
        (named.DECIMAL128, "decimal", with_decimal, 1.0),
        (named.BINARY128, "MPFR", with_mpfr, 0.5),
    ):
        name = {10: "decimal128", 2: "binary128"}[fmt.base]
        a, b, c = (fmt.array(row) / 3**30 for row in integers)
        if not np.all(fmt.array(work()[:1000]) == (a * b + c)[:1000]):
            raise RuntimeError(f"gpbnb and {peer} differ")
        times = medians({"gpbnb": lambda a=a, b=b, c=c: a * b + c, peer: work}, 9)
        table += rows(f"10⁵ multiply-adds, {name}", times, "gpbnb", {peer: least})
    return table


def measure() -> list[Row]:
    """Times beside ``decimal``, and beside mpmath in binary of as many digits."""
    table = []
    for precision in (8, 17):
        limit = 10**precision
        triples = np.random.default_rng(precision).integers(limit // 10, limit, (3, COUNT))
        a, b, c = (FloatFormat(10, precision).array(row) for row in triples)
        context = decimal.Context(prec=precision, rounding=decimal.ROUND_HALF_UP)
        decimals = [[decimal.Decimal(x) for x in row] for row in triples.tolist()]
        floats = [[mpmath.mpf(x) for x in row] for row in triples.tolist()]

        def with_decimal(context: Any = context, decimals: Any = decimals) -> list[decimal.Decimal]:
            with decimal.localcontext(context):
                return [x * y + z for x, y, z in zip(*decimals, strict=True)]

        def with_mpmath(precision: int = precision, floats: Any = floats) -> list[Any]:
            with mpmath.workdps(precision):
                return [x * y + z for x, y, z in zip(*floats, strict=True)]

        def with_gpbnb(a: Any = a, b: Any = b, c: Any = c) -> Any:
            return a * b + c

        if [int(x) for x in with_gpbnb()[:10_000].to_fractions()] != [int(x) for x in with_decimal()[:10_000]]:
            raise RuntimeError("gpbnb and decimal differ")
        works: dict[str, Callable[[], Any]] = {"gpbnb": with_gpbnb, "decimal": with_decimal, "mpmath": with_mpmath}
        times = medians(works, 5, once=frozenset({"mpmath"}))
        table += rows(f"10⁶ multiply-adds, {precision} decimal digits", times, "gpbnb", {"decimal": REACH[precision]})
    return table + measure_wide()
