"""Compare the longest significands with the exact kernel in every rounding and range: ``python -m benchmarks.wide``.

These are significands of two words, and those of 53 bits that the machine's float64 serves. Fused multiply-adds of
shorter ones are compared, too: those of base 10, and of 53 bits with ties away from zero, take two words.

Operands are those of :mod:`benchmarks.exactness`: random, ties, near-ties, cancellations, carries. In a format with a
range, a third of the pairs lies at its lower end, where numbers are subnormal or become zero, and a third at its upper
end. Where the exact kernel overflows, the loop must give no result, or the limit if the format saturates. The counts of
a whole comparison are left in ``benchmarks/results``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.exactness import OPERATIONS as UNFUSED
from benchmarks.exactness import RESULTS, WIDE, Draw, Job, pairs, radicands
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.kernels.backends import Backend, Components, Exact, Looped, TwoWords, exact
from gpbnb.arithmetic.kernels.exact import kernel
from gpbnb.arithmetic.kernels.selection import wide_tag
from gpbnb.arithmetic.rounding import Limits, Rounding, Rules
from gpbnb.report.display.tables import Table

OPERATIONS = (*UNFUSED, "fused")
SHORT = {2: (2, 11, 24, 25, 26, 40, 52, 53), 10: (1, 2, 7, 8, 9, 16, 17, 18), 16: (1, 6, 12, 13)}
"""Precisions whose fused multiply-adds are compared, though their other operations take one word."""
BINARY = 53  # bits of float64
ROUNDINGS = [rounding for rounding in Rounding if rounding is not Rounding.STOCHASTIC]
RANGES = ("none", "subnormal", "flushed", "saturating", "short", "fixed")
BATCH = 500
COUNT = 5000  # of each operation in each format


class Count(NamedTuple):
    """What was compared in one format, how many results overflowed, and the differences."""

    rules: Rules
    compared: int
    overflowed: int
    different: list[str]


def formats() -> Iterator[Rules]:
    """Every base, precision, rounding and range."""
    for base, precisions in WIDE.items():
        for precision in precisions:
            for rounding in ROUNDINGS:
                for kind in RANGES:
                    if kind != "fixed" or base == 2:
                        yield Rules(base, precision, rounding, _limits(base, precision, kind))


def formats_of_float64() -> Iterator[Rules]:
    """Every rounding and range of 53 bits, but ties away from zero; in fixed point, 53 bits with the sign."""
    for rounding in ROUNDINGS:
        for kind in RANGES if rounding is not Rounding.NEAREST else ():
            precision = BINARY - (kind == "fixed")
            yield Rules(2, precision, rounding, _limits(2, precision, kind, 200))


def formats_of_words() -> Iterator[Rules]:
    """Every rounding and range of shorter significands that compiled loops serve."""
    for base, precisions in SHORT.items():
        for precision in precisions:
            for rounding in ROUNDINGS:
                for kind in ("none", "subnormal", "flushed"):
                    rules = Rules(base, precision, rounding, _limits(base, precision, kind, 3000 if base == 10 else 60))
                    if not isinstance(backends.backend(rules), Exact):
                        yield rules


def _limits(base: int, precision: int, kind: str, far: int = 3000) -> Limits | None:
    if kind == "none":
        return None
    if kind == "fixed":
        unit = Fraction(1, 2 ** (precision - 3))
        return Limits(2, True, (2**precision - 1) * unit, -(2**precision) * unit, "saturate", True)
    emin, emax = (-6, 9) if kind == "short" else (-far, far)
    # A largest number that does not end in nines, as FP8 E4M3 has.
    digits = base**precision - (base if kind == "saturating" else 1)
    largest = digits * Fraction(base) ** (emax - precision + 1)
    return Limits(emin, kind != "flushed", largest, -largest, "saturate" if kind == "saturating" else "raise")


def _in_words(rules: Rules) -> bool:
    return rules.precision <= SHORT[rules.base][-1]


def backend(rules: Rules) -> Looped:
    """The backend that is compared: significands of two words beyond the digits of one."""
    if _in_words(rules):
        return cast(Looped, backends.backend(rules))
    tag = wide_tag(rules)
    if tag is None:
        raise ValueError(f"got {rules}; needed significands that two words hold")
    return TwoWords(rules, tag)


def operands(rules: Rules, operation: str, count: int, seed: tuple[int, ...]) -> list[Components]:
    """Significands and exponents of numbers of the format."""
    if operation == "fused":
        return fused_operands(rules, count, seed)
    name = operation if operation in ("add", "subtract", "multiply", "divide") else "add"
    job = Job(rules.base, rules.precision, True, name, count, seed)
    if operation == "round":
        m, e = pairs(job._replace(precision=WIDE[rules.base][-1]))[:2]
        return [(m, np.clip(e, -5000, 5000) if rules.limits else e)]
    found = [radicands(job)] if operation == "sqrt" else [*zip(*[iter(pairs(job))] * 2, strict=True)]
    if operation == "divide":
        m, e = found[1]
        found[1] = np.where(m == 0, rules.base ** (rules.precision - 1), m), e
    if rules.limits is None:
        return found
    limited = kernel(rules)
    lowest, highest = limited.quantum, limited.top[0]
    rng = np.random.default_rng(seed)
    # Near operands stay near each other; products, quotients and roots reach the ends from the middle.
    share = {"multiply": 2, "divide": 2, "sqrt": 1}.get(operation, 1)
    ends = np.array([0, lowest // share, highest // share], object)[rng.integers(0, 3, count)]
    shift = [ends, ends if operation != "divide" else -ends]
    if rules.limits.fixed:
        shift = [ends * 0 + lowest + 1] * 2
    return [_within(rules, m, e + by) for (m, e), by in zip(found, shift, strict=False)]


def fused_operands(rules: Rules, count: int, seed: tuple[int, ...]) -> list[Components]:
    """Two factors; an addend that is random, almost cancels the product, or has about twice its size as a unit."""
    job = Job(rules.base, rules.precision, True, "multiply", count, seed)
    m1, e1, m2, e2 = pairs(job)
    d = Draw(job, count)
    near = d.rng.integers(0, 2, count) == 0
    m1, m2 = np.where(near, d.edge() * d.sign(), m1), np.where(near, d.edge(), m2)
    e = e1 + e2
    opposite, shift = d.normalized(m1 * m2, e)
    opposite = -np.where(m1 < 0, -1, 1) * np.where(m1 * m2 == 0, 0, d.into_range(opposite + d.below(7) - 3))
    m3 = d.choose(d.sign() * d.any(), opposite, d.sign() * d.any(), d.sign() * d.edge())
    e3 = np.where(m3 == opposite, shift + d.below(2), d.choose(e + d.gap(), e + 2 * d.t + d.below(7) - 3, e + d.gap()))
    found = [(m1, e1), (m2, e2), (m3, e3)]
    found = [(m, np.where(m == 0, 0, e)) for m, e in found]
    if rules.limits is None:
        return found
    limited = kernel(rules)
    ends = np.array([0, limited.quantum, limited.top[0]], object)[d.rng.integers(0, 3, count)]
    if rules.limits.fixed:
        ends = ends * 0 + limited.quantum + 1
    shifts = (ends // 2, ends - ends // 2, ends)
    return [_within(rules, m, e + by) for (m, e), by in zip(found, shifts, strict=True)]


def _within(rules: Rules, m: NDArray[Any], e: NDArray[Any]) -> Components:
    """Round to the format, with one in place of what is beyond its range, or becomes zero."""
    limited = kernel(rules)
    one = limited.from_ratio(1, 1)

    def number(m: int, e: int) -> tuple[int, int]:
        try:
            pair = limited.from_ratio(m, 1, max(min(e, 10**5), -(10**5)))
        except OverflowError:
            return one
        return pair if pair[0] or not m else one

    return cast(Components, np.frompyfunc(number, 2, 2)(m, e))


def expected(backend: Backend, operation: str, arrays: list[Components]) -> tuple[NDArray[Any], ...]:
    """Significands and exponents of the exact kernel, and where it overflows."""
    operate = backend.kernel.from_ratio if operation == "round" else getattr(backend.kernel, operation)

    def result(*pair: int) -> tuple[int, int, bool]:
        try:
            m, e = operate(pair[0], 1, pair[1]) if operation == "round" else operate(*pair)
        except OverflowError:
            return 0, 0, True
        return m, e, False

    parts = [part for components in arrays for part in components]
    return cast(tuple[NDArray[Any], ...], np.frompyfunc(result, len(parts), 3)(*parts))


def apply(rules: Rules, operation: str, arrays: list[Components]) -> Components | None:
    """Apply an operation; rounding converts from the format with the most digits, without limits."""
    wide = backend(rules)
    source = backend(Rules(rules.base, WIDE[rules.base][-1], Rounding.CHOP)) if operation == "round" else wide
    stored = [cast(Components, source.from_exact(m, e)) for m, e in arrays]
    if operation == "round":
        return wide.from_backend(source, stored[0])
    return wide.apply(operation, *stored)


def compare(rules: Rules, count: int, seed: int, operations: tuple[str, ...] = OPERATIONS) -> Count:
    """Compare `count` results of each operation in one format."""
    compared = overflowed = 0
    different: list[str] = []
    for operation in operations:
        index = OPERATIONS.index(operation)
        for start in range(0, count, BATCH):
            key = (seed, rules.precision, index, start)
            arrays = operands(rules, operation, min(BATCH, count - start), key)
            if operation == "sqrt":
                arrays = [(abs(arrays[0][0]), arrays[0][1])]
            m, e, gone = expected(exact(rules), operation, arrays)
            kept = ~gone.astype(bool)
            if not kept.all():
                overflowed += int((~kept).sum())
                first = [tuple(part[~kept][:1] for part in components) for components in arrays]
                if apply(rules, operation, first) is not None:
                    different.append(f"{rules} {operation} {first}: no overflow")
            arrays = [tuple(part[kept] for part in components) for components in arrays]
            result = apply(rules, operation, arrays)
            compared += int(kept.sum())
            if result is None:
                different.append(f"{rules} {operation}: no result")
                continue
            found = backend(rules).to_exact(result)
            wrong = np.flatnonzero((found[0] != m[kept]) | (found[1] != e[kept]))
            different += [f"{rules} {operation} {[(x[i], f[i]) for x, f in arrays]}" for i in wrong[:3]]
    return Count(rules, compared, overflowed, different)


def _family(rules: Rules) -> str:
    if not _in_words(rules):
        return f"base {rules.base}, two words"
    return "base 2, float64" if rules.precision >= BINARY - 1 else f"base {rules.base}, one word"


def write(counts: list[Count]) -> None:
    """Write what was compared in each family and rounding to ``benchmarks/results``."""
    body = []
    families = dict.fromkeys(_family(count.rules) for count in counts)
    for family, rounding in product(families, ROUNDINGS):
        mine = [count for count in counts if (_family(count.rules), count.rules.rounding) == (family, rounding)]
        numbers = [(count.compared, count.overflowed, len(count.different)) for count in mine]
        if mine:
            body.append((family, rounding.value, *(f"{sum(column):,}" for column in zip(*numbers, strict=True))))
    table = Table("results compared", ("significands", "rounding", "compared", "overflows", "different"), tuple(body))
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "wide.md").write_text(f"{table.markdown()}\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.wide", description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=COUNT, help="results of each operation in each format")
    parser.add_argument("--seed", type=int, default=754)
    options = parser.parse_args()
    todo = [(rules, OPERATIONS) for rules in (*formats(), *formats_of_float64())]
    todo += [(rules, ("fused",)) for rules in formats_of_words()]
    counts = [compare(rules, options.count, options.seed, operations) for rules, operations in tqdm(todo)]
    if options.count >= COUNT:
        write(counts)
    for text in [text for count in counts for text in count.different][:20]:
        print(text)
    compared, overflowed = sum(count.compared for count in counts), sum(count.overflowed for count in counts)
    different = sum(len(count.different) for count in counts)
    print(f"{compared:,} results compared, {overflowed:,} overflows, {different or 'none'} different")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
