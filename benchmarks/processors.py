"""Compare the formats of processors with independent arithmetic, digit for digit: ``python -m benchmarks.processors``.

==================  ==========================================================================  =======================
what                which operands                                                              compared with
==================  ==========================================================================  =======================
binary16            every pair of finite numbers: + - * /                                       the machine's float32,
                                                                                                converted to float16
bfloat16            every pair of finite numbers: + - * /                                       ml_dtypes
both FP8 formats    every pair, and for E4M3 every triple of the fused multiply-add             ml_dtypes
conversion to them  every number, and 1/4, 1/2, 3/4 of each gap with their neighbours           NumPy, ml_dtypes
square roots        every number that is not negative                                           NumPy, ml_dtypes
binary32, binary64  random bit patterns, half of the pairs close to each other                  the machine, by NumPy
==================  ==========================================================================  =======================

Ties go to even throughout. The machine, NumPy and ml_dtypes compute in float32 and round again, which is right for
formats of at most 11 bits: no quotient, sum, product or root of theirs is, in 24 bits, a new tie. The other modes are
compared with their definitions, in Fractions, by the tests.

A finite number there must be the same number here; an infinity there must overflow here, and so must the NaN that E4M3
has in its place.

The full comparison takes minutes to an hour. It writes each finished part to a journal in ``.cache`` and resumes from
it, as long as the compared code stays the same. When all parts are done it writes the counts to
``benchmarks/results/processors.csv``.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import hashlib
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import ml_dtypes
import numpy as np
from numba import njit
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.journal import Journal
from gpbnb.arithmetic import named
from gpbnb.arithmetic import rounding as rules
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import bits, elementwise, processor
from gpbnb.report.display.tables import Table

RESULTS = Path(__file__).parent / "results"
SMALL: dict[str, tuple[FloatFormat, Any]] = {
    "binary16": (named.BINARY16, np.float16),
    "bfloat16": (named.BFLOAT16, ml_dtypes.bfloat16),
    "FP8 E4M3": (named.FP8_E4M3, ml_dtypes.float8_e4m3fn),
    "FP8 E5M2": (named.FP8_E5M2, ml_dtypes.float8_e5m2),
}
MACHINE: dict[str, tuple[FloatFormat, Any]] = {
    "binary32": (named.BINARY32, np.float32),
    "binary64": (named.BINARY64, np.float64),
}
OPERATIONS = ("add", "subtract", "multiply", "divide")
RANDOM = 4_000_000  # pairs of each operation of binary32 and binary64
_LEAST_HALF, _LEAST_NORMAL, _OVERFLOW = np.float32([2.0**-24, 2.0**-14, 65520.0])
_BATCH = 1 << 16
_PART = 4096  # numbers, each with every other, in one line of the journal
JOURNAL = Path(__file__).parent.parent / ".cache" / "exactness.csv"


class Count(NamedTuple):
    """Comparisons of one operation, and how many differ."""

    fmt: str
    operation: str
    compared: int
    different: int


def code_digest() -> str:
    """Eight characters that change with the code that rounds."""
    files = [module.__file__ for module in (bits, named, processor, rules)]
    return hashlib.sha256(b"".join(Path(str(file)).read_bytes() for file in files)).hexdigest()[:8]


def _half(single: NDArray[np.float32]) -> NDArray[np.float16]:
    """The float16 nearest to each float32.

    Handling overflow and underflow by hand is faster: when NumPy converts, it spends most of its time on their flags.
    """
    size = np.abs(single)
    exact = np.where(size < _LEAST_NORMAL, np.rint(single / _LEAST_HALF) * _LEAST_HALF, single)
    return np.where(size < _OVERFLOW, exact, np.copysign(np.float32(np.inf), single)).astype(np.float16)


@njit
def _unequal(found: Any, expected: Any, values: Any) -> Any:
    """How many results differ; `expected` are the bit patterns of the type, `values` their float64, NaN if infinite."""
    count = 0
    for i in range(found.shape[0]):
        wanted = values[expected[i]]
        same = (found[i] == wanted) & (np.copysign(1.0, found[i]) > -1.0 or found[i] != 0.0)
        count += not (same or (wanted != wanted and found[i] != found[i]))
    return count


def operate(operation: str, dtype: Any, a: Any, b: NDArray[Any]) -> NDArray[Any]:
    """The bit patterns of ``a operation b`` for one number and many."""
    with np.errstate(all="ignore"):
        if dtype is np.float16:
            found = _half(getattr(np, operation)(a.astype(np.float32), b.astype(np.float32)))
        else:
            found = np.asarray(getattr(np, operation)(a, b))
    return found.view(f"u{np.dtype(dtype).itemsize}")


def finite(dtype: Any) -> NDArray[Any]:
    """Every finite number of a type of 8 or 16 bits, once: without the negative zero."""
    size = np.dtype(dtype).itemsize
    every = np.arange(256**size, dtype=f"u{size}").view(dtype)
    with np.errstate(all="ignore"):
        wide = every.astype(np.float64)
    return every[np.isfinite(wide) & ~((wide == 0) & np.signbit(wide))]


def computed(fmt: FloatFormat, name: str, *operands: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the compiled loop gives, NaN where it overflows."""
    result = np.empty(operands[0].size)
    inputs = [np.ascontiguousarray(x) for x in operands]
    for x in inputs:
        x.flags.writeable = False
    elementwise.ENTRIES[name](fmt.backend.tag, result.size, *inputs, result)  # type: ignore[attr-defined]
    return result


def differing(found: NDArray[np.float64], expected: NDArray[Any]) -> int:
    """How many results differ; NaN stands for an overflow, and no zero may be negative."""
    with np.errstate(all="ignore"):
        wide = expected.astype(np.float64)
    same = np.where(np.isfinite(wide), found == wide, np.isnan(found))
    return int(np.count_nonzero(~same | ((found == 0) & np.signbit(found))))


def pairs(name: str, share: float, rng: np.random.Generator, journal: Journal | None = None) -> Iterator[Count]:
    """Each number, or a share of them, with every other."""
    fmt, dtype = SMALL[name]
    every = finite(dtype)
    wide = every.astype(np.float64)
    size = np.dtype(dtype).itemsize
    with np.errstate(all="ignore"):
        values = np.arange(256**size, dtype=f"u{size}").view(dtype).astype(np.float64)
    values[~np.isfinite(values)] = np.nan
    rows = np.flatnonzero(rng.random(every.size) < share) if share < 1 else np.arange(every.size)
    for operation in OPERATIONS:
        second, wide_second = (every[wide != 0], wide[wide != 0]) if operation == "divide" else (every, wide)
        compared = different = 0
        for start in tqdm(range(0, rows.size, _PART), desc=f"{name} {operation}", disable=share < 1, leave=False):
            part = f"{name} {operation} {start}"
            if journal is None or part not in journal.parts:
                chosen, wrong = rows[start : start + _PART], 0
                for i in chosen:
                    expected = operate(operation, dtype, every[i], second)
                    found = computed(fmt, operation, np.full(second.size, wide[i]), wide_second)
                    wrong += _unequal(found, expected, values)
                count = Count(name, operation, chosen.size * second.size, int(wrong))
                if journal is not None:
                    journal.add(part, count)
            else:
                fmt_name, kind, *counts = journal.parts[part]
                count = Count(fmt_name, kind, *map(int, counts))
            compared, different = compared + count.compared, different + count.different
        yield Count(name, operation, compared, different)


def unary(name: str) -> Iterator[Count]:
    """Square roots, and conversions of float64 between the numbers."""
    fmt, dtype = SMALL[name]
    wide = np.sort(finite(dtype).astype(np.float64))
    positive = wide[wide >= 0]
    with np.errstate(all="ignore"):
        yield Count(
            name, "sqrt", positive.size, differing(computed(fmt, "sqrt", positive), np.sqrt(positive.astype(dtype)))
        )
    # The points are float32, from which NumPy and ml_dtypes round once.
    gaps = np.diff(wide)
    points = [wide, *(wide[:-1] + share * gaps for share in (0.25, 0.5, 0.75))]
    middle = (wide[:-1] + 0.5 * gaps).astype(np.float32)
    points += [np.nextafter(middle, np.float32(end)).astype(np.float64) for end in (-np.inf, np.inf)]
    x = np.concatenate(points)
    assert np.array_equal(x, x.astype(np.float32))
    yield Count(name, "conversion", x.size, differing(computed(fmt, "round_", x), x.astype(np.float32).astype(dtype)))


def triples(share: float, rng: np.random.Generator) -> Iterator[Count]:
    """``a * b + c`` of E4M3, exact in float64, and converted from it."""
    fmt, dtype = SMALL["FP8 E4M3"]
    wide = finite(dtype).astype(np.float64)
    b, c = (part.ravel() for part in np.meshgrid(wide, wide))
    rows = wide[rng.random(wide.size) < max(share, 0.02)] if share < 1 else wide
    different = 0
    for a in rows:
        with np.errstate(all="ignore"):
            expected = (a * b + c).astype(dtype)
        different += differing(computed(fmt, "fused", np.full(b.size, a), b, c), expected)
    yield Count("FP8 E4M3", "fused", rows.size * b.size, different)


def machine(name: str, share: float, rng: np.random.Generator) -> Iterator[Count]:
    """Random bit patterns: all exponents alike, subnormal numbers and overflow included."""
    fmt, dtype = MACHINE[name]
    size = np.dtype(dtype).itemsize
    for operation in (*OPERATIONS, "sqrt"):
        compared = different = 0
        with np.errstate(all="ignore"):
            for _ in range(max(1, round(share * RANDOM / _BATCH))):
                x, y = (rng.integers(0, 256**size, _BATCH, dtype=f"u{size}").view(dtype) for _ in range(2))
                near = (y.astype(np.float64) * rng.choice([1, -1, 1 + 2.0**-9, 2.0**-24], _BATCH)).astype(dtype)
                x = np.where(rng.random(_BATCH) < 0.5, x, near)
                kept = np.isfinite(x) & np.isfinite(y) & ((y != 0) | (operation != "divide"))
                if operation == "sqrt":
                    x, kept = np.abs(x), np.isfinite(x)
                given = (x[kept],) if operation == "sqrt" else (x[kept], y[kept])
                wide = [part.astype(np.float64) + 0.0 for part in given]
                different += differing(computed(fmt, operation, *wide), getattr(np, operation)(*given))
                compared += int(np.count_nonzero(kept))
        yield Count(name, operation, compared, different)


def run(share: float, seed: int, journal: Journal | None = None) -> Iterator[Count]:
    """Compare everything, or a share; the slowest last."""
    rng = np.random.default_rng(seed)
    yield from triples(share, rng)
    for name in MACHINE:
        yield from machine(name, share, rng)
    for name in reversed(SMALL):
        yield from unary(name)
        # Of the FP8 formats always all pairs: there are few.
        yield from pairs(name, 1 if name.startswith("FP8") else share, rng, journal)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.processors", description=__doc__.split("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="share of all comparisons, 1 for all (default)")
    parser.add_argument("--seed", type=int, default=1985)
    options = parser.parse_args()
    start = time.perf_counter()
    counts = []
    for count in run(options.share, options.seed, Journal(JOURNAL, code_digest()) if options.share == 1 else None):
        counts.append(count)
        print(f"{count.fmt:<10} {count.operation:<11} {count.compared:>15,} {count.different:>10,}", flush=True)
    total, different = sum(c.compared for c in counts), sum(c.different for c in counts)
    print(f"{total:,} results compared in {time.perf_counter() - start:.0f} s, {different or 'none'} different")
    if options.share == 1:
        write(counts)
    return 1 if different else 0


def write(counts: list[Count]) -> None:
    """Store the counts with the date, the commit and what they were compared with."""
    RESULTS.mkdir(exist_ok=True)
    commit = subprocess.run(
        ["git", "rev-parse", "--short=10", "HEAD"], capture_output=True, text=True, cwd=RESULTS, check=False
    ).stdout.strip()
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    with (RESULTS / "processors.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow((*Count._fields, "date", "commit", "code", "numpy", "ml_dtypes"))
        for count in counts:
            writer.writerow((*count, date, commit, code_digest(), np.__version__, ml_dtypes.__version__))
    body = []
    for fmt in (*SMALL, *MACHINE):
        mine = {count.operation: count for count in counts if count.fmt == fmt}
        pairs_compared = sum(mine[name].compared for name in OPERATIONS)
        others = [f"{mine[name].compared:,}" if name in mine else "" for name in ("fused", "sqrt", "conversion")]
        body.append((fmt, f"{pairs_compared:,}", *others, str(sum(count.different for count in mine.values()))))
    header = ("format", "+ - * /", "fused", "square root", "conversion", "different")
    table = Table("results compared", header, tuple(body)).markdown()
    about = f"Compared on {date} at commit {commit} with numpy {np.__version__} and ml_dtypes {ml_dtypes.__version__}."
    (RESULTS / "processors.md").write_text(f"{table}\n\n{about}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
