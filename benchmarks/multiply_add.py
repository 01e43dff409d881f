"""A million base-10 multiply-adds, two roundings each, at 8 and 17 digits."""

from __future__ import annotations

import decimal
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic.formats import FloatFormat

COUNT = 1_000_000
REACH = {8: 8, 17: 4}


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
    return table
