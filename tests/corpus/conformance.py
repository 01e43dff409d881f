"""Compare the package with independent arithmetic on fresh inputs: ``python -m tests.corpus.conformance``.

Each row of a table is a format: a base, a precision, a rounding, a range, and so a kind of storage. Each operation on
random and on difficult operands is compared with ``decimal`` in base 10, with MPFR in bases 2 and 16 without a range,
and else with exact fractions. Formats of processors are compared with the processor, NumPy and ml_dtypes. Runs of the
corpus with another seed are compared with its oracle, and generated C with its emulation, by each compiler, without and
with optimization, and under the sanitizer of undefined behaviour.

``--slice I/K`` takes every K-th row or run, from the I-th, so that the whole can be spread over several calls. A whole
comparison leaves its counts in ``benchmarks/results``.
"""

from __future__ import annotations

import argparse
import decimal
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import gmpy2
import ml_dtypes
import numpy as np

from gpbnb.arithmetic.kernels import backends
from tests.corpus import oracle, package
from tests.corpus.__main__ import confirm, drawn, names
from tests.corpus.draw import PROCESSORS, ROUNDINGS, Draw, Fixed, Float, Format
from tests.corpus.families import ARITHMETIC

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"
OPERATIONS = (*ARITHMETIC, "convert")
COUNT = 100
"""Results of each operation in each format."""

SHORT = {2: range(1, 54), 10: range(1, 19), 16: range(1, 14)}
WIDE = {2: (54, 61, 62, 63, 64, 106, 113), 10: (19, 20, 27, 33, 34), 16: (14, 15, 27, 28)}
INTEGERS = {2: (114, 200), 3: (1, 5, 33, 40), 10: (35, 50), 16: (29,)}
"""Precisions by the way in which significands are stored: one word, two, or integers of any length."""


class Row(NamedTuple):
    """A format, and how it is stored."""

    storage: str
    fmt: Format


def rows() -> Iterator[Row]:
    """Every base, precision and rounding; ranges take turns."""
    for storage, table in (("one word", SHORT), ("two words", WIDE), ("integers", INTEGERS)):
        for base, precisions in table.items():
            for precision in precisions:
                for i, rounding in enumerate((*ROUNDINGS, "half up")):
                    plain = Float(base, precision, rounding)
                    yield Row(storage, plain)
                    kind = (i + precision) % 4
                    reach = (9, 60, 20, 12)[kind]
                    if (i + precision) % 2 == 0:
                        overflow = "saturate" if kind == 2 else "raise"
                        limited = plain._replace(emin=-reach, emax=reach + 1, subnormal=kind != 0, overflow=overflow)
                        yield Row(f"{storage}, range", limited)
    for bits in (4, 8, 16, 24, 32, 53, 60, 80):
        for i, rounding in enumerate((*ROUNDINGS, "half up")):
            overflow = ("raise", "saturate", "wrap")[(i + bits // 4) % 3]
            yield Row(
                "fixed point", Fixed((i * 3 + 1) % (bits - 1), bits - 1 - (i * 3 + 1) % (bits - 1), rounding, overflow)
            )


# -- independent arithmetic -------------------------------------------------------------------------------------------

Results = list[Any]
"""A number for each tuple of operands, or why there is none."""


def expected(fmt: Format, operation: str, operands: Any) -> Results:
    """What other arithmetic gives."""
    if isinstance(fmt, Float) and fmt.base == 10 and fmt.rounding in _DECIMAL and _serves_decimal(fmt, operation):
        return _by_decimal(fmt, operation, operands)
    if isinstance(fmt, Float) and fmt.base in (2, 16) and fmt.emin is None:
        return [_by_mpfr(fmt, operation, each) for each in operands]
    return [_exactly(fmt, operation, each) for each in operands]


def _exactly(fmt: Format, operation: str, given: Any) -> Any:
    found = (
        oracle.converted(fmt, given, "fractions") if operation == "convert" else oracle.applied(fmt, operation, [given])
    )
    return found if isinstance(found, str) else found[0]


_DECIMAL = {
    "nearest": decimal.ROUND_HALF_UP, "chop": decimal.ROUND_DOWN, "even": decimal.ROUND_HALF_EVEN,
    "up": decimal.ROUND_CEILING, "down": decimal.ROUND_FLOOR,
}  # fmt: skip


def _serves_decimal(fmt: Float, operation: str) -> bool:
    """Whether ``decimal`` has the format, with subnormal numbers and errors; its roots only round half to even."""
    return (fmt.emin is None or (fmt.subnormal and fmt.overflow == "raise")) and operation != "sqrt"


def _by_decimal(fmt: Float, operation: str, operands: Any) -> Results:
    low, high = (decimal.MIN_EMIN, decimal.MAX_EMAX) if fmt.emin is None else (fmt.emin, fmt.emax)
    context = decimal.Context(fmt.precision, _DECIMAL[fmt.rounding], low, high, traps=[decimal.Overflow])
    exact = decimal.Context(400, Emin=decimal.MIN_EMIN, Emax=decimal.MAX_EMAX, traps=[decimal.Inexact])
    name = {"fused": "fma", "convert": "plus"}.get(operation, operation)
    found = []
    for given in operands:
        numbers = [exact.divide(decimal.Decimal(each.numerator), decimal.Decimal(each.denominator)) for each in given]
        try:
            found.append(Fraction(getattr(context, name)(*numbers)))
        except decimal.Overflow:
            found.append("overflow")
    return found


_MPFR = {"subtract": "sub", "multiply": "mul", "divide": "div", "fused": "fma", "convert": "plus"}


def _by_mpfr(fmt: Float, operation: str, given: Any) -> Any:
    """Round toward zero to eight bits more than the result has, with a last bit for what is lost; then round that."""
    most = (4 if fmt.base == 16 else 1) * fmt.precision + 8
    context = gmpy2.context(precision=most, round=gmpy2.RoundToZero)
    long = gmpy2.context(precision=2000)
    numbers = [long.div(gmpy2.mpz(each.numerator), gmpy2.mpz(each.denominator)) for each in given]
    if any(each.rc for each in numbers):
        return _exactly(fmt, operation, given)
    value = getattr(context, _MPFR.get(operation, operation))(*numbers)
    if value == 0:
        return Fraction(0)
    lost = value.rc  # the sign of the result less the exact one
    found = Fraction(int(value.as_integer_ratio()[0]), int(value.as_integer_ratio()[1]))
    if lost:
        found += Fraction(1 if value > 0 else -1) * Fraction(2) ** (gmpy2.get_exp(value) - most - 1)
    return oracle.rounds(fmt)(found)


# -- comparisons ------------------------------------------------------------------------------------------------------


class Count(NamedTuple):
    """Results compared in one row, by operation, and those that differ."""

    row: Row
    compared: dict[str, int]
    different: list[str]


def compare(row: Row, count: int, seed: int) -> Count:
    """Compare `count` results of each operation in a format."""
    fmt, draw, compared, wrong = row.fmt, Draw(f"conformance {row.fmt}", seed), dict[str, int](), list[str]()
    r = oracle.rounds(fmt)
    for operation in OPERATIONS:
        if operation == "convert":
            operands: Any = [[_long(draw, fmt, r)] for _ in range(count)]
        else:
            operands = draw.operands(fmt, operation, count, r) + edges(fmt, operation, r)
        values = expected(fmt, operation, operands)
        beyond = [x for x, value in zip(operands, values, strict=True) if isinstance(value, str)]
        within = [(x, value) for x, value in zip(operands, values, strict=True) if not isinstance(value, str)]
        compared[operation] = len(within) + len(beyond[:3])
        wrong += [
            f"{fmt}: {operation} {x}: no overflow" for x in beyond[:3] if _found(fmt, operation, [x]) != "overflow"
        ]
        found = _found(fmt, operation, [x for x, _ in within]) if within else []
        if isinstance(found, str):
            wrong.append(f"{fmt}: {operation}: {found}")
            continue
        wrong += [
            f"{fmt}: {operation} {[str(a) for a in x]}: {number}, expected {value}"
            for (x, value), number in zip(within, found, strict=True) if number != value
        ][:3]  # fmt: skip
    return Count(row, compared, wrong)


def edges(fmt: Format, operation: str, r: Callable[[Fraction], Fraction]) -> Any:
    """Sums of all nines that carry, and of one that borrows a digit, to a tie or just beside it."""
    if isinstance(fmt, Fixed) or operation not in ("add", "subtract"):
        return []
    b, unit = fmt.base, Fraction(fmt.base) ** (1 - fmt.precision)
    sums = [(b - unit, (1 + Fraction(b, 2) + k * unit) * unit) for k in (-1, 0, 1)]
    sums += [(Fraction(1), -(1 + k * unit) * unit / (2 * b)) for k in (-1, 0, 1)]
    sign = 1 if operation == "add" else -1
    return [[r(x * side), r(y * side * sign)] for x, y in sums for side in (1, -1)]


def _found(fmt: Format, operation: str, operands: Any) -> Any:
    if operation == "convert":
        return package.converted(fmt, [x for (x,) in operands], "fractions")
    return package.applied(fmt, operation, operands)


def _long(draw: Draw, fmt: Format, r: Callable[[Fraction], Fraction]) -> Fraction:
    """A number with more digits than a format, often at or beside the midpoint of two of its numbers."""
    while True:
        x = draw.operands(fmt, "convert", 1, r)[0][0]
        base = fmt.base if isinstance(fmt, Float) else 2
        unit = abs(x) / base ** draw.between(1, 70) if x else Fraction(0)
        found = draw.pick((x + unit * draw.between(-3, 3), x + unit / 2, x, draw.number(9, 12)))
        if not isinstance(fmt, Fixed) or abs(found) < 2**fmt.integer:
            return found


NATIVE: dict[str, Any] = {
    "BINARY16": np.float16, "BINARY32": np.float32, "BINARY64": np.float64, "BFLOAT16": ml_dtypes.bfloat16,
    "FP8_E4M3": ml_dtypes.float8_e4m3fn, "FP8_E5M2": ml_dtypes.float8_e5m2,
}  # fmt: skip
"""Formats of processors, and the types that compute in them; FP8 is compared on every pair of numbers."""


def native(name: str, count: int, seed: int) -> tuple[int, int]:
    """Compare + - * / and square roots with the processor, NumPy or ml_dtypes; count results, and those that differ."""
    dtype, rng = NATIVE[name], np.random.default_rng(seed)
    size = np.dtype(dtype).itemsize
    every = np.arange(256, dtype=np.uint8).view(dtype) if size == 1 else None
    compared = different = 0
    for operation in ("add", "subtract", "multiply", "divide", "sqrt"):
        with np.errstate(all="ignore"):
            if every is not None:
                x, y = (part.ravel() for part in np.meshgrid(every, every))
            else:
                x, y = (rng.integers(0, 256**size, count, dtype=f"u{size}").view(dtype) for _ in range(2))
                near = (y.astype(np.float64) * rng.choice([1, -1, 1 + 2.0**-9, 2.0**-24], count)).astype(dtype)
                x = np.where(rng.random(count) < 0.5, x, near)
            x = abs(x) if operation == "sqrt" else x
            given = [part.astype(np.float64) for part in ((x,) if operation == "sqrt" else (x, y))]
            found = getattr(np, operation)(*((x,) if operation == "sqrt" else (x, y))).astype(np.float64)
            kept = np.logical_and.reduce([np.isfinite(part) for part in (*given, found)])
            over = np.logical_and.reduce([np.isfinite(part) for part in given]) & ~kept
        if operation == "divide":
            kept, over = kept & (given[1] != 0), over & (given[1] != 0)
        ours = package.applied_to_floats(PROCESSORS[name], operation, *(part[kept] + 0.0 for part in given))
        different += int(np.count_nonzero(ours != found[kept] + 0.0))
        compared += int(kept.sum())
        for i in np.flatnonzero(over)[:50]:
            compared += 1
            different += (
                package.applied_to_floats(PROCESSORS[name], operation, *(part[i : i + 1] for part in given)) is not None
            )
    return compared, different


COMPILERS = ("gcc", "clang")
LEVELS = ("-O0", "-O2", "-O1 -fsanitize=undefined -fno-sanitize-recover=all")


def built(name: str, seed: int) -> tuple[str, int, int, list[str]]:
    """Write a filter of the corpus with another seed in C, and build it in every way; kind, builds, steps, faults."""
    run = drawn(name, seed)[0]
    settings = [f"{compiler} {level}" for compiler in COMPILERS if shutil.which(compiler) for level in LEVELS]
    steps = list(package.coded(*run.arguments, settings=settings))  # type: ignore[union-attr]
    found = [step["C"] for step in steps if "C" in step]
    fmt = run.arguments[1]  # type: ignore[union-attr]
    kind = "words"
    if isinstance(fmt, Float):
        kind = "binary32" if fmt.precision == 24 else "binary64"
    elif isinstance(fmt, Fixed):
        kind = f"int{1 + fmt.integer + fmt.fraction}"
    pairs = zip(settings, found, strict=False)
    faults = [f"{name} {run.title}: {setting}: {each}" for setting, each in pairs if each != "agrees"]
    return kind, len(found), sum("vectors" in step for step in steps), faults


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.corpus.conformance", description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=COUNT, help="results of each operation in each format")
    parser.add_argument("--seed", type=int, default=1, help="of the inputs")
    parser.add_argument("--slice", default="0/1", metavar="I/K", help="every K-th row and run, from the I-th")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    backends.LOOPS_AFTER = 0  # loops are compared, not what exact arithmetic computes before
    first, every = map(int, options.slice.split("/"))
    whole = every == 1 and options.count >= COUNT
    wrong = arithmetic([*rows()][first::every], options, whole)
    wrong += processors([*NATIVE][first::every], options, whole)
    wrong += code([f"code {i}" for i in range(120)][first::every], options, whole)
    chosen = [each for each in names() if not each.startswith("code")][first::every]
    wrong += confirm(chosen, options.seed, options.processes)
    return 1 if wrong else 0


def _table(name: str, header: tuple[str, ...], body: list[tuple[str, ...]], about: str, stored: bool) -> None:
    """Print a table, and store it after a whole comparison."""
    lines = [header, ("---",) * len(header), *body]
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    print(f"{text}\n{about}\n")
    if stored:
        (RESULTS / name).write_text(f"{text}\n\n{about}\n", encoding="utf-8")


def _today() -> str:
    return datetime.now(UTC).date().isoformat()


def arithmetic(chosen: list[Row], options: Any, whole: bool) -> int:
    with ProcessPoolExecutor(options.processes) as pool:
        count = len(chosen)
        counts = list(pool.map(compare, chosen, [options.count] * count, [options.seed] * count, chunksize=4))
    for each in [text for found in counts for text in found.different][:20]:
        print(each)
    groups: dict[tuple[str, str], list[Count]] = {}
    for each in counts:
        fmt = each.row.fmt
        base = "2" if isinstance(fmt, Fixed) else str(fmt.base)
        groups.setdefault((base, each.row.storage), []).append(each)
    body = []
    for key, mine in groups.items():
        numbers = [sum(each.compared.get(name, 0) for each in mine) for name in OPERATIONS]
        cells = (*(f"{n:,}" for n in (*numbers, sum(numbers))), str(sum(len(each.different) for each in mine)))
        body.append((*key, str(len(mine)), *cells))
    about = (
        f"Compared on {_today()} with decimal {decimal.__version__}, gmpy2 {gmpy2.version()} ({gmpy2.mpfr_version()}) "
        "and exact fractions."
    )
    _table("exactness.md", ("base", "stored as", "formats", *OPERATIONS, "all", "different"), body, about, whole)
    return sum(len(each.different) for each in counts)


def processors(chosen: list[str], options: Any, whole: bool) -> int:
    count = 10_000 * options.count
    found = {name: native(name, count, options.seed) for name in chosen}
    body = [(name, f"{compared:,}", str(different)) for name, (compared, different) in found.items()]
    versions = f"numpy {np.__version__} and ml_dtypes {ml_dtypes.__version__}"
    about = f"Compared on {_today()} on {platform.machine()} with {versions}."
    _table("processors.md", ("format", "all", "different"), body, about, whole)
    return sum(different for _, different in found.values())


def code(chosen: list[str], options: Any, whole: bool) -> int:
    with ProcessPoolExecutor(options.processes) as pool:
        found = list(pool.map(built, chosen, [options.seed] * len(chosen)))
    for each in [text for *_, faults in found for text in faults][:20]:
        print(each)
    body = []
    for kind in dict.fromkeys(sorted(each[0] for each in found)):
        mine = [each for each in found if each[0] == kind]
        faults = sum(len(each[3]) for each in mine)
        builds, steps = sum(each[1] for each in mine), sum(each[1] * each[2] for each in mine)
        body.append((kind, str(len(mine)), f"{builds - faults:,}", f"{steps:,}", str(faults)))
    compilers = ", ".join(each for each in COMPILERS if shutil.which(each))
    about = f"Compared on {_today()} on {platform.machine()} with {compilers}: {', '.join(LEVELS)}."
    _table("code.md", ("format", "filters", "builds", "steps compared", "different"), body, about, whole)
    return sum(len(each[3]) for each in found)


if __name__ == "__main__":
    sys.exit(main())
