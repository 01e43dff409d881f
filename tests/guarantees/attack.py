"""Attack guarantees with emulated runs: ``python -m tests.guarantees.attack`` prints a table by form and format.

A seed determines a filter, a format, limits and inputs. Kalman filters are those of
:mod:`gpbnb.report.guarantees.filters`. Linear systems, in every structure, are compared with the system as given, in
floating point with and without a range, in fixed point and in words. Their inputs are random, constant, those that move
an output or its error due to stored coefficients furthest, and the best of some tries for each stretch of a run.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.system import output_errors
from gpbnb.filters.program import matrices
from gpbnb.filters.structures import WITH_FIR
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.interrupts import interruptible
from gpbnb.report.guarantees.filters import examine

KINDS = ("unlimited", "subnormal", "flushed", "fixed point", "words")
STEPS, CANDIDATES = 200, 8


class Attacked(NamedTuple):
    """A filter that was attacked: its kind, the number of runs, and the largest error / bound."""

    kind: str
    runs: int
    largest: float


def kalman(seed: int) -> Attacked:
    """Attack the guarantee of a Kalman filter."""
    row = examine(seed)
    if row.wrong:
        raise AssertionError(f"got {row}; needed no error above its bound")
    return Attacked(row.form.replace("_", " "), row.runs, row.largest)


def drawn_system(rng: np.random.Generator) -> tuple[LinearSystem, NDArray[np.float64]]:
    """Draw a stable system of order one to four in some structure, and limits on its inputs."""
    n, m, p = int(rng.integers(1, 5)), int(rng.integers(1, 3)), int(rng.integers(1, 3))
    structure = (*WITH_FIR, "dense")[int(rng.integers(len(WITH_FIR) + 1))]
    if structure != "dense":
        angles = rng.uniform(0, np.pi, n // 2)
        poles = rng.uniform(0.2, 0.95, n // 2) * np.exp(1j * angles)
        a = np.poly([*poles, *poles.conj(), *rng.uniform(-0.95, 0.95, n % 2)]).real
        b, a = (np.round(each * 2**12) / 2**12 for each in (rng.standard_normal(n + 1), a))
        system = LinearSystem.from_coefficients(b, [1] if structure == "FIR" else a, structure)
        return system, 10.0 ** rng.uniform(-1, 1, 1)
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.2, 0.95) / np.abs(np.linalg.eigvals(A)).max()
    parts = (A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m)))
    A, B, C, D = (np.round(each * 2**12) / 2**12 for each in parts)
    return LinearSystem(A, B, C, D), 10.0 ** rng.uniform(-1, 1, m)


def drawn_format(rng: np.random.Generator, kind: str) -> FloatFormat | FixedFormat | WordFormats:
    """Draw a format of a kind."""
    among = [each for each in Rounding if kind not in KINDS[3:] or each is not Rounding.STOCHASTIC]
    rounding, base = among[int(rng.integers(len(among)))], int(rng.choice([2, 10, 16]))
    if rounding is Rounding.STOCHASTIC:
        base = 2  # the only one with compiled loops
    digits = int(rng.integers(8, 25) / np.log2(base)) + 2
    if kind == "unlimited":
        return FloatFormat(base, digits, rounding)
    if kind in ("subnormal", "flushed"):
        span = int(np.ceil(rng.integers(8, 20) / np.log2(base)))
        return FloatFormat(2 if base == 10 else base, digits, rounding, -span, 64, kind == "subnormal")
    data = FixedFormat(16, int(rng.integers(8, 20)), rounding)
    if kind == "fixed point":
        return data
    wide = FixedFormat(20, data.fraction_bits + int(rng.integers(0, 12)), rounding)
    return WordFormats(data, int(rng.integers(10, 20)), wide if rng.integers(2) else None)


def errors(system: LinearSystem, fmt: Any, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the error of each output at each step, (steps, p)."""
    off = system.outputs(u, fmt) - system.outputs(u)
    return np.asarray(off[..., 0] + off[..., 1])


def response(system: LinearSystem, fmt: Any, output: int) -> NDArray[np.float64]:
    """Return what inputs add to the error of an output after the last step, due to stored coefficients, (steps, m)."""
    made, n = system.as_filter(), system.n
    rows = []
    for coefficients in (made.stored(fmt), made.coefficients):
        A, B = (each.astype(np.float64) for each in matrices(made.program, coefficients))
        row, found = np.eye(len(A))[n + output], []
        for _ in range(STEPS):
            found.append(row @ B)
            row = row @ A
        rows.append(found[::-1])
    return np.array(rows[0]) - np.array(rows[1])


def inputs(
    system: LinearSystem, fmt: Any, most: NDArray[np.float64], rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Give the inputs of each run, (steps, m)."""
    m, at = system.m, int(rng.integers(system.p))
    for _ in range(3):
        yield most * rng.uniform(-1, 1, (STEPS, m))
    for level in (np.ones(m), rng.choice((-1.0, 1.0), m), rng.uniform(-1, 1, m)):
        yield np.broadcast_to(most * level, (STEPS, m)).copy()
    responses = []
    for j in range(m):
        unit = np.zeros((STEPS, m))
        unit[0, j] = 1.0
        responses.append(system.outputs(unit)[::-1, at, 0])
    worst = most * np.where(np.array(responses).T >= 0, 1.0, -1.0)
    yield worst
    yield worst * rng.uniform(0.9, 1, (STEPS, m))
    of_error = most * np.where(response(system, fmt, at) >= 0, 1.0, -1.0)
    yield of_error
    yield -of_error * rng.uniform(0.9, 1, (STEPS, m))
    chosen = of_error.copy()
    for k in range(0, STEPS, 25):  # the best of some tries for a stretch, by the error at its end
        tries = [chosen]
        for i in range(CANDIDATES - 1):
            other = chosen.copy()
            stretch = chosen[k : k + 25] if i % 2 else most
            other[k : k + 25] = stretch * rng.uniform(0.8 if i % 2 else -1, 1, (25, m))
            tries.append(other)
        chosen = max(tries, key=lambda u: float(np.abs(errors(system, fmt, u[: k + 25])[-1, at])))
    yield chosen


def linear(seed: int) -> Attacked:
    """Attack the guarantee of a linear system."""
    rng, kind = np.random.default_rng([55, seed]), KINDS[seed % len(KINDS)]
    system, most = drawn_system(rng)
    fmt = drawn_format(rng, kind)
    try:
        bound = output_errors(system, fmt, most)
    except (ValueError, OverflowError):
        return Attacked(kind, 0, 0.0)
    runs, largest = 0, 0.0
    for u in inputs(system, fmt, most, rng):
        ratio = float((np.abs(errors(system, fmt, u)).max(axis=0) / bound).max())
        if ratio > 1:
            raise AssertionError(f"seed {seed}: got {ratio} of the bound in {fmt}; needed at most 1")
        runs, largest = runs + 1, max(largest, ratio)
    return Attacked(kind, runs, largest)


def table(found: Sequence[Attacked]) -> str:
    """Count filters and runs by kind, with the largest error / bound."""
    lines = ["kind                    filters   bounded      runs   largest error / bound"]
    for kind in sorted({each.kind for each in found}):
        some = [each for each in found if each.kind == kind]
        bounded, runs = sum(each.runs > 0 for each in some), sum(each.runs for each in some)
        lines.append(f"{kind:22} {len(some):8} {bounded:9} {runs:9}   {max(each.largest for each in some):.4f}")
    lines.append(f"{'all':22} {len(found):8} {'':9} {sum(each.runs for each in found):9}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack some filters of each kind, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.guarantees.attack", description=__doc__)
    parser.add_argument("--filters", type=int, default=1_500, help="number of Kalman filters")
    parser.add_argument("--systems", type=int, default=1_500, help="number of linear systems")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--slice", default="0/1", metavar="I/K", help="the I-th of K parts, from 0")
    given = parser.parse_args(arguments)
    part, parts = map(int, given.slice.split("/"))
    filters, systems = (
        range(given.first + part * count // parts, given.first + (part + 1) * count // parts)
        for count in (given.filters, given.systems)
    )
    print(table([*map(kalman, filters), *map(linear, systems)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(interruptible("python -m tests.guarantees.attack", main))
