"""Sums, products, inner products, factors and inverses in short formats, beside peers that compute the same digits."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import flint
import gmpy2
import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic import linalg, named
from gpbnb.arithmetic.formats import FloatFormat

COUNT, SIZE, SMALL = 1_000_000, 300, 100
EVEN = FloatFormat(2, 24, "even", emin=-126, emax=127)
FORMATS = {"binary16": named.BINARY16, "bfloat16": named.BFLOAT16, "24 bits": EVEN}
WIDTHS = {"binary16": (5, 10), "bfloat16": (8, 7), "24 bits": (8, 23)}  # bits of exponent and fraction
Works = dict[str, Callable[[], Any]]


def _floats(result: Any) -> Any:
    """Return the numbers of a result of any library as float64."""
    for method in ("to_float", "to_numpy"):
        if hasattr(result, method):
            return np.asarray(getattr(result, method)(), np.float64)
    return np.asarray(result, np.float64)


def compare(task: str, works: Works, reach: dict[str, float], turns: int) -> list[Row]:
    """Rows of a task, after a look that each peer computes the digits of gpbnb."""
    expected = _floats(works["gpbnb"]())
    for peer, work in works.items():
        if not np.array_equal(_floats(work()), expected):
            raise RuntimeError(f"{task}: gpbnb and {peer} differ")
    return rows(task, medians(works, turns), "gpbnb", reach)


def apytypes_tasks(name: str, *numbers: Any) -> list[tuple[str, Works, float]]:
    """Each task in one format, and the ratio to reach; an earlier product took a fifth of the time of APyTypes."""
    from apytypes import APyFloatArray

    a, b, A, B = (FORMATS[name].array(each) for each in numbers)
    p, q, P, Q = (APyFloatArray.from_float(each, *WIDTHS[name]) for each in numbers)
    return [
        (f"add 10⁶ in {name}", {"gpbnb": lambda: a + b, "APyTypes": lambda: p + q}, 1),
        (f"multiply 10⁶ in {name}", {"gpbnb": lambda: a * b, "APyTypes": lambda: p * q}, 1),
        (f"dot of 10⁶ in {name}", {"gpbnb": lambda: a @ b, "APyTypes": lambda: p @ q}, 5),
        (f"product 300 × 300 in {name}", {"gpbnb": lambda: A @ B, "APyTypes": lambda: P @ Q}, 25),
    ]


def measure_apytypes(*numbers: Any) -> list[Row]:
    """Elementwise work, inner products and matrix products beside APyTypes, if it is installed."""
    if find_spec("apytypes") is None:
        return []
    table = []
    for name in FORMATS:
        for task, works, least in apytypes_tasks(name, *numbers):
            table += compare(task, works, {"APyTypes": least}, 5)
    return table


def measure_machine(x: Any, y: Any, A: Any, B: Any) -> list[Row]:
    """The formats of the processor beside NumPy without BLAS, which sums from left to right too."""
    table = []
    for name, fmt, dtype in (("binary32", named.BINARY32, np.float32), ("binary64", named.BINARY64, np.float64)):
        a, b, C, D = (fmt.array(each) for each in (x, y, A, B))
        p, q, P, Q = (each.astype(dtype) for each in (x, y, A, B))
        products: Works = {"gpbnb": lambda C=C, D=D: C @ D, "einsum": lambda P=P, Q=Q: np.einsum("ij,jk->ik", P, Q)}
        table += compare(f"product 300 × 300 in {name}", products, {"einsum": 1 / 3}, 9)
        sums: Works = {"gpbnb": lambda a=a, b=b: a @ b, "cumsum": lambda p=p, q=q: np.cumsum(p * q, dtype=p.dtype)[-1]}
        table += compare(f"dot of 10⁶ in {name}", sums, {"cumsum": 1 / 3}, 9)
    half, other = (each.astype(np.float16) for each in (A, B))
    c, d = named.BINARY16.array(A), named.BINARY16.array(B)
    mixed: Works = {"gpbnb": lambda: linalg.matmul(c, d, sums=named.BINARY32), "numpy float16": lambda: half @ other}
    return table + compare("product 300 × 300, binary16 with binary32 sums", mixed, {"numpy float16": 1}, 9)


def measure_elimination() -> list[Row]:
    """Factors beside lists of MPFR, and an inverse beside a proved enclosure by Arb."""
    A = np.random.default_rng(2).standard_normal((SMALL, SMALL)) + 10 * np.eye(SMALL)
    fmt = FloatFormat(2, 24, "even")
    a = fmt.array(A)
    start = [[gmpy2.mpfr(x) for x in row] for row in a.to_float().tolist()]

    def with_mpfr() -> list[list[Any]]:
        """The upper factor."""
        u = [list(row) for row in start]
        with gmpy2.context(precision=24):
            for k in range(SMALL):
                top = u[k]
                for i in range(k + 1, SMALL):
                    row, factor = u[i], u[i][k] / top[k]
                    row[k] = gmpy2.mpfr(0)
                    row[k + 1 :] = [x - factor * y for x, y in zip(row[k + 1 :], top[k + 1 :], strict=True)]
        return u

    table = compare("LU, n = 100, 24 bits", {"gpbnb": lambda: linalg.lu(a).upper, "MPFR": with_mpfr}, {"MPFR": 60}, 5)
    enclosed = flint.arb_mat(a.to_float().tolist())
    works: Works = {"gpbnb": lambda: linalg.inv(a), "Arb, an enclosure": enclosed.inv}
    return table + rows("inverse, n = 100, 24 bits", medians(works, 9), "gpbnb", {"Arb, an enclosure": 1})


def measure() -> list[Row]:
    """Times of all of them; numbers are of a size that no sum leaves the range of binary16."""
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((2, COUNT))
    A, B = rng.standard_normal((2, SIZE, SIZE))
    return measure_apytypes(x, y, A, B) + measure_machine(x, y, A, B) + measure_elimination()
