"""Compare the compiled kernels with independent arithmetic, digit for digit: ``python -m benchmarks.exactness``.

Base 10 is compared with ``decimal`` (ROUND_HALF_UP, ROUND_DOWN), bases 2 and 16 with MPFR through gmpy2. MPFR has no
rounding of ties away from zero, but it follows from two of its roundings: chopped to one bit more, which keeps whether
the exact result lies at or beyond the midpoint, then away from zero.

Formats whose significands take two words have rows of their own; :mod:`benchmarks.wide` compares all their roundings
and ranges. Half of the operands are random. The others are hard: ties, near-ties, cancellation, far exponents, powers
of the base, carries to a new digit. The whole comparison, a share of 1, leaves its counts in ``benchmarks/results``.
"""

from __future__ import annotations

import argparse
import decimal
import os
import platform
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import gmpy2
import numba
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.rounding import Rounding, Rules
from gpbnb.report.display.tables import Table

PRECISIONS = {2: range(1, 54), 10: range(1, 19), 16: range(1, 14)}
WIDE = {2: (54, 55, 61, 62, 63, 64, 65, 106, 112, 113), 10: (19, 20, 21, 27, 33, 34), 16: (14, 15, 27, 28)}
"""Precisions whose significands take two words."""
OPERATIONS = ("add", "subtract", "multiply", "divide", "sqrt", "round")
PER_BASE_AND_ROUNDING = {2: 10_000_000, 10: 10_000_000, 16: 1_000_000}
PER_WIDE = 1_000_000
BATCH = 25_000
SHOWN = 20  # mismatches
RESULTS = Path(__file__).parent / "results"

Integers = NDArray[Any]


class Job(NamedTuple):
    """One batch: `count` operations of one kind in one format."""

    base: int
    precision: int
    nearest: bool
    operation: str
    count: int
    seed: tuple[int, ...]

    @property
    def wide(self) -> bool:
        """Whether significands take two words."""
        return self.precision in WIDE[self.base]

    @property
    def rules(self) -> Rules:
        return Rules(self.base, self.precision, Rounding.NEAREST if self.nearest else Rounding.CHOP)


class Outcome(NamedTuple):
    """How many were compared, and those that differ."""

    job: Job
    compared: int
    mismatches: list[str]


def jobs(share: float, seed: int) -> Iterator[Job]:
    """All batches, or a share of each."""
    families = [(base, precisions, PER_BASE_AND_ROUNDING[base]) for base, precisions in PRECISIONS.items()]
    for base, precisions, total in [*families, *((base, precisions, PER_WIDE) for base, precisions in WIDE.items())]:
        each = -(-total // (len(precisions) * len(OPERATIONS)))
        count = max(1, round(each * share))
        for nearest in (True, False):
            for precision in precisions:
                for index, operation in enumerate(OPERATIONS):
                    for start in range(0, count, BATCH):
                        key = (seed, base, precision, int(nearest), index, start)
                        yield Job(base, precision, nearest, operation, min(BATCH, count - start), key)


# -- operands --------------------------------------------------------------------------------------


class Draw:
    """Operands of one format: significands of t digits, object arrays of Python's integers, and exponents."""

    def __init__(self, job: Job, count: int) -> None:
        self.rng = np.random.default_rng(job.seed)
        self.base, self.t, self.count = job.base, job.precision, count
        self.least, self.limit = self.base ** (self.t - 1), self.base**self.t
        self.bits = self.base.bit_length() - 1
        self.reach = 10**9 if self.base == 10 else int(200 / np.log2(self.base))

    def below(self, limit: int) -> Integers:
        """Integers from 0 to `limit` - 1, those of more than a word not quite uniform."""
        if limit <= 2**62:
            return self.rng.integers(0, limit, self.count).astype(object)
        words = [self.rng.integers(0, 2**60, self.count).astype(object) for _ in range(4)]
        return np.asarray(sum(word << (60 * i) for i, word in enumerate(words)) % limit, dtype=object)

    def sign(self) -> Integers:
        return 1 - 2 * self.below(2)

    def choose(self, *choices: Integers) -> Integers:
        return np.asarray(np.choose(self.rng.integers(0, len(choices), self.count), choices), dtype=object)

    def random(self) -> Integers:
        return self.least + self.below(self.limit - self.least)

    def short(self) -> Integers:
        """Few digits, then zeros."""
        zeros = np.array([self.base ** int(k) for k in self.rng.integers(0, self.t, self.count)], dtype=object)
        return self.random() // zeros * zeros

    def edge(self) -> Integers:
        """At a power of the base, or just beside one."""
        step = self.below(3)
        return self.into_range(self.choose(self.least + step, self.limit - 1 - step))

    def any(self) -> Integers:
        return self.choose(self.random(), self.random(), self.short(), self.edge())

    def gap(self) -> Integers:
        """Difference of exponents: near, about t, far."""
        near = self.below(5) - 2
        middle = self.below(2 * self.t + 9) - self.t - 4
        return self.choose(near, middle, middle, self.sign() * self.below(self.reach))

    def into_range(self, m: Integers) -> Integers:
        return np.clip(m, self.least, self.limit - 1)

    def normalized(self, m: Integers, e: Integers) -> tuple[Integers, Integers]:
        """Cut to t digits whatever has more, fill up with zeros what has less."""
        m, e = abs(m), e.copy()
        for i, n in enumerate(m):
            if n:
                excess = (len(str(n)) if self.base == 10 else -(-n.bit_length() // self.bits)) - self.t
                m[i] = n // self.base**excess if excess > 0 else n * self.base**-excess
                e[i] += excess
        return m, e

    def half(self, u: Integers) -> Integers:
        """Twice the midpoint above u, or a number beside it."""
        return 2 * u + 1 + self.choose(self.below(1), self.below(3) - 1)


def pairs(job: Job) -> tuple[Integers, ...]:
    """Significands and exponents of both operands."""
    kinds = {"add": _sums, "subtract": _sums, "multiply": _products, "divide": _quotients}[job.operation]
    parts = []
    hard = job.count // 2
    draw = Draw(job, job.count - hard)
    parts.append((draw.sign() * draw.any(), draw.gap(), draw.sign() * draw.any(), draw.gap()))
    share = -(-hard // len(kinds))
    for index, kind in enumerate(kinds):
        if share:
            m1, e1, m2, e2 = kind(draw := Draw(job._replace(seed=(*job.seed, index)), share))
            sign = draw.sign()
            parts.append((sign * m1, e1, sign * m2, e2))
    m1, e1, m2, e2 = (np.concatenate(columns)[: job.count] for columns in zip(*parts, strict=True))
    return m1, np.where(m1 == 0, 0, e1), m2, np.where(m2 == 0, 0, e2)


def _ties_of_sums(d: Draw) -> tuple[Integers, ...]:
    """The second operand is half a unit of the first's last digit, or a little more or less."""
    e1 = d.gap()
    m2, e2 = d.normalized(d.base // 2 * d.least * d.base + d.below(5) - 2, e1 - d.t - 1)
    return d.any(), e1, d.sign() * m2, e2


def _cancellations(d: Draw) -> tuple[Integers, ...]:
    e, m1 = d.gap(), d.any()
    return m1, e, -d.sign() * d.into_range(m1 + d.below(7) - 3), e


def _cancellations_across_a_power(d: Draw) -> tuple[Integers, ...]:
    e, step = d.gap(), d.below(4)
    m2, e2 = d.normalized(d.limit - d.below(4), e - 1)
    return d.into_range(d.least + step), e, -d.sign() * m2, e2


def _carries(d: Draw) -> tuple[Integers, ...]:
    """99...9 and what makes it 100...0, or almost."""
    e = d.gap()
    m2, e2 = d.normalized(1 + d.below(d.base * 2), e - d.below(3))
    return d.into_range(d.limit - 1 - d.below(2)), e, m2, e2


def _zeros(d: Draw) -> tuple[Integers, ...]:
    return d.any() * d.below(2), d.gap(), d.any(), d.gap()


def _ties_of_products(d: Draw) -> tuple[Integers, ...]:
    """Factors of j and t + 1 - j digits whose product ends in half a unit."""
    m1, m2 = np.empty(d.count, object), np.empty(d.count, object)
    half = d.base // 2 if d.base > 2 else 1
    n = d.below(d.limit)
    for i, j in enumerate(d.rng.integers(1, d.t + 1, d.count)):
        k = d.t + 1 - int(j)
        x, y = (d.base ** (size - 1) + int(n[i]) % (d.base**size - d.base ** (size - 1)) for size in (int(j), k))
        m1[i], m2[i] = x // d.base * d.base + half, y | 1
    return (*d.normalized(m1, d.gap()), *d.normalized(m2, d.gap()))


def _near_ties_of_products(d: Draw) -> tuple[Integers, ...]:
    m1 = d.any()
    n = d.half(d.any()) * d.choose(d.below(1) + d.limit, d.below(1) + d.least)
    m2, e2 = d.normalized(n // (2 * m1) + d.below(2), d.gap())
    return m1, d.gap(), m2, e2


def _near_ties_of_quotients(d: Draw) -> tuple[Integers, ...]:
    m2 = d.any()
    m1, e1 = d.normalized(d.half(d.any()) * m2 // 2 + d.below(2), d.gap())
    return m1, e1, m2, d.gap()


def _exact_quotients(d: Draw) -> tuple[Integers, ...]:
    x, m2 = d.short(), d.short()
    m1, e1 = d.normalized(x * m2, d.gap())
    return m1, e1, m2, d.gap()


_sums = (_ties_of_sums, _cancellations, _cancellations_across_a_power, _carries, _zeros)
_products = (_ties_of_products, _near_ties_of_products, _near_ties_of_products, _zeros)
_quotients = (_near_ties_of_quotients, _near_ties_of_quotients, _exact_quotients, _zeros)


def radicands(job: Job) -> tuple[Integers, Integers]:
    """Random, squares, and squares of midpoints, each with its neighbours."""
    d = Draw(job, job.count)
    n = d.choose(d.half(d.any()) ** 2, 4 * d.any() ** 2, 4 * d.short() ** 2)
    near, e = d.normalized(n * d.base * d.base // 4 + 0, d.gap())
    near = d.into_range(near + d.choose(d.below(1), d.below(3) - 1))
    m = d.choose(d.any(), near)
    return m, e


def long_numbers(job: Job) -> Integers:
    """What is rounded: integers of up to 53 bits or 18 digits, with ties and near-ties of t digits, of both signs."""
    base, longest = (10, 18) if job.base == 10 else (2, 53)
    d = Draw(job._replace(base=base, precision=longest), job.count)
    t = min(job.precision, longest - 1) if job.base != 16 else 4 * job.precision - 3
    drops = d.rng.integers(1, longest - t + 1, d.count) if longest > t else np.ones(d.count, int)
    units = np.array([base ** int(k) for k in drops], dtype=object)
    ties = d.random() // (base ** max(longest - t - 1, 0)) * base ** max(longest - t - 2, 0) + 0
    near = (d.random() // units) * units + units // 2 + d.below(3) - 1
    return d.sign() * d.choose(d.any(), near, np.clip(ties, 0, d.limit - 1))


# -- oracles -----------------------------------------------------------------------------------------


def decimal_oracle(job: Job) -> Callable[..., list[decimal.Decimal]]:
    """The operation of ``decimal`` on lists of Decimals."""
    context = decimal.Context(
        prec=job.precision,
        rounding=decimal.ROUND_HALF_UP if job.nearest else decimal.ROUND_DOWN,
        Emax=decimal.MAX_EMAX,
        Emin=decimal.MIN_EMIN,
    )
    if job.operation == "sqrt" and job.nearest:
        # libmpdec's square root always rounds half to even; no root is a tie of t digits, so that it serves.
        return lambda x: [context.sqrt(a) for a in x]
    if job.operation == "sqrt":
        return lambda x: [_chopped_root(context, a) for a in x]
    if job.operation == "round":
        return lambda x: [context.plus(a) for a in x]
    function = getattr(context, job.operation)
    return lambda x, y: [function(a, b) for a, b in zip(x, y, strict=True)]


def _chopped_root(context: decimal.Context, a: decimal.Decimal) -> decimal.Decimal:
    """The root to many digits, chopped: it is either exact or differs from t digits before those end."""
    wide = decimal.Context(prec=2 * context.prec + 4, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN)
    return context.plus(wide.sqrt(a))


def binary_oracle(job: Job) -> Callable[..., list[Any]]:
    """The operation of MPFR on lists of its numbers."""
    digits = job.precision
    name = {"subtract": "sub", "multiply": "mul", "divide": "div", "round": "plus"}.get(job.operation, job.operation)
    most = 4 * digits + 1 if job.base == 16 else digits + 1
    sizes, context = range(1, most + 1), gmpy2.context
    contexts = {bits: getattr(context(precision=bits, round=gmpy2.RoundToZero), name) for bits in sizes}
    away = {bits: context(precision=bits, round=gmpy2.RoundAwayZero).plus for bits in sizes}

    def rounded(bits: int, operands: tuple[Any, ...]) -> Any:
        if job.nearest:
            return away[bits](contexts[bits + 1](*operands))
        return contexts[bits](*operands)

    def base_two(*lists: list[Any]) -> list[Any]:
        return [rounded(digits, operands) for operands in zip(*lists, strict=True)]

    def base_sixteen(*lists: list[Any]) -> list[Any]:
        results = []
        for operands in zip(*lists, strict=True):
            chopped = contexts[most](*operands)
            if chopped == 0:
                results.append(gmpy2.mpfr(0))
                continue
            leading = (gmpy2.get_exp(chopped) - 1) % 4  # bits after the first of the first digit
            results.append(rounded(4 * digits - 3 + leading, operands))
        return results

    return base_two if job.base == 2 else base_sixteen


# -- the comparison ----------------------------------------------------------------------------------


def compare(job: Job) -> Outcome:
    """Run a batch through the kernel and the oracle."""
    backend = backends.backend(job.rules)
    operands: list[tuple[Integers, Integers]]
    if job.operation == "round" and job.wide:
        widest = job._replace(precision=WIDE[job.base][-1])
        m1, e1, _, _ = pairs(widest._replace(operation="add"))
        operands = [(m1, e1)]
    elif job.operation == "round":
        operands = [(long_numbers(job), np.zeros(job.count, object))]
    elif job.operation == "sqrt":
        operands = [radicands(job)]
    else:
        m1, e1, m2, e2 = pairs(job)
        if job.operation == "divide":
            m2 = np.where(m2 == 0, job.base ** (job.precision - 1), m2)
        operands = [(m1, e1), (m2, e2)]
    run = _two_words if job.wide else _decimal if job.base == 10 else _binary
    return Outcome(job, job.count, run(job, backend, operands))


def _decimal(job: Job, backend: Any, operands: list[tuple[Integers, Integers]]) -> list[str]:
    compiled = [(m.astype(np.int64), e.astype(np.int64)) for m, e in operands]
    m, e = backend.apply("round_" if job.operation == "round" else job.operation, *compiled)
    inputs = [decimals(m, e) for m, e in operands]
    expected = decimal_oracle(job)(*inputs)
    computed = decimals(m, e)
    size = np.abs(m)
    normal = (size >= 10 ** (job.precision - 1)) & (size < 10**job.precision) | ((m == 0) & (e == 0))
    return [
        f"{job}: {[str(x[i]) for x in inputs]}: {computed[i]}, but decimal {expected[i]}"
        for i in range(job.count)
        if computed[i] != expected[i] or not normal[i]
    ][:SHOWN]


def decimals(m: Any, e: Any) -> list[decimal.Decimal]:
    long = decimal.Context(prec=60, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN)
    return [long.scaleb(decimal.Decimal(a), b) for a, b in zip(m.tolist(), e.tolist(), strict=True)]


def _two_words(job: Job, backend: Any, operands: list[tuple[Integers, Integers]]) -> list[str]:
    if job.operation == "round":
        widest = backends.backend(job._replace(precision=WIDE[job.base][-1]).rules)
        result = backend.from_backend(widest, widest.from_exact(*operands[0]))
    else:
        result = backend.apply(job.operation, *(backend.from_exact(m, e) for m, e in operands))
    m, e = backend.to_exact(result)
    numbers, oracle = (decimals, decimal_oracle) if job.base == 10 else (_mpfrs(job.base), binary_oracle)
    inputs, computed = [numbers(*pair) for pair in operands], numbers(m, e)
    size, least = abs(m), job.base ** (job.precision - 1)
    normal = (size >= least) & (size < least * job.base) | ((m == 0) & (e == 0))
    return [
        f"{job}: {[str(x[i]) for x in inputs]}: {computed[i]}, but {value}"
        for i, value in enumerate(oracle(job)(*inputs))
        if computed[i] != value or not normal[i]
    ][:SHOWN]


def _mpfrs(base: int) -> Callable[[Integers, Integers], list[Any]]:
    exact = gmpy2.context(precision=128)
    bits = base.bit_length() - 1

    def numbers(m: Integers, e: Integers) -> list[Any]:
        return [
            exact.mul_2exp(gmpy2.mpfr(a, 128), bits * b) if b >= 0 else exact.div_2exp(gmpy2.mpfr(a, 128), -bits * b)
            for a, b in zip(m.tolist(), e.tolist(), strict=True)
        ]

    return numbers


def _binary(job: Job, backend: Any, operands: list[tuple[Integers, Integers]]) -> list[str]:
    scale = 4 if job.base == 16 and job.operation != "round" else 1
    compiled = [np.ldexp(m.astype(np.float64), (scale * e).astype(np.int64)) for m, e in operands]
    name = "round_" if job.operation == "round" else job.operation
    (result,) = backend.apply(name, *((x,) for x in compiled))
    inputs = [x.tolist() for x in compiled]
    numbers = [[gmpy2.mpfr(a, 53) for a in x] for x in inputs]
    expected = np.array([float(value) for value in binary_oracle(job)(*numbers)])
    wrong = np.flatnonzero((result != expected) | np.signbit(result) & (result == 0))
    return [
        f"{job}: {[x[i].hex() for x in inputs]}: {float(result[i]).hex()}, but MPFR {float(expected[i]).hex()}"
        for i in wrong[:SHOWN]
    ]


def run(share: float = 1.0, seed: int = 1984, processes: int = 1, progress: bool = False) -> list[Outcome]:
    """Compare every batch."""
    todo = list(jobs(share, seed))
    outcomes = []
    with tqdm(total=sum(job.count for job in todo), unit="op", unit_scale=True, disable=not progress) as bar:

        def done(outcome: Outcome) -> None:
            outcomes.append(outcome)
            bar.update(outcome.compared)

        if processes == 1:
            for job in todo:
                done(compare(job))
        else:
            with ProcessPoolExecutor(processes) as pool:
                for future in as_completed([pool.submit(compare, job) for job in todo]):
                    done(future.result())
    return outcomes


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exactness", description=__doc__.split("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="share of all comparisons, 1 for all (default)")
    parser.add_argument("--seed", type=int, default=1984)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    outcomes = run(options.share, options.seed, options.processes, progress=True)
    counts: Counter[tuple[int, bool, bool, str]] = Counter()
    wrong: Counter[tuple[int, bool, bool, str]] = Counter()
    for job, compared, mismatches in outcomes:
        counts[job.base, job.wide, job.nearest, job.operation] += compared
        wrong[job.base, job.wide, job.nearest, job.operation] += len(mismatches)
    about = (
        f"Python {platform.python_version()}, numpy {np.__version__}, numba {numba.__version__}, "
        f"decimal {decimal.__version__} (libmpdec {getattr(decimal, '__libmpdec_version__', 'unknown')}), "
        f"gmpy2 {gmpy2.version()} ({gmpy2.mpfr_version()})"
    )
    header = ("base", "digits", "rounding", *OPERATIONS, "all", "different")
    body = []
    for base, wide, nearest in product(PRECISIONS, (False, True), (True, False)):
        row = [counts[base, wide, nearest, name] for name in OPERATIONS]
        different = sum(wrong[base, wide, nearest, name] for name in OPERATIONS)
        digits = WIDE[base] if wide else PRECISIONS[base]
        kind = "nearest" if nearest else "chop"
        body.append((str(base), f"{digits[0]}-{digits[-1]}", kind, *(f"{n:,}" for n in (*row, sum(row), different))))
    print(about)
    for cells in (header, *body):
        print(f"{cells[0]:>4} {cells[1]:<7}{cells[2]:<8}" + "".join(f"{cell:>12}" for cell in cells[3:]))
    for text in [text for outcome in outcomes for text in outcome.mismatches][:SHOWN]:
        print(text)
    total, different = sum(counts.values()), sum(wrong.values())
    print(f"{total:,} operations compared, {different or 'none'} different")
    if options.share == 1:
        RESULTS.mkdir(exist_ok=True)
        table = Table("operations compared", header, tuple(body)).markdown()
        (RESULTS / "exactness.md").write_text(f"{table}\n\nCompared with: {about}.\n", encoding="utf-8")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
