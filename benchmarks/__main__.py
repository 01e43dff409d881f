"""Time multiply-adds with two roundings each in gpbnb and its peers, in one run on one machine."""

from __future__ import annotations

import decimal
import platform
import statistics
import sys
import time
from collections.abc import Callable

import mpmath
import numpy as np

from gpbnb.formats import FloatFormat

COUNT = 20_000
REPEATS = 5


def median_seconds(work: Callable[[], object]) -> float:
    """Median wall time of `work` over REPEATS runs, after one that is not counted."""
    work()
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def multiply_add(precision: int) -> dict[str, float]:
    """Seconds for COUNT decimal ``a * b + c`` in each library."""
    limit = 10**precision
    triples = np.random.default_rng(precision).integers(limit // 10, limit, (3, COUNT)).tolist()
    a, b, c = (FloatFormat(10, precision).array(row) for row in triples)
    context = decimal.Context(prec=precision, rounding=decimal.ROUND_HALF_UP)
    decimals = [[decimal.Decimal(x) for x in row] for row in triples]
    floats = [[mpmath.mpf(x) for x in row] for row in triples]

    def with_decimal() -> list[decimal.Decimal]:
        return [context.add(context.multiply(x, y), z) for x, y, z in zip(*decimals, strict=True)]

    def with_mpmath() -> list[mpmath.mpf]:
        with mpmath.workdps(precision):
            return [x * y + z for x, y, z in zip(*floats, strict=True)]

    computed = [int(x) for x in (a * b + c).to_fractions()]
    assert computed == [int(x) for x in with_decimal()], "gpbnb and decimal differ"
    return {
        "gpbnb": median_seconds(lambda: a * b + c),
        "decimal": median_seconds(with_decimal),
        "mpmath (binary)": median_seconds(with_mpmath),
    }


def main() -> None:
    print(f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}, numpy {np.__version__}")
    print(f"{COUNT} multiply-adds, two roundings each; median of {REPEATS} runs")
    print(f"{'digits':>6}  {'library':<16} {'time':>9}  {'ratio to gpbnb':>14}")
    for precision in (8, 17):
        times = multiply_add(precision)
        for name, seconds in times.items():
            print(f"{precision:>6}  {name:<16} {1e3 * seconds:>6.1f} ms  {seconds / times['gpbnb']:>14.2f}")


if __name__ == "__main__":
    sys.exit(main())
