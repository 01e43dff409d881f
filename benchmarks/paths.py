"""Compare compiled loops over whole arrays with the exact kernel, digit for digit: ``python -m benchmarks.paths``.

Products, inner products, factors, inverses, quotients, sums and conversions have loops without range checks, loops in
the processor's binary32, and loops that look for lost results only at their end. Each is compared with the same
operations on Python's integers. A result beyond the range must overflow in both.

Some operands have few digits, so that ties are frequent; others have exponents far apart, lie next to the smallest
numbers, so that products underflow, or next to the largest, so that sums overflow.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from gpbnb.arithmetic import linalg, named
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.tables import Table

RESULTS = Path(__file__).parent / "results"
FORMATS: dict[str, FloatFormat | FixedFormat] = {
    "binary16": named.BINARY16,
    "bfloat16": named.BFLOAT16,
    "FP8 E4M3": named.FP8_E4M3,
    "TF32": named.TF32,
    "binary32": named.BINARY32,
    "binary64": named.BINARY64,
    "11 bits, even": FloatFormat(2, 11, "even"),
    "24 bits, even": FloatFormat(2, 24, "even"),
    "24 bits, even, flushed": FloatFormat(2, 24, "even", emin=-100, emax=100, subnormal=False),
    "24 bits, even, small": FloatFormat(2, 24, "even", emin=-40, emax=40),
    "25 bits, even": FloatFormat(2, 25, "even"),
    "26 bits, even": FloatFormat(2, 26, "even"),
    "52 bits, even": FloatFormat(2, 52, "even"),
    "53 bits, even": FloatFormat(2, 53, "even"),
    "53 bits, even, small": FloatFormat(2, 53, "even", emin=-100, emax=100),
    "53 bits, up": FloatFormat(2, 53, "up"),
    "11 bits, even, flushed": FloatFormat(2, 11, "even", emin=-14, emax=15, subnormal=False),
    "11 bits, nearest": FloatFormat(2, 11),
    "24 bits, nearest": FloatFormat(2, 24),
    "24 bits, chop": FloatFormat(2, 24, "chop"),
    "53 bits, nearest": FloatFormat(2, 53),
    "53 bits, chop": FloatFormat(2, 53, "chop"),
    "24 bits, up": FloatFormat(2, 24, "up"),
    "6 hexadecimal, chop": FloatFormat(16, 6, "chop"),
    "6 hexadecimal, nearest": FloatFormat(16, 6),
    "8 decimal, nearest": FloatFormat(10, 8),
    "17 decimal, chop": FloatFormat(10, 17, "chop"),
    "Q3.12, even": FixedFormat(3, 12, "even", overflow="saturate"),
    "Q7.8, nearest": FixedFormat(7, 8),
}
OPERATIONS = 1_000_000  # of each kind in each format
_SIZE = 22  # of matrices


class Count(NamedTuple):
    """Operations compared on one path, how many arrays overflowed, and those that differ."""

    fmt: str
    operation: str
    compared: int
    overflowed: int
    different: int


def drawn(fmt: Any, rng: np.random.Generator, *shapes: tuple[int, ...]) -> list[FloatArray]:
    """Arrays of one of four kinds each, three times in four of the same kind."""
    kinds = rng.choice(["short", "far", "low", "high"], len(shapes))
    if rng.random() < 0.75:
        kinds[:] = kinds[0]
    return [_numbers(fmt, shape, kind, rng) for shape, kind in zip(shapes, kinds, strict=True)]


def _numbers(fmt: Any, shape: tuple[int, ...], kind: str, rng: np.random.Generator) -> FloatArray:
    """Numbers of a kind, and a tenth zeros."""
    limits = fmt.limits
    lowest, highest = (-250.0, 250.0) if limits is None else (float(limits.emin), float(np.log2(float(limits.largest))))
    lowest, highest = (bound * (np.log2(fmt.base) if limits is not None else 1) for bound in (lowest, highest))
    values = rng.integers(-9, 10, shape) + rng.choice([0.0, 1 / 2, 1 / 3, 2.0**-12], shape)
    if kind == "far":
        least = int(max(lowest / 2, -200))
        values = rng.standard_normal(shape) * 2.0 ** rng.integers(
            least, max(least + 1, int(min(highest / 3, 60))), shape
        )
    elif kind == "low":
        values = values * 2.0 ** max(lowest / 2 - 3, -240)
    elif kind == "high":
        values = values * 2.0 ** min(highest / 2 - 4, 240)
    values[rng.random(shape) < 0.1] = 0
    limit = np.inf if limits is None else float(limits.largest) / 2
    array: FloatArray = fmt.array(np.clip(values, -limit, limit))
    return array


def _quotients(fmt: Any, rng: np.random.Generator) -> tuple[Callable[..., Any], list[FloatArray], int]:
    x, y = drawn(fmt, rng, (1000,), (1000,))
    return lambda x, y: x / y, [x, np.where(y == 0, x.operand(fmt.array(0.5)), y)], 1000  # type: ignore[list-item]


def _ordered(fmt: Any, rng: np.random.Generator, order: Any) -> tuple[Callable[..., Any], list[FloatArray], int]:
    n = 900 + int(rng.integers(100))
    return lambda x, y: linalg.matmul(x, y, order=order), drawn(fmt, rng, (2, n), (n, 2)), 8 * n


def _square(fmt: Any, rng: np.random.Generator) -> FloatArray:
    (a,) = drawn(fmt, rng, (_SIZE, _SIZE))
    largest = float(np.max(np.abs(a.to_float())))
    scale = min(4 * largest, float(fmt.limits.largest) / 2 if fmt.limits else np.inf)
    return np.where(np.eye(_SIZE, dtype=bool), fmt.array(scale), a) if rng.random() < 0.8 else a  # type: ignore[return-value]


KINDS: dict[str, Callable[[Any, np.random.Generator], tuple[Callable[..., Any], list[FloatArray], int]]] = {
    "product": lambda fmt, rng: (
        lambda a, b: a @ b,
        drawn(fmt, rng, (_SIZE, _SIZE), (_SIZE, _SIZE + 3)),
        2 * _SIZE * _SIZE * (_SIZE + 3),
    ),
    "matrix times vector": lambda fmt, rng: (
        lambda a, b: a @ b,
        drawn(fmt, rng, (102, 100), (100,)),
        20_400,
    ),
    "inner product": lambda fmt, rng: (
        lambda a, b: a @ b,
        drawn(fmt, rng, (10_001,), (10_001,)),
        20_002,
    ),
    "LU": lambda fmt, rng: (
        lambda a: linalg.lu(a, pivot=bool(a.shape[0] % 2)),
        [_square(fmt, rng)],
        2 * _SIZE**3 // 3,
    ),
    "inverse": lambda fmt, rng: (lambda a: linalg.inv(a, pivot=True), [_square(fmt, rng)], 8 * _SIZE**3 // 3),
    "quotient": _quotients,
    "partial sums": lambda fmt, rng: (np.cumsum, drawn(fmt, rng, (1000,)), 1000),
    "pairwise sum": lambda fmt, rng: _ordered(fmt, rng, "pairwise"),
    "blocked sum": lambda fmt, rng: _ordered(fmt, rng, "blocked"),
    "conversion": lambda fmt, rng: (fmt.array, drawn(FloatFormat(2, 53), rng, (1000,)), 1000),
    "to float64": lambda fmt, rng: (lambda x: x.to_float(), drawn(fmt, rng, (1000,)), 1000),
    "square root": lambda fmt, rng: (lambda x: np.sqrt(abs(x)), drawn(fmt, rng, (1000,)), 1000),
}


def outcome(function: Callable[..., Any], *arrays: FloatArray) -> list[NDArray[Any]] | str:
    """Significands and exponents of what a function returns, or how it fails."""
    try:
        result = function(*arrays)
    except (OverflowError, np.linalg.LinAlgError) as error:
        return type(error).__name__
    if isinstance(result, np.ndarray):
        return [result]
    parts = result if isinstance(result, tuple) else (result,)
    return [half for part in parts if isinstance(part, FloatArray) for half in part.to_pairs()]


def same(found: list[NDArray[Any]] | str, expected: list[NDArray[Any]] | str) -> bool:
    """Whether both failed in the same way, or gave equal numbers."""
    if isinstance(found, str) or isinstance(expected, str):
        return bool(found == expected)
    return len(found) == len(expected) and all(map(np.array_equal, found, expected))


def compare(fmt: str, operation: str, count: int, seed: int) -> Count:
    """Compare at least `count` operations of one path."""
    rng = np.random.default_rng([seed, list(FORMATS).index(fmt), list(KINDS).index(operation)])
    compared = overflowed = different = 0
    while compared < count:
        function, arrays, size = KINDS[operation](FORMATS[fmt], rng)
        expected = outcome(function, *(array.on_exact_backend() for array in arrays))
        different += not same(outcome(function, *arrays), expected)
        overflowed += isinstance(expected, str)
        compared += size
    return Count(fmt, operation, compared, overflowed, different)


def run(count: int, seed: int, formats: Any = FORMATS, kinds: Any = KINDS) -> Iterator[Count]:
    """Compare every path, or those of some formats and kinds."""
    for fmt in formats:
        for operation in kinds:
            yield compare(fmt, operation, count, seed)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paths", description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=OPERATIONS, help="operations on each path, a million by default")
    parser.add_argument("--seed", type=int, default=1986)
    options = parser.parse_args()
    counts = list(tqdm(run(options.count, options.seed), total=len(FORMATS) * len(KINDS)))
    rows = []
    for fmt in FORMATS:
        mine = [count for count in counts if count.fmt == fmt]
        rows.append((fmt, *(f"{count.compared:,}" for count in mine), str(sum(count.different for count in mine))))
        print(*rows[-1], sep="  ")
    total, different = sum(count.compared for count in counts), sum(count.different for count in counts)
    print(f"{total:,} operations compared, {different or 'no'} arrays different")
    if options.count >= OPERATIONS:
        RESULTS.mkdir(exist_ok=True)
        table = Table("operations compared", ("format", *KINDS, "arrays that differ"), tuple(rows)).markdown()
        (RESULTS / "paths.md").write_text(f"{table}\n", encoding="utf-8")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
